//! The features of a record that a stepwise calibration looks at, as least-squares problems of the few variables that a
//! step moves.

use crate::fit::numeric::least_squares::Problem;
use crate::fit::problem::compare::Pair;
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::problem::thresholds::{DIRECTION_SHARES, LEAD_OF_PERIOD, PHASE_SHARE};
use crate::model::ModelError;
use crate::model::trace::Trace;

/// A feature of the record that a step looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Feature {
    /// Mean heads before the closure.
    Steady,
    /// The valve's opening, read back from the head before it.
    ValveCurve,
    /// All samples before the first reflection is back.
    FirstRise,
    /// The times at which the level between extrema is crossed, in the first half of the cycles.
    EarlyPhase,
    /// The same in the second half.
    LatePhase,
    /// Heights of the extrema of the second half.
    LatePeaks,
    /// All samples of the first cycles within the problem's window.
    FirstCycles,
    /// Everything.
    Record,
}

impl Feature {
    /// As users read it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Feature::Steady => "heads before the closure",
            Feature::ValveCurve => "opening read back from the head at the valve",
            Feature::FirstRise => "first rise",
            Feature::EarlyPhase => "phase of the early cycles",
            Feature::LatePhase => "phase of the late cycles",
            Feature::LatePeaks => "heights of the late peaks",
            Feature::FirstCycles => "first cycles",
            Feature::Record => "whole record",
        }
    }
}

/// A feature as a problem of a few variables, with the others fixed.
pub(crate) struct FeatureProblem<'p> {
    pub(crate) problem: &'p FitProblem<'p>,
    pub(crate) which: &'p [usize],
    pub(crate) feature: Feature,
    /// All variables.
    values: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Period at the start of the step, s: the comparison stays the same while it moves.
    period_s: f64,
}

impl<'p> FeatureProblem<'p> {
    /// From `values`, within `bounds` of all variables or where they are.
    pub(crate) fn new(
        problem: &'p FitProblem,
        which: &'p [usize],
        feature: Feature,
        values: &[f64],
        bounds: &(Vec<f64>, Vec<f64>),
    ) -> Self {
        let at = problem.variables(values);
        FeatureProblem {
            lower: which.iter().map(|&j| bounds.0[j].min(at[j])).collect(),
            upper: which.iter().map(|&j| bounds.1[j].max(at[j])).collect(),
            values: at,
            period_s: problem.model.period_s(&values[..problem.model.shared.len()]),
            problem,
            which,
            feature,
        }
    }

    /// Where it starts.
    pub(crate) fn start(&self) -> Vec<f64> {
        self.which.iter().map(|&j| self.values[j]).collect()
    }

    /// All variables.
    pub(crate) fn whole(&self, x: &[f64]) -> Vec<f64> {
        let mut all = self.values.clone();
        self.which.iter().zip(x).for_each(|(&j, &v)| all[j] = v);
        all
    }

    /// Differences between measurement and model of run `r` in the feature, in units of their uncertainty.
    fn of_run(&self, r: usize, values: &[f64]) -> Result<Vec<f64>, ModelError> {
        let traces = self.problem.modelled(r, values, self.problem.window().reaches)?.traces;
        Ok((0..traces.len()).flat_map(|s| self.of_sensor(r, s, values, &traces[s])).collect())
    }

    fn of_sensor(&self, r: usize, s: usize, values: &[f64], trace: &Trace) -> Vec<f64> {
        let run = &self.problem.runs[r];
        let sensor = &run.sensors[s];
        let (start, offset) = (self.problem.closure_start_s(r, values), self.problem.offset_m(r, s, values));
        let known_start = run.start.closure_s.0;
        let index = |t: f64| sensor.time_s.partition_point(|&time| time < t);
        let (from, to) = match self.feature {
            Feature::Steady => (0, index(known_start - LEAD_OF_PERIOD * self.period_s)),
            Feature::FirstRise => {
                (index(known_start - LEAD_OF_PERIOD * self.period_s), index(known_start + 0.5 * self.period_s))
            }
            _ => (index(known_start), sensor.time_s.len()),
        };
        let measured_m = &sensor.head_m[from..to];
        let model_m: Vec<f64> = sensor.time_s[from..to].iter().map(|t| offset + trace.at(t - start)).collect();
        let differences = || measured_m.iter().zip(&model_m).map(|(a, b)| (a - b) / sensor.noise_m);
        match self.feature {
            // The mean of n samples is known √n times as well as one.
            Feature::Steady => vec![differences().sum::<f64>() / (measured_m.len().max(1) as f64).sqrt()],
            Feature::FirstRise => differences().collect(),
            _ => {
                let time_s: Vec<f64> = sensor.time_s[from..to].iter().map(|t| t - known_start).collect();
                let pair = Pair {
                    time_s: &time_s,
                    measured_m,
                    model_m: &model_m,
                    noise_m: sensor.noise_m,
                    period_s: self.period_s,
                };
                self.of_extrema(&run.extrema[s], known_start, &pair)
            }
        }
    }

    fn of_extrema(&self, found: &[(f64, usize, bool)], known_start: f64, pair: &Pair) -> Vec<f64> {
        let found: Vec<_> = found.iter().map(|&(t, c, p)| (t - known_start, c, p)).collect();
        let extrema = pair.extrema(&found);
        let middle = (found.len() / 2).min(extrema.len());
        let seen = match self.feature {
            Feature::LatePhase | Feature::LatePeaks => &extrema[middle..],
            Feature::EarlyPhase => &extrema[..middle],
            _ => &extrema[..],
        };
        let zero_if_lost = |v: f64| if v.is_finite() { v } else { 0.0 };
        let phases = seen.iter().map(|e| zero_if_lost(e.phase_s / (PHASE_SHARE * self.period_s)));
        let heights = seen.iter().map(|e| zero_if_lost((e.model_m - e.measured_m) / pair.noise_m));
        match self.feature {
            Feature::LatePeaks => heights.collect(),
            _ => phases.collect(),
        }
    }
}

impl Problem for FeatureProblem<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        let all = self.whole(x);
        if matches!(self.feature, Feature::FirstCycles | Feature::Record) {
            return self.problem.residuals(&all);
        }
        let values = self.problem.values(&all);
        let mut residuals = Vec::new();
        for r in 0..self.problem.runs.len() {
            residuals.extend(self.of_run(r, &values)?);
        }
        // Priors of the moved variables, from meters or a creep test, hold for each feature, too.
        residuals.extend(self.which.iter().filter_map(|&j| self.problem.prior_residual(j, all[j])));
        Ok(residuals)
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    fn difference_step(&self, j: usize) -> f64 {
        self.problem.difference_step(self.which[j])
    }
}

/// The whole record along one direction of the variables.
pub(crate) struct DirectionProblem<'p> {
    pub(crate) problem: &'p FitProblem<'p>,
    pub(crate) from: &'p [f64],
    pub(crate) direction: &'p [f64],
}

impl DirectionProblem<'_> {
    /// All variables after a share of the direction.
    pub(crate) fn whole(&self, share: f64) -> Vec<f64> {
        let (lower, upper) = self.problem.bounds();
        let moved = self.from.iter().zip(self.direction).map(|(x, d)| x + share * d);
        moved.zip(lower.iter().zip(upper)).map(|(x, (l, u))| x.clamp(*l, *u)).collect()
    }
}

impl Problem for DirectionProblem<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        self.problem.residuals(&self.whole(x[0]))
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        DIRECTION_SHARES
    }

    fn difference_step(&self, _j: usize) -> f64 {
        1e-2
    }
}
