//! 95% intervals from standard errors: symmetric in the variable that the fit moves (mostly a logarithm), open where a
//! bound cuts them off.

use crate::fit::inference::errors::{Errors, Linearised, Moments};
use crate::fit::numeric::quantiles::Z_95;
use crate::fit::problem::fit_problem::FitProblem;

/// The linear interval of variable `j`, in the parameter's unit; an open end is infinite. A variable at a bound has the
/// rise of the sum of squares away from it: `d²/σ² + 2 g d`, `g` the slope that presses it against the bound.
pub(crate) fn linear(
    problem: &FitProblem,
    (fit, moments): (Linearised, &Moments),
    errors: &Errors,
    x: &[f64],
    j: usize,
) -> (f64, f64) {
    use crate::fit::numeric::least_squares::Problem;
    let (lower, upper) = problem.bounds();
    if lower[j] >= upper[j] {
        let value = problem.value(j, x[j]);
        return (value, value);
    }
    let half = if fit.at_bound[j] { away_from_bound(fit, moments, j) } else { [Z_95 * errors.of_variable(j); 2] };
    let (low, high) = (x[j] - half[0], x[j] + half[1]);
    // An unknown end is open, and so is one at or beyond a bound.
    let low = if low > lower[j] { problem.value(j, low) } else { f64::NEG_INFINITY };
    let high = if high < upper[j] { problem.value(j, high) } else { f64::INFINITY };
    (low, high)
}

/// How far a variable at a bound may go down and up: into the box as far as the threshold, out of it without an end.
fn away_from_bound(fit: Linearised, moments: &Moments, j: usize) -> [f64; 2] {
    let mut freed = fit.at_bound.to_vec();
    freed[j] = false;
    let errors = Errors::among(moments, &freed);
    let variance = errors.believed[(j, j)];
    let slope: f64 = fit.columns[j].iter().zip(fit.residuals).map(|(c, r)| c * r).sum();
    let threshold = Z_95 * Z_95 * errors.inflation(j);
    let inward = step_inward(variance, slope.abs(), threshold);
    if slope > 0.0 { [f64::INFINITY, inward] } else { [inward, f64::INFINITY] }
}

/// The positive root of `d²/variance + 2 slope d = threshold`.
fn step_inward(variance: f64, slope: f64, threshold: f64) -> f64 {
    if !variance.is_finite() {
        return if slope > 0.0 { threshold / (2.0 * slope) } else { f64::INFINITY };
    }
    threshold / (slope + (slope * slope + threshold / variance).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_from_a_bound_solves_its_equation() {
        for (variance, slope) in [(0.04, 0.0), (0.04, 30.0), (f64::INFINITY, 2.0)] {
            let d = step_inward(variance, slope, 3.84);
            assert!((d * d / variance + 2.0 * slope * d - 3.84).abs() < 1e-12, "{d}");
        }
        assert!((step_inward(0.04, 0.0, Z_95 * Z_95) / 0.2 - Z_95).abs() < 1e-12);
    }

    /// y = x₀ t + x₁ with x₁ held at its lower bound of 0 by data that ask for -0.2.
    #[test]
    fn a_variable_at_its_bound_is_open_there_and_ends_inside() {
        let t: Vec<f64> = (0..200).map(|i| f64::from(i) / 100.0 - 1.0).collect();
        let columns = vec![t.iter().map(|t| -t).collect::<Vec<f64>>(), vec![-1.0; 200]];
        let residuals: Vec<f64> = (0..200).map(|i| -0.2 + if i % 2 == 0 { 0.5 } else { -0.5 }).collect();
        let record = 0..200;
        let fit = Linearised {
            columns: &columns,
            residuals: &residuals,
            records: &[vec![record]],
            common: &[],
            at_bound: &[false, true],
            in_time: None,
        };
        let [down, up] = away_from_bound(fit, &fit.moments(None), 1);
        assert!(down == f64::INFINITY && up > 0.0 && up < 0.1, "{down} {up}");
    }
}
