//! Several runs beside a reference: curves aligned at the closure, what differs, and how parameters drift.

use std::error::Error;
use std::sync::Arc;

use serde_json::{Value, json};

use crate::fit::data::run_data::{RunData, SensorData};
use crate::report::history::text::json as history_json;
use crate::report::view::decimate;
use crate::results::fit_record::recorded_at;
use crate::results::history::{History, Index};
use crate::study::{Study, models};
use crate::web::session::Session;
use crate::web::session::bench::Bench;
use crate::web::session::place::Run;
use crate::web::session::samples::Stretch;
use crate::web::view::packed::Packed;

type AnyError = Box<dyn Error + Send + Sync>;

/// Most runs in one chart.
const MOST: usize = 24;
/// Points of a chart that does not say how many it wants, and the most that it gets.
const POINTS: usize = 1200;
const MOST_POINTS: usize = 20_000;

/// Runs and their curves, the first being the reference. For each of its sensors `S` the columns `S/time_s` (after the
/// start of the closure) and `S/RUN_m`, the heads of each run at these times.
///
/// # Errors
/// Runs that do not exist, too many of them, one that cannot be read.
pub fn compared(session: &Session, ids: &[usize], stretch: Stretch) -> Result<Packed, AnyError> {
    if ids.is_empty() || ids.len() > MOST {
        return Err(format!("choose from 1 to {MOST} runs to compare").into());
    }
    let runs = session.place().named(ids)?;
    let studies = runs.iter().map(|run| session.glances.study(&run.path)).collect::<Result<Vec<_>, _>>()?;
    let reference = &studies[0].runs()[0];
    let mut packed = Packed::default();
    let mut about: Vec<Value> = (runs.iter().zip(&studies))
        .map(|(run, study)| of_run(run, study, session.benches.with(&run.path).as_deref()))
        .collect();
    let mut sensors = Vec::new();
    for (s, sensor) in reference.sensors.iter().enumerate() {
        let others: Vec<Option<&SensorData>> = studies.iter().map(|study| same(study, &sensor.sensor.name)).collect();
        let times: Vec<f64> = sensor.time_s.iter().map(|t| t - reference.start.closure_s.0).collect();
        let at = |s: Option<f64>, open: usize| s.map_or(open, |s| times.partition_point(|&t| t < s));
        let (from, to) = (at(stretch.from_s, 0), at(stretch.to_s, times.len()));
        let times = &times[from..to.max(from)];
        let heads: Vec<Vec<f64>> = (studies.iter().zip(&others))
            .map(|(study, sensor)| sensor.map_or(vec![f64::NAN; times.len()], |s| heads_at(&study.runs()[0], s, times)))
            .collect();
        for (about, own) in about.iter_mut().zip(&heads) {
            about["differences_m"][&sensor.sensor.name] = json!(rms_difference(times, own, &heads[0]));
        }
        let curves: Vec<&[f64]> = heads.iter().map(Vec::as_slice).collect();
        let points = stretch.points.unwrap_or(POINTS).clamp(4, MOST_POINTS);
        let kept = decimate::keep(&curves, times.len(), (points / 2 / curves.len()).max(40));
        packed.push(format!("{s}/time_s"), kept.iter().map(|&i| times[i]).collect());
        for (id, head_m) in ids.iter().zip(&heads) {
            packed.push(format!("{s}/{id}_m"), kept.iter().map(|&i| head_m[i]).collect());
        }
        sensors.push(json!({
            "name": sensor.sensor.name, "position_m": sensor.sensor.position_m, "points": kept.len(),
            "noise_m": sensor.total_noise_m,
        }));
    }
    packed.say("runs", json!(about));
    packed.say("sensors", json!(sensors));
    Ok(packed)
}

fn same<'a>(study: &'a Arc<Study>, sensor: &str) -> Option<&'a SensorData> {
    study.runs()[0].sensors.iter().find(|s| s.sensor.name == sensor)
}

/// Heads at times after the start of the closure, straight lines between samples; not a number beyond the record.
fn heads_at(run: &RunData, sensor: &SensorData, times: &[f64]) -> Vec<f64> {
    let (time_s, head_m) = (&sensor.time_s, &sensor.head_m);
    let at = |t: &f64| {
        let t = t + run.start.closure_s.0;
        let i = time_s.partition_point(|&own| own <= t);
        match (i.checked_sub(1), time_s.get(i)) {
            (Some(before), Some(after)) => {
                let share = (t - time_s[before]) / (after - time_s[before]);
                head_m[before] + share * (head_m[i] - head_m[before])
            }
            (Some(before), None) if time_s[before] == t => head_m[before],
            _ => f64::NAN,
        }
    };
    times.iter().map(at).collect()
}

/// Root mean square of the difference from the closure on, where both are known.
fn rms_difference(times: &[f64], own: &[f64], reference: &[f64]) -> Option<f64> {
    let after = times.iter().zip(own.iter().zip(reference)).filter(|(t, (a, b))| **t >= 0.0 && (*a - *b).is_finite());
    let (sum, n) = after.fold((0.0, 0), |(sum, n), (_, (a, b))| (sum + (a - b).powi(2), n + 1));
    (n > 0).then(|| (sum / f64::from(n)).sqrt())
}

/// What is compared of a run: what its signals show, and the model beside it or the finding of the folder's index.
fn of_run(run: &Run, study: &Study, bench: Option<&Bench>) -> Value {
    let loaded = &study.recordings()[0];
    let features = &loaded.features;
    let mut all = Vec::new();
    let mut say = |label: &str, unit: &str, value: Option<f64>, standard_error: Option<f64>| {
        all.push(json!({ "label": label, "unit": unit, "value": value, "standard_error": standard_error }));
    };
    let estimate = |e: Option<crate::signal::Estimate>| (e.map(|e| e.value), e.map(|e| e.standard_error));
    say("water temperature", "°C", Some(features.temperature_degc), None);
    let velocity = estimate(features.steady_velocity_m_s);
    say("velocity before", "m/s", velocity.0.or(Some(study.runs()[0].start.velocity_m_s.0)), velocity.1);
    if let Some(sensor) = features.sensors.get(features.reference) {
        let before = sensor.steady_before_m;
        say(&format!("head before, {}", sensor.name), "m", Some(before.value), Some(before.standard_error));
        let rise = sensor.first_peak.map(|peak| peak.head_m - before.value);
        say(&format!("first rise, {}", sensor.name), "m", rise, None);
    }
    let period = estimate(features.period);
    say("period", "s", period.0, period.1);
    let crossings = features.wave_speed.crossings;
    say("wave speed, crossings", "m/s", crossings.map(|c| c.value), crossings.map(|c| c.standard_error));
    // a slow closure has no front to cross
    let of_period = estimate(features.wave_speed.period);
    say("wave speed, 4L/T", "m/s", of_period.0, of_period.1);
    say("damping, first cycle", "1", features.damping_per_cycle.first().copied(), None);
    let (model, rmse_m, noise_m, parameters) = modelled(run, bench);
    json!({
        "id": run.id.to_string(), "name": run.name(), "when": recorded_at(loaded.recording.run.start_unix_ns),
        "rig": study.rig().name, "measured": all, "model": model, "rmse_m": rmse_m, "noise_m": noise_m,
        "parameters": parameters, "differences_m": {},
    })
}

/// Effects, error, noise and parameters of a run's model: as it is or was open, kept or not, or of the file beside the
/// run.
fn modelled(run: &Run, bench: Option<&Bench>) -> (Value, Value, Value, Vec<Value>) {
    let of = |name: &str, value: f64, standard_error: Option<f64>| json!({ "name": name, "value": value, "standard_error": standard_error });
    let own =
        bench.filter(|bench| bench.paths == [run.path.clone()]).map(Bench::file).filter(|file| !file.models.is_empty());
    if let Some(file) = own.or_else(|| models::load(&run.path.with_extension("model.toml")).ok()) {
        let model = file.current();
        let parameters = model.parameters.iter().map(|p| of(&p.name, p.value, p.standard_error)).collect();
        return (json!(model.effects), json!(model.rmse_m), json!(model.noise_m), parameters);
    }
    let Some(finding) = run.known.as_ref().and_then(|known| known.finding.as_ref()) else {
        return (Value::Null, Value::Null, Value::Null, Vec::new());
    };
    let parameters = finding.parameters.iter().map(|p| of(&p.name, p.value, p.standard_error)).collect();
    (json!(finding.effects), json!(finding.rmse_m), json!(finding.noise_m), parameters)
}

/// How the parameters of each rig of the folder drift, as `history --json` says it.
///
/// # Errors
/// No folder is open, or it has no index.
pub fn history(session: &Session) -> Result<Value, AnyError> {
    let folder = session.place().folder().ok_or("open a folder: one run has no history")?;
    let index = Index::read(folder)?;
    let of = |rig: &String| Ok(serde_json::from_str(&history_json(&History::of(&index, rig)?)?)?);
    index.rigs()?.iter().map(of).collect::<Result<Vec<Value>, AnyError>>().map(|all| json!(all))
}
