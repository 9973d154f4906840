//! The objective of a fit: it compares samples in time, or the oscillation in frequency.
//!
//! In frequency the residuals of a sensor become the real and imaginary parts of their transform, at the bins around
//! the odd harmonics that the record shows above its noise, through the window of [`crate::signal::harmonics`]; and the
//! two levels that a transform of the oscillation cannot show, before the closure and after it. Each is divided by its
//! noise. Neighbouring bins of a window share some of the samples: all weights are reduced so that together they count
//! as many as are independent.

use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use crate::fit::data::run_data::SensorData;
use crate::fit::problem::thresholds::{HARMONIC_HALF_WIDTH, HARMONIC_OVER_NOISE, MAX_HARMONICS, MAX_MISSING_HARMONICS};
use crate::signal::harmonics::{Response, Tone, Window};

/// What a fit compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Objective {
    /// Every sample.
    #[default]
    Time,
    /// Bins around the odd harmonics.
    Frequency,
}

/// The odd harmonics of a trace above its noise: `(1, 3, 5 …, tone)`, each located near where the previous ones
/// suggest.
pub fn odd_harmonics(response: &Response, about_hz: f64, noise: f64) -> Vec<(usize, Tone)> {
    let level = HARMONIC_OVER_NOISE * response.white * noise;
    let out = |tone: &Tone| tone.amplitude > level;
    let Some(first) = response.peak(0.75 * about_hz, 1.25 * about_hz).filter(out) else { return Vec::new() };
    let half = first.frequency_hz;
    let (mut found, mut quiet) = (vec![(1, first)], 0);
    let most_hz = 0.8 * response.step_hz * response.amplitudes.len() as f64;
    for k in 2..=MAX_HARMONICS {
        let number = 2 * k - 1;
        // At the spacing of the previous two.
        let expected_hz = match found.as_slice() {
            [.., (m, a), (n, b)] => {
                b.frequency_hz + (number - n) as f64 * (b.frequency_hz - a.frequency_hz) / (n - m) as f64
            }
            _ => number as f64 * half,
        };
        if expected_hz > most_hz || quiet == MAX_MISSING_HARMONICS {
            break;
        }
        // No peak is two harmonics: the next one lies at least half their spacing above the last.
        let least_hz = found.last().map_or(0.0, |(n, last)| last.frequency_hz + 0.5 * (number - n) as f64 * half);
        let apart = |tone: &Tone| tone.frequency_hz > least_hz;
        match response.peak(expected_hz - 0.6 * half, expected_hz + 0.6 * half).filter(out).filter(apart) {
            Some(tone) => {
                found.push((number, tone));
                quiet = 0;
            }
            None => quiet += 1,
        }
    }
    found
}

/// The map from a sensor's residuals at its samples, over their noise, to residuals in frequency.
#[derive(Clone)]
pub(crate) struct Bins {
    /// Samples before the closure.
    before: usize,
    /// Samples in the window.
    inside: std::ops::Range<usize>,
    weights: Vec<f64>,
    /// Bins of the transform that count.
    kept: Vec<usize>,
    plan: Arc<dyn RealToComplex<f64>>,
    /// Scale of each part of a bin.
    scale: f64,
}

impl Bins {
    /// For a sensor's samples, `entering` of them, whose closure starts at `closure_s` and takes `closing_s`; none
    /// where the record lasts less than three periods after it.
    pub(crate) fn of(
        sensor: &SensorData,
        entering: std::ops::Range<usize>,
        (closure_s, closing_s): (f64, f64),
        period_s: f64,
    ) -> Option<Bins> {
        let (time_s, head_m) = (&sensor.time_s[entering.clone()], &sensor.head_m[entering]);
        let from_s = closure_s + closing_s;
        let window = Window::new(from_s, *time_s.last()?, period_s)?;
        let response = Response::of(&window, time_s, head_m)?;
        let harmonics = odd_harmonics(&response, 1.0 / period_s, sensor.noise_m);
        // The period that this record shows sets the edges.
        let measured_s = harmonics.first().map_or(period_s, |(_, tone)| 1.0 / tone.frequency_hz);
        let window = Window::new(from_s, window.to_s, measured_s)?;
        let inside = time_s.partition_point(|&t| t < from_s)..time_s.len();
        let weights: Vec<f64> = time_s[inside.clone()].iter().map(|&t| window.weight(t)).collect();
        let n = weights.len();
        let step_hz = (n - 1) as f64 / (n as f64 * (time_s[inside.end - 1] - time_s[inside.start]));
        let around = |k: &usize| {
            harmonics
                .iter()
                .any(|(_, tone)| (*k as f64 * step_hz - tone.frequency_hz).abs() <= HARMONIC_HALF_WIDTH / measured_s)
        };
        let (square, fourth) = weights.iter().fold((0.0, 0.0), |(s, f), w| (s + w * w, f + w.powi(4)));
        let independent = square * square / fourth / n as f64;
        Some(Bins {
            before: time_s.partition_point(|&t| t < closure_s),
            inside,
            kept: (1..n / 2).filter(around).collect(),
            plan: RealFftPlanner::<f64>::new().plan_fft_forward(n),
            scale: (2.0 * independent / square).sqrt(),
            weights,
        })
    }

    /// Number of residuals.
    pub(crate) fn len(&self) -> usize {
        2 + 2 * self.kept.len()
    }

    /// The transpose of [`of_residuals`](Self::of_residuals): what a weight on each residual in frequency is on the
    /// residuals in time.
    pub(crate) fn transposed(&self, weights: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.inside.end];
        out[..self.before].fill(weights[0] / (self.before as f64).sqrt().max(1.0));
        let n = self.weights.len();
        let mut bins = vec![Complex::new(0.0, 0.0); n / 2 + 1];
        for (&k, part) in self.kept.iter().zip(weights[2..].chunks_exact(2)) {
            // The inverse sums a bin and its conjugate.
            bins[k] = Complex::new(part[0], part[1]) * (0.5 * self.scale);
        }
        let mut waves = vec![0.0; n];
        // Lengths are the plan's own and bins at the ends are real, so it cannot refuse them.
        let _ = RealFftPlanner::<f64>::new().plan_fft_inverse(n).process(&mut bins, &mut waves);
        let whole: f64 = self.weights.iter().sum();
        let square: f64 = self.weights.iter().map(|w| w * w).sum();
        let mean = waves.iter().zip(&self.weights).map(|(v, w)| v * w).sum::<f64>() / whole;
        for ((x, v), w) in out[self.inside.clone()].iter_mut().zip(&waves).zip(&self.weights) {
            *x += w * (v - mean + weights[1] / square.sqrt());
        }
        out
    }

    /// Residuals in frequency of residuals in time.
    pub(crate) fn of_residuals(&self, residuals: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.len());
        out.push(residuals[..self.before].iter().sum::<f64>() / (self.before as f64).sqrt().max(1.0));
        let inside = &residuals[self.inside.clone()];
        let whole: f64 = self.weights.iter().sum();
        let square: f64 = self.weights.iter().map(|w| w * w).sum();
        let sum: f64 = inside.iter().zip(&self.weights).map(|(r, w)| r * w).sum();
        out.push(sum / square.sqrt());
        let mut weighted: Vec<f64> = inside.iter().zip(&self.weights).map(|(r, w)| (r - sum / whole) * w).collect();
        let mut bins = vec![Complex::new(0.0, 0.0); weighted.len() / 2 + 1];
        // Lengths are the plan's own, so it cannot refuse them.
        if self.plan.process(&mut weighted, &mut bins).is_ok() {
            out.extend(self.kept.iter().flat_map(|&k| [self.scale * bins[k].re, self.scale * bins[k].im]));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `gᵀ(B r) = (Bᵀg)ᵀ r` for any `r` and `g`, an even number of samples and an odd one.
    #[test]
    fn the_transpose_is_that_of_the_map() {
        let mut random = fastrand::Rng::with_seed(3);
        for n in [240, 241] {
            let bins = Bins {
                before: 30,
                inside: 55..55 + n,
                weights: (0..n).map(|i| (std::f64::consts::PI * (i as f64 + 0.5) / n as f64).sin()).collect(),
                kept: vec![1, 4, 5, 6, 50],
                plan: RealFftPlanner::<f64>::new().plan_fft_forward(n),
                scale: 0.3,
            };
            let residuals: Vec<f64> = (0..55 + n).map(|_| random.f64() - 0.5).collect();
            let weights: Vec<f64> = (0..bins.len()).map(|_| random.f64() - 0.5).collect();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let (there, back) =
                (dot(&weights, &bins.of_residuals(&residuals)), dot(&bins.transposed(&weights), &residuals));
            assert!((there - back).abs() < 1e-12, "{n}: {there} {back}");
        }
    }
}
