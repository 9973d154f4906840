//! The last descent of a fit, restarted until it ends at an optimum.

use crate::fit::numeric::least_squares::{Limits, Solution, Stop};
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::descent::{polishing, predict_reduction};
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
        let from = problem.values(&solution.x);
        let limits = polishing(problem, &solution.residuals, limits);
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
