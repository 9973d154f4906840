//! Profile likelihood: how far one parameter can move while all others follow, before the fit is worse than noise can explain.
//!
//! Along the parameter the sum of squares is minimised over all others; the interval ends where it has risen by the 95% point of χ² with one
//! degree of freedom (Venzon & Moolgavkar 1988, Appl. Statist. 37, 87), times the factor by which the parameter scatters more
//! than white noise of the believed size would let it (Kent 1982, Biometrika 69, 19): see [`crate::fit::inference::errors`]. Where the problem is linear that
//! is the linear interval; a side on which the threshold is not reached before the bound is open, and one on which no optimum was found before the
//! threshold is not known: see [`walk`]. An element of creep that has vanished in the fit ([`crate::fit::search::prune_elements`]) stays so.

pub(crate) mod walk;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::inference::interval::Z_95;
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, jacobian};
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::fit_problem::Calibration;
use crate::fit::search::calibrate::{FitError, Options, Progress};
use crate::fit::search::coarse_fit::Fitter;
use crate::fit::search::finish::{FINAL_REACHES, errors_of};
use crate::fit::search::prune_elements::vanished;
use crate::fit::validate::profile::walk::{End, SETTLED, Start, walk};
use crate::rig::Rig;

/// Share of the interval on one side by which profile and linear interval may differ before it is said.
const DIFFERENT: f64 = 0.3;

/// The profile of one parameter, in its own unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// The 95% interval; an end that is open or not known is infinite.
    pub interval_95: (f64, f64),
    /// Where an end is not known: the last value at which an optimum was found, below and above.
    pub unknown_beyond: [Option<f64>; 2],
    /// Points at which no optimum was found; they are not among the others.
    pub unresolved: usize,
    /// The linear one.
    pub linear_95: (f64, f64),
    /// Value and rise of the sum of squares, ascending by value; 3.84 is the threshold.
    pub points: Vec<(f64, f64)>,
    /// By how much less than nothing the rise became: the fit was not the best.
    pub fell_by: f64,
    /// Where it is centred: the optimum that a descent from the fit leads to.
    pub best: f64,
}

/// Profiles of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Profiles {
    /// Of each parameter that was asked for.
    pub of_each: Vec<Profile>,
    /// By how much lower than the fit's the sum of squares is at their centre, in units of what one sample leaves there.
    pub below_fit: f64,
    /// Simulations that they took.
    pub evaluations: usize,
}

impl Profile {
    /// Whether it says something else than the linear interval about its centre; where there is no linear one, it does not.
    pub fn disagrees(&self) -> bool {
        let value = self.best;
        if self.linear_95.0.is_nan() || self.linear_95.1.is_nan() {
            return false;
        }
        let sides = [(self.interval_95.0, self.linear_95.0), (self.interval_95.1, self.linear_95.1)];
        sides.into_iter().any(|(own, linear)| match (own.is_finite(), linear.is_finite()) {
            (true, true) => {
                let ratio = (own - value) / (linear - value);
                ratio.is_finite() && !(1.0 / (1.0 + DIFFERENT)..=1.0 + DIFFERENT).contains(&ratio)
            }
            (own, linear) => own != linear,
        })
    }
}

/// Profiles of the parameters `which` of a fit, by their index, in that order.
///
/// Their centre is the optimum that a descent from the fit leads to on its own grid, whether or not the fit ended there. They are walked on a grid of
/// [`FINAL_REACHES`] reaches or little more, about the best fit there: the grid moves a valley more than it bends it.
///
/// # Errors
/// As [`crate::fit::search::calibrate::refine`].
pub fn profiles(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    which: &[usize],
    options: &Options,
    progress: &(dyn Fn(&Progress) + Sync),
) -> Result<Profiles, FitError> {
    let values = fit.values();
    let fitter = Fitter::new(rig, runs, options, progress, &fit.effects, Some(&values))?;
    let model = fitter.model(&fit.effects);
    let mut own = fitter.problem(&model, fitter.whole(fit.reaches));
    // An element that has vanished stays so: the profiles are those of the model without it, which is as good.
    let gone: Vec<usize> = vanished(&own, &values).into_iter().flat_map(|e| [e.strength, e.time]).collect();
    own.hold(&gone, &values);
    let limits = |problem: &Calibration| Limits {
        iterations: options.patience,
        cost_tolerance: SETTLED / problem.samples().max(1) as f64,
        step_tolerance: 1e-10,
        thorough: true,
    };
    let at_fit = own.residuals(&own.variables(&values))?;
    let centre = fitter.minimise(&own, &values, limits(&own), "profiles: their centre")?;
    let fall = at_fit.iter().map(|r| r * r).sum::<f64>() - 2.0 * centre.cost;
    let below_fit = fall / (2.0 * centre.cost / own.samples().max(1) as f64).max(f64::MIN_POSITIVE);
    let values = own.values(&centre.x);
    let reaches = model.fitting_reaches(&values[..model.shared.len()], FINAL_REACHES.max(fitter.least_reaches));
    let mut problem = fitter.problem(&model, fitter.whole(reaches));
    problem.hold(&gone, &values);
    let best = fitter.minimise(&problem, &values, limits(&problem), "profiles: the best fit")?;
    let columns = jacobian(&problem, &best.x, &best.residuals)?;
    fitter.count(1 + columns.len());
    let fitted = problem.variables(&values);
    let done = AtomicUsize::new(0);
    let one = |&j: &usize| {
        let parameter = &fit.parameters[j];
        // Held variables do not follow; one at its bound is let go.
        let solution = Solution {
            at_bound: best.at_bound.iter().enumerate().map(|(i, held)| *held && i != j).collect(),
            ..best.clone()
        };
        let errors = errors_of(&problem, &solution, &columns, &problem.gain_errors().into_values().collect::<Vec<_>>());
        let believed = errors.believed[(j, j)];
        let error = parameter.standard_error / problem.stretch(j, values[j]);
        let unit = if error.is_finite() { (error * error / believed).max(1.0) } else { errors.inflation(j) };
        let (lower, upper) = problem.bounds();
        let half = Z_95 * if error.is_finite() { error } else { errors.covariance[(j, j)].sqrt() };
        let first = if half.is_finite() && half > 0.0 { half } else { 0.05 * (upper[j] - lower[j]) };
        let follow: Vec<f64> = (0..best.x.len())
            .map(|i| if i == j { 1.0 } else { errors.believed[(i, j)] / believed })
            .map(|f| if f.is_finite() { f } else { 0.0 })
            .collect();
        let walk = walk(&problem, &Start { best: &best, j, unit, first, follow: &follow });
        fitter.count(walk.evaluations);
        let name = |x: f64| problem.value(j, (fitted[j] + x - best.x[j]).clamp(lower[j], upper[j]));
        let end = |end: End, open: f64| if let End::At(x) = end { name(x) } else { open };
        let unknown = |end: End| if let End::Unknown(x) = end { Some(name(x)) } else { None };
        let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(&Progress {
            stage: format!("profile {finished} of {}: {}", which.len(), parameter.name),
            reaches,
            iteration: walk.points.len(),
            error_over_noise: (2.0 * best.cost / problem.samples().max(1) as f64).sqrt(),
        });
        Profile {
            interval_95: (end(walk.ends[0], f64::NEG_INFINITY), end(walk.ends[1], f64::INFINITY)),
            unknown_beyond: walk.ends.map(unknown),
            unresolved: walk.unresolved,
            linear_95: parameter.interval_95,
            fell_by: walk.fell_by,
            best: values[j],
            points: walk.points.into_iter().filter(|p| p.1.is_finite()).map(|(x, rise)| (name(x), rise)).collect(),
        }
    };
    let of_each = which.par_iter().map(one).collect();
    Ok(Profiles { of_each, below_fit, evaluations: fitter.evaluations.load(Ordering::Relaxed) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disagreement_is_said() {
        let of = |interval_95, linear_95| Profile {
            interval_95,
            unknown_beyond: [None; 2],
            unresolved: 0,
            linear_95,
            points: vec![],
            fell_by: 0.0,
            best: 1.0,
        };
        assert!(!of((0.8, 1.25), (0.78, 1.22)).disagrees());
        assert!(of((0.8, 1.6), (0.78, 1.22)).disagrees());
        assert!(of((0.8, f64::INFINITY), (0.78, 1.22)).disagrees());
        assert!(!of((0.8, f64::INFINITY), (0.8, f64::INFINITY)).disagrees());
        assert!(!of((0.8, 1.6), (f64::NAN, f64::NAN)).disagrees());
    }
}
