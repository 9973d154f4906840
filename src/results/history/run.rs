//! One run of a folder: where it stands and what was found in it.

use crate::fit::validate::conflict::lacks_something;

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

    pub(super) fn by_name(name: &str) -> Option<State> {
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

impl Finding {
    /// The model leaves more than the noise: what it lacks pulls its values, by how much nobody knows.
    pub fn lacks_something(&self) -> bool {
        lacks_something(self.rmse_m, self.noise_m, 0.0)
    }
}

/// One run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its number in the index.
    pub id: i64,
    /// What it is known by, whatever its name (see [`content`](crate::results::history::content)).
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
    /// Its values may stand for the rig: nothing is missing in it, or a person accepted it.
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
