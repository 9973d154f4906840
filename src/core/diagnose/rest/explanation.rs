//! An explanation of what a model leaves, as plain data.

use crate::diagnose::rest::law::Law;
use crate::diagnose::rest::waveform::Pulsation;

/// Where a forcing acts.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Site {
    /// On the supply's head.
    Supply,
    /// On the flow at the valve.
    Valve,
    /// A flow out of a pipe: its position with the standard error, m, and in a network the pipe.
    Pipe {
        /// The first pipe of the line, in a network.
        pipe: Option<String>,
        /// From the line's beginning, m.
        position_m: f64,
        /// Standard error of that, m.
        error_m: f64,
    },
    /// On what a sensor shows.
    Sensor(String),
    /// A strain of the wall.
    Wall,
}

impl Site {
    /// Its name in JSON.
    pub fn name(&self) -> String {
        match self {
            Site::Supply => "supply".into(),
            Site::Valve => "valve".into(),
            Site::Pipe { .. } => "pipe".into(),
            Site::Sensor(name) => format!("sensor@{name}"),
            Site::Wall => "wall".into(),
        }
    }

    /// Unit of the forcing there.
    pub fn unit(&self) -> &'static str {
        match self {
            Site::Supply | Site::Sensor(_) => "m",
            Site::Valve | Site::Pipe { .. } => "m³/s",
            Site::Wall => "1",
        }
    }
}

/// A forcing that explains what a model leaves of a run.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Explanation {
    /// Where.
    pub site: Site,
    /// Probability that it is there, among all places.
    pub probability: f64,
    /// Evidence over no forcing, natural logarithm of odds before tempering, over all runs.
    pub evidence: f64,
    /// What it looks like, in one sentence without its end.
    pub says: String,
    /// The run that shows it most.
    pub run: String,
    /// Times after the start of that run's closure, s.
    pub time_s: Vec<f64>,
    /// The forcing, in the site's unit.
    pub value: Vec<f64>,
    /// Its standard deviations.
    pub sd: Vec<f64>,
    /// When it begins, s after the start of the closure.
    pub onset_s: Option<f64>,
    /// The tone that it is, if it is one.
    pub pulsation: Option<Pulsation>,
    /// What it follows, and the share of its variance that this explains.
    pub law: Option<(Law, f64)>,
    /// What is left with it over the errors that a cell's mean has, root mean square.
    pub left_over_noise: f64,
}
