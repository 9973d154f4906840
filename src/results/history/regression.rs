//! Weighted linear regression of values that scatter by more than their standard errors.
//!
//! A fit's standard error says how well one record determines a value, not how well the rig repeats it. So each value
//! has the variance se² + τ², where τ, the scatter between runs, is what makes the weighted squares of the residuals as
//! many as there are degrees of freedom (Paule & Mandel 1982, J. Res. NBS 87(5)); τ is 0 where the errors explain
//! everything. Intervals are Student's (Knapp & Hartung 2003, Stat. Med. 22). With equal errors that are small beside
//! the scatter this is ordinary least squares.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A fitted regression.
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    /// One a column.
    pub coefficients: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Scatter between runs beyond their errors, a standard deviation (τ).
    pub scatter: f64,
    /// Degrees of freedom.
    pub freedom: usize,
}

impl Regression {
    /// Fits `values`, each with its standard error (above 0), on columns of the same length. None where there are no
    /// more values than columns, or where the columns do not differ.
    pub fn fit(columns: &[Vec<f64>], values: &[f64], standard_errors: &[f64]) -> Option<Regression> {
        let (n, p) = (values.len(), columns.len());
        if n <= p || p == 0 {
            return None;
        }
        let x = DMatrix::from_fn(n, p, |i, j| columns[j][i]);
        let y = DVector::from_column_slice(values);
        let freedom = n - p;
        let solve = |variance: f64| -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
            let weights: Vec<f64> = standard_errors.iter().map(|se| 1.0 / (se * se + variance)).collect();
            let weighted = DMatrix::from_fn(n, p, |i, j| weights[i] * x[(i, j)]);
            let covariance = (x.transpose() * &weighted).cholesky()?.inverse();
            let coefficients = &covariance * weighted.transpose() * &y;
            let residuals = &y - &x * &coefficients;
            let square = residuals.iter().zip(&weights).map(|(r, w)| w * r * r).sum();
            Some((coefficients, covariance, square))
        };
        let variance = scatter_variance(&y, freedom as f64, |v| solve(v).map(|s| s.2))?;
        let (coefficients, covariance, _) = solve(variance)?;
        let finite = coefficients.iter().chain(covariance.iter()).all(|v| v.is_finite());
        finite.then(|| Regression {
            coefficients: coefficients.iter().copied().collect(),
            covariance,
            scatter: variance.sqrt(),
            freedom,
        })
    }

    /// Half width of the interval of a coefficient that holds it with a probability of `level`.
    pub fn half_width(&self, coefficient: usize, level: f64) -> f64 {
        self.quantile(level) * self.covariance[(coefficient, coefficient)].sqrt()
    }

    /// The value at a place, and half the width of the interval that holds a new value with the standard error
    /// `standard_error` there.
    pub fn predict(&self, row: &[f64], standard_error: f64, level: f64) -> (f64, f64) {
        let x = DVector::from_column_slice(row);
        let value = self.coefficients.iter().zip(row).map(|(b, x)| b * x).sum();
        let variance = (x.transpose() * &self.covariance * &x)[(0, 0)] + self.scatter.powi(2) + standard_error.powi(2);
        (value, self.quantile(level) * variance.sqrt())
    }

    /// Student's t that holds the share `level` between −t and t.
    fn quantile(&self, level: f64) -> f64 {
        StudentsT::new(0.0, 1.0, self.freedom as f64).map_or(f64::INFINITY, |t| t.inverse_cdf(0.5 + 0.5 * level))
    }
}

/// The variance between runs at which the weighted square is the degrees of freedom; the square falls as the variance
/// grows.
fn scatter_variance(values: &DVector<f64>, freedom: f64, square: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    if square(0.0)? <= freedom {
        return Some(0.0);
    }
    let (mut low, mut high) = (0.0, (values.max() - values.min()).powi(2));
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if square(middle)? > freedom { low = middle } else { high = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Anscombe's first set (1973, Am. Stat. 27(1)): 3.0001 ± 1.1247 and 0.5001 ± 0.1179 on 9 degrees of freedom,
    /// residual standard error 1.237, as every text on regression has it.
    #[test]
    fn equal_errors_are_ordinary_least_squares() {
        let x = [10.0, 8.0, 13.0, 9.0, 11.0, 14.0, 6.0, 4.0, 12.0, 7.0, 5.0];
        let y = [8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68];
        let fit = Regression::fit(&[vec![1.0; 11], x.to_vec()], &y, &[1e-3; 11]).unwrap();
        assert!((fit.coefficients[0] - 3.0001).abs() < 1e-4 && (fit.coefficients[1] - 0.5001).abs() < 1e-4);
        assert!((fit.covariance[(0, 0)].sqrt() - 1.1247).abs() < 1e-4);
        assert!((fit.covariance[(1, 1)].sqrt() - 0.1179).abs() < 1e-4);
        assert!((fit.scatter - 1.237).abs() < 1e-3);
        // t of 9 degrees of freedom at 0.975 is 2.2622
        assert!((fit.half_width(1, 0.95) / 0.1179 - 2.2622).abs() < 2e-3);
    }

    /// Errors that differ, against scipy: `tools/history/regression.py` prints these numbers.
    #[test]
    fn unequal_errors_are_weighted() {
        let (columns, y, se) = uneven();
        let fit = Regression::fit(&columns, &y, &se).unwrap();
        let expected = EXPECTED;
        for (found, exact) in fit.coefficients.iter().zip(&expected.0) {
            assert!((found - exact).abs() < 1e-6 * exact.abs().max(1.0), "{found} {exact}");
        }
        for (j, exact) in expected.1.iter().enumerate() {
            assert!((fit.half_width(j, 0.95) - exact).abs() < 1e-6 * exact, "{} {exact}", fit.half_width(j, 0.95));
        }
        assert!((fit.scatter - expected.2).abs() < 1e-6, "{}", fit.scatter);
        let (value, half) = fit.predict(&[1.0, 3.5, -2.0], 0.4, 0.99);
        assert!((value - expected.3).abs() < 1e-6 && (half - expected.4).abs() < 1e-6, "{value} {half}");
    }

    #[test]
    fn errors_that_explain_all_leave_no_scatter() {
        let fit = Regression::fit(&[vec![1.0; 4]], &[1.0, 1.1, 0.9, 1.0], &[0.5, 0.5, 0.5, 0.5]).unwrap();
        assert_eq!(fit.scatter, 0.0);
        assert!((fit.covariance[(0, 0)].sqrt() - 0.25).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_told_apart_is_not() {
        assert!(Regression::fit(&[vec![1.0; 2]], &[1.0, 2.0], &[1.0; 2]).is_some());
        assert!(Regression::fit(&[vec![1.0]], &[1.0], &[1.0]).is_none());
        assert!(Regression::fit(&[vec![1.0; 3], vec![2.0; 3]], &[1.0, 2.0, 3.0], &[1.0; 3]).is_none());
    }

    type Case = (Vec<Vec<f64>>, Vec<f64>, Vec<f64>);

    fn uneven() -> Case {
        let run = [-3.5, -2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5];
        let kelvin = [-4.0, 1.0, 3.5, -2.0, 0.5, 4.0, -1.0, -2.0];
        let y = [403.1, 394.2, 388.9, 399.7, 394.8, 387.1, 398.3, 400.9];
        let se = [0.3, 0.5, 0.2, 1.1, 0.4, 0.3, 0.8, 0.25];
        (vec![vec![1.0; 8], run.to_vec(), kelvin.to_vec()], y.to_vec(), se.to_vec())
    }

    /// Coefficients, half widths at 95%, scatter, prediction and its half width at 99%.
    const EXPECTED: ([f64; 3], [f64; 3], f64, f64, f64) = (
        [395.881515899, 0.146391291, -2.049527274],
        [0.586242721, 0.241320211, 0.203924051],
        0.485581180,
        400.492939967,
        3.136539365,
    );
}
