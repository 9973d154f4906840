//! How neighbouring readings of a creep test are correlated, and the effect on the errors of its fit.
//!
//! The spectrum of the residuals, by which errors of a long record are judged
//! ([`crate::fit::inference::noise_autocorrelation`]), fails for a creep test: of noise that drifts there are few
//! independent readings, and the fit absorbs most of its slow part. So the noise is modelled as a first-order
//! autoregression in the order of the readings (whatever the times between them: it drifts from reading to reading) and
//! white noise of the reading itself, without which the drift would be hidden. The correlation φ of what drifts and the
//! share of what is white are found by restricted likelihood, which accounts for what the fit has absorbed (Patterson &
//! Thompson 1971, Biometrika 58, 545), by the innovations of a Kalman filter (Harvey 1989, Forecasting, Structural Time
//! Series Models and the Kalman Filter, sec. 3.4). With them, as for any noise, `C = A Jᵀ V J A`, `A = (JᵀJ)⁻¹`.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::creep::thresholds::WHITE_SHARES;
use crate::creep::thresholds::{CORRELATION_STEP, LAST_CORRELATION, LEAST_MEAN_SQUARE, WHITE_NOISE_PENALTY};
use crate::fit::numeric::uncertainty::covariance;

/// Noise of the readings of a linearised fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ReadingNoise {
    /// Correlation of the drift from one reading to the next.
    pub(crate) phi: f64,
    /// Share of the variance that is white.
    white: f64,
    /// Variance, in units of the believed one.
    variance: f64,
}

impl ReadingNoise {
    /// Of the residuals of a fit, each record a test's readings in their order.
    pub(crate) fn of(columns: &[&[f64]], residuals: &[f64], records: &[Range<usize>]) -> Self {
        let (n, p) = (residuals.len() as f64, columns.len() as f64);
        let mean_square = residuals.iter().map(|r| r * r).sum::<f64>() / n;
        let freedom = (n - p).max(1.0);
        let white = ReadingNoise { phi: 0.0, white: 0.0, variance: mean_square * n / freedom };
        if mean_square < LEAST_MEAN_SQUARE {
            return white;
        }
        let likelihood = |(i, k): (usize, usize)| {
            let shape = ReadingNoise {
                phi: CORRELATION_STEP * i as f64,
                white: if i > 0 { WHITE_SHARES[k] } else { 0.0 },
                variance: 1.0,
            };
            let Generalised { square, log_normal, log_noise } = shape.generalised(columns, residuals, records)?;
            let worth = if shape.white > 0.0 { WHITE_NOISE_PENALTY } else { 0.0 };
            let likelihood = -log_noise - freedom * square.ln() - log_normal - worth;
            Some((likelihood, (i, k), ReadingNoise { variance: square / freedom, ..shape }))
        };
        let likeliest = |of: Vec<(usize, usize)>| {
            of.into_par_iter().filter_map(likelihood).max_by(|a, b| a.0.total_cmp(&b.0)).map(|best| (best.1, best.2))
        };
        // On a coarse grid, then on the fine one around its best point.
        let last = WHITE_SHARES.len() - 1;
        let coarse =
            (0..=LAST_CORRELATION).step_by(7).flat_map(|i| (0..=last).step_by(3).map(move |k| (i, k))).collect();
        let Some(((i, k), _)) = likeliest(coarse) else { return white };
        let shares = k.saturating_sub(3)..=(k + 3).min(last);
        let near = (i.saturating_sub(6)..=(i + 6).min(LAST_CORRELATION))
            .flat_map(|i| shares.clone().map(move |k| (i, k)))
            .collect();
        likeliest(near).map_or(white, |(_, best)| best)
    }

    /// The result of generalised least squares with this noise; none where columns are parallel.
    fn generalised(&self, columns: &[&[f64]], residuals: &[f64], records: &[Range<usize>]) -> Option<Generalised> {
        let (left, log_noise) = self.innovations(residuals, records);
        let left = DVector::from_vec(left);
        let free: Vec<Vec<f64>> = columns.iter().map(|c| self.innovations(c, records).0).collect();
        let size: Vec<f64> = columns.iter().map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt()).collect();
        let x = DMatrix::from_fn(residuals.len(), columns.len(), |i, j| free[j][i] / size[j]);
        let normal = (x.transpose() * &x).cholesky()?;
        let scores = x.transpose() * &left;
        let square = left.norm_squared() - scores.dot(&normal.solve(&scores));
        let log_normal = normal.l().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
        Some(Generalised { square, log_normal, log_noise })
    }

    /// Sum of squares that generalised least squares leaves of a fit with the noise's correlations, to first order.
    pub(crate) fn square(&self, columns: &[&[f64]], residuals: &[f64], records: &[Range<usize>]) -> f64 {
        self.generalised(columns, residuals, records)
            .map_or_else(|| residuals.iter().map(|r| r * r).sum(), |found| found.square)
    }

    /// A series without the correlation of each record: the difference of each value from its prediction by those
    /// before, over the standard deviation of that for noise of variance 1; and the sum of the logarithms of these
    /// variances.
    fn innovations(&self, series: &[f64], records: &[Range<usize>]) -> (Vec<f64>, f64) {
        let (phi, white, slow) = (self.phi, self.white, 1.0 - self.white);
        let (mut out, mut logs) = (series.to_vec(), 0.0);
        for record in records {
            let (mut expected, mut variance) = (0.0, slow);
            for i in record.clone() {
                let whole = variance + white;
                let off = series[i] - expected;
                out[i] = off / whole.sqrt();
                logs += whole.ln();
                expected = phi * (expected + variance / whole * off);
                variance = phi * phi * variance * white / whole + slow * (1.0 - phi * phi);
            }
        }
        (out, logs)
    }

    /// The number of readings that count as one.
    pub(crate) fn inflation(&self) -> f64 {
        1.0 + (1.0 - self.white) * 2.0 * self.phi / (1.0 - self.phi)
    }

    /// The covariance of the variables, noise taken as not below `least` in variance; zero for those at a bound,
    /// infinite for those left open.
    pub(crate) fn covariance(
        &self,
        columns: &[Vec<f64>],
        at_bound: &[bool],
        records: &[Range<usize>],
        least: f64,
    ) -> DMatrix<f64> {
        let inverse = covariance(columns, at_bound);
        let remembered: Vec<Vec<f64>> = columns.iter().map(|c| self.with_neighbours(c, records)).collect();
        let scores = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            columns[i].iter().zip(&remembered[j]).map(|(a, b)| a * b).sum()
        });
        // Open values stay open: infinity times zero is not a number.
        let open = inverse.diagonal().iter().any(|v| v.is_infinite());
        if open { inverse } else { &inverse * scores * &inverse * self.variance.max(least) }
    }

    /// `V x` for noise of variance 1, `V` within each record `φ^|i-j|` of what drifts, and the rest on its diagonal.
    fn with_neighbours(&self, series: &[f64], records: &[Range<usize>]) -> Vec<f64> {
        let (phi, slow) = (self.phi, 1.0 - self.white);
        let mut out = series.to_vec();
        for record in records {
            let (mut before, mut after) = (0.0, 0.0);
            for i in record.clone() {
                out[i] += slow * before;
                before = phi * (before + series[i]);
            }
            for i in record.clone().rev() {
                out[i] += slow * after;
                after = phi * (after + series[i]);
            }
        }
        out
    }
}

/// See [`ReadingNoise::generalised`].
struct Generalised {
    /// Sum of squares, in units of noise of variance 1.
    square: f64,
    /// Logarithm of the determinant of the columns' normal matrix.
    log_normal: f64,
    /// And of the noise's covariance.
    log_noise: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First-order noise of variance 1.
    fn noise(n: usize, phi: f64, seed: u64) -> Vec<f64> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut normal = || (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos();
        let mut e = normal();
        (0..n)
            .map(|_| {
                let now = e;
                e = phi * e + (1.0 - phi * phi).sqrt() * normal();
                now
            })
            .collect()
    }

    /// A level and a bend out of some 300 readings whose noise is worth but 15 of them: the estimates scatter as
    /// predicted.
    #[test]
    fn estimates_scatter_as_they_are_said_to() {
        let n = 280;
        let columns = vec![vec![1.0; n], (0..n).map(|i| 1.0 - (-(i as f64) / 60.0).exp()).collect::<Vec<f64>>()];
        let refs: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let x = DMatrix::from_fn(n, 2, |i, j| columns[j][i]);
        let inverse = (x.transpose() * &x).try_inverse().unwrap();
        // The last with three quarters of its variance in the readings.
        for (phi, white) in [(0.0, 0.0), (0.6, 0.0), (0.9, 0.0), (0.95, 0.75f64)] {
            let (mut scatter, mut expected, draws) = ([0.0; 2], [0.0; 2], 300);
            for seed in 0..draws {
                let slow = noise(n, phi, seed).into_iter().zip(noise(n, 0.0, 1000 + seed));
                let e = DVector::from_iterator(n, slow.map(|(s, w)| (1.0 - white).sqrt() * s + white.sqrt() * w));
                let by = &inverse * x.transpose() * &e;
                let left = &e - &x * &by;
                let found = ReadingNoise::of(&refs, left.as_slice(), std::slice::from_ref(&(0..n)));
                let covariance = found.covariance(&columns, &[false; 2], std::slice::from_ref(&(0..n)), 0.0);
                for j in 0..2 {
                    scatter[j] += by[j] * by[j];
                    expected[j] += covariance[(j, j)];
                }
            }
            for j in 0..2 {
                let ratio = (expected[j] / scatter[j]).sqrt();
                assert!((0.85..1.15).contains(&ratio), "φ {phi}, variable {j}: {ratio}");
            }
        }
    }

    #[test]
    fn records_do_not_remember_each_other_and_rounding_is_no_noise() {
        let series = [1.0, 2.0, 3.0, 4.0];
        let alike = ReadingNoise { phi: 0.5, white: 0.0, variance: 1.0 };
        let of = |v: f64| v / 0.75f64.sqrt();
        assert_eq!(alike.innovations(&series, &[0..2, 2..4]).0, [1.0, of(1.5), 3.0, of(2.5)]);
        assert_eq!(alike.with_neighbours(&series, &[0..2, 2..4]), [2.0, 2.5, 5.0, 5.5]);
        let tiny: Vec<f64> = (0..50).map(|i| 1e-9 * f64::from(i)).collect();
        assert_eq!(ReadingNoise::of(&[&[1.0; 50]], &tiny, std::slice::from_ref(&(0..50))).inflation(), 1.0);
    }

    /// Of noise that drifts and of readings that are white beside it, innovations match the covariance:
    /// `|innovations|² = rᵀ V⁻¹ r`, and their variances multiply to its determinant.
    #[test]
    fn innovations_whiten_a_drift_with_white_noise_on_top() {
        let alike = ReadingNoise { phi: 0.9, white: 0.3, variance: 1.0 };
        let unit = |j: usize| (0..12).map(|i| if i == j { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
        let covariance = DMatrix::from_fn(12, 12, |i, j| alike.with_neighbours(&unit(j), &[0..7, 7..12])[i]);
        assert!((covariance[(2, 4)] - 0.7 * 0.81).abs() < 1e-12 && covariance[(6, 7)] == 0.0, "{covariance}");
        let series = noise(12, 0.5, 3);
        let (innovations, logs) = alike.innovations(&series, &[0..7, 7..12]);
        let square: f64 = innovations.iter().map(|v| v * v).sum();
        let r = DVector::from_vec(series);
        let cholesky = covariance.cholesky().unwrap();
        assert!((square - r.dot(&cholesky.solve(&r))).abs() < 1e-9);
        assert!((logs - cholesky.determinant().ln()).abs() < 1e-9);
    }
}
