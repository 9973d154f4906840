//! The valve's opening read back from the head measured before it, and the closure in two linear stages nearest to it.

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::least_squares::{Problem, minimise};
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::problem::thresholds::{READ_BACK_SPAN, STRAIGHT_WITHIN, TWO_STAGE_LIMITS, VALVE_SENSOR_SHARE};
use crate::model::valve_from_head::{ValveCurve, valve_from_head};
use crate::model::{ModelError, Resolution};
use crate::rig::Rig;

/// Linear from `(0, 1)` to `(inflection_s, inflection_opening)`, then to `(closing_s, 0)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoStage {
    /// When the valve changes its speed, s.
    pub inflection_s: f64,
    /// Its opening then.
    pub inflection_opening: f64,
    /// When it is closed, s.
    pub closing_s: f64,
    /// Difference of the curve from it, rms, of the opening.
    pub rms: f64,
}

/// Index of the pressure sensor of a run that shows the head before the valve.
///
/// # Errors
/// If no sensor stands there.
pub fn valve_sensor(rig: &Rig, run: &RunData) -> Result<usize, FitError> {
    let within_m = VALVE_SENSOR_SHARE * rig.length_m();
    let found = run.sensors.iter().position(|s| rig.length_m() - rig.on_way_m(s.sensor.place()) <= within_m);
    found.ok_or_else(|| FitError::NoValveSensor { file: run.file.clone(), within_m })
}

/// The valve's curve of run `r` from its head at `sensor`, up to twice the closing time among the `values`.
///
/// # Errors
/// As [`valve_from_head`].
pub(crate) fn read_back(
    problem: &FitProblem,
    r: usize,
    values: &[f64],
    sensor: usize,
    reaches: usize,
) -> Result<ValveCurve, ModelError> {
    let run = &problem.runs[r];
    let (start, offset) = (problem.closure_start_s(r, values), problem.offset_m(r, sensor, values));
    let own = problem.run_values(r, values);
    let seen = &run.sensors[sensor];
    let from = seen.time_s.partition_point(|&t| t < start);
    let time_s: Vec<f64> = seen.time_s[from..].iter().map(|t| t - start).collect();
    let head_m: Vec<f64> = seen.head_m[from..].iter().map(|h| h - offset).collect();
    let duration_s = (READ_BACK_SPAN * own.closing_time_s).min(time_s.last().copied().unwrap_or(0.0));
    let resolution = Resolution { reaches, duration_s };
    let shared = &values[..problem.model.shared.len()];
    valve_from_head(problem.model, &run.conditions, shared, &own, resolution, (&time_s, &head_m))
}

/// The time between the opening's fall below 90% and below 10%, over 80%, s; linear from sample to sample.
pub(crate) fn effective_closing_s(curve: &ValveCurve) -> Option<f64> {
    let points: Vec<(f64, f64)> = curve.time_s.iter().copied().zip(curve.opening.iter().copied()).collect();
    let below = |level: f64| {
        let at = points.iter().position(|(_, opening)| *opening <= level)?;
        let (t, opening) = points[at];
        let before = at.checked_sub(1).map(|i| points[i]).filter(|(_, before)| before.is_finite() && *before > opening);
        Some(before.map_or(t, |(from, before)| t - (t - from) * (level - opening) / (before - opening)))
    };
    Some((below(0.1)? - below(0.9)?) / 0.8)
}

impl TwoStage {
    /// How far the inflection lies off the straight line from open to closed, of the opening.
    pub fn bend(&self) -> f64 {
        self.inflection_opening - (1.0 - self.inflection_s / self.closing_s)
    }

    /// Whether a straight line describes the curve as well; then the inflection may lie anywhere on it.
    pub fn straight(&self) -> bool {
        self.bend().abs() < STRAIGHT_WITHIN.0.max(STRAIGHT_WITHIN.1 * self.rms)
    }

    /// The opening at a time after the start of the closure.
    pub fn opening(&self, time_s: f64) -> f64 {
        let (inflection_s, opening) = (self.inflection_s, self.inflection_opening);
        if time_s < inflection_s {
            1.0 - (1.0 - opening) * time_s / inflection_s
        } else {
            opening * ((self.closing_s - time_s) / (self.closing_s - inflection_s)).max(0.0)
        }
    }

    /// Least squares from the linear closure with its kink in nine places.
    pub(crate) fn nearest(curve: &ValveCurve, closing_s: f64) -> Self {
        let points: Vec<(f64, f64)> =
            curve.time_s.iter().copied().zip(curve.opening.iter().copied()).filter(|(_, o)| o.is_finite()).collect();
        let law = Law { points, lower: [0.3 * closing_s, 0.02, 0.0], upper: [READ_BACK_SPAN * closing_s, 0.98, 1.0] };
        let starts = [0.25, 0.5, 0.75].iter().flat_map(|t| [-0.2, 0.0, 0.2].map(|off| [closing_s, *t, 1.0 - t + off]));
        let found = starts.filter_map(|start| minimise(&law, &start, TWO_STAGE_LIMITS, |_, _| {}).ok());
        let best = found.min_by(|a, b| a.cost.total_cmp(&b.cost));
        let n = law.points.len().max(1) as f64;
        best.map_or(
            TwoStage { inflection_s: f64::NAN, inflection_opening: f64::NAN, closing_s: f64::NAN, rms: f64::NAN },
            |s| TwoStage { rms: (2.0 * s.cost / n).sqrt(), ..TwoStage::of(&s.x) },
        )
    }

    /// Of the variables closing time, kink as a part of it, opening at the kink.
    fn of(x: &[f64]) -> Self {
        TwoStage { inflection_s: x[1] * x[0], inflection_opening: x[2], closing_s: x[0], rms: f64::NAN }
    }
}

/// The law as a least-squares problem.
struct Law {
    points: Vec<(f64, f64)>,
    lower: [f64; 3],
    upper: [f64; 3],
}

impl Problem for Law {
    type Error = std::convert::Infallible;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, Self::Error> {
        let law = TwoStage::of(x);
        Ok(self.points.iter().map(|(t, opening)| opening - law.opening(*t)).collect())
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    fn difference_step(&self, j: usize) -> f64 {
        1e-6 * self.upper[j]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(law: impl Fn(f64) -> f64) -> ValveCurve {
        let time_s: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.5e-3).collect();
        let opening = time_s.iter().map(|t| law(*t)).collect();
        ValveCurve { velocity_m_s: vec![0.0; time_s.len()], time_s, opening }
    }

    #[test]
    fn two_stages_are_found_again() {
        let truth = TwoStage { inflection_s: 0.03, inflection_opening: 0.35, closing_s: 0.11, rms: 0.0 };
        let found = TwoStage::nearest(&curve(|t| truth.opening(t)), 0.1);
        assert!((found.inflection_s - 0.03).abs() < 1e-4, "{found:?}");
        assert!((found.inflection_opening - 0.35).abs() < 1e-3 && (found.closing_s - 0.11).abs() < 1e-4, "{found:?}");
        assert!(found.rms < 1e-4 && !found.straight() && (found.bend() - (0.35 - 8.0 / 11.0)).abs() < 0.01);
        assert!(TwoStage::nearest(&curve(|t| (1.0 - t / 0.1).max(0.0)), 0.1).straight());
    }

    #[test]
    fn the_effective_time_of_a_linear_closure_is_its_time() {
        let linear = curve(|t| (1.0 - t / 0.08).max(0.0));
        assert!((effective_closing_s(&linear).unwrap() - 0.08).abs() < 1e-9);
        assert_eq!(effective_closing_s(&curve(|_| 1.0)), None);
    }
}
