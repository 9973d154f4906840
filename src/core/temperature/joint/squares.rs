//! What the comparison of the laws with the fits apart needs: sums of squares, and what noise alone makes of their difference.

use crate::fit::inference::errors::{Errors, Linearised};
use crate::fit::numeric::least_squares::{Problem, Solution, jacobian};
use crate::fit::outcome::fit::Fit;
use crate::model::ModelError;
use crate::temperature::compare::Sums;
use crate::temperature::joint::Joint;

pub(crate) fn sums(joint: &Joint, fits: &[Fit], apart: &[f64], solution: &Solution, noise_a_parameter: f64) -> Sums {
    let square = |r: &[f64]| r.iter().map(|r| r * r).sum::<f64>();
    let free = |f: &Fit| f.parameters.iter().filter(|p| p.run.is_none() && !p.at_bound && !p.held).count();
    let shared: usize = fits.iter().map(free).sum();
    let of_laws = solution.at_bound[..joint.law.parameters.len()].iter().filter(|b| !**b).count();
    let samples = joint.samples();
    Sums {
        apart: square(apart),
        together: square(&solution.residuals),
        samples,
        noise_a_parameter,
        apart_parameters: fits.iter().map(|f| f.parameters.len()).sum(),
        saved: shared.saturating_sub(of_laws),
    }
}

/// What noise makes the laws leave more than the fits apart, a parameter that they save: 1 where it is as white as believed. Noise that is not gives a parameter what
/// it holds at the frequencies at which that speaks: the mean of the weights of the sum of χ² that the difference is (Rao & Scott 1981, J. Am. Stat.
/// Assoc. 76, 221; Rotnitzky & Jewell 1990, Biometrika 77, 485).
pub(crate) fn noise_a_parameter(
    joint: &Joint,
    fits: &[Fit],
    (values, residuals): (&[Vec<f64>], &[f64]),
    (together, columns): (&Solution, &[Vec<f64>]),
) -> Result<f64, ModelError> {
    // Noise as the fits apart leave it: what the laws leave is on trial.
    let taken = Errors::of(Linearised {
        columns,
        residuals,
        records: &joint.records(),
        elsewhere: None,
        common: &[],
        at_bound: &together.at_bound,
        in_time: None,
    });
    let (mut apart, mut variables) = (0.0, 0);
    for ((calibration, fit), x) in joint.calibrations.iter().zip(fits).zip(values) {
        let residuals = calibration.residuals(x)?;
        let columns = jacobian(calibration, x, &residuals)?;
        let at_bound: Vec<bool> = fit.parameters.iter().map(|p| p.at_bound || p.held).collect();
        let errors = Errors::of(Linearised {
            columns: &columns,
            residuals: &residuals,
            records: &calibration.record_rows(),
            elsewhere: None,
            common: &[],
            at_bound: &at_bound,
            in_time: None,
        });
        apart += errors.taken;
        variables += at_bound.iter().filter(|held| !**held).count();
    }
    // Each thermometer's error is a square that the fits apart do not have, and a variable of the fit together.
    let runs = joint.own.len();
    let saved = (variables + runs) as f64 - together.at_bound.iter().filter(|held| !**held).count() as f64;
    let more = apart + runs as f64 - taken.taken;
    Ok(if saved >= 1.0 { (more / saved).max(1.0) } else { 1.0 })
}
