//! Amplitude over frequency of a trace, e.g. to see in which harmonics a residual lies.
//!
//! The trace is interpolated to even steps. Its mean is removed, a cosine tapers its first and last tenth (Harris 1978,
//! Proc. IEEE 66, 51), and zeros pad it to at least twice its length. Amplitudes are those of sines as long as the
//! trace: a sine of amplitude 1 has a peak of 1.

use realfft::RealFftPlanner;

/// Share of the trace over which the taper rises, and falls.
const TAPER: f64 = 0.1;
/// Least number of samples for a spectrum.
const LEAST_SAMPLES: usize = 16;

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Distance between neighbouring frequencies, Hz; the first is 0.
    pub step_hz: f64,
    /// Amplitude at each frequency, in the trace's unit.
    pub amplitude: Vec<f64>,
    /// Root mean square over the frequencies of the amplitude that white noise of standard deviation 1 would have.
    pub white: f64,
}

impl Spectrum {
    /// The spectrum of values at ascending times, s. Samples that are not finite are bridged by straight lines. `None`
    /// for fewer than 16 samples.
    pub fn of(time_s: &[f64], values: &[f64]) -> Option<Spectrum> {
        let samples: Vec<(f64, f64)> = time_s
            .iter()
            .copied()
            .zip(values.iter().copied())
            .filter(|(t, v)| t.is_finite() && v.is_finite())
            .collect();
        let (step_s, mut even) = on_even_steps(&samples)?;
        let n = even.len();
        let mean = even.iter().sum::<f64>() / n as f64;
        let weights: Vec<f64> = (0..n).map(|i| taper(i, n)).collect();
        even.iter_mut().zip(&weights).for_each(|(v, w)| *v = (*v - mean) * w);
        even.resize((2 * n).next_power_of_two(), 0.0);
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(even.len());
        let mut bins = plan.make_output_vec();
        plan.process(&mut even, &mut bins).ok()?;
        let whole: f64 = weights.iter().sum();
        let square: f64 = weights.iter().map(|w| w * w).sum();
        Some(Spectrum {
            step_hz: 1.0 / (step_s * even.len() as f64),
            amplitude: bins.iter().map(|b| 2.0 * b.norm() / whole).collect(),
            white: 2.0 * square.sqrt() / whole,
        })
    }

    /// Frequency and amplitude, up to `most_hz`.
    pub fn points(&self, most_hz: f64) -> impl Iterator<Item = (f64, f64)> {
        let points = self.amplitude.iter().enumerate().map(|(i, a)| (i as f64 * self.step_hz, *a));
        points.take_while(move |(f, _)| *f <= most_hz)
    }

    /// Frequency, Hz, of the highest amplitude between two frequencies, by a parabola through the logarithms of it and
    /// its neighbours.
    pub fn peak_hz(&self, from_hz: f64, to_hz: f64) -> Option<f64> {
        let inside = self.points(to_hz).enumerate().filter(|(_, (f, _))| *f >= from_hz);
        let (i, (peak_hz, _)) = inside.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
        let log = |i: usize| self.amplitude.get(i).map(|a| a.ln());
        let around = i.checked_sub(1).and_then(|before| Some((log(before)?, log(i)?, log(i + 1)?)));
        let shift = around.map_or(0.0, |(a, b, c)| 0.5 * (a - c) / (a - 2.0 * b + c));
        // At an edge of the band the highest point is not a peak, and the parabola's vertex is arbitrary.
        Some(if shift.abs() <= 1.0 { peak_hz + shift * self.step_hz } else { peak_hz })
    }
}

/// Linear interpolation on steps of the median sample distance.
pub(crate) fn on_even_steps(samples: &[(f64, f64)]) -> Option<(f64, Vec<f64>)> {
    if samples.len() < LEAST_SAMPLES {
        return None;
    }
    let (first, last) = (samples[0].0, samples[samples.len() - 1].0);
    let mut steps: Vec<f64> = samples.windows(2).map(|w| w[1].0 - w[0].0).filter(|s| *s > 0.0).collect();
    steps.sort_unstable_by(f64::total_cmp);
    // At most twice as many points as samples, however unevenly these lie.
    let step_s = steps.get(steps.len() / 2)?.max((last - first) / (2 * samples.len()) as f64);
    let n = ((last - first) / step_s + 1e-6) as usize + 1;
    let mut next = 1;
    let even = (0..n).map(|i| {
        let t = first + i as f64 * step_s;
        while next + 1 < samples.len() && samples[next].0 < t {
            next += 1;
        }
        let ((t0, v0), (t1, v1)) = (samples[next - 1], samples[next]);
        if t1 > t0 { v0 + ((t - t0) / (t1 - t0)).clamp(0.0, 1.0) * (v1 - v0) } else { v1 }
    });
    Some((step_s, even.collect()))
}

fn taper(i: usize, n: usize) -> f64 {
    let edge = TAPER * n as f64;
    let inside = (i as f64 + 0.5).min(n as f64 - i as f64 - 0.5);
    if inside >= edge { 1.0 } else { 0.5 - 0.5 * (std::f64::consts::PI * inside / edge).cos() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn times(n: usize, step_s: f64) -> Vec<f64> {
        (0..n).map(|i| i as f64 * step_s).collect()
    }

    #[test]
    fn a_sine_peaks_at_its_frequency_with_its_amplitude() {
        for frequency_hz in [3.0, 7.31, 40.2] {
            let time_s = times(5000, 2e-3);
            let wave: Vec<f64> = time_s.iter().map(|t| 12.0 + 0.7 * (TAU * frequency_hz * t + 0.4).sin()).collect();
            let spectrum = Spectrum::of(&time_s, &wave).unwrap();
            let peak_hz = spectrum.peak_hz(0.0, 250.0).unwrap();
            assert!((peak_hz - frequency_hz).abs() <= 0.1 * spectrum.step_hz, "{peak_hz}");
            let highest = spectrum.amplitude.iter().copied().fold(0.0, f64::max);
            assert!((highest / 0.7 - 1.0).abs() < 0.03, "{highest}");
            // An octave away there is a thousandth of it.
            let away = spectrum.points(250.0).filter(|(f, _)| *f > 2.0 * frequency_hz).map(|p| p.1).fold(0.0, f64::max);
            assert!(away < 2e-3, "{away}");
        }
    }

    #[test]
    fn white_noise_lies_at_its_level() {
        let mut rng = fastrand::Rng::with_seed(5);
        let noise: Vec<f64> = (0..8000).map(|_| (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0).collect();
        let spectrum = Spectrum::of(&times(8000, 1e-3), &noise).unwrap();
        let n = spectrum.amplitude.len() as f64;
        let rms = (spectrum.amplitude.iter().map(|a| a * a).sum::<f64>() / n).sqrt();
        assert!((rms / spectrum.white - 1.0).abs() < 0.05, "{rms} {}", spectrum.white);
    }

    #[test]
    fn gaps_and_uneven_times_do_no_harm() {
        let mut rng = fastrand::Rng::with_seed(1);
        let mut time_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 1e-3 + 5e-4 * rng.f64()).collect();
        time_s.drain(1000..1050);
        let mut wave: Vec<f64> = time_s.iter().map(|t| (TAU * 4.0 * t).sin()).collect();
        wave[300] = f64::NAN;
        let spectrum = Spectrum::of(&time_s, &wave).unwrap();
        assert!((spectrum.peak_hz(0.0, 100.0).unwrap() - 4.0).abs() < 0.15);
        assert!(Spectrum::of(&time_s[..9], &wave[..9]).is_none());
        assert!(Spectrum::of(&[0.0; 40], &[1.0; 40]).is_none(), "no time passes");
        let clustered: Vec<f64> = (0..100).map(|i| if i < 90 { f64::from(i) * 1e-9 } else { f64::from(i) }).collect();
        assert!(Spectrum::of(&clustered, &vec![1.0; 100]).unwrap().amplitude.len() < 1000);
    }
}
