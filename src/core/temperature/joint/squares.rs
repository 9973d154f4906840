//! Sums of squares for the comparison of the laws with the separate fits, and their difference by noise alone.

use crate::fit::inference::errors::{Errors, Linearised};
use crate::fit::numeric::least_squares::{Problem, Solution, jacobian};
use crate::fit::outcome::fit::Fit;
use crate::model::ModelError;
use crate::temperature::compare::Sums;
use crate::temperature::joint::problem::JointProblem;

pub(crate) fn sums(
    joint: &JointProblem,
    fits: &[Fit],
    apart: &[f64],
    solution: &Solution,
    noise_per_parameter: f64,
) -> Sums {
    let square = |r: &[f64]| r.iter().map(|r| r * r).sum::<f64>();
    let free = |f: &Fit| f.parameters.iter().filter(|p| p.run.is_none() && !p.at_bound && !p.held).count();
    let shared: usize = fits.iter().map(free).sum();
    let of_laws = solution.at_bound[..joint.law.parameters.len()].iter().filter(|b| !**b).count();
    let samples = joint.samples();
    Sums {
        apart: square(apart),
        together: square(&solution.residuals),
        samples,
        noise_per_parameter,
        apart_parameters: fits.iter().map(|f| f.parameters.len()).sum(),
        saved: shared.saturating_sub(of_laws),
    }
}

/// How much more noise makes the laws leave than the separate fits, for each parameter that they save: 1 where it is as
/// white as believed. Other noise gives a parameter what it contains at the frequencies that the parameter moves: the
/// mean of the weights of the sum of χ² that the difference is (Rao & Scott 1981, J. Am. Stat. Assoc. 76, 221;
/// Rotnitzky & Jewell 1990, Biometrika 77, 485).
pub(crate) fn noise_per_parameter(
    joint: &JointProblem,
    fits: &[Fit],
    (values, residuals): (&[Vec<f64>], &[f64]),
    (together, columns): (&Solution, &[Vec<f64>]),
) -> Result<f64, ModelError> {
    // The separate fits give the noise, for the laws are on trial.
    let taken = Errors::of(Linearised {
        columns,
        residuals,
        records: &joint.records(),
        common: &[],
        at_bound: &together.at_bound,
        in_time: None,
    });
    let (mut apart, mut variables) = (0.0, 0);
    for ((problem, fit), x) in joint.problems.iter().zip(fits).zip(values) {
        let residuals = problem.residuals(x)?;
        let columns = jacobian(problem, x, &residuals)?;
        let at_bound: Vec<bool> = fit.parameters.iter().map(|p| p.at_bound || p.held).collect();
        let errors = Errors::of(Linearised {
            columns: &columns,
            residuals: &residuals,
            records: &problem.rows.record_rows(),
            common: &[],
            at_bound: &at_bound,
            in_time: None,
        });
        apart += errors.taken;
        variables += at_bound.iter().filter(|held| !**held).count();
    }
    // Each thermometer's error is a square that the separate fits do not have, and a variable of the joint fit.
    let runs = joint.own.len();
    let saved = (variables + runs) as f64 - together.at_bound.iter().filter(|held| !**held).count() as f64;
    let more = apart + runs as f64 - taken.taken;
    Ok(if saved >= 1.0 { (more / saved).max(1.0) } else { 1.0 })
}
