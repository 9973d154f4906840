//! Frequency response of a closed pipe from a decaying record: amplitude and phase at its odd harmonics.
//!
//! A record after a closure is a sum of decaying oscillations that begins at full strength and stops abruptly. Without
//! a window each would leak over all others. The window here rises over one period T of the pipe and falls over a whole
//! number of periods, along the integral of a Hann pulse, `x - sin(2πx)/2π`. The transform of such an edge of length T
//! vanishes at 2/T, 3/T, …; odd harmonics lie 2/T apart, so undamped oscillations do not leak between them at all, and
//! damped ones little. The mean under the window is removed first. Amplitudes are those of steady sines under the
//! window; a decaying oscillation shows its mean strength. Compare only what was seen through the same window.
//!
//! For transforms of windowed records see Harris (1978, Proc. IEEE 66, 51); for the odd harmonics as a pipe's response,
//! Lee, Lambert, Simpson, Vítkovský & Liggett (2006, J. Hydraul. Res. 44, 633).

use std::f64::consts::TAU;

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

use crate::signal::spectrum::on_even_steps;

/// Least number of periods of the pipe that a record must last after the closure.
pub const LEAST_PERIODS: f64 = 3.0;

/// A stretch of a record and the weights of its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// Its beginning, s.
    pub from_s: f64,
    /// Its end, s.
    pub to_s: f64,
    /// Length of its rising edge, a period of the pipe, s.
    pub rise_s: f64,
    /// Length of its falling edge, whole periods, s.
    pub fall_s: f64,
}

/// Amplitude and phase of one frequency.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Tone {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude, in the trace's unit.
    #[serde(rename = "amplitude_m")]
    pub amplitude: f64,
    /// Phase of the cosine at the window's beginning, rad, from -π to π.
    pub phase_rad: f64,
}

/// A trace under a window, and its transform.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    step_s: f64,
    /// Time from the window's beginning to the first sample, s.
    late_s: f64,
    /// Samples without their mean, times their weights.
    weighted: Vec<f64>,
    /// Sum of the weights.
    whole: f64,
    /// Spacing of the frequencies of `amplitudes`, Hz.
    pub step_hz: f64,
    /// Amplitude at 0, `step_hz`, … up to half the sample rate.
    pub amplitudes: Vec<f64>,
    /// Phase at the same frequencies, rad, as in [`Tone`].
    pub phases: Vec<f64>,
    /// Root mean square amplitude of white noise of standard deviation 1.
    pub white: f64,
}

impl Window {
    /// The window from the end of the closure to the end of the record, for a pipe of period `period_s`; none if the
    /// record is too short.
    pub fn new(from_s: f64, to_s: f64, period_s: f64) -> Option<Window> {
        let periods = (to_s - from_s) / period_s;
        (period_s > 0.0 && periods >= LEAST_PERIODS && periods.is_finite()).then(|| Window {
            from_s,
            to_s,
            rise_s: period_s,
            fall_s: period_s * (0.5 * periods).floor().max(1.0),
        })
    }

    /// Weight of a time, 0 to 1.
    pub fn weight(&self, time_s: f64) -> f64 {
        edge((time_s - self.from_s) / self.rise_s) * edge((self.to_s - time_s) / self.fall_s)
    }
}

/// The integral of a Hann pulse.
fn edge(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x - (TAU * x).sin() / TAU
}

impl Response {
    /// Applies a window to a trace at ascending times, s. Straight lines bridge samples that are not finite. None if
    /// fewer than 16 samples lie in the window.
    pub fn of(window: &Window, time_s: &[f64], values: &[f64]) -> Option<Response> {
        let inside =
            time_s.iter().zip(values).filter(|(t, v)| (window.from_s..=window.to_s).contains(*t) && v.is_finite());
        let samples: Vec<(f64, f64)> = inside.map(|(t, v)| (*t, *v)).collect();
        let (step_s, mut even) = on_even_steps(&samples)?;
        let first_s = samples[0].0;
        let weights: Vec<f64> = (0..even.len()).map(|i| window.weight(first_s + i as f64 * step_s)).collect();
        let whole: f64 = weights.iter().sum();
        let square: f64 = weights.iter().map(|w| w * w).sum();
        let mean = even.iter().zip(&weights).map(|(v, w)| v * w).sum::<f64>() / whole;
        even.iter_mut().zip(&weights).for_each(|(v, w)| *v = (*v - mean) * w);
        let weighted = even.clone();
        even.resize((4 * even.len()).next_power_of_two(), 0.0);
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(even.len());
        let (step_hz, mut bins) = (1.0 / (step_s * even.len() as f64), plan.make_output_vec());
        plan.process(&mut even, &mut bins).ok()?;
        let late = |hz: f64| Complex::from_polar(1.0, -TAU * hz * (first_s - window.from_s));
        Some(Response {
            step_s,
            late_s: first_s - window.from_s,
            weighted,
            whole,
            step_hz,
            amplitudes: bins.iter().map(|b| 2.0 * b.norm() / whole).collect(),
            phases: bins.iter().enumerate().map(|(k, b)| (b * late(k as f64 * step_hz)).arg()).collect(),
            white: 2.0 * square.sqrt() / whole,
        })
    }

    /// Amplitude and phase at any frequency, by direct summation.
    pub fn at(&self, frequency_hz: f64) -> Tone {
        let turn = Complex::from_polar(1.0, -TAU * frequency_hz * self.step_s);
        let (mut phase, mut sum) = (Complex::new(1.0, 0.0), Complex::new(0.0, 0.0));
        for (i, value) in self.weighted.iter().enumerate() {
            if i % 512 == 0 {
                // Recomputed now and then, because a running product drifts.
                phase = Complex::from_polar(1.0, -TAU * frequency_hz * (self.late_s + self.step_s * i as f64));
            }
            sum += phase * *value;
            phase *= turn;
        }
        Tone { frequency_hz, amplitude: 2.0 * sum.norm() / self.whole, phase_rad: sum.arg() }
    }

    /// The highest point between two frequencies, located to a millionth of itself; none if it lies at an edge.
    pub fn peak(&self, from_hz: f64, to_hz: f64) -> Option<Tone> {
        let first = (from_hz / self.step_hz).ceil().max(1.0) as usize;
        let last = ((to_hz / self.step_hz).floor() as usize).min(self.amplitudes.len().checked_sub(2)?);
        let highest = (first..=last).max_by(|a, b| self.amplitudes[*a].total_cmp(&self.amplitudes[*b]))?;
        let here = self.amplitudes[highest];
        if self.amplitudes[highest - 1] > here || self.amplitudes[highest + 1] > here {
            return None;
        }
        // Golden section between the neighbours.
        let ratio = 0.5 * (5f64.sqrt() - 1.0);
        let (mut low, mut high) = ((highest - 1) as f64 * self.step_hz, (highest + 1) as f64 * self.step_hz);
        while high - low > 1e-6 * high {
            let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
            if self.at(a).amplitude < self.at(b).amplitude { low = a } else { high = b }
        }
        Some(self.at(0.5 * (low + high)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(n: usize) -> Vec<f64> {
        (0..n).map(|i| i as f64 * 1e-3).collect()
    }

    /// The fit separates odd harmonics of a steady oscillation exactly, whatever the record's length.
    #[test]
    fn odd_harmonics_do_not_leak_into_each_other() {
        let (time_s, period_s) = (times(9001), 0.72);
        let parts = [(1.0, 20.0, 0.3), (3.0, 2.0, -1.0), (5.0, 0.01, 2.0)];
        let wave =
            |t: &f64| 5.0 + parts.iter().map(|(n, a, p)| a * (TAU * n / period_s * (t - 1.3) + p).cos()).sum::<f64>();
        let values: Vec<f64> = time_s.iter().map(wave).collect();
        let window = Window::new(1.3, 9.0, period_s).unwrap();
        let response = Response::of(&window, &time_s, &values).unwrap();
        for (n, amplitude, phase) in parts {
            let peak = response.peak((n - 0.5) / period_s, (n + 0.5) / period_s).unwrap();
            let at = response.at(n / period_s);
            assert!((peak.frequency_hz * period_s / n - 1.0).abs() < 1e-3, "{peak:?}");
            assert!(
                (at.amplitude / amplitude - 1.0).abs() < 0.02 && (at.phase_rad - phase).abs() < 0.02,
                "{n}: {at:?}"
            );
        }
        // The plain cut would put ten times the fifth's strength there.
        let cut: Complex<f64> = (time_s.iter().zip(&values).filter(|(t, _)| **t >= 1.3))
            .map(|(t, v)| Complex::from_polar(2.0 * (v - 5.0) / 7701.0, -TAU * 5.0 / period_s * (t - 1.3)))
            .sum();
        assert!(cut.norm() > 0.1, "{}", cut.norm());
    }

    /// A decaying cosine under the window is the window's own transform at a complex frequency.
    #[test]
    fn a_decaying_oscillation_has_the_strength_and_frequency_of_its_integral() {
        let (time_s, period_s) = (times(12_001), 1.1);
        let (decay, omega) = (0.4, TAU / period_s);
        let values: Vec<f64> = time_s.iter().map(|t| 8.0 * (-decay * t).exp() * (omega * t + 0.5).cos()).collect();
        let window = Window::new(0.0, 12.0, period_s).unwrap();
        let response = Response::of(&window, &time_s, &values).unwrap();
        let n = 400_000;
        let (mut sum, mut whole) = (0.0, 0.0);
        for i in 0..n {
            let t = 12.0 * (f64::from(i) + 0.5) / f64::from(n);
            sum += window.weight(t) * 8.0 * (-decay * t).exp();
            whole += window.weight(t);
        }
        let peak = response.peak(0.6, 1.2).unwrap();
        assert!((peak.frequency_hz * period_s - 1.0).abs() < 2e-3, "{peak:?}");
        assert!((response.at(1.0 / period_s).amplitude / (sum / whole) - 1.0).abs() < 5e-3, "{peak:?} {}", sum / whole);
        assert!((response.at(1.0 / period_s).phase_rad - 0.5).abs() < 0.02);
    }

    #[test]
    fn white_noise_lies_at_its_level_and_short_records_have_no_response() {
        let mut rng = fastrand::Rng::with_seed(3);
        let values: Vec<f64> = (0..8000).map(|_| (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0).collect();
        let window = Window::new(0.0, 8.0, 1.0).unwrap();
        let response = Response::of(&window, &times(8000), &values).unwrap();
        let square: f64 = response.amplitudes.iter().skip(20).map(|a| a * a).sum();
        let rms = (square / (response.amplitudes.len() - 20) as f64).sqrt();
        assert!((rms / response.white - 1.0).abs() < 0.05, "{rms} {}", response.white);
        assert!(Window::new(0.0, 2.9, 1.0).is_none() && Window::new(0.0, 2.9, 0.0).is_none());
        assert!(Response::of(&window, &[0.1; 5], &[1.0; 5]).is_none());
    }
}
