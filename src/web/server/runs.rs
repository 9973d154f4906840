//! What may be asked of runs beside the one that is open.

use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::http::Uri;
use axum::routing::get;

use crate::web::server::answers::of_json;
use crate::web::server::routes::{App, asked, binary, calm};
use crate::web::session::place::NoSuchRun;
use crate::web::session::samples::Stretch;
use crate::web::view::{model, runs, simulated_test};

/// The routes.
pub(crate) fn routes() -> Router<Arc<App>> {
    Router::new()
        .route("/api/glance", get(glance))
        .route("/api/compare", get(compare))
        .route(
            "/api/history",
            get(|State(app): State<Arc<App>>| calm(move || Ok(of_json(&runs::history(&app.session)?)))),
        )
        .route("/api/models", get(|State(app): State<Arc<App>>| calm(move || Ok(of_json(&model::all(&app.session)?)))))
        .route("/api/disk", get(|State(app): State<Arc<App>>| calm(move || Ok(of_json(&app.session.room())))))
        .route("/api/simulation", get(simulation))
}

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// Numbers of runs, `3,0,7`.
fn numbers(text: Option<&String>) -> Result<Vec<usize>, AnyError> {
    let text = text.map_or("", String::as_str);
    Ok(text.split(',').map(str::parse).collect::<Result<_, _>>().map_err(|_| "name runs by their numbers: runs=0,2")?)
}

async fn glance(State(app): State<Arc<App>>, uri: Uri) -> axum::response::Response {
    calm(move || {
        let ids = numbers(asked(&uri).get("run"))?;
        let runs = app.session.place().named(&ids)?;
        let run = runs.first().ok_or(NoSuchRun)?;
        Ok(of_json(&app.session.glances.glance(&run.path)))
    })
    .await
}

async fn compare(State(app): State<Arc<App>>, uri: Uri) -> axum::response::Response {
    calm(move || {
        let asked = asked(&uri);
        let number = |key: &str| asked.get(key).map(|text| text.parse::<f64>()).transpose();
        let points = asked.get("points").map(|text| text.parse()).transpose()?;
        let stretch = Stretch { from_s: number("from")?, to_s: number("to")?, points };
        Ok(binary(runs::compared(&app.session, &numbers(asked.get("runs"))?, stretch)?))
    })
    .await
}

async fn simulation(State(app): State<Arc<App>>, uri: Uri) -> axum::response::Response {
    calm(move || {
        let rig = app.session.rig().ok_or("open a rig file, or a recording of the rig, to record on it")?;
        let asked = asked(&uri);
        let effects = asked.get("effects").map(String::as_str).filter(|text| !text.trim().is_empty());
        Ok(of_json(&simulated_test::settings(&rig, effects.unwrap_or("none"), &app.session.before_the_open_run())?))
    })
    .await
}
