//! An answer that the records leave standing, and what they tell of its parameters.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::baseline::Baseline;
use crate::diagnose::evidence::EvidenceScale;
use crate::fit::numeric::least_squares::{Problem, jacobian};
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::effects::Chosen;
use crate::model::{ModelError, RunValues};
use crate::product::gram;

/// A model that the records leave standing.
#[derive(Debug, Clone)]
pub struct Answer {
    /// What it says, in the words of the command line.
    pub name: String,
    /// Its effects; the last of them is what it blames.
    pub effects: Vec<Chosen>,
    /// Values of all variables: shared ones, places of sensors, then each run's.
    pub values: Vec<f64>,
}

/// What the records tell of the variables that all runs share: a normal distribution.
pub(crate) struct Known {
    pub(crate) names: Vec<String>,
    /// The variables at its centre.
    pub(crate) centre: DVector<f64>,
    /// `UᵀU` is the information.
    pub(crate) root: DMatrix<f64>,
    /// Of each run.
    pub(crate) runs: Vec<RunValues>,
    pub(crate) closure_s: f64,
    /// The square that counts as one after this answer: see [`EvidenceScale`].
    pub(crate) unit: f64,
}

impl Answer {
    /// What the records tell, where their noise is all that is unknown.
    ///
    /// # Errors
    /// If the model cannot be simulated.
    pub(crate) fn known(&self, baseline: &Baseline) -> Result<Option<Known>, ModelError> {
        let model = baseline.model(&self.effects);
        let problem = baseline.problem(&model);
        let x = problem.variables(&self.values);
        let residuals = problem.residuals(&x)?;
        let columns = jacobian(&problem, &x, &residuals)?;
        let shared = problem.place_variables().end;
        let mut information = gram(&columns);
        for j in 0..columns.len() {
            information[(j, j)] += flat(&problem, j);
        }
        let Some(marginal) = marginal(&information, shared) else { return Ok(None) };
        let Some(root) = marginal.cholesky().map(|c| c.l().transpose()) else { return Ok(None) };
        Ok(Some(Known {
            names: problem.parameters[..shared].iter().map(|p| p.name.clone()).collect(),
            centre: DVector::from_column_slice(&x[..shared]),
            root,
            runs: (0..baseline.runs.len()).map(|r| problem.run_values(r, &self.values)).collect(),
            closure_s: problem.closure_start_s(0, &self.values),
            unit: EvidenceScale::of(&residuals[..problem.samples()], baseline.features()).unit,
        }))
    }
}

/// Information that the bounds of a variable hold: that of an even distribution between them; all where it is held.
pub(crate) fn flat(problem: &FitProblem, j: usize) -> f64 {
    const HELD: f64 = 1e12;
    let (lower, upper) = problem.bounds();
    let width = upper[j] - lower[j];
    if width > 0.0 { (12.0 / width.powi(2)).min(HELD) } else { HELD }
}

/// The information on the first `n` variables where the others are free (a Schur complement).
fn marginal(information: &DMatrix<f64>, n: usize) -> Option<DMatrix<f64>> {
    let all = information.nrows();
    let own = information.view((n, n), (all - n, all - n)).into_owned();
    let across = information.view((n, 0), (all - n, n)).into_owned();
    let of_shared = information.view((0, 0), (n, n)).into_owned();
    if all == n {
        return Some(of_shared);
    }
    let explained = own.cholesky()?.solve(&across);
    let left = of_shared - across.transpose() * explained;
    Some(0.5 * (&left + left.transpose()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_nuisance_explains_is_no_information() {
        // one measurement of a + b, one of b with standard error 1/2: a is known to ±√(1 + 1/4)
        let information = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 5.0]);
        let marginal = marginal(&information, 1).unwrap();
        assert!((1.0 / marginal[(0, 0)] - 1.25).abs() < 1e-12);
    }
}
