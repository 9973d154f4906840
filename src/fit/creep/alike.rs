//! How alike neighbouring readings of a creep test err, and what that does to the errors of its fit.
//!
//! The spectrum of the residuals, by which errors of a long record are judged ([`crate::fit::colour`]), fails a creep test: of noise that drifts there are
//! few independent readings, and the fit takes up most of what it does slowly. So the noise is taken as a first-order autoregression in the order of
//! the readings (whatever the times between them: what drifts does so from reading to reading), and its correlation φ is found by restricted
//! likelihood, which knows what the fit has taken up (Patterson & Thompson 1971, Biometrika 58, 545). With it, as for any noise,
//! `C = A Jᵀ V J A`, `A = (JᵀJ)⁻¹`.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::fit::uncertainty::covariance;

/// Mean square of residuals, in units of the noise's, below which there is no noise to be alike: readings are rounded.
const NOTHING: f64 = 0.1;
/// Correlations that are tried: beyond the last one noise cannot be told from creep.
const TRIED: usize = 49;
const STEP: f64 = 0.02;

/// Noise of a linearised fit: its variance in units of what was believed, and the correlation of neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Alike {
    /// Correlation of a reading's noise with that of the one before.
    pub(super) phi: f64,
    /// Variance.
    variance: f64,
}

impl Alike {
    /// Of the residuals of a fit, each record a test's readings in their order.
    pub(super) fn of(columns: &[&[f64]], residuals: &[f64], records: &[Range<usize>]) -> Self {
        let (n, p) = (residuals.len() as f64, columns.len() as f64);
        let mean_square = residuals.iter().map(|r| r * r).sum::<f64>() / n;
        let freedom = (n - p).max(1.0);
        let white = Alike { phi: 0.0, variance: mean_square * n / freedom };
        if mean_square < NOTHING {
            return white;
        }
        let tried = (0..=TRIED).filter_map(|i| {
            let phi = STEP * i as f64;
            let free: Vec<Vec<f64>> = columns.iter().map(|c| without_memory(c, phi, records)).collect();
            let left = DVector::from_vec(without_memory(residuals, phi, records));
            let size: Vec<f64> = columns.iter().map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt()).collect();
            let x = DMatrix::from_fn(residuals.len(), columns.len(), |i, j| free[j][i] / size[j]);
            let normal = (x.transpose() * &x).cholesky()?;
            let scores = x.transpose() * &left;
            let square = left.norm_squared() - scores.dot(&normal.solve(&scores));
            let log_normal: f64 = normal.l().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
            let likelihood = records.len() as f64 * (1.0 - phi * phi).ln() - freedom * square.ln() - log_normal;
            Some((likelihood, Alike { phi, variance: square / freedom / (1.0 - phi * phi) }))
        });
        tried.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(white, |(_, best)| best)
    }

    /// How many readings count as one.
    pub(super) fn inflation(&self) -> f64 {
        (1.0 + self.phi) / (1.0 - self.phi)
    }

    /// The covariance of the variables, noise taken as not below `least` in variance; zero for those at a bound, infinite for those left open.
    pub(super) fn covariance(
        &self,
        columns: &[Vec<f64>],
        at_bound: &[bool],
        records: &[Range<usize>],
        least: f64,
    ) -> DMatrix<f64> {
        let inverse = covariance(columns, at_bound);
        let remembered: Vec<Vec<f64>> = columns.iter().map(|c| with_neighbours(c, self.phi, records)).collect();
        let scores = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            columns[i].iter().zip(&remembered[j]).map(|(a, b)| a * b).sum()
        });
        // What is left open stays so: infinity times nothing is no number.
        let open = inverse.diagonal().iter().any(|v| v.is_infinite());
        if open { inverse } else { &inverse * scores * &inverse * self.variance.max(least) }
    }
}

/// A series of which each record's correlation is taken out: its first value shrunk, the others less `phi` times the one before.
fn without_memory(series: &[f64], phi: f64, records: &[Range<usize>]) -> Vec<f64> {
    let mut out = series.to_vec();
    for record in records {
        for i in record.clone().skip(1) {
            out[i] = series[i] - phi * series[i - 1];
        }
        out[record.start] *= (1.0 - phi * phi).sqrt();
    }
    out
}

/// `Σ_j φ^|i-j| x_j` within each record.
fn with_neighbours(series: &[f64], phi: f64, records: &[Range<usize>]) -> Vec<f64> {
    let mut out = series.to_vec();
    for record in records {
        let (mut before, mut after) = (0.0, 0.0);
        for i in record.clone() {
            out[i] += before;
            before = phi * (before + series[i]);
        }
        for i in record.clone().rev() {
            out[i] += after;
            after = phi * (after + series[i]);
        }
    }
    out
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

    /// A level and a bend out of some 300 readings whose noise is worth but 15 of them: the estimates scatter as they are said to.
    #[test]
    fn estimates_scatter_as_they_are_said_to() {
        let n = 280;
        let columns = vec![vec![1.0; n], (0..n).map(|i| 1.0 - (-(i as f64) / 60.0).exp()).collect::<Vec<f64>>()];
        let refs: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let x = DMatrix::from_fn(n, 2, |i, j| columns[j][i]);
        let inverse = (x.transpose() * &x).try_inverse().unwrap();
        for phi in [0.0, 0.6, 0.9] {
            let (mut scatter, mut said, draws) = ([0.0; 2], [0.0; 2], 300);
            for seed in 0..draws {
                let e = DVector::from_vec(noise(n, phi, seed));
                let by = &inverse * x.transpose() * &e;
                let left = &e - &x * &by;
                let found = Alike::of(&refs, left.as_slice(), std::slice::from_ref(&(0..n)));
                let covariance = found.covariance(&columns, &[false; 2], std::slice::from_ref(&(0..n)), 0.0);
                for j in 0..2 {
                    scatter[j] += by[j] * by[j];
                    said[j] += covariance[(j, j)];
                }
            }
            for j in 0..2 {
                let ratio = (said[j] / scatter[j]).sqrt();
                assert!((0.85..1.15).contains(&ratio), "φ {phi}, variable {j}: {ratio}");
            }
        }
    }

    #[test]
    fn records_do_not_remember_each_other_and_rounding_is_no_noise() {
        let series = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(without_memory(&series, 0.5, &[0..2, 2..4])[1..], [1.5, 3.0 * 0.75f64.sqrt(), 2.5]);
        assert_eq!(with_neighbours(&series, 0.5, &[0..2, 2..4]), [2.0, 2.5, 5.0, 5.5]);
        let tiny: Vec<f64> = (0..50).map(|i| 1e-9 * f64::from(i)).collect();
        assert_eq!(Alike::of(&[&[1.0; 50]], &tiny, std::slice::from_ref(&(0..50))).inflation(), 1.0);
    }
}
