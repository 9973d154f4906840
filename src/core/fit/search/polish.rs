//! The last descent of a fit, restarted until it ends at an optimum.
//!
//! Variables are logarithms where values are positive. A compliance that has shrunk to almost nothing hardly moves
//! then: a step by a factor changes nothing, and the descent stops although a step of the value itself would gain much.
//! So where the prediction exceeds the gain, the linearised problem is solved once in the values, and the descent goes
//! on from there.

use crate::fit::inference::optimum::bounded_step;
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, Stop};
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::descent::{by_value, lower_along, polishing, predict_reduction};
use crate::fit::search::options::Effort;
use crate::fit::search::prune_elements::prune_elements;
use crate::fit::search::thresholds::MAX_RESTARTS;
use crate::model::ModelError;

/// Descends from `values` to an optimum, if it can be reached.
pub(crate) fn polish(
    ctx: &Calibrator,
    problem: &FitProblem,
    values: &[f64],
    limits: Limits,
) -> Result<Solution, ModelError> {
    let mut solution = ctx.minimise(problem, values, limits, "all samples")?;
    // A descent may give up in a bent valley although more could be gained: restarted it often goes on.
    for _ in 0..MAX_RESTARTS {
        if solution.stop != Stop::CostSettled {
            break;
        }
        let predicted = predict_reduction(ctx, problem, &solution)?;
        if predicted.at_optimum(problem, &solution) {
            break;
        }
        let from = leap(ctx, problem, &solution, &predicted.columns)?.unwrap_or_else(|| problem.values(&solution.x));
        let limits = polishing(ctx, problem, &from, limits)?;
        let again = ctx.minimise(problem, &from, limits, "all samples, restarted")?;
        let fall = solution.cost - again.cost;
        if fall > 0.0 {
            solution = again;
        }
        if fall <= limits.cost_tolerance * solution.cost {
            break;
        }
    }
    match ctx.options.effort {
        Effort::Whole => prune_elements(ctx, problem, solution, limits),
        Effort::Brief | Effort::Converged => Ok(solution),
    }
}

/// Values after a step of the values themselves; none where no share of it lowers the cost.
fn leap(
    ctx: &Calibrator,
    problem: &FitProblem,
    solution: &Solution,
    columns: &[Vec<f64>],
) -> Result<Option<Vec<f64>>, ModelError> {
    let values = problem.values(&solution.x);
    let by_value = by_value(problem, columns, &values);
    let (lower, upper) = problem.bounds();
    let (lower, upper) = (problem.values(lower), problem.values(upper));
    let step = bounded_step(&by_value, &solution.residuals, &values, (&lower, &upper));
    lower_along(ctx, problem, &values, &step, solution.cost)
}
