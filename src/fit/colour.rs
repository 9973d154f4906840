//! What the colour of the residuals does to the errors of a fit: the covariance of the scores `Jᵀr`.
//!
//! Least squares with noise that is stationary but not white has `Cov(Jᵀr) = Jᵀ R J`, `R` the noise's autocovariance (Grenander 1954, Ann.
//! Math. Statist. 25, 252). Over frequency that is each column's spectrum weighed by the noise's (Grenander & Rosenblatt 1957, Statistical
//! Analysis of Stationary Time Series, ch. 7): noise counts at the frequencies at which a parameter speaks. The noise's spectrum is the residuals' periodogram,
//! averaged over neighbours (Daniell 1946), over more of them at higher frequencies.

use std::ops::Range;

use nalgebra::DMatrix;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

/// Independent frequencies on either side that are averaged at the least, and the share of the frequency where that is more.
const LEAST_NEIGHBOURS: f64 = 16.0;
const SHARE: f64 = 0.25;

/// `Jᵀ R J` over records, each a range of the residuals that one instrument took one after the other. Residuals are in units of
/// the noise that they are believed to have: a spectrum below that noise's counts as that noise.
pub fn score_covariance(columns: &[&[f64]], residuals: &[f64], records: &[Range<usize>]) -> DMatrix<f64> {
    let p = columns.len();
    let mut total = DMatrix::zeros(p, p);
    for record in records.iter().filter(|r| r.len() > 1) {
        let transform = Transform::of(record.len());
        let weight = transform.weights(&residuals[record.clone()]);
        let spectra: Vec<Vec<f64>> = columns
            .par_iter()
            .map(|column| {
                let own = &column[record.clone()];
                if own.iter().all(|v| *v == 0.0) {
                    return Vec::new();
                }
                let weighed = transform.spectrum(own).into_iter().zip(&weight);
                weighed.flat_map(|(v, w)| [v.re * w, v.im * w]).collect()
            })
            .collect();
        let rows: Vec<Vec<f64>> = (0..p)
            .into_par_iter()
            .map(|i| (0..=i).map(|j| spectra[i].iter().zip(&spectra[j]).map(|(a, b)| a * b).sum()).collect())
            .collect();
        total += DMatrix::from_fn(p, p, |i, j| rows[i.max(j)][i.min(j)]);
    }
    total
}

/// Fourier transform of series of one length, padded with zeros to twice that: correlations do not wrap around.
struct Transform {
    samples: usize,
    padded: usize,
    plan: std::sync::Arc<dyn RealToComplex<f64>>,
}

impl Transform {
    fn of(samples: usize) -> Self {
        let padded = (2 * samples).next_power_of_two();
        Transform { samples, padded, plan: RealFftPlanner::new().plan_fft_forward(padded) }
    }

    fn spectrum(&self, series: &[f64]) -> Vec<Complex<f64>> {
        let mut input = series.to_vec();
        input.resize(self.padded, 0.0);
        let mut out = self.plan.make_output_vec();
        // Fails on wrong lengths only, and both are the plan's own.
        let _ = self.plan.process(&mut input, &mut out);
        out
    }

    /// Root of what each frequency counts: the noise's power there, twice where a frequency stands for its negative too.
    fn weights(&self, residuals: &[f64]) -> Vec<f64> {
        let periodogram: Vec<f64> =
            self.spectrum(residuals).iter().map(|v| v.norm_sqr() / self.samples as f64).collect();
        let last = periodogram.len() - 1;
        let both = |k: usize| if k == 0 || k == last { 1.0 } else { 2.0 };
        let power = averaged(&periodogram, LEAST_NEIGHBOURS * self.padded as f64 / self.samples as f64);
        power.iter().enumerate().map(|(k, s)| (both(k) * s.max(1.0) / self.padded as f64).sqrt()).collect()
    }
}

/// Each value averaged over its neighbours, mirrored at both ends.
fn averaged(values: &[f64], least: f64) -> Vec<f64> {
    let last = values.len() - 1;
    let mirrored = |k: isize| {
        let k = k.unsigned_abs() % (2 * last).max(1);
        values[if k > last { 2 * last - k } else { k }]
    };
    let reach = ((SHARE * last as f64).max(least) as isize).min(last as isize).max(1);
    let mut sums = vec![0.0];
    for k in -reach..=last as isize + reach {
        sums.push(sums[sums.len() - 1] + mirrored(k));
    }
    (0..=last)
        .map(|k| {
            let half = ((SHARE * k as f64).max(least) as isize).min(reach);
            let at = k as isize + reach;
            (sums[(at + half + 1) as usize] - sums[(at - half) as usize]) / (2 * half + 1) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First-order noise `e = φ e⁻ + w` of variance 1/(1 - φ²).
    fn first_order(n: usize, phi: f64, seed: u64) -> Vec<f64> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut normal = || (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos();
        let mut e = normal() / (1.0 - phi * phi).sqrt();
        (0..n)
            .map(|_| {
                e = phi * e + normal();
                e
            })
            .collect()
    }

    /// `Jᵀ R J` of first-order noise, term by term.
    fn exact(column: &[f64], phi: f64) -> f64 {
        let variance = 1.0 / (1.0 - phi * phi);
        // Both directions of the recursion s = φ s⁻ + x are the sums over earlier samples.
        let (mut memory, mut total) = (0.0, 0.0);
        for x in column {
            total += x * (x + 2.0 * memory);
            memory = phi * (memory + x);
        }
        variance * total
    }

    /// A constant, a slow sine and a fast one, in red noise: each has the variance of its own frequency.
    #[test]
    fn each_column_meets_the_noise_of_its_own_frequency() {
        let n = 6000;
        for phi in [0.0, 0.6, 0.9] {
            for period in [f64::INFINITY, 300.0, 7.0, 3.0] {
                let column: Vec<f64> =
                    (0..n).map(|i| (std::f64::consts::TAU * i as f64 / period + 0.7).cos()).collect();
                let said = |seed| {
                    score_covariance(&[&column], &first_order(n, phi, seed), std::slice::from_ref(&(0..n)))[(0, 0)]
                };
                let found = (1..=10).map(said).sum::<f64>() / 10.0;
                let ratio = found / exact(&column, phi).max(column.iter().map(|c| c * c).sum());
                assert!((0.8..1.25).contains(&ratio), "φ {phi}, period {period}: {ratio}");
            }
        }
    }

    /// Over many draws the estimates of a slope in red noise scatter as the covariance says.
    #[test]
    fn estimates_scatter_as_they_are_said_to() {
        let n = 2000;
        let column: Vec<f64> = (0..n).map(|i| (i as f64 / 40.0).sin()).collect();
        let square: f64 = column.iter().map(|c| c * c).sum();
        let (mut scatter, mut said, draws) = (0.0, 0.0, 200);
        for seed in 0..draws {
            let noise = first_order(n, 0.8, seed);
            let estimate = column.iter().zip(&noise).map(|(c, e)| c * e).sum::<f64>() / square;
            let residuals: Vec<f64> = column.iter().zip(&noise).map(|(c, e)| e - estimate * c).collect();
            scatter += estimate * estimate;
            said += score_covariance(&[&column], &residuals, std::slice::from_ref(&(0..n)))[(0, 0)] / (square * square);
        }
        assert!((scatter / said).sqrt() < 1.15 && (scatter / said).sqrt() > 0.87, "{}", (scatter / said).sqrt());
    }

    /// Two records do not correlate with each other.
    #[test]
    fn records_count_apart() {
        let column = vec![1.0; 400];
        let residuals: Vec<f64> = (0..400).map(|i| if i < 200 { 3.0 } else { -3.0 }).collect();
        let apart = score_covariance(&[&column], &residuals, &[0..200, 200..400])[(0, 0)];
        let first = score_covariance(&[&column], &residuals, std::slice::from_ref(&(0..200)))[(0, 0)];
        assert!((apart / first - 2.0).abs() < 1e-9, "{apart} {first}");
    }
}
