//! The files of the page, in the program itself: a laboratory may be offline.

use axum::body::Body;
use axum::http::header::{CONTENT_TYPE, LINK};
use axum::http::{Response, StatusCode};
use axum::response::IntoResponse;

use crate::web::server::answers::refusal;

/// Name, kind and content.
type Asset = (&'static str, &'static str, &'static str);

const JS: &str = "text/javascript; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";

macro_rules! page {
    ($($kind:ident $name:literal),+ $(,)?) => {
        [$(($name, $kind, include_str!(concat!("../assets/", $name)))),+]
    };
}

const HTML: &str = "text/html; charset=utf-8";

const PAGE: &[Asset] = &page![
    HTML "index.html", CSS "workbench.css", CSS "newrig.css", JS "main.js", JS "api.js", JS "arrive.js", JS "charts.js", JS "commands.js", JS "compare.js",
    JS "dom.js", JS "drawing.js", JS "drift.js", JS "folds.js", JS "future.js", JS "hands.js", JS "heights.js", JS "known.js", JS "live.js", JS "marks.js",
    JS "newrig.js", JS "panel.js", JS "past.js", JS "picture.js", JS "place.js", JS "plot.js", JS "record.js", JS "rig.js", JS "runs.js",
    JS "sidebyside.js", JS "slider.js", JS "store.js", JS "take.js", JS "together.js", JS "touch.js",
];

const CHARTS: [Asset; 2] = [
    ("uPlot.iife.min.js", JS, include_str!("../../report/html/assets/uplot/uPlot.iife.min.js")),
    ("uPlot.min.css", CSS, include_str!("../../report/html/assets/uplot/uPlot.min.css")),
];

/// What the modules ask for first.
const STATE: &str = "</api/state>; rel=preload; as=fetch; crossorigin=anonymous";

/// The page itself. Its header names all modules, so that a browser fetches them at once and not level by level: over a
/// network each level costs a round trip. The state of the session comes with them.
pub(crate) fn page() -> impl IntoResponse {
    let modules = PAGE.iter().filter(|(_, kind, _)| *kind == JS);
    let modules = modules.map(|(name, ..)| format!("</assets/{name}>; rel=modulepreload"));
    let links: Vec<String> = std::iter::once(STATE.to_owned()).chain(modules).collect();
    ([(LINK, links.join(", "))], answer("index.html"))
}

/// A file by its name.
pub(crate) fn answer(name: &str) -> Response<Body> {
    match PAGE.iter().chain(&CHARTS).find(|(known, ..)| *known == name) {
        Some((_, kind, content)) => ([(CONTENT_TYPE, *kind)], *content).into_response(),
        None => refusal(StatusCode::NOT_FOUND, "there is no such file"),
    }
}
