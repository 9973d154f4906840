//! What became of each recording of a folder, and how a rig's parameters drift from run to run.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`index`] | the folder's index, a SQLite file: every run with its state, parameters and accepted models |
//! | [`content`] | what makes two files one recording |
//! | [`lock`] | one writer a folder |
//! | [`regression`] | weighted linear regression of values that scatter by more than their errors |
//! | [`drift`] | drift per run and per kelvin; whether a new value is within its history |

pub mod content;
pub mod drift;
pub(crate) mod error;
pub mod index;
pub mod lock;
pub mod regression;
pub(crate) mod schema;

pub use crate::results::history::error::HistoryError;
pub use crate::results::history::index::Index;

use crate::results::history::drift::{Drift, Point};

/// Where a run stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Known, not yet worked on.
    Waiting,
    /// Being worked on, or cut off in the middle of it.
    Running,
    /// Fitted and diagnosed.
    Done,
    /// It cannot be: the error says why.
    Failed,
}

impl State {
    const ALL: [State; 4] = [State::Waiting, State::Running, State::Done, State::Failed];

    /// Its word, in the index and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            State::Waiting => "waiting",
            State::Running => "running",
            State::Done => "done",
            State::Failed => "failed",
        }
    }

    fn by_name(name: &str) -> Option<State> {
        State::ALL.into_iter().find(|s| s.name() == name)
    }
}

/// The verdict of a run in which nothing is missing.
pub const NOTHING_MISSING: &str = "nothing-missing";

/// A fitted value.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// The parameter's name, with its unit.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard error; none where it was held or the data do not determine it.
    pub standard_error: Option<f64>,
    /// Its unit.
    pub unit: String,
    /// It belongs to this run alone, as its flow does; the others describe the rig.
    pub own: bool,
}

/// What a calibration and a diagnosis found in a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Finding {
    /// Water temperature, °C.
    pub temperature_degc: Option<f64>,
    /// Flow before the closure, m³/s.
    pub flow_m3_s: Option<f64>,
    /// Effects of the fitted model.
    pub effects: Vec<String>,
    /// Verdict of the diagnosis, as the contract names it.
    pub verdict: String,
    /// The effect that is missing, where one is.
    pub missing: Option<String>,
    /// The probability that the verdict is right.
    pub probability: f64,
    /// All in one line.
    pub line: String,
    /// Error of the fit over all samples, m.
    pub rmse_m: f64,
    /// Noise of the same, m.
    pub noise_m: f64,
    /// Parameters of the fitted model.
    pub parameters: Vec<Value>,
    /// File of the fit, from the folder.
    pub model_file: String,
    /// File of the report, from the folder.
    pub report_file: String,
}

/// One run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its number in the index.
    pub id: i64,
    /// What it is known by, whatever its name (see [`content`]).
    pub content: String,
    /// File name of the recording, from the folder.
    pub file: String,
    /// Name of its rig; empty where the recording cannot be read.
    pub rig: String,
    /// Start of the recording, ns since 1970 UTC; 0 where it is not known.
    pub recorded_unix_ns: i64,
    /// Where it stands.
    pub state: State,
    /// How often it was begun.
    pub tries: u32,
    /// Why it failed.
    pub error: Option<String>,
    /// What was found; none unless it is done.
    pub finding: Option<Finding>,
    /// Its model was accepted as the rig's, by itself or by a person.
    pub accepted: bool,
}

impl Run {
    /// Its values may stand for the rig: nothing is missing in it, or a person said so.
    pub fn is_sound(&self) -> bool {
        self.accepted || self.finding.as_ref().is_some_and(|f| f.verdict == NOTHING_MISSING)
    }
}

/// A model that was accepted as the rig's.
#[derive(Debug, Clone, PartialEq)]
pub struct Accepted {
    /// The recording that it was fitted to.
    pub file: String,
    /// When it was accepted, RFC 3339.
    pub when: String,
    /// By whom: `automatic` or `by hand`.
    pub how: String,
    /// The model, as an entry of a file of models.
    pub model: String,
}

/// A rig's runs and the drift of its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// The rig's name.
    pub rig: String,
    /// All its runs in the order in which they were recorded.
    pub runs: Vec<Run>,
    /// Effects of the model that the parameters belong to: those of the last accepted model, else of the last run.
    pub effects: Vec<String>,
    /// The last accepted model.
    pub in_force: Option<Accepted>,
    /// Parameters of that model that describe the rig.
    pub parameters: Vec<ParameterHistory>,
}

/// One parameter from run to run.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterHistory {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Its values in sound runs.
    pub points: Vec<Point>,
    /// Its values in runs in which something is missing: shown, not counted.
    pub doubtful: Vec<Point>,
    /// Its drift; none while there are too few runs.
    pub drift: Option<Drift>,
}

impl History {
    /// The history of a rig.
    ///
    /// # Errors
    /// An index that cannot be read, a rig that it does not know.
    pub fn of(index: &Index, rig: &str) -> Result<History, HistoryError> {
        let runs = index.runs(rig)?;
        if runs.is_empty() {
            return Err(HistoryError::UnknownRig { rig: rig.to_owned(), known: index.rigs()? });
        }
        let in_force = index.in_force(rig)?;
        let basis =
            in_force.as_ref().and_then(|a| runs.iter().find(|r| r.file == a.file)).filter(|r| r.finding.is_some());
        let basis = basis.or_else(|| runs.iter().rev().find(|r| r.finding.is_some()));
        let effects = basis.and_then(|r| r.finding.as_ref()).map(|f| f.effects.clone()).unwrap_or_default();
        let parameters = parameters(&runs, &effects);
        Ok(History { rig: rig.to_owned(), runs, effects, in_force, parameters })
    }
}

/// The parameters of the runs whose model has these effects.
fn parameters(runs: &[Run], effects: &[String]) -> Vec<ParameterHistory> {
    let mut all: Vec<ParameterHistory> = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        let Some(finding) = run.finding.as_ref().filter(|f| f.effects == effects) else { continue };
        for value in finding.parameters.iter().filter(|v| !v.own) {
            let place = all.iter().position(|p| p.name == value.name).unwrap_or_else(|| {
                let (name, unit) = (value.name.clone(), value.unit.clone());
                all.push(ParameterHistory { name, unit, points: vec![], doubtful: vec![], drift: None });
                all.len() - 1
            });
            let Some(standard_error) = value.standard_error.filter(|e| *e > 0.0 && e.is_finite()) else { continue };
            let point = Point {
                run: (i + 1) as f64,
                temperature_degc: finding.temperature_degc,
                value: value.value,
                standard_error,
            };
            let series = if run.is_sound() { &mut all[place].points } else { &mut all[place].doubtful };
            series.push(point);
        }
    }
    for parameter in &mut all {
        parameter.drift = crate::results::history::drift::drift(&parameter.points);
    }
    all
}
