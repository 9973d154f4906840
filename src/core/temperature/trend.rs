//! A straight line through values of known errors, with 95% intervals (Draper & Smith, *Applied Regression Analysis*,
//! 1998, ch. 1-2, 9).

use crate::temperature::thresholds::SCATTER_SIGNIFICANCE;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

/// `y = at_zero + slope x`.
///
/// Where the values scatter about the line as their errors predict, the errors decide its intervals. Where they scatter
/// more, by χ² at 5%, the scatter does, with Student's t of two degrees of freedom fewer than values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Value at x = 0.
    pub at_zero: f64,
    /// Change of y a unit of x.
    pub slope: f64,
    /// Standard errors of both, and their covariance.
    pub at_zero_error: f64,
    /// See `at_zero_error`.
    pub slope_error: f64,
    covariance: f64,
    /// Half a 95% interval in standard errors.
    pub quantile: f64,
    /// Values beyond the two that a line takes.
    pub freedom: usize,
    /// Chance of a scatter as large as this one if the line holds; none where two values leave no scatter.
    pub chance: Option<f64>,
}

impl Line {
    /// The line through `y` at `x`, each known to its standard deviation `sd`; none for fewer than two places.
    pub fn through(x: &[f64], y: &[f64], sd: &[f64]) -> Option<Line> {
        let weights: Vec<f64> = sd.iter().map(|s| s.powi(-2)).collect();
        let total: f64 = weights.iter().sum();
        let mean = |v: &[f64]| weights.iter().zip(v).map(|(w, v)| w * v).sum::<f64>() / total;
        let (x_mean, y_mean) = (mean(x), mean(y));
        let spread: f64 = weights.iter().zip(x).map(|(w, x)| w * (x - x_mean).powi(2)).sum();
        if x.len() < 2 || !(spread > 0.0 && spread.is_finite()) {
            return None;
        }
        let both: f64 = weights.iter().zip(x.iter().zip(y)).map(|(w, (x, y))| w * (x - x_mean) * (y - y_mean)).sum();
        let slope = both / spread;
        let at_zero = y_mean - slope * x_mean;
        let square: f64 =
            weights.iter().zip(x.iter().zip(y)).map(|(w, (x, y))| w * (y - at_zero - slope * x).powi(2)).sum();
        let freedom = x.len() - 2;
        let chance = ChiSquared::new(freedom as f64).ok().filter(|_| freedom > 0).map(|law| law.sf(square));
        let scattered = chance.is_some_and(|p| p < SCATTER_SIGNIFICANCE);
        let (widening, quantile) = if scattered {
            (
                square / freedom as f64,
                StudentsT::new(0.0, 1.0, freedom as f64).map_or(f64::NAN, |t| t.inverse_cdf(0.975)),
            )
        } else {
            (1.0, Normal::standard().inverse_cdf(0.975))
        };
        Some(Line {
            at_zero,
            slope,
            at_zero_error: (widening * (1.0 / total + x_mean * x_mean / spread)).sqrt(),
            slope_error: (widening / spread).sqrt(),
            covariance: -widening * x_mean / spread,
            quantile,
            freedom,
            chance,
        })
    }

    /// Its value at `x` and half the 95% interval of it.
    pub fn at(&self, x: f64) -> (f64, f64) {
        let variance = self.at_zero_error.powi(2) + 2.0 * x * self.covariance + (x * self.slope_error).powi(2);
        (self.at_zero + self.slope * x, self.quantile * variance.max(0.0).sqrt())
    }

    /// 95% interval of the slope.
    pub fn slope_interval(&self) -> (f64, f64) {
        let half = self.quantile * self.slope_error;
        (self.slope - half, self.slope + half)
    }

    /// The values scatter about it by more than their errors.
    pub fn is_contradicted(&self) -> bool {
        self.chance.is_some_and(|p| p < SCATTER_SIGNIFICANCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With equal errors the weighted line is the plain one: here by scipy 1.17,
    /// `linregress([0,10,20,30,40], [1,3.1,4.8,7.3,8.9])`: slope 0.2, intercept 1.02, standard error of the
    /// slope 0.00702377.
    #[test]
    fn a_scattered_line_is_the_classical_one() {
        let (x, y) = ([0.0, 10.0, 20.0, 30.0, 40.0], [1.0, 3.1, 4.8, 7.3, 8.9]);
        let line = Line::through(&x, &y, &[1e-3; 5]).unwrap();
        assert!((line.slope - 0.2).abs() < 1e-12 && (line.at_zero - 1.02).abs() < 1e-12, "{line:?}");
        assert!((line.slope_error - 0.007_023_77).abs() < 1e-6, "{line:?}");
        assert!((line.quantile - 3.182_446).abs() < 1e-5 && line.is_contradicted());
        // The interval of the line is narrowest at the mean of x: s/√n there.
        let s = line.slope_error * 1000f64.sqrt();
        assert!((line.at(20.0).1 - line.quantile * s / 5f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn values_that_keep_to_their_errors_have_the_errors_interval() {
        let line = Line::through(&[-1.0, 1.0, 3.0], &[1.0, 2.0, 3.05], &[0.1; 3]).unwrap();
        assert!((line.quantile - 1.959_964).abs() < 1e-5 && !line.is_contradicted());
        assert!((line.slope_error - 0.1 / 8f64.sqrt()).abs() < 1e-12);
        let two = Line::through(&[0.0, 2.0], &[1.0, 2.0], &[0.1, 0.2]).unwrap();
        assert!((two.slope - 0.5).abs() < 1e-12 && two.chance.is_none());
        assert!((two.slope_error - 0.1f64.hypot(0.2) / 2.0).abs() < 1e-12);
        assert!(Line::through(&[1.0, 1.0], &[1.0, 2.0], &[0.1; 2]).is_none());
    }
}
