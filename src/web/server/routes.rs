//! What may be asked of the workbench, and how it answers.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::error::Error;
use std::num::NonZero;
use std::sync::Arc;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::header::{ACCEPT, CONTENT_TYPE};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::IntoResponse;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::routing::{get, post};
use futures_util::stream;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::json;
use tokio::sync::Semaphore;

use crate::model::effects::{CATALOGUE, catalogue_of};
use crate::report::effects::json::about;
use crate::watch::evaluate::sentence;
use crate::web::server::answers::{Answer, download, of_json, refusal};
use crate::web::server::assets;
use crate::web::server::bodies::gather;
use crate::web::server::guard::{Guard, admit};
use crate::web::session::Session;
use crate::web::session::actions::Action;
use crate::web::session::bench::Bench;
use crate::web::session::jobs::Busy;
use crate::web::session::place::NoSuchRun;
use crate::web::session::samples::Stretch;
use serde_json::Value;

use crate::results::parquet::{Column, parquet};
use crate::web::view::curves::{Question, of_all, of_sensor, simulate};
use crate::web::view::packed::Packed;
use crate::web::view::take_away::{self, as_table};
use crate::web::view::words::in_json;
use crate::web::view::{model, state};

type AnyError = Box<dyn Error + Send + Sync>;

/// Most pages that listen at a time.
const MOST_LISTENERS: usize = 200;

/// What every route needs.
pub struct App {
    /// What is open.
    pub session: Arc<Session>,
    /// One place for each core: more solves at a time would only take memory.
    solves: Semaphore,
}

/// The effects that a model of the rig in use can have.
fn effects(session: &Session) -> Value {
    let all = session.rig().map_or_else(|| CATALOGUE.to_vec(), |rig| catalogue_of(&rig));
    all.into_iter().map(about).collect()
}

/// All routes, `more` among them, behind one guard.
pub fn router(session: Arc<Session>, guard: Arc<Guard>, more: Router<Arc<App>>) -> Router {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let app = Arc::new(App { session, solves: Semaphore::new(cores) });
    Router::new()
        .route("/", get(|| async { assets::page() }))
        .route("/assets/{name}", get(|Path(name): Path<String>| async move { assets::answer(&name) }))
        .route("/api/state", get(|State(app): State<Arc<App>>| calm(move || Ok(of_json(&state::json(&app.session))))))
        .route("/api/effects", get(|State(app): State<Arc<App>>| calm(move || Ok(of_json(&effects(&app.session))))))
        .route("/api/events", get(events))
        .route("/api/curves", get(curves))
        .route("/api/curves.csv", get(curves_csv))
        .route("/api/curves.parquet", get(curves_parquet))
        .route("/api/report", get(|State(app): State<Arc<App>>| solved(app, report)))
        .route("/api/fit.toml", get(|State(app): State<Arc<App>>| calm(move || fit_file(&app.session))))
        .route("/api/simulate", post(simulation))
        .route("/api/diagnose", post(|app, body| act(app, body, |Nothing {}| Action::Diagnose)))
        .route("/api/fit", post(|app, body| act(app, body, Action::Fit)))
        .route("/api/add", post(|app, body| act(app, body, |a: Addition| Action::Add(a.effect, a.set))))
        .route("/api/remove", post(|app, body| act(app, body, |e: OneEffect| Action::Remove(e.effect))))
        .route("/api/profile", post(|app, body| act(app, body, |p: OneParameter| Action::Profile(p.parameter, p.run))))
        .route("/api/posterior", post(|app, body| act(app, body, |d: Draws| Action::Sample(d.draws))))
        .route("/api/known", get(known))
        .route("/api/undo", post(|app, body| act(app, body, |Nothing {}| Action::Undo)))
        .route("/api/redo", post(|app, body| act(app, body, |Nothing {}| Action::Redo)))
        .route("/api/force", post(|app, body| act(app, body, |m: OneModel| Action::Force(m.model))))
        .route("/api/open", post(open))
        .route("/api/cancel", post(cancel))
        .route("/api/import", post(import))
        .route("/api/new-rig", post(new_rig))
        .route("/api/recover", post(recover))
        .route("/api/record", post(record))
        .route(
            "/api/record/stop",
            post(|State(app): State<Arc<App>>| async move {
                app.session.recorder.stop();
                of_json(&app.session.recorder.json())
            }),
        )
        .merge(more)
        .fallback(|| async { refusal(StatusCode::NOT_FOUND, "there is nothing here") })
        .method_not_allowed_fallback(|| async { refusal(StatusCode::METHOD_NOT_ALLOWED, "not in this way") })
        .layer(DefaultBodyLimit::disable())
        .layer(from_fn(gather))
        .layer(from_fn_with_state(guard, admit))
        .with_state(app)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Addition {
    effect: String,
    #[serde(default)]
    set: BTreeMap<String, f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OneEffect {
    effect: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OneParameter {
    parameter: String,
    #[serde(default)]
    run: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Draws {
    draws: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OneModel {
    model: usize,
}

/// A run, by number.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OneRun {
    run: String,
}

/// The runs to open together, by number.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Runs {
    #[serde(default)]
    run: Option<String>,
    #[serde(default)]
    runs: Vec<String>,
}

fn refused(error: &(dyn Error + 'static)) -> Answer {
    refusal(StatusCode::BAD_REQUEST, &sentence(error))
}

fn busy(error: &Busy) -> Answer {
    refusal(StatusCode::CONFLICT, &error.to_string())
}

/// Computes beside the server's own thread, which has all pages to serve.
pub(super) async fn calm(work: impl FnOnce() -> Result<Answer, AnyError> + Send + 'static) -> Answer {
    match tokio::task::spawn_blocking(work).await {
        Ok(Ok(answer)) => answer,
        Ok(Err(error)) => refused(error.as_ref()),
        Err(_) => refusal(StatusCode::INTERNAL_SERVER_ERROR, "this failed by a fault of the program"),
    }
}

/// The same for what runs models. Who asks waits for a core, and a page that has gone away waits no longer.
async fn solved(app: Arc<App>, work: impl FnOnce(&Session) -> Result<Answer, AnyError> + Send + 'static) -> Answer {
    // the semaphore is never closed
    let _place = app.solves.acquire().await;
    let session = app.session.clone();
    calm(move || work(&session)).await
}

/// What a body says.
fn parsed<T: DeserializeOwned>(body: &Bytes) -> Result<T, AnyError> {
    let text: &[u8] = if body.is_empty() { b"{}" } else { body };
    Ok(serde_json::from_slice(text)?)
}

/// Starts what a body asks for.
async fn act<T: DeserializeOwned + Send + 'static>(
    State(app): State<Arc<App>>,
    body: Bytes,
    action: impl FnOnce(T) -> Action + Send + 'static,
) -> Answer {
    calm(move || {
        let action = action(parsed(&body)?);
        Ok(app.session.act(action).map_or_else(|error| busy(&error), started))
    })
    .await
}

fn started(job: u64) -> Answer {
    (StatusCode::ACCEPTED, of_json(&json!({ "job": job }))).into_response()
}

async fn open(State(app): State<Arc<App>>, body: Bytes) -> Answer {
    calm(move || {
        let asked: Runs = parsed(&body)?;
        let ids: Vec<usize> = asked.run.iter().chain(&asked.runs).map(|id| id.parse()).collect::<Result<_, _>>()?;
        let runs = app.session.place().named(&ids).unwrap_or_default();
        if runs.is_empty() {
            return Ok(refusal(StatusCode::NOT_FOUND, &NoSuchRun.to_string()));
        }
        Ok(app.session.open(runs, false).map_or_else(|error| busy(&error), started))
    })
    .await
}

async fn cancel(State(app): State<Arc<App>>) -> Answer {
    match app.session.jobs.cancel() {
        Some(job) => started(job),
        None => refusal(StatusCode::CONFLICT, "nothing is at work"),
    }
}

async fn import(State(app): State<Arc<App>>, body: Bytes) -> Answer {
    calm(move || Ok(of_json(&app.session.import(&parsed(&body)?)?))).await
}

async fn recover(State(app): State<Arc<App>>, body: Bytes) -> Answer {
    calm(move || {
        let OneRun { run } = parsed(&body)?;
        Ok(of_json(&app.session.recover(run.parse().map_err(|_| NoSuchRun)?)?))
    })
    .await
}

async fn new_rig(State(app): State<Arc<App>>, body: Bytes) -> Answer {
    calm(move || Ok(of_json(&app.session.new_rig(&parsed(&body)?)?))).await
}

async fn record(State(app): State<Arc<App>>, body: Bytes) -> Answer {
    calm(move || {
        app.session.record(&parsed(&body)?)?;
        Ok((StatusCode::ACCEPTED, of_json(&app.session.recorder.json())).into_response())
    })
    .await
}

fn bench_of(session: &Session) -> Result<Arc<Bench>, AnyError> {
    session.bench().ok_or_else(|| Busy::Nothing.into())
}

/// What the query of an address says.
pub(super) fn asked(uri: &Uri) -> BTreeMap<String, String> {
    let pairs = uri.query().unwrap_or_default().split('&').filter_map(|pair| pair.split_once('='));
    pairs.map(|(key, value)| (key.to_owned(), unescaped(value))).collect()
}

/// A part of an address with its escapes undone.
fn unescaped(text: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        let hex = |b: Option<u8>| b.and_then(|b| char::from(b).to_digit(16));
        bytes.push(match byte {
            b'+' => b' ',
            b'%' => match (hex(rest.next()), hex(rest.next())) {
                (Some(high), Some(low)) => (16 * high + low) as u8,
                _ => b'?',
            },
            plain => plain,
        });
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Which curves an address asks for.
struct Curves {
    /// Number of the run, of the sensor; none for all.
    sensor: Option<(usize, usize)>,
    stretch: Stretch,
    models: String,
    own_unit: bool,
}

impl Curves {
    fn of(uri: &Uri) -> Result<Self, AnyError> {
        let asked = asked(uri);
        let number = |key: &str| asked.get(key).map(|text| text.parse::<f64>()).transpose();
        let index = |key: &str| asked.get(key).map_or(Ok(0), |text| text.parse::<usize>());
        let points = asked.get("points").map(|text| text.parse()).transpose()?;
        let all = asked.get("sensor").is_some_and(|text| text == "all");
        Ok(Self {
            sensor: if all { None } else { Some((index("run")?, index("sensor")?)) },
            stretch: Stretch { from_s: number("from")?, to_s: number("to")?, points },
            models: asked.get("curves").map_or("model", String::as_str).to_owned(),
            own_unit: asked.get("unit").is_some_and(|unit| unit == "own"),
        })
    }

    fn packed(self, bench: &Bench) -> Result<Packed, AnyError> {
        let models: Vec<_> = self.models.split(',').collect();
        match self.sensor {
            Some(sensor) => of_sensor(bench, sensor, self.stretch, &models),
            None => of_all(bench, self.stretch, &models),
        }
    }
}

pub(super) fn binary(packed: Packed) -> Answer {
    ([(CONTENT_TYPE, "application/octet-stream")], packed.bytes()).into_response()
}

async fn curves(State(app): State<Arc<App>>, uri: Uri) -> Answer {
    solved(app, move |session| Ok(binary(Curves::of(&uri)?.packed(&*bench_of(session)?)?))).await
}

/// What the chart of these curves shows, to keep, and the name of the file.
fn table(session: &Session, uri: &Uri, ending: &str) -> Result<(String, Packed), AnyError> {
    let (bench, asked) = (bench_of(session)?, Curves::of(uri)?);
    let sensor = asked.sensor.ok_or("a table is of one sensor: sensor=0 is the first")?;
    let own_unit = asked.own_unit;
    let (stem, table) = as_table(&bench, sensor, own_unit, &asked.packed(&bench)?);
    Ok((format!("{stem}.{ending}"), table))
}

async fn curves_csv(State(app): State<Arc<App>>, uri: Uri) -> Answer {
    solved(app, move |session| {
        let (name, table) = table(session, &uri, "csv")?;
        Ok(download(&name, "text/csv; charset=utf-8", table.csv()))
    })
    .await
}

async fn curves_parquet(State(app): State<Arc<App>>, uri: Uri) -> Answer {
    solved(app, move |session| {
        let (name, table) = table(session, &uri, "parquet")?;
        let columns = table.columns().iter().map(|(name, values)| (name.clone(), Column::Numbers(values)));
        Ok(download(&name, "application/vnd.apache.parquet", parquet(&columns.collect::<Vec<_>>())))
    })
    .await
}

async fn simulation(State(app): State<Arc<App>>, headers: HeaderMap, body: Bytes) -> Answer {
    solved(app, move |session| {
        let question: Question = parsed(&body)?;
        let simulation = simulate(&*bench_of(session)?, &question)?;
        let wants_bytes = headers.get(ACCEPT).is_some_and(|kind| kind == "application/octet-stream");
        Ok(if wants_bytes { binary(simulation.packed()) } else { of_json(&json!(simulation)) })
    })
    .await
}

async fn known(State(app): State<Arc<App>>, uri: Uri) -> Answer {
    calm(move || {
        let asked = asked(&uri);
        let name = asked.get("parameter").ok_or("name a parameter: parameter=wave_speed_m_s")?;
        Ok(of_json(&model::known(&*bench_of(&app.session)?, name, asked.get("run").map(String::as_str))?))
    })
    .await
}

fn report(session: &Session) -> Result<Answer, AnyError> {
    let bench = bench_of(session)?;
    Ok(download(&format!("{}.html", bench.name()), "text/html; charset=utf-8", take_away::report(&bench)?))
}

fn fit_file(session: &Session) -> Result<Answer, AnyError> {
    let bench = bench_of(session)?;
    Ok(download(&format!("{}.fit.toml", bench.name()), "application/toml", take_away::fit_file(&bench)?))
}

async fn events(State(app): State<Arc<App>>) -> Answer {
    if app.session.hub.listeners() >= MOST_LISTENERS {
        return refusal(StatusCode::SERVICE_UNAVAILABLE, "too many pages are open: close some");
    }
    let start = (app.session.hub.listen(), app.session.clone(), 0);
    let events = stream::unfold(start, |(mut listener, session, mut told)| async move {
        let event = loop {
            let heard = listener.next().await?;
            let data = match (heard.data, heard.name) {
                (Some(data), _) => data,
                // a page that is slow is shown where the recording stands now, and not all that was before
                (None, "live") => match session.recorder.live_since(told) {
                    Some((now, live)) => {
                        told = now;
                        live.to_string()
                    }
                    None => continue,
                },
                (None, _) => session.bench().and_then(|bench| model::json(&bench)).unwrap_or_default().to_string(),
            };
            break Event::default().event(heard.name).data(in_json(data));
        };
        Some((Ok::<_, Infallible>(event), (listener, session, told)))
    });
    Sse::new(events).keep_alive(KeepAlive::default()).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_is_read_as_a_browser_writes_it() {
        let uri: Uri = "/api/curves?run=1&curves=candidate%3Aleak,model&from=-0.5&odd=%zz".parse().unwrap();
        let of = asked(&uri);
        assert_eq!((&of["run"][..], &of["curves"][..], &of["from"][..]), ("1", "candidate:leak,model", "-0.5"));
        assert_eq!(of["odd"], "?");
    }
}
