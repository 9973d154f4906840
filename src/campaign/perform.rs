//! One task, done: from its line to a document. It depends on nothing but the line and its inputs, neither on the
//! machine nor on what ran before.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use crate::campaign::error::sentence;
use crate::campaign::input::Checked;
use crate::campaign::task::{FitOptions, Task, Work};
use crate::fit::problem::method::Method;
use crate::fit::problem::objective::Objective;
use crate::fit::search::options::Options;
use crate::fit::validate::conflict::warnings;
use crate::model::Conditions;
use crate::model::effects::{Chosen, parse_list};
use crate::report::diagnosis::text as diagnosis;
use crate::rig::{Rig, Sensor};
use crate::sensitivity::factor::{Factor, Range, Reach};
use crate::sensitivity::features::OUTPUTS;
use crate::sensitivity::study::{Study as Design, elementary_effects, variance_shares};
use crate::sensitivity::subject::{Subject, sensor};
use crate::signal::faults::SensorFault;
use crate::simulate::scenario::{Scenario, ValveForm};
use crate::study::Study;
use crate::study::hold::{self, Hold};

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// Methods of a calibration by name.
pub const METHODS: [Method; 5] =
    [Method::LeastSquares, Method::Global, Method::MicroGa, Method::GlobalLocal, Method::Stepwise];

/// Reaches of simulations whose features are read, unless `reaches` is set.
const REACHES: f64 = 96.0;

/// Recordings that are kept open: shards do the tasks of one recording after another.
const OPEN: usize = 4;

/// Does tasks, one at a time. Recordings stay open from one task to the next.
#[derive(Default)]
pub struct Performer {
    checked: Checked,
    open: Vec<(Opened, Study)>,
}

/// What a study was opened from: recordings, rig, sensors left out.
type Opened = (Vec<PathBuf>, Option<PathBuf>, Vec<String>);

impl Performer {
    /// Does a task of the campaign in `folder`.
    ///
    /// # Errors
    /// Why it failed, in a sentence.
    pub fn perform(&mut self, folder: &Path, task: &Task) -> Result<Value, String> {
        self.attempt(folder, task).map_err(|error| sentence(error.as_ref()))
    }

    fn attempt(&mut self, folder: &Path, task: &Task) -> Result<Value, AnyError> {
        // an effect of one's own is known once its rig is read
        let effects = || parse_list(&task.list_of_effects());
        match &task.work {
            Work::Calibrate { method, seed, budget, misfit, fit } => {
                let study = self.study(folder, task, &fit.ignore)?;
                let effects = effects()?;
                let method = METHODS.into_iter().find(|m| m.name() == method).ok_or("there is no such method")?;
                let objective = if misfit == "frequency" { Objective::Frequency } else { Objective::Time };
                let options = Options { method, budget: *budget, objective, ..options(fit, *seed) };
                let mut calibration = study.calibrate(&effects).options(options);
                calibration.hold = holds(fit);
                let fitted = calibration.run()?;
                Ok(serde_json::to_value(study.record(&fitted, &warnings(&fitted, study.runs())))?)
            }
            Work::Diagnose { seed, fit } | Work::Reliability { seed, fit, .. } => {
                let study = self.study(folder, task, &fit.ignore)?;
                let effects = effects()?;
                let mut options = options(fit, *seed);
                let held = hold::constraints(study.rig(), study.runs(), std::slice::from_ref(&effects), &holds(fit));
                options.constraints = held.into_iter().flatten().collect();
                let found = study.diagnose_model(&effects, &options)?;
                let faults: Vec<SensorFault> =
                    study.recordings().iter().flat_map(|loaded| loaded.faults.iter().cloned()).collect();
                Ok(diagnosis::value(&[found], &faults)?)
            }
            Work::Simulate { set } => {
                let rig = self.rig(folder, task)?;
                simulated(rig, &effects()?, set)
            }
            Work::Sensitivity { .. } => {
                let rig = self.rig(folder, task)?;
                designed(rig, &effects()?, &task.work)
            }
        }
    }

    fn rig(&mut self, folder: &Path, task: &Task) -> Result<Rig, AnyError> {
        let input = task.rig.as_ref().ok_or("the task names no rig")?;
        Ok(Rig::load(&self.checked.path(folder, input)?)?)
    }

    /// The recordings of a task, read once as long as their files stay as they are.
    fn study(&mut self, folder: &Path, task: &Task, ignored: &[String]) -> Result<&Study, AnyError> {
        let recordings = task.recordings.iter().map(|input| self.checked.path(folder, input));
        let recordings = recordings.collect::<Result<Vec<_>, _>>()?;
        let rig = task.rig.as_ref().map(|input| self.checked.path(folder, input)).transpose()?;
        let opened: Opened = (recordings, rig, ignored.to_vec());
        let at = match self.open.iter().position(|(of, _)| *of == opened) {
            Some(at) => at,
            None => {
                let study = Study::open_without(opened.1.as_deref(), &opened.0, ignored)?;
                if self.open.len() == OPEN {
                    self.open.remove(0);
                }
                self.open.push((opened, study));
                self.open.len() - 1
            }
        };
        Ok(&self.open[at].1)
    }
}

fn options(fit: &FitOptions, seed: Option<u64>) -> Options {
    let usual = Options::default();
    Options { most_reaches: fit.most_reaches, starts: fit.random_starts, seed: seed.unwrap_or(usual.seed), ..usual }
}

fn holds(fit: &FitOptions) -> Vec<Hold> {
    fit.hold.iter().map(|(name, &[lower, upper])| Hold { name: name.clone(), lower, upper }).collect()
}

/// Whether a simulation or a study of a rig can be begun: all that is known before it runs.
///
/// # Errors
/// Settings, parameters or a sensor that the model does not have, values that it cannot take.
pub fn check(rig: &Rig, effects: &[Chosen], work: &Work) -> Result<(), AnyError> {
    let (Work::Simulate { set } | Work::Sensitivity { set, .. }) = work else { return Ok(()) };
    let scenario = scenario(rig.clone(), effects, set)?;
    let sensor = sensor(&scenario.rig, sensor_read(work))?;
    varied(&subject(&scenario, sensor), work).map(drop)
}

/// A closure on a rig, with these settings.
///
/// # Errors
/// A setting that the model does not have, or a value that it cannot take.
fn scenario(rig: Rig, effects: &[Chosen], set: &BTreeMap<String, f64>) -> Result<Scenario, AnyError> {
    let mut settings: Vec<(String, f64)> = set.iter().map(|(name, value)| (name.clone(), *value)).collect();
    if !set.contains_key("reaches") {
        settings.push(("reaches".to_owned(), REACHES));
    }
    let scenario = Scenario::new(rig, effects, ValveForm::Linear, &settings)?;
    scenario.model().resolving_reaches(&Conditions::of(scenario.water), &scenario.shared, &scenario.run)?;
    Ok(scenario)
}

/// The sensor that a study names.
fn sensor_read(work: &Work) -> Option<&str> {
    if let Work::Sensitivity { sensor, .. } = work { sensor.as_deref() } else { None }
}

/// The parameters that a study varies, with their ranges.
fn varied(subject: &Subject, work: &Work) -> Result<Vec<Factor>, AnyError> {
    let Work::Sensitivity { range, only, within, .. } = work else { return Ok(Vec::new()) };
    let ranges: Vec<Range> = range.iter().map(|(name, &[low, high])| Range { name: name.clone(), low, high }).collect();
    Ok(subject.factors(within.map_or(Reach::Bounds, Reach::Factor), &ranges, only)?)
}

fn subject<'a>(scenario: &'a Scenario, sensor: &'a Sensor) -> Subject<'a> {
    Subject {
        model: scenario.model(),
        conditions: Conditions::of(scenario.water),
        values: scenario.values().into_iter().map(|(_, value)| value).collect(),
        reaches: scenario.reaches,
        sensor,
    }
}

/// Features of the head at each pressure sensor.
fn simulated(rig: Rig, effects: &[Chosen], set: &BTreeMap<String, f64>) -> Result<Value, AnyError> {
    let scenario = scenario(rig, effects, set)?;
    let mut sensors = Map::new();
    for (_, sensor) in scenario.rig.pressure_sensors() {
        let subject = subject(&scenario, sensor);
        let values = subject.features(&subject.values)?.values();
        let named = OUTPUTS.iter().zip(values).map(|(output, value)| (output.name.to_owned(), json!(value)));
        sensors.insert(sensor.name.clone(), named.collect::<Map<_, _>>().into());
    }
    let values: Map<String, Value> = scenario.values().into_iter().map(|(name, v)| (name, json!(v))).collect();
    Ok(json!({ "reaches": scenario.reaches, "settings": values, "sensors": sensors }))
}

/// A sensitivity study.
fn designed(rig: Rig, effects: &[Chosen], work: &Work) -> Result<Value, AnyError> {
    let Work::Sensitivity { method, seed, set, size, .. } = work else {
        return Err("this is no sensitivity study".into());
    };
    let scenario = scenario(rig, effects, set)?;
    let subject = subject(&scenario, sensor(&scenario.rig, sensor_read(work))?);
    let factors = varied(&subject, work)?;
    let mut design = Design {
        rig: scenario.rig.name.clone(),
        effects: scenario.effects.iter().map(Chosen::label).collect(),
        sensor: subject.sensor.name.clone(),
        reaches: subject.reaches,
        period_s: subject.period_s(),
        values: scenario.values(),
        seed: *seed,
        ..Design::default()
    };
    match method.as_str() {
        "morris" => design.morris = Some(elementary_effects(&subject, &factors, *size, *seed, &|| ())?),
        _ => design.sobol = Some(variance_shares(&subject, &factors, *size, *seed, &|| ())?),
    }
    Ok(serde_json::to_value(&design)?)
}
