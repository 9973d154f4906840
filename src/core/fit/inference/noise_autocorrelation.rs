//! The effect of autocorrelated noise on the errors of a fit: the covariance of the scores `Jᵀe`.
//!
//! Least squares with stationary noise that is not white has `Cov(Jᵀe) = Jᵀ R J`, `R` the noise's autocovariance
//! (Grenander 1954, Ann. Math. Statist. 25, 252). Over frequency that is each column's spectrum weighted by the noise's
//! (Grenander & Rosenblatt 1957, Statistical Analysis of Stationary Time Series, ch. 7): noise counts at the
//! frequencies that a parameter moves. The noise's spectrum is the periodogram of the residuals, or of samples before
//! the closure, over its broad shape (see [`shape`]), averaged over neighbours (Daniell 1946), over more of them at
//! higher frequencies.
//!
//! Instruments that are sampled together may err together (mains, a pump, the supply's level): their spectrum is the
//! matrix of their cross-spectra (Hannan 1970, Multiple Time Series, ch. VII), averaged alike. Coherent noise adds up
//! over them; incoherent noise averages out.

use crate::fit::inference::thresholds::{MIN_SMOOTHING_NEIGHBOURS, SMOOTHING_SHARE};
pub(crate) mod shape;

use std::ops::Range;

use nalgebra::DMatrix;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

/// Records that were sampled together, equally many samples each: the range of each one's samples among the residuals,
/// and its noise, from there or elsewhere at the same rate.
pub type Together<'a> = Vec<(Range<usize>, &'a [f64])>;

/// `Jᵀ R J` over records, each the samples of one instrument in their order. Noise is in units of its believed size: a
/// lower spectrum counts as 1.
pub fn score_covariance(columns: &[&[f64]], records: &[Together]) -> DMatrix<f64> {
    let p = columns.len();
    let of = |records: &Together| {
        let longest = records.iter().map(|(rows, noise)| rows.len().max(noise.len())).max().unwrap_or(0);
        let transform = Transform::of(longest);
        let noise: Vec<&[f64]> = records.iter().map(|(_, noise)| *noise).collect();
        let density = transform.density(&noise);
        let spectra: Vec<Vec<Vec<Complex<f64>>>> = columns
            .par_iter()
            .map(|column| records.iter().map(|(rows, _)| transform.spectrum(&column[rows.clone()])).collect())
            .collect();
        let rows: Vec<Vec<f64>> = (0..p)
            .into_par_iter()
            .map(|i| {
                let met = density.times(&spectra[i]);
                let with = |j: usize| met.iter().zip(&spectra[j]).map(|(a, b)| real_product(a, b)).sum();
                (0..=i).map(with).collect()
            })
            .collect();
        DMatrix::from_fn(p, p, |i, j| rows[i.max(j)][i.min(j)])
    };
    let long = |records: &&Together| records.iter().all(|(rows, noise)| rows.len() > 1 && noise.len() > 1);
    records.iter().filter(long).fold(DMatrix::zeros(p, p), |total, records| total + of(records))
}

/// Real part of `Σ āb`; a spectrum without any frequency is zero.
fn real_product(a: &[Complex<f64>], b: &[Complex<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

/// Spectral density of the noise of several instruments.
struct Density {
    /// The cross-spectrum of instruments `a` and `b ≤ a`, weighted so that a sum over its frequencies is one over all.
    cross: Vec<Vec<Vec<Complex<f64>>>>,
}

impl Density {
    /// Its product with a column's spectra, one for each instrument.
    fn times(&self, spectra: &[Vec<Complex<f64>>]) -> Vec<Vec<Complex<f64>>> {
        let row = |a: usize| {
            let mut sum: Vec<Complex<f64>> = Vec::new();
            for (b, spectrum) in spectra.iter().enumerate().filter(|(_, s)| !s.is_empty()) {
                sum.resize(spectrum.len(), Complex::default());
                let both = &self.cross[a.max(b)][a.min(b)];
                let terms = sum.iter_mut().zip(both).zip(spectrum);
                // That of b and a is the conjugate of that of a and b.
                if b <= a {
                    terms.for_each(|((sum, s), x)| *sum += s * x);
                } else {
                    terms.for_each(|((sum, s), x)| *sum += s.conj() * x);
                }
            }
            sum
        };
        (0..spectra.len()).map(row).collect()
    }
}

/// Fourier transform of series of one length, padded with zeros to twice that: correlations do not wrap around.
struct Transform {
    padded: usize,
    plan: std::sync::Arc<dyn RealToComplex<f64>>,
}

impl Transform {
    fn of(samples: usize) -> Self {
        let padded = (2 * samples).next_power_of_two();
        Transform { padded, plan: RealFftPlanner::new().plan_fft_forward(padded) }
    }

    /// Empty for a series of zeros.
    fn spectrum(&self, series: &[f64]) -> Vec<Complex<f64>> {
        if series.iter().all(|v| *v == 0.0) {
            return Vec::new();
        }
        let mut input = series.to_vec();
        input.resize(self.padded, 0.0);
        let mut out = self.plan.make_output_vec();
        // Fails on wrong lengths only, and both are the plan's own.
        let _ = self.plan.process(&mut input, &mut out);
        out
    }

    /// The density of series of noise; each instrument's own is not below 1.
    fn density(&self, noise: &[&[f64]]) -> Density {
        let samples = noise.iter().map(|n| n.len()).min().unwrap_or(1).max(1);
        let last = self.padded / 2;
        let none = vec![Complex::default(); last + 1];
        let spectrum = |n: &&[f64]| Some(self.spectrum(&n[..samples])).filter(|s| !s.is_empty());
        let spectra: Vec<Vec<Complex<f64>>> =
            noise.iter().map(|n| spectrum(n).unwrap_or_else(|| none.clone())).collect();
        let oversampled = self.padded as f64 / samples as f64;
        let least = MIN_SMOOTHING_NEIGHBOURS * oversampled;
        let broad = |s: &Vec<Complex<f64>>| {
            let periodogram: Vec<f64> = s.iter().map(|v| v.norm_sqr() / samples as f64).collect();
            crate::fit::inference::noise_autocorrelation::shape::shape(&periodogram, oversampled)
                .into_iter()
                .map(f64::sqrt)
                .collect()
        };
        let broad: Vec<Vec<f64>> = spectra.par_iter().map(broad).collect();
        // A frequency between the ends stands for its negative too.
        let weight = |k: usize| if k == 0 || k == last { 1.0 } else { 2.0 } / self.padded as f64;
        let one = |(a, b): (usize, usize)| -> Vec<Complex<f64>> {
            let flat = (0..=last).map(|k| 1.0 / (samples as f64 * broad[a][k] * broad[b][k]));
            let product = flat.zip(spectra[a].iter().zip(&spectra[b])).map(|(flat, (a, b))| a * b.conj() * flat);
            let (re, im): (Vec<f64>, Vec<f64>) = product.map(|v| (v.re, v.im)).unzip();
            let (re, im) = (averaged(&re, least, 1.0), averaged(&im, least, -1.0));
            let whole = (0..=last).map(|k| Complex::new(re[k], im[k]) * (broad[a][k] * broad[b][k]));
            // No instrument errs less than it is believed to.
            let whole = whole.map(|s| if a == b { Complex::from(s.re.max(1.0)) } else { s });
            whole.enumerate().map(|(k, s)| s * weight(k)).collect()
        };
        Density { cross: (0..noise.len()).map(|a| (0..=a).map(|b| one((a, b))).collect()).collect() }
    }
}

/// Each value averaged over its neighbours, those beyond either end mirrored and times `sign`.
fn averaged(values: &[f64], least: f64, sign: f64) -> Vec<f64> {
    let last = values.len() - 1;
    let mirrored = |k: isize| {
        let beyond = k < 0 || k as usize > last;
        let k = k.unsigned_abs() % (2 * last).max(1);
        values[if k > last { 2 * last - k } else { k }] * if beyond { sign } else { 1.0 }
    };
    let reach = ((SMOOTHING_SHARE * last as f64).max(least) as isize).min(last as isize).max(1);
    let mut sums = vec![0.0];
    for k in -reach..=last as isize + reach {
        sums.push(sums[sums.len() - 1] + mirrored(k));
    }
    (0..=last)
        .map(|k| {
            let half = ((SMOOTHING_SHARE * k as f64).max(least) as isize).min(reach);
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
                let expected =
                    |seed| score_covariance(&[&column], &[vec![(0..n, &first_order(n, phi, seed)[..])]])[(0, 0)];
                let found = (1..=10).map(expected).sum::<f64>() / 10.0;
                let ratio = found / exact(&column, phi).max(column.iter().map(|c| c * c).sum());
                assert!((0.8..1.25).contains(&ratio), "φ {phi}, period {period}: {ratio}");
            }
        }
    }

    /// Over many draws the estimates of a slope in red noise scatter as the covariance predicts.
    #[test]
    fn estimates_scatter_as_they_are_said_to() {
        let n = 2000;
        let column: Vec<f64> = (0..n).map(|i| (i as f64 / 40.0).sin()).collect();
        let square: f64 = column.iter().map(|c| c * c).sum();
        let (mut scatter, mut expected, draws) = (0.0, 0.0, 200);
        for seed in 0..draws {
            let noise = first_order(n, 0.8, seed);
            let estimate = column.iter().zip(&noise).map(|(c, e)| c * e).sum::<f64>() / square;
            let residuals: Vec<f64> = column.iter().zip(&noise).map(|(c, e)| e - estimate * c).collect();
            scatter += estimate * estimate;
            expected += score_covariance(&[&column], &[vec![(0..n, &residuals[..])]])[(0, 0)] / (square * square);
        }
        assert!(
            (scatter / expected).sqrt() < 1.15 && (scatter / expected).sqrt() > 0.87,
            "{}",
            (scatter / expected).sqrt()
        );
    }

    /// Records that were not sampled together do not correlate with each other.
    #[test]
    fn records_count_apart() {
        let column = vec![1.0; 400];
        let (up, down) = (vec![3.0; 200], vec![-3.0; 200]);
        let apart = score_covariance(&[&column], &[vec![(0..200, &up[..])], vec![(200..400, &down[..])]])[(0, 0)];
        let first = score_covariance(&[&column], &[vec![(0..200, &up[..])]])[(0, 0)];
        assert!((apart / first - 2.0).abs() < 1e-9, "{apart} {first}");
    }

    /// The sum over three sensors of noise that is common to all, that is each one's own, and half of each; of a column
    /// that the sensors see alike, one late by a tenth of a period, and one that the third sees upside down.
    #[test]
    fn noise_that_sensors_share_adds_up_over_them() {
        let (n, draws) = (1500, 60);
        let wave = |late: f64, sign: f64| -> Vec<f64> {
            (0..n).map(|i| sign * (std::f64::consts::TAU * (i as f64 / 150.0 - late)).sin()).collect()
        };
        for column in [[(0.0, 1.0); 3], [(0.0, 1.0), (0.1, 1.0), (0.0, 1.0)], [(0.0, 1.0), (0.0, 1.0), (0.0, -1.0)]] {
            let column: Vec<f64> = column.into_iter().flat_map(|(late, sign)| wave(late, sign)).collect();
            for share in [0.0, 0.5, 1.0f64] {
                let (mut scatter, mut expected) = (0.0, 0.0);
                for seed in 0..draws {
                    let all = first_order(n, 0.95, 1000 + seed);
                    let noise: Vec<Vec<f64>> = (0..3)
                        .map(|s| {
                            let own = first_order(n, 0.95, 4 * seed + s);
                            all.iter().zip(own).map(|(a, o)| share.sqrt() * a + (1.0 - share).sqrt() * o).collect()
                        })
                        .collect();
                    let score: f64 = column.iter().zip(noise.iter().flatten()).map(|(c, e)| c * e).sum();
                    let together = (0..3).map(|s| (s * n..(s + 1) * n, &noise[s][..])).collect();
                    scatter += score * score;
                    expected += score_covariance(&[&column], &[together])[(0, 0)];
                }
                // Sixty draws know a standard deviation to 9%.
                let ratio = (scatter / expected).sqrt();
                assert!((0.75..1.25).contains(&ratio), "share {share}: {ratio}");
            }
        }
    }

    /// A short record in noise that a longer one before it shows: the sum scatters as predicted.
    #[test]
    fn noise_may_be_seen_elsewhere() {
        let (short, long) = (300, 3000);
        let column: Vec<f64> = (0..short).map(|i| 1.0 + (i as f64 / 40.0).sin()).collect();
        let (mut scatter, mut expected) = (0.0, 0.0);
        for seed in 0..200 {
            let noise = first_order(long + short, 0.95, seed);
            let score: f64 = column.iter().zip(&noise[long..]).map(|(c, e)| c * e).sum();
            scatter += score * score;
            expected += score_covariance(&[&column], &[vec![(0..short, &noise[..long])]])[(0, 0)];
        }
        let ratio = (scatter / expected).sqrt();
        assert!((0.85..1.18).contains(&ratio), "{ratio}");
    }
}
