//! The data of a run that a fit uses: heads, noise, and what is known beforehand of its velocity, head, closure and
//! offsets.

use crate::fit::data::thresholds::DEFAULT_ACCURACY_PERCENT;
use crate::model::Conditions;
use crate::rig::{Place, Sensor};
use crate::signal::Tone;

/// One pressure sensor's samples.
#[derive(Debug, Clone)]
pub struct SensorData {
    /// The sensor.
    pub sensor: Sensor,
    /// Sample times on the recording's clock, s.
    pub time_s: Vec<f64>,
    /// Measured heads, m.
    pub head_m: Vec<f64>,
    /// Standard deviation of the noise, m; more than zero. Hum is none.
    pub noise_m: f64,
    /// Standard deviation of all disturbances while the flow is steady, slow ones included but no lasting
    /// oscillation, m; not below the noise.
    pub total_noise_m: f64,
    /// Tones of the mains that its wiring picks up.
    pub hum: Vec<Tone>,
    /// Lasting oscillations in the pipe before the closure, as of a pump: no model of a closure follows them.
    pub lines: Vec<Tone>,
    /// Standard deviation of its zero error, m.
    pub offset_sd_m: f64,
    /// Number of samples at the end of its range, which are left out: the true pressure went beyond.
    pub saturated: usize,
}

impl SensorData {
    /// Root mean square of what oscillates in the pipe before the closure, m.
    pub fn oscillation_m(&self) -> f64 {
        self.lines.iter().map(|line| 0.5 * line.amplitude_m.powi(2)).sum::<f64>().sqrt()
    }

    /// Standard deviation of its gain error: an accuracy is a limit, below which all errors are equally likely (JCGM
    /// 100:2008, 4.3.7).
    pub fn gain_sd(&self) -> f64 {
        self.sensor.accuracy_percent_fs.unwrap_or(DEFAULT_ACCURACY_PERCENT) / 100.0 / 3f64.sqrt()
    }
}

/// One run, ready to be fitted.
#[derive(Debug, Clone)]
pub struct RunData {
    /// File name.
    pub file: String,
    /// Its pressure sensors, at least one.
    pub sensors: Vec<SensorData>,
    /// Water and supply; the times of a measured supply head are on the recording's clock.
    pub conditions: Conditions,
    /// Where the fit starts.
    pub start: RunStart,
    /// Its flow meter, where it has one.
    pub meter: Option<Meter>,
    /// Measured extrema, by sensor: `(time on the recording's clock, cycle, is a peak)`.
    pub extrema: Vec<Vec<(f64, usize, bool)>>,
}

/// A flow meter's reading before the closure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meter {
    /// Its place.
    pub place: Place,
    /// Flow, m³/s.
    pub flow_m3_s: f64,
    /// Relative uncertainty.
    pub relative_sd: f64,
}

/// Start values of a run from its signals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunStart {
    /// Start of the closure on the recording's clock, s, and its uncertainty.
    pub closure_s: (f64, f64),
    /// Velocity in the last pipe, m/s, and its relative uncertainty.
    pub velocity_m_s: (f64, f64),
    /// Head upstream of the valve, m, and its uncertainty where no sensor shows steady pressure.
    pub valve_head_m: (f64, Option<f64>),
    /// Wave speed relative to the rig's start value, where the signals show it.
    pub wave_speed_ratio: Option<f64>,
    /// Closing time that the record shows, where it counts more than the rig file's.
    pub closing_time: Option<ShownClosing>,
}

/// How long the valve takes to close, as a record shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShownClosing {
    /// The time, s, and its standard error.
    pub seen_s: (f64, f64),
    /// The rig file's, s, and its standard deviation where the file gives one.
    pub said_s: (f64, Option<f64>),
}
