//! What a descent could still gain where it ended, and how far one is worth its cost.

use std::borrow::Cow;

use crate::fit::inference::thresholds::OPTIMUM_REDUCTION;
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, Stop, jacobian, predicted_at};
use crate::fit::numeric::uncertainty::correlation_inflation;
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::thresholds::POLISH_REDUCTION;
use crate::model::ModelError;

/// The reduction that an undamped step predicts.
pub(crate) struct PredictedReduction<'a> {
    /// Of the sum of squares, in units of what one sample leaves.
    pub(crate) reduction: f64,
    /// The Jacobian's columns that predict it: those at the solution itself where the prediction exceeds that of an
    /// optimum.
    pub(crate) columns: Cow<'a, [Vec<f64>]>,
}

impl PredictedReduction<'_> {
    /// Whether a solution is an optimum. Where no step lowers the cost it is one, whatever the prediction: residuals
    /// may have corners. Elsewhere the prediction decides; samples whose errors are alike count once.
    pub(crate) fn at_optimum(&self, problem: &FitProblem, solution: &Solution) -> bool {
        !matches!(solution.stop, Stop::CostSettled | Stop::IterationsSpent)
            || self.independent(problem, solution) <= OPTIMUM_REDUCTION
    }

    /// The reduction in units of what one independent sample leaves.
    pub(crate) fn independent(&self, problem: &FitProblem, solution: &Solution) -> f64 {
        self.reduction / correlation_inflation(&solution.residuals[..problem.samples()])
    }
}

fn over_one_sample<'a>(
    problem: &FitProblem,
    solution: &Solution,
    columns: Cow<'a, [Vec<f64>]>,
) -> PredictedReduction<'a> {
    let of_one = (2.0 * solution.cost / problem.samples().max(1) as f64).max(f64::MIN_POSITIVE);
    let reduction = predicted_at(problem, &columns, &solution.residuals, &solution.x) / of_one;
    PredictedReduction { reduction, columns }
}

/// The limits of a descent from where these are the residuals: it ends where the fall of the sum of squares is not worth
/// another iteration, and not before the tolerance of `limits`. Samples whose errors are alike count once.
pub(crate) fn polishing(problem: &FitProblem, residuals: &[f64], limits: Limits) -> Limits {
    let samples = problem.samples();
    let worth = POLISH_REDUCTION * correlation_inflation(&residuals[..samples]) / samples.max(1) as f64;
    Limits { cost_tolerance: worth.min(limits.cost_tolerance), ..limits }
}

/// The same from these values.
///
/// # Errors
/// Values that cannot be evaluated.
pub(crate) fn polishing_from(
    ctx: &Calibrator,
    problem: &FitProblem,
    values: &[f64],
    limits: Limits,
) -> Result<Limits, ModelError> {
    ctx.count(1);
    Ok(polishing(problem, &problem.residuals(&problem.variables(values))?, limits))
}

/// The Jacobian's columns at a solution; those of the last step where the descent converged.
pub(crate) fn slopes<'a>(
    ctx: &Calibrator,
    problem: &FitProblem,
    solution: &'a Solution,
) -> Result<Cow<'a, [Vec<f64>]>, ModelError> {
    if solution.stop.converged() {
        return Ok(Cow::Borrowed(&solution.columns));
    }
    let columns = jacobian(problem, &solution.x, &solution.residuals)?;
    ctx.count(columns.len());
    Ok(Cow::Owned(columns))
}

/// The reduction that an undamped step predicts at a solution.
pub(crate) fn predict_reduction<'a>(
    ctx: &Calibrator,
    problem: &FitProblem,
    solution: &'a Solution,
) -> Result<PredictedReduction<'a>, ModelError> {
    predict_reduction_by(ctx, problem, solution, slopes(ctx, problem, solution)?)
}

/// The same where the columns that [`slopes`] gives are at hand.
pub(crate) fn predict_reduction_by<'a>(
    ctx: &Calibrator,
    problem: &FitProblem,
    solution: &Solution,
    columns: Cow<'a, [Vec<f64>]>,
) -> Result<PredictedReduction<'a>, ModelError> {
    let predicted = over_one_sample(problem, solution, columns);
    if predicted.independent(problem, solution) <= OPTIMUM_REDUCTION || !solution.stop.converged() {
        return Ok(predicted);
    }
    // The columns of the last step may be out of date.
    let columns = jacobian(problem, &solution.x, &solution.residuals)?;
    ctx.count(columns.len());
    Ok(over_one_sample(problem, solution, Cow::Owned(columns)))
}
