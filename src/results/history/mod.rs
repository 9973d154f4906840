//! What became of each recording of a folder, and how a rig's parameters drift from run to run.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`index`] | the folder's index, a SQLite file: every run with its state, parameters and accepted models |
//! | [`run`] | one run: where it stands, what was found in it |
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
pub(crate) mod run;
pub(crate) mod schema;

pub use crate::results::history::error::HistoryError;
pub use crate::results::history::index::Index;
pub use crate::results::history::run::{Accepted, Finding, NOTHING_MISSING, Run, State, Value};

use crate::results::history::drift::{Drift, Point, drift};

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
        parameter.drift = drift(&parameter.points);
    }
    all
}
