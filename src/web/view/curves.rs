//! Measurement and models at a sensor, as many points as a chart has pixels: each keeps the extremes of what was
//! measured.

use std::collections::BTreeMap;
use std::error::Error;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Serialize, Serializer};
use serde_json::json;

use crate::model::constraint::Given;
use crate::model::effects::Chosen;
use crate::study::simulated::Simulated;
use crate::web::session::actions::given;
use crate::web::session::bench::Bench;
use crate::web::session::samples::{Samples, Stretch};
use crate::web::view::packed::Packed;

type AnyError = Box<dyn Error + Send + Sync>;

/// Reaches while a slider moves, where the fit's own grid would not keep up.
const COARSE_REACHES: usize = 64;
/// Samples times reaches from which it would not.
const KEEPS_UP: usize = 4_000_000;

/// Models of one answer.
const MOST_MODELS: usize = 16;

/// A model to draw.
struct Drawn {
    name: String,
    effects: Vec<Chosen>,
    given: Vec<Given>,
    reaches: usize,
}

/// A sensor's measurement and the models that are asked for: `model`, `previous`, `number:N`, `candidate:LABEL`, and
/// `fitting`, the one that is being fitted as it is at this moment.
///
/// # Errors
/// A run or sensor that does not exist, a model that cannot be simulated, too many of them.
pub fn of_sensor(
    bench: &Bench,
    (run, sensor): (usize, usize),
    stretch: Stretch,
    asked: &[&str],
) -> Result<Packed, AnyError> {
    let samples = bench.samples(run, sensor).ok_or("there is no such sensor")?;
    let shown = bench.shown((run, sensor), &samples, &stretch);
    let mut packed = Packed::default();
    packed.say("points", json!(shown.0.len()));
    packed.say("samples", json!(shown.1));
    packed.say("decimated", json!(shown.0.len() < shown.1));
    for (name, values) in columns((run, sensor), &samples, &shown.0, &simulated(bench, asked)?) {
        packed.push(name, values);
    }
    Ok(packed)
}

/// As [`of_sensor`] for every sensor of every run: each model is simulated once. Columns `RUN/SENSOR/time_s` and so on.
///
/// # Errors
/// A model that cannot be simulated, too many of them.
pub fn of_all(bench: &Bench, stretch: Stretch, asked: &[&str]) -> Result<Packed, AnyError> {
    let mut packed = Packed::default();
    pack(of_each(bench, stretch, &simulated(bench, asked)?), &mut packed);
    Ok(packed)
}

fn simulated(bench: &Bench, asked: &[&str]) -> Result<Vec<(String, Arc<Simulated>)>, AnyError> {
    if asked.len() > MOST_MODELS {
        return Err(format!("a chart draws at most {MOST_MODELS} models, and {} are asked for", asked.len()).into());
    }
    let drawn = asked.iter().filter_map(|name| drawn(bench, name));
    drawn.map(|d| Ok((d.name, bench.simulated(&d.effects, &d.given, d.reaches)?))).collect()
}

fn columns(
    (run, sensor): (usize, usize),
    samples: &Samples<'_>,
    kept: &[usize],
    models: &[(String, Arc<Simulated>)],
) -> Vec<(String, Vec<f64>)> {
    // the clock is that of the model in force, whatever else is drawn
    let mut columns = vec![
        ("time_s".to_owned(), kept.iter().map(|&i| samples.after_start_s(i)).collect()),
        ("measured_m".to_owned(), kept.iter().map(|&i| samples.head_m(i)).collect()),
    ];
    for (name, simulated) in models {
        let head_m = simulated.shown.head_m(run, sensor);
        columns.push((format!("{name}_m"), kept.iter().map(|&i| head_m(samples.time_s[i])).collect()));
    }
    columns
}

fn drawn(bench: &Bench, asked: &str) -> Option<Drawn> {
    if asked == "fitting" {
        let now = bench.passing()?;
        let reaches = bench.fit().map_or(COARSE_REACHES, |fit| fit.reaches);
        let (effects, given) = (now.effects.clone(), now.given.clone());
        return Some(Drawn { name: asked.to_owned(), effects, given, reaches });
    }
    let fit = bench.fit()?;
    let of_fit = |fit: &crate::Fit| Drawn {
        name: asked.to_owned(),
        effects: fit.effects.clone(),
        given: fit.given(),
        reaches: fit.reaches,
    };
    let of_number = |number: usize| {
        let file = bench.file();
        let entry = file.models.get(number.checked_sub(1)?)?;
        Some(Drawn { name: asked.to_owned(), effects: entry.chosen(), given: entry.given(), reaches: fit.reaches })
    };
    match asked.split_once(':') {
        None if asked == "model" => Some(of_fit(&fit)),
        None if asked == "previous" => of_number(bench.file().current().grown_from?),
        Some(("number", number)) => of_number(number.parse().ok()?),
        Some(("candidate", label)) => {
            let found = bench.diagnosis()?;
            let candidate = found.candidates.iter().find(|c| c.label == label || c.effect == label);
            let pair = found.pair.as_ref().filter(|pair| pair.labels.join(" + ") == label);
            pair.map(|pair| of_fit(&pair.fit)).or_else(|| Some(of_fit(candidate?.fit.as_ref()?)))
        }
        _ => None,
    }
}

/// The model in force at other values.
#[derive(Debug, Clone, Default, PartialEq, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Question {
    /// Values by name; the others are as fitted. A name stands for the parameter in all runs.
    pub set: BTreeMap<String, f64>,
    /// Effects to leave out for a moment.
    pub without: Vec<String>,
    /// From when on, s after the start of the closure.
    pub from: Option<f64>,
    /// Until when.
    pub to: Option<f64>,
    /// Points a sensor.
    pub points: Option<usize>,
    /// On a coarser grid where the fit's own would not keep up with a slider.
    pub coarse: bool,
    /// The parameters that are not set follow by a few steps of a coarse fit.
    pub follow: bool,
}

/// Simulates the model in force at other values; nothing is kept.
///
/// # Errors
/// No model yet, names that the model does not have, a model that cannot be simulated.
pub fn simulate(bench: &Bench, asked: &Question) -> Result<Simulation, AnyError> {
    let fit = bench.fit().ok_or("the model is still being fitted")?;
    let stays = |c: &Chosen| !asked.without.iter().any(|name| *name == c.effect.name() || *name == c.label());
    let effects: Vec<Chosen> = fit.effects.iter().filter(|c| stays(c)).cloned().collect();
    let mut values: Vec<Given> = given(&asked.set).collect();
    if let Some(odd) = values.iter().find(|g| !g.value.is_finite()) {
        return Err(format!("{} must be a number", odd.name).into());
    }
    let mut followed = Vec::new();
    if asked.follow && asked.without.is_empty() {
        followed = bench.study.followed(&fit, &values, asked.coarse)?;
        values.extend(followed.iter().cloned());
    }
    let owners = bench.study.owners(&fit);
    let fitted = fit.given().into_iter().zip(owners);
    values.extend(fitted.filter(|(_, owner)| owner.is_none_or(|i| stays(&fit.effects[i]))).map(|(given, _)| given));
    let samples: usize = bench.study.runs().iter().flat_map(|r| &r.sensors).map(|s| s.time_s.len()).sum();
    let coarse = asked.coarse && fit.reaches > COARSE_REACHES && fit.reaches * samples > KEEPS_UP;
    let reaches = if coarse { COARSE_REACHES } else { fit.reaches };
    let simulated = Arc::new(bench.study.simulated(&effects, &values, reaches)?);
    let stretch = Stretch { from_s: asked.from, to_s: asked.to, points: asked.points };
    Ok(Simulation {
        rmse_m: simulated.rmse_m(bench.study.runs()),
        noise_m: fit.pooled().1,
        reaches: simulated.reaches,
        coarse,
        followed: followed.into_iter().map(|g| json!({ "name": g.name, "run": g.run, "value": g.value })).collect(),
        curves: of_each(bench, stretch, &[("model".to_owned(), simulated)]),
    })
}

/// The model at other values, beside what was measured.
#[derive(Debug, Serialize)]
pub struct Simulation {
    rmse_m: f64,
    noise_m: f64,
    reaches: usize,
    /// The grid is coarser than the fit's.
    coarse: bool,
    /// Where the parameters that were not set have followed to.
    followed: Vec<serde_json::Value>,
    /// Each sensor.
    curves: Vec<SensorCurves>,
}

/// One sensor; all columns of one length. Times are after the start of the closure as the fit has it, s: a later
/// closure shows as later.
#[derive(Debug, Serialize)]
struct SensorCurves {
    run: usize,
    sensor: usize,
    name: String,
    #[serde(flatten, serialize_with = "by_name")]
    columns: Vec<(String, Vec<f64>)>,
}

fn by_name<S: Serializer>(columns: &[(String, Vec<f64>)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(columns.iter().map(|(name, values)| (name, values)))
}

impl Simulation {
    /// The same as bytes: columns `RUN/SENSOR/time_s` and so on.
    pub fn packed(self) -> Packed {
        let mut packed = Packed::default();
        packed.say("rmse_m", json!(self.rmse_m));
        packed.say("noise_m", json!(self.noise_m));
        packed.say("reaches", json!(self.reaches));
        packed.say("coarse", json!(self.coarse));
        packed.say("followed", json!(self.followed));
        pack(self.curves, &mut packed);
        packed
    }
}

fn of_each(bench: &Bench, stretch: Stretch, models: &[(String, Arc<Simulated>)]) -> Vec<SensorCurves> {
    let runs = bench.study.runs().iter().enumerate();
    let places: Vec<_> = runs.flat_map(|(r, run)| (0..run.sensors.len()).map(move |s| (r, s))).collect();
    let of_place = |&(run, sensor): &(usize, usize)| {
        let samples = bench.samples(run, sensor)?;
        let shown = bench.shown((run, sensor), &samples, &stretch);
        let name = bench.study.runs()[run].sensors[sensor].sensor.name.clone();
        Some(SensorCurves { run, sensor, name, columns: columns((run, sensor), &samples, &shown.0, models) })
    };
    places.par_iter().filter_map(of_place).collect()
}

fn pack(curves: Vec<SensorCurves>, packed: &mut Packed) {
    let about = |c: &SensorCurves| json!({ "run": c.run, "sensor": c.sensor, "points": c.columns[0].1.len() });
    packed.say("sensors", curves.iter().map(about).collect());
    for c in curves {
        c.columns.into_iter().for_each(|(name, values)| packed.push(format!("{}/{}/{name}", c.run, c.sensor), values));
    }
}
