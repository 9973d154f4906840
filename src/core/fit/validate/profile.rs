//! Profile likelihood: how far one parameter can move, with all others following, before the fit is worse than noise
//! explains.
//!
//! Along the parameter the sum of squares is minimised over all others; the interval ends where it has risen by the 95%
//! point of χ² with one degree of freedom (Venzon & Moolgavkar 1988, Appl. Statist. 37, 87), times the factor by which
//! the parameter scatters more than white noise of the believed size would let it (Kent 1982, Biometrika 69, 19): see
//! [`crate::fit::inference::errors`]. Where the problem is linear that is the linear interval; a side is open where the
//! bound comes before the threshold, and unknown where no optimum was found before the threshold: see [`walk`]. An
//! element of creep that has vanished in the fit ([`crate::fit::problem::elements`]) stays so.

pub(crate) mod walk;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::inference::errors::Errors;
use crate::fit::numeric::least_squares::{Limits, Problem, jacobian};
use crate::fit::numeric::quantiles::Z_95;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::profile::Profile;
use crate::fit::problem::elements::vanished;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::assemble::moments_of;
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::options::Options;
use crate::fit::search::thresholds::{FINAL, FINAL_REACHES};
use crate::fit::validate::profile::walk::{End, Start, walk};
use crate::fit::validate::thresholds::PROFILE_COST_TOLERANCE;
use crate::model::stop;
use crate::rig::Rig;

/// Profiles of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Profiles {
    /// Of each parameter that was asked for.
    pub of_each: Vec<Profile>,
    /// By how much lower than the fit's the sum of squares is at their centre, in units of what one sample leaves
    /// there.
    pub below_fit: f64,
    /// Simulations that they took.
    pub evaluations: usize,
}

/// Profiles of the parameters `which` of a fit, by their index, in that order.
///
/// Their centre is the optimum that a descent from the fit leads to on its own grid, whether or not the fit ended
/// there. They are walked on a grid of [`FINAL_REACHES`] reaches or little more, about the best fit there: the grid
/// moves a valley more than it bends it.
///
/// # Errors
/// As [`crate::fit::search::calibrate::refine`].
pub fn profiles(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    which: &[usize],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Profiles, FitError> {
    let values = fit.values();
    let ctx = Calibrator::new(rig, runs, options, progress, &fit.effects, Some(&values))?;
    let model = ctx.model(&fit.effects);
    let mut own = ctx.problem(&model, ctx.whole(fit.reaches));
    // An element that has vanished stays so: the profiles are those of the model without it, which is as good.
    let gone: Vec<usize> = vanished(&own, &values).into_iter().flat_map(|e| [e.strength, e.time]).collect();
    own.hold(&gone, &values);
    let limits = |problem: &FitProblem| Limits {
        iterations: FINAL.iterations,
        cost_tolerance: PROFILE_COST_TOLERANCE / problem.samples().max(1) as f64,
        step_tolerance: 1e-10,
        thorough: true,
    };
    let at_fit = own.residuals(&own.variables(&values))?;
    let centre = ctx.minimise(&own, &values, limits(&own), "profiles: their centre")?;
    let fall = at_fit.iter().map(|r| r * r).sum::<f64>() - 2.0 * centre.cost;
    let below_fit = fall / (2.0 * centre.cost / own.samples().max(1) as f64).max(f64::MIN_POSITIVE);
    let values = own.values(&centre.x);
    let reaches = model.fitting_reaches(&values[..model.shared.len()], FINAL_REACHES.max(ctx.least_reaches));
    let mut problem = ctx.problem(&model, ctx.whole(reaches));
    problem.hold(&gone, &values);
    let best = ctx.minimise(&problem, &values, limits(&problem), "profiles: the best fit")?;
    let columns = jacobian(&problem, &best.x, &best.residuals)?;
    ctx.count(1 + columns.len());
    let common: Vec<_> = problem.rows.gain_errors().into_values().collect();
    let moments = moments_of(&problem, &best, &columns, &common);
    let fitted = problem.variables(&values);
    let done = AtomicUsize::new(0);
    let one = |&j: &usize| {
        let parameter = &fit.parameters[j];
        // Held variables do not follow; one at its bound is let go.
        let held: Vec<bool> = best.at_bound.iter().enumerate().map(|(i, held)| *held && i != j).collect();
        let errors = Errors::among(&moments, &held);
        let believed = errors.believed[(j, j)];
        let error = parameter.standard_error() / problem.stretch(j, values[j]);
        let unit = if error.is_finite() { (error * error / believed).max(1.0) } else { errors.inflation(j) };
        let (lower, upper) = problem.bounds();
        let half = Z_95 * if error.is_finite() { error } else { errors.covariance[(j, j)].sqrt() };
        let first = if half.is_finite() && half > 0.0 { half } else { 0.05 * (upper[j] - lower[j]) };
        let follow: Vec<f64> = (0..best.x.len())
            .map(|i| if i == j { 1.0 } else { errors.believed[(i, j)] / believed })
            .map(|f| if f.is_finite() { f } else { 0.0 })
            .collect();
        let walk = walk(&problem, &Start { best: &best, j, unit, first, follow: &follow });
        ctx.count(walk.evaluations);
        let name = |x: f64| problem.value(j, (fitted[j] + x - best.x[j]).clamp(lower[j], upper[j]));
        let end = |end: End, open: f64| if let End::At(x) = end { name(x) } else { open };
        let unknown = |end: End| if let End::Unknown(x) = end { Some(name(x)) } else { None };
        let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(&Progress::fitting(
            format!("profile {finished} of {}: {}", which.len(), parameter.name),
            reaches,
            walk.points.len(),
            (2.0 * best.cost / problem.samples().max(1) as f64).sqrt(),
        ));
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
    stop::check()?;
    Ok(Profiles { of_each, below_fit, evaluations: ctx.evaluations.load(Ordering::Relaxed) })
}
