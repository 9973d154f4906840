//! One file's samples, and the relation of its clock to the first file's.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::number::{plus_minus, significant, to_error};
use crate::recording::Recording;

/// One file's samples.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its name, for messages.
    pub file: String,
    /// Its samples; sensors that it lacks are empty.
    pub recording: Recording,
    /// Resolution of its start time, s; if unknown, the value of the last digit that is not 0.
    pub start_digit_s: Option<f64>,
}

/// What the alignment of a clock rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Edges of a trigger recorded in every file.
    Trigger,
    /// The wall-clock times that the files give.
    Time,
    /// The pressure front.
    Front,
}

impl Method {
    /// Every method, the most reliable first.
    pub const ALL: [Method; 3] = [Method::Trigger, Method::Time, Method::Front];
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Method::Trigger => "trigger",
            Method::Time => "time",
            Method::Front => "front",
        })
    }
}

/// Relation of one part's clock to the first part's: `t = offset + (1 + drift) t_own`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Clock {
    /// The part's name.
    pub file: String,
    /// What it was aligned by.
    pub method: Method,
    /// The first part's time at this one's time 0, s.
    pub offset_s: f64,
    /// Standard error of the alignment at `at_s`, s. For absolute times it covers only their resolution.
    pub uncertainty_s: f64,
    /// The time on this clock at which it was aligned, s: the middle of its edges or fronts.
    pub at_s: f64,
    /// Drift in parts per million: how much this clock is slow. Known only from several edges.
    pub drift_ppm: Option<f64>,
    /// Standard error of the drift, ppm.
    pub drift_error_ppm: Option<f64>,
    /// Number of edges, or of pairs of fronts, that it rests on.
    pub events: usize,
    /// Root mean square of the residuals, s; none of a single event.
    pub residual_s: Option<f64>,
    /// What was found and what contradicts it, in words.
    pub remarks: Vec<String>,
    /// Why it may be wrong, and what to do.
    pub warnings: Vec<String>,
}

impl Clock {
    /// The clock that the others are aligned with.
    pub(crate) fn own(file: &str, method: Method) -> Clock {
        Clock {
            file: file.into(),
            method,
            offset_s: 0.0,
            uncertainty_s: 0.0,
            at_s: 0.0,
            drift_ppm: None,
            drift_error_ppm: None,
            events: 0,
            residual_s: None,
            remarks: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// The first part's time at a time of this part's clock, s.
    pub fn time_s(&self, own_s: f64) -> f64 {
        own_s + self.offset_s + self.drift_ppm.unwrap_or(0.0) * 1e-6 * own_s
    }

    /// Standard error of that, s. It grows away from `at_s` with the error of the drift.
    pub(crate) fn error_s(&self, own_s: f64) -> f64 {
        self.uncertainty_s.hypot(self.drift_error_ppm.unwrap_or(0.0) * 1e-6 * (own_s - self.at_s))
    }
}

impl fmt::Display for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match (self.method, self.events) {
            (Method::Trigger, 1) => "one edge of the trigger".to_string(),
            (Method::Trigger, n) => format!("{n} edges of the trigger"),
            (Method::Time, _) => "absolute time".into(),
            (Method::Front, 1) => "the front at one pair of sensors".into(),
            (Method::Front, n) => format!("the front at {n} pairs of sensors"),
        };
        // with a drift, state the offset where it is known best
        let of_s = self.drift_ppm.map_or(0.0, |_| (1e3 * self.at_s).round() / 1e3);
        let (at, error) = (to_error(self.time_s(of_s), self.uncertainty_s), short(self.uncertainty_s));
        write!(f, "{}: aligned by {what}: time {of_s} s is at {at} s ± {error}", self.file)?;
        if let Some(drift) = self.drift_ppm {
            let drift = self.drift_error_ppm.map_or_else(|| significant(drift, 3), |error| plus_minus(drift, error));
            write!(f, ", clock slow by {drift} ppm")?;
        }
        if let Some(residual) = self.residual_s {
            write!(f, ", {} left between them", short(residual))?;
        }
        self.remarks.iter().try_for_each(|remark| write!(f, "; {remark}"))
    }
}

/// A short time in a suitable unit.
pub(crate) fn short(time_s: f64) -> String {
    match time_s.abs() {
        t if t >= 0.1 => format!("{} s", significant(time_s, 2)),
        t if t >= 1e-4 => format!("{} ms", significant(time_s * 1e3, 2)),
        _ => format!("{} µs", significant(time_s * 1e6, 2)),
    }
}

/// Methods that differ by more than this many of their standard errors contradict each other.
pub(crate) const SURE: f64 = 4.0;
