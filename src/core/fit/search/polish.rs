//! The last descent of a fit, begun anew until it ends at an optimum.
//!
//! Variables are logarithms where values are positive. A compliance that has shrunk to next to nothing hardly moves then: a step by a factor
//! changes nothing, and a descent believes itself at its end though the value itself would gain much. So where more is promised than was found, the
//! linearised problem is solved once in the values, and the descent goes on from there.

use std::borrow::Cow;

use nalgebra::DVector;

use crate::fit::inference::optimum::{AT_OPTIMUM, promised_fall, promising_step};
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, Stop, jacobian};
use crate::fit::problem::fit_problem::Calibration;
use crate::fit::search::coarse_fit::Fitter;
use crate::model::ModelError;

/// How often a descent that has given up is begun anew at the most.
const ANEW: usize = 3;
/// Shares of the step in the values that are tried.
const SHARES: [f64; 4] = [1.0, 0.5, 0.2, 0.05];

/// What a step of a descent promises.
pub(crate) struct Promise<'a> {
    /// Fall of the sum of squares, in units of what one sample leaves.
    pub(crate) fall: f64,
    /// The Jacobian's columns that say so: those at the solution itself where more is promised than at an optimum.
    pub(crate) columns: Cow<'a, [Vec<f64>]>,
}

impl Promise<'_> {
    /// Whether a solution is an optimum. Where every step has been tried it is one, whatever is promised: residuals may have corners. Of
    /// any other end it is measured.
    pub(crate) fn at_optimum(&self, solution: &Solution) -> bool {
        !matches!(solution.stop, Stop::CostSettled | Stop::IterationsSpent) || self.fall <= AT_OPTIMUM
    }
}

fn promise<'a>(problem: &Calibration, solution: &Solution, columns: Cow<'a, [Vec<f64>]>) -> Promise<'a> {
    let of_one = (2.0 * solution.cost / problem.samples().max(1) as f64).max(f64::MIN_POSITIVE);
    let fall = promised_fall(&columns, &solution.residuals, &solution.x, problem.bounds()) / of_one;
    Promise { fall, columns }
}

/// Columns of a Jacobian in the values instead of the variables.
pub(crate) fn by_value(problem: &Calibration, columns: &[Vec<f64>], values: &[f64]) -> Vec<Vec<f64>> {
    let of = |(j, column): (usize, &Vec<f64>)| {
        let stretch = problem.stretch(j, values[j]);
        column.iter().map(|c| c / stretch).collect()
    };
    columns.iter().enumerate().map(of).collect()
}

impl Fitter<'_> {
    /// Goes down from `values` as far as it goes.
    pub(crate) fn last_descent(
        &self,
        problem: &Calibration,
        values: &[f64],
        limits: Limits,
    ) -> Result<Solution, ModelError> {
        let mut solution = self.minimise(problem, values, limits, "all samples")?;
        // A descent may give up in a bent valley, though more is promised: begun anew it often goes on.
        for _ in 0..ANEW {
            if solution.stop != Stop::CostSettled {
                break;
            }
            let promised = self.promised(problem, &solution)?;
            if promised.fall <= AT_OPTIMUM {
                break;
            }
            let from = self.leap(problem, &solution, &promised.columns)?.unwrap_or_else(|| problem.values(&solution.x));
            let again = self.minimise(problem, &from, limits, "all samples, anew")?;
            if again.cost >= solution.cost {
                break;
            }
            solution = again;
        }
        self.without_surplus(problem, solution, limits)
    }

    /// Values that a step in the values themselves leads to; none where it does not lead down.
    fn leap(
        &self,
        problem: &Calibration,
        solution: &Solution,
        columns: &[Vec<f64>],
    ) -> Result<Option<Vec<f64>>, ModelError> {
        let values = problem.values(&solution.x);
        let by_value = by_value(problem, columns, &values);
        let (lower, upper) = problem.bounds();
        let (lower, upper) = (problem.values(lower), problem.values(upper));
        let step = promising_step(&by_value, &solution.residuals, &values, (&lower, &upper));
        self.lower_along(problem, &values, &step, solution.cost)
    }

    /// Values along a step, or on a share of it, where the cost falls below one that is known; none where it does not.
    pub(crate) fn lower_along(
        &self,
        problem: &Calibration,
        values: &[f64],
        step: &DVector<f64>,
        cost: f64,
    ) -> Result<Option<Vec<f64>>, ModelError> {
        let (lower, upper) = problem.bounds();
        let (lower, upper) = (problem.values(lower), problem.values(upper));
        for share in SHARES {
            let there: Vec<f64> =
                (0..values.len()).map(|j| (values[j] + share * step[j]).clamp(lower[j], upper[j])).collect();
            self.count(1);
            let residuals = problem.residuals(&problem.variables(&there))?;
            if 0.5 * residuals.iter().map(|r| r * r).sum::<f64>() < cost {
                return Ok(Some(there));
            }
        }
        Ok(None)
    }

    /// The Jacobian's columns at a solution: those of its last step where that no longer mattered.
    pub(crate) fn slopes<'a>(
        &self,
        problem: &Calibration,
        solution: &'a Solution,
    ) -> Result<Cow<'a, [Vec<f64>]>, ModelError> {
        if solution.stop.converged() {
            return Ok(Cow::Borrowed(&solution.columns));
        }
        let columns = jacobian(problem, &solution.x, &solution.residuals)?;
        self.count(columns.len());
        Ok(Cow::Owned(columns))
    }

    /// What a step of a descent promises at a solution.
    pub(crate) fn promised<'a>(
        &self,
        problem: &Calibration,
        solution: &'a Solution,
    ) -> Result<Promise<'a>, ModelError> {
        let promised = promise(problem, solution, self.slopes(problem, solution)?);
        if promised.fall <= AT_OPTIMUM || matches!(promised.columns, Cow::Owned(_)) {
            return Ok(promised);
        }
        // The last step mattered, after all.
        let columns = jacobian(problem, &solution.x, &solution.residuals)?;
        self.count(columns.len());
        Ok(promise(problem, solution, Cow::Owned(columns)))
    }
}
