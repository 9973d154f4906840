//! Features of a simulated head: peaks, their times, phase and damping.

use serde::Serialize;

use crate::model::trace::Trace;
use crate::signal::oscillation::{Oscillation, oscillation};

/// Number of peaks that are read.
pub const PEAKS: usize = 4;
/// Number of cycles over which the decrement is averaged.
pub const CYCLES: usize = 3;
/// Index of the crossing of the mean level that gives the phase: the end of the second cycle.
pub const CROSSING: usize = 4;

/// A number that is read from a head.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Output {
    /// Its name, with the unit.
    pub name: &'static str,
    /// The unit.
    pub unit: &'static str,
    /// What it is, in words.
    pub about: &'static str,
}

const fn output(name: &'static str, unit: &'static str, about: &'static str) -> Output {
    Output { name, unit, about }
}

/// All outputs, in the order of [`Features::values`].
pub const OUTPUTS: [Output; 16] = [
    output("peak1_m", "m", "height of the first peak above the head before the closure"),
    output("peak2_m", "m", "height of the second peak"),
    output("peak3_m", "m", "height of the third peak"),
    output("peak4_m", "m", "height of the fourth peak"),
    output("time1_s", "s", "time of the first peak after the start of the closure"),
    output("time2_s", "s", "time of the second peak"),
    output("time3_s", "s", "time of the third peak"),
    output("time4_s", "s", "time of the fourth peak"),
    output("drop12_m", "m", "first peak minus second"),
    output("drop13_m", "m", "first peak minus third"),
    output("drop14_m", "m", "first peak minus fourth"),
    output("lag12_s", "s", "time from the first peak to the second"),
    output("lag13_s", "s", "time from the first peak to the third"),
    output("lag14_s", "s", "time from the first peak to the fourth"),
    output("phase_cycles", "periods", "fourth crossing of the mean level later than 2 × 4L/a, in periods 4L/a"),
    output("damping_per_cycle", "1", "logarithmic decrement of the swing from peak to trough, mean over three cycles"),
];

/// Index of an output in [`OUTPUTS`].
///
/// # Panics
/// If `name` is not in [`OUTPUTS`].
pub fn index(name: &str) -> usize {
    OUTPUTS.iter().position(|o| o.name == name).expect("a name of OUTPUTS")
}

/// Features of one head.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    /// Head before the closure, m.
    pub before_m: f64,
    /// Theoretical period `4L/a`, s.
    pub period_s: f64,
    /// The oscillation.
    pub seen: Oscillation,
}

impl Features {
    /// Reads a trace of a closure on a pipe with the theoretical period `4L/a`.
    pub fn of(trace: &Trace, period_s: f64) -> Features {
        Features { before_m: trace.values[0], period_s, seen: oscillation(trace.dt_s, &trace.values, period_s) }
    }

    /// Whether there are enough cycles for every output.
    pub fn complete(&self) -> bool {
        self.seen.damping_per_cycle.len() >= CYCLES && self.peak(PEAKS).is_some()
    }

    /// Time (s) and height above the head before the closure (m) of a peak, counted from 1.
    pub fn peak(&self, number: usize) -> Option<(f64, f64)> {
        let found = self.seen.extrema.iter().find(|e| e.peak && e.cycle == number)?;
        Some((found.time_s, found.head_m - self.before_m))
    }

    /// Time of the `number`-th crossing of the mean level, s.
    pub fn crossing_s(&self, number: usize) -> Option<f64> {
        self.seen.crossings_s.get(number - 1).copied()
    }

    /// Logarithmic decrement, mean over up to [`CYCLES`] cycles.
    pub fn damping(&self) -> Option<f64> {
        let seen = &self.seen.damping_per_cycle[..self.seen.damping_per_cycle.len().min(CYCLES)];
        (!seen.is_empty()).then(|| seen.iter().sum::<f64>() / seen.len() as f64)
    }

    /// The outputs in the order of [`OUTPUTS`]; NaN for those that do not exist.
    pub fn values(&self) -> Vec<f64> {
        let peaks: Vec<(f64, f64)> = (1..=PEAKS).map(|k| self.peak(k).unwrap_or((f64::NAN, f64::NAN))).collect();
        let phase = self.crossing_s(CROSSING).map(|t| t / self.period_s - 0.5 * CROSSING as f64);
        let heights = peaks.iter().map(|p| p.1);
        let times = peaks.iter().map(|p| p.0);
        let drops = peaks[1..].iter().map(|p| peaks[0].1 - p.1);
        let lags = peaks[1..].iter().map(|p| p.0 - peaks[0].0);
        let last = [phase, self.damping()].map(|v| v.unwrap_or(f64::NAN));
        heights.chain(times).chain(drops).chain(lags).chain(last).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn each_output_is_what_it_says() {
        // A cosine-like surge of period 1.1 on a pipe whose theoretical period is 1.
        let (period_s, decrement) = (1.1, 0.3);
        let dt_s = 0.002;
        let values = (0..4000)
            .map(|i| f64::from(i) * dt_s)
            .map(|t| 20.0 + 10.0 * (-decrement * t / period_s).exp() * (TAU * t / period_s).sin())
            .collect();
        let features = Features::of(&Trace { dt_s, values, late_s: 0.0 }, 1.0);
        assert!(features.complete());
        let values = features.values();
        assert_eq!(values.len(), OUTPUTS.len());
        let get = |name: &str| values[index(name)];
        let ratio = (-decrement).exp();
        assert!((get("peak2_m") / get("peak1_m") - ratio).abs() < 1e-3);
        assert!((get("drop13_m") - (get("peak1_m") - get("peak3_m"))).abs() < 1e-12);
        assert!((get("lag14_s") - 3.0 * period_s).abs() < 2e-3 && (get("lag12_s") - period_s).abs() < 2e-3);
        assert!((get("phase_cycles") - 0.2).abs() < 0.01, "{}", get("phase_cycles"));
        assert!((get("damping_per_cycle") - decrement).abs() < 3e-3, "{}", get("damping_per_cycle"));
    }

    #[test]
    fn what_is_not_there_is_not_a_number() {
        let flat = Features::of(&Trace { dt_s: 0.01, values: vec![5.0; 500], late_s: 0.0 }, 1.0);
        assert!(!flat.complete() && flat.values().iter().all(|v| v.is_nan()));
    }
}
