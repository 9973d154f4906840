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
use realfft::{RealFftPlanner, RealToComplex};

use crate::product::dot;

/// `Jᵀ R J` over records, each the samples of one instrument in their order, for each of several `noises`. A group of
/// `records` was sampled together, equally many samples each; `noises` hold a series for each record, at the same rate,
/// in units of its believed size: a lower spectrum counts as 1.
pub fn score_covariances(
    columns: &[&[f64]],
    records: &[Vec<Range<usize>>],
    noises: &[Vec<Vec<&[f64]>>],
) -> Vec<DMatrix<f64>> {
    let p = columns.len();
    let mut totals = vec![DMatrix::zeros(p, p); noises.len()];
    for (g, rows) in records.iter().enumerate().filter(|(_, rows)| rows.iter().all(|rows| rows.len() > 1)) {
        let series = noises.iter().flat_map(|noise| &noise[g]).map(|noise| noise.len());
        let transform = Transform::of(rows.iter().map(Range::len).chain(series).max().unwrap_or(0));
        let spectra: Vec<Vec<Spectrum>> = columns
            .par_iter()
            .map(|column| rows.iter().map(|rows| transform.spectrum(&column[rows.clone()])).collect())
            .collect();
        let long = |(_, noise): &(_, &Vec<Vec<&[f64]>>)| noise[g].iter().all(|noise| noise.len() > 1);
        for (total, noise) in totals.iter_mut().zip(noises).filter(long) {
            let density = transform.density(&noise[g]);
            let products: Vec<Vec<f64>> = (0..p)
                .into_par_iter()
                .map(|i| {
                    let met = density.times(&spectra[i]);
                    let with = |j: usize| met.iter().zip(&spectra[j]).map(|(a, b)| a.product(b)).sum();
                    (0..=i).map(with).collect()
                })
                .collect();
            *total += DMatrix::from_fn(p, p, |i, j| products[i.max(j)][i.min(j)]);
        }
    }
    totals
}

/// A spectrum's real and imaginary parts; without any frequency it is zero.
#[derive(Clone, Default)]
struct Spectrum {
    re: Vec<f64>,
    im: Vec<f64>,
}

impl Spectrum {
    /// Real part of `Σ āb`.
    fn product(&self, b: &Spectrum) -> f64 {
        let n = self.re.len().min(b.re.len());
        dot(&self.re[..n], &b.re[..n]) + dot(&self.im[..n], &b.im[..n])
    }

    /// Adds the product of two others; of the first one's conjugate where `sign` is -1.
    fn add(&mut self, a: &Spectrum, sign: f64, b: &Spectrum) {
        self.re.resize(b.re.len(), 0.0);
        self.im.resize(b.im.len(), 0.0);
        let parts = self.re.iter_mut().zip(&mut self.im).zip(a.re.iter().zip(&a.im)).zip(b.re.iter().zip(&b.im));
        for (((re, im), (a_re, a_im)), (b_re, b_im)) in parts {
            *re += a_re * b_re - sign * a_im * b_im;
            *im += a_re * b_im + sign * a_im * b_re;
        }
    }
}

/// Spectral density of the noise of several instruments.
struct Density {
    /// The cross-spectrum of instruments `a` and `b ≤ a`, weighted so that a sum over its frequencies is one over all.
    cross: Vec<Vec<Spectrum>>,
}

impl Density {
    /// Its product with a column's spectra, one for each instrument.
    fn times(&self, spectra: &[Spectrum]) -> Vec<Spectrum> {
        let row = |a: usize| {
            let mut sum = Spectrum::default();
            for (b, spectrum) in spectra.iter().enumerate().filter(|(_, s)| !s.re.is_empty()) {
                // That of b and a is the conjugate of that of a and b.
                sum.add(&self.cross[a.max(b)][a.min(b)], if b <= a { 1.0 } else { -1.0 }, spectrum);
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
        let padded = 2 * quick_length(samples);
        Transform { padded, plan: RealFftPlanner::new().plan_fft_forward(padded) }
    }

    /// Zero for a series of zeros.
    fn spectrum(&self, series: &[f64]) -> Spectrum {
        if series.iter().all(|v| *v == 0.0) {
            return Spectrum::default();
        }
        let mut input = series.to_vec();
        input.resize(self.padded, 0.0);
        let mut out = self.plan.make_output_vec();
        // Fails on wrong lengths only, and both are the plan's own.
        let _ = self.plan.process(&mut input, &mut out);
        let (re, im) = out.into_iter().map(|v| (v.re, v.im)).unzip();
        Spectrum { re, im }
    }

    /// The density of series of noise; each instrument's own is not below 1.
    fn density(&self, noise: &[&[f64]]) -> Density {
        let samples = noise.iter().map(|n| n.len()).min().unwrap_or(1).max(1);
        let last = self.padded / 2;
        let none = || Spectrum { re: vec![0.0; last + 1], im: vec![0.0; last + 1] };
        let spectrum = |n: &&[f64]| Some(self.spectrum(&n[..samples])).filter(|s| !s.re.is_empty());
        let spectra: Vec<Spectrum> = noise.iter().map(|n| spectrum(n).unwrap_or_else(none)).collect();
        let oversampled = self.padded as f64 / samples as f64;
        let least = MIN_SMOOTHING_NEIGHBOURS * oversampled;
        let broad = |s: &Spectrum| {
            let square = |(re, im): (&f64, &f64)| (re * re + im * im) / samples as f64;
            let periodogram: Vec<f64> = s.re.iter().zip(&s.im).map(square).collect();
            crate::fit::inference::noise_autocorrelation::shape::shape(&periodogram, oversampled)
                .into_iter()
                .map(f64::sqrt)
                .collect()
        };
        let broad: Vec<Vec<f64>> = spectra.par_iter().map(broad).collect();
        // A frequency between the ends stands for its negative too.
        let weight = |k: usize| if k == 0 || k == last { 1.0 } else { 2.0 } / self.padded as f64;
        let one = |(a, b): (usize, usize)| {
            let mut product = Spectrum::default();
            product.add(&spectra[b], -1.0, &spectra[a]);
            let whole = |mut part: Vec<f64>, sign: f64| -> Vec<f64> {
                let size = |k: usize| broad[a][k] * broad[b][k];
                (0..=last).for_each(|k| part[k] /= samples as f64 * size(k));
                averaged(&part, least, sign).into_iter().enumerate().map(|(k, v)| v * size(k)).collect()
            };
            let mut whole = match a == b {
                // No instrument errs less than it is believed to.
                true => Spectrum {
                    re: whole(product.re, 1.0).into_iter().map(|s| s.max(1.0)).collect(),
                    im: vec![0.0; last + 1],
                },
                false => Spectrum { re: whole(product.re, 1.0), im: whole(product.im, -1.0) },
            };
            for part in [&mut whole.re, &mut whole.im] {
                part.iter_mut().enumerate().for_each(|(k, s)| *s *= weight(k));
            }
            whole
        };
        Density { cross: (0..noise.len()).map(|a| (0..=a).map(|b| one((a, b))).collect()).collect() }
    }
}

/// The least length from so many samples on that has no prime factor above 5: a transform of it is quick.
fn quick_length(samples: usize) -> usize {
    let odd = (0..).map(|k| 5usize.pow(k)).take_while(|five| *five <= 2 * samples.max(1));
    let odd =
        odd.flat_map(|five| (0..).map(move |k| five * 3usize.pow(k)).take_while(move |odd| *odd <= 2 * samples.max(1)));
    odd.map(|odd| odd * samples.div_ceil(odd).next_power_of_two()).min().unwrap_or(1)
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

    /// Of records that were sampled together, each with its noise.
    fn score_covariance(columns: &[&[f64]], records: &[Vec<(Range<usize>, &[f64])>]) -> DMatrix<f64> {
        let rows: Vec<Vec<_>> =
            records.iter().map(|group| group.iter().map(|(rows, _)| rows.clone()).collect()).collect();
        let noise = records.iter().map(|group| group.iter().map(|(_, noise)| *noise).collect()).collect();
        score_covariances(columns, &rows, &[noise]).remove(0)
    }

    #[test]
    fn quick_lengths_are_the_least() {
        let is_quick = |n: &usize| {
            [2, 3, 5].iter().fold(*n, |n, p| (0..40).fold(n, |n, _| if n % p == 0 { n / p } else { n })) == 1
        };
        for samples in (1..3000).chain([65_537, 99_991]) {
            assert_eq!(quick_length(samples), (samples..).find(is_quick).unwrap(), "{samples}");
        }
    }

    /// Several noises at once are each as if it were alone, whatever the others' lengths.
    #[test]
    fn noises_do_not_disturb_each_other() {
        let (n, long) = (500, 900);
        let column: Vec<f64> = (0..n).map(|i| (i as f64 / 40.0).sin()).collect();
        let (own, before) = (first_order(n, 0.5, 1), first_order(long, 0.9, 2));
        let rows = 0..n;
        let both = score_covariances(&[&column], &[vec![rows]], &[vec![vec![&own[..]]], vec![vec![&before[..]]]]);
        for (together, noise) in both.iter().zip([&own, &before]) {
            let alone = score_covariance(&[&column], &[vec![(0..n, &noise[..])]])[(0, 0)];
            assert!((together[(0, 0)] / alone - 1.0).abs() < 0.05, "{} {alone}", together[(0, 0)]);
        }
    }

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
