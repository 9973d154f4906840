//! Hum: tones of the mains and of their harmonics, which a sensor's wiring picks up. They stand in its record before
//! the closure as after it.

use std::f64::consts::{PI, TAU};

use crate::robust::NOT_BY_CHANCE;
use crate::signal::sine::Sine;
use crate::signal::spectrum::Spectrum;

/// A lasting oscillation.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Tone {
    /// Its frequency, or an alias of it, Hz.
    #[serde(rename = "frequency_hz")]
    pub hz: f64,
    /// Its amplitude, m.
    pub amplitude_m: f64,
}

/// Noise, its colour and its tones are read from at most this many samples before the closure: enough for 1% of the
/// variance.
pub(crate) const LONGEST_LEAD: usize = 20_000;
/// Frequencies of the mains, Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];
/// Their harmonics that wiring picks up. Rectifiers and lamps make the first few.
const HARMONICS: usize = 6;
/// The mains keep their frequency within this, Hz (EN 50160: 0.5 Hz in 99.5% of a year); a motor on the mains turns
/// more slowly, by its slip.
const WITHIN_HZ: f64 = 0.5;
/// So far around the mains' band, in units of the resolution 1/T of a record of length T, the noise is read, and so
/// near to a tone it is not.
const AROUND: f64 = 24.0;
const NEAR: f64 = 3.0;
/// Tones in and near one band.
const MOST: usize = 8;

/// The hum in samples of an even record that is otherwise steady, `interval_s` apart, the strongest tone first; takes
/// it out of them.
///
/// A tone is one whose power is beyond what chance makes of the noise around it. It is hum where it lies within the
/// mains' band.
pub(crate) fn take_hum(samples: &mut [f64], interval_s: f64) -> Vec<Tone> {
    let number: Vec<f64> = (0..samples.len()).map(|i| i as f64).collect();
    let mut found: Vec<Tone> = Vec::new();
    // other tones leak into the band: they are taken out of a copy
    let mut left = samples.to_vec();
    let mut spectrum = Spectrum::of(&number, &left);
    for mains_hz in MAINS_HZ {
        for k in 1..=HARMONICS {
            let cycles = mains_hz * k as f64 * interval_s;
            // beyond half the rate a tone is seen at its alias
            let alias = (cycles - cycles.round()).abs();
            let half = WITHIN_HZ * k as f64 * interval_s;
            for _ in 0..MOST {
                let at = spectrum
                    .as_ref()
                    .and_then(|spectrum| strongest(spectrum, samples.len(), [alias - half, alias + half]));
                let Some(tone) = at.map(|at| Sine::of(&left, at)) else { break };
                tone.take(&mut left);
                spectrum = Spectrum::of(&number, &left);
                if (tone.cycles_per_sample - alias).abs() <= half {
                    tone.take(samples);
                    found.push(Tone { hz: tone.cycles_per_sample / interval_s, amplitude_m: tone.amplitude() });
                }
            }
        }
    }
    found.sort_by(|a, b| b.amplitude_m.total_cmp(&a.amplitude_m));
    found
}

/// Tones that were found before `closure_s`, with their frequencies as the whole record shows them.
///
/// The samples before the closure tell a frequency to `σ/A √(24/n)/2πT` (Rife & Boorstyn 1974), which is some turns over
/// a long record. Within four of these errors, the frequency is the one at which the record has most power, if a tone of
/// like amplitude is there. Hann's window keeps out what is slow, and the front.
pub(crate) fn sharpened(tones: &[Tone], noise_m: f64, closure_s: f64, time_s: &[f64], head_m: &[f64]) -> Vec<Tone> {
    let before = time_s.partition_point(|&t| t < closure_s);
    let (Some(first_s), Some(last_s)) = (time_s.first(), time_s.last()) else { return tones.to_vec() };
    let (lead_s, span_s) = (closure_s - first_s, last_s - first_s);
    // most records have no hum, and may be long
    if tones.is_empty() || before == 0 || span_s <= 0.0 {
        return tones.to_vec();
    }
    let seen = before.min(LONGEST_LEAD) as f64;
    let lead_s = lead_s * seen / before as f64;
    let mean_m = head_m.iter().sum::<f64>() / head_m.len() as f64;
    let window = |t: f64| (PI * (t - first_s) / span_s).sin().powi(2);
    let weight: f64 = time_s.iter().map(|&t| window(t)).sum();
    let sharp = |tone: &Tone| {
        let sd_hz = noise_m / tone.amplitude_m * (24.0 / seen).sqrt() / (TAU * lead_s);
        let half_hz = (4.0 * sd_hz).min(WITHIN_HZ);
        // turned back by the tone, the record is slow: means over a tenth of a turn hold what it has of the tone
        let mean_s = 0.1 / half_hz;
        let mut means = vec![(0.0, 0.0); (span_s / mean_s) as usize + 1];
        for (t, head) in time_s.iter().zip(head_m) {
            let (sin, cos) = (TAU * tone.hz * (t - first_s)).sin_cos();
            let own = &mut means[((t - first_s) / mean_s) as usize];
            let windowed_m = (head - mean_m) * window(*t);
            *own = (own.0 + windowed_m * cos, own.1 - windowed_m * sin);
        }
        let amplitude_m = |off_hz: f64| {
            let turned = means.iter().enumerate().map(|(i, (a, b))| {
                let (sin, cos) = (TAU * off_hz * mean_s * i as f64).sin_cos();
                (a * cos + b * sin, b * cos - a * sin)
            });
            let (a, b) = turned.fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
            2.0 * f64::hypot(a, b) / weight
        };
        let step_hz = 0.1 / span_s;
        let steps = (half_hz / step_hz).ceil() as i32;
        let near = (-steps..=steps).map(|k| step_hz * f64::from(k)).map(|off_hz| (amplitude_m(off_hz), off_hz));
        let strongest = near.max_by(|a, b| a.0.total_cmp(&b.0));
        // what is far larger or smaller is another thing, such as a harmonic of the surge
        let own = strongest.filter(|(there_m, _)| (0.5..2.0).contains(&(there_m / tone.amplitude_m)));
        Tone { hz: tone.hz + own.map_or(0.0, |(_, off_hz)| off_hz), ..*tone }
    };
    tones.iter().map(sharp).collect()
}

/// The frequency of the strongest tone in and around a band, in cycles a sample, where chance makes none of its power.
/// The power of noise at one frequency over the mean of that at `m` others is distributed as F(2, 2m): it exceeds `x`
/// with probability `(1 + x/m)^-m`.
fn strongest(spectrum: &Spectrum, samples: usize, [from, to]: [f64; 2]) -> Option<f64> {
    let resolution = 1.0 / samples as f64;
    let (from, to) = ((from - AROUND * resolution).max(resolution), (to + AROUND * resolution).min(0.5));
    let at = spectrum.peak_hz(from, to)?;
    let power = |a: f64| a * a;
    let inside = spectrum.points(to).filter(|(f, _)| *f >= from);
    let around: Vec<f64> = inside.filter(|(f, _)| (f - at).abs() > NEAR * resolution).map(|(_, a)| power(a)).collect();
    let others = around.len() as f64 * spectrum.step_hz / resolution;
    let mean = around.iter().sum::<f64>() / around.len().max(1) as f64;
    let peak = spectrum.amplitude.get((at / spectrum.step_hz).round() as usize).copied().map(power)?;
    (peak > mean * others * (NOT_BY_CHANCE / others).exp_m1()).then_some(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::testing::Gauss;

    fn record(seed: u64, tones: &[(f64, f64)]) -> Vec<f64> {
        let mut dice = Gauss::new(seed);
        let at = |i: usize| tones.iter().map(|(hz, m)| m * (TAU * hz * i as f64 * 1e-3 + 1.0).sin()).sum::<f64>();
        (0..1500).map(|i| at(i) + 0.1 * dice.next()).collect()
    }

    fn spread(samples: &[f64]) -> f64 {
        (samples.iter().map(|v| v * v).sum::<f64>() / samples.len() as f64).sqrt()
    }

    /// Two tones come out with frequency and amplitude, and the noise is left.
    #[test]
    fn the_mains_and_a_harmonic_are_found_and_taken_out() {
        let mut samples = record(1, &[(49.93, 0.6), (149.8, 0.2)]);
        let found = take_hum(&mut samples, 1e-3);
        let [first, second] = found[..] else { panic!("{found:?}") };
        // Rife & Boorstyn 1974: the least standard deviation is (σ/A) sqrt(24/N³)/2π cycles a sample, 0.0022 Hz
        // and 0.0067 Hz
        assert!((first.hz - 49.93).abs() < 0.01 && (first.amplitude_m - 0.6).abs() < 0.02, "{first:?}");
        assert!((second.hz - 149.8).abs() < 0.03 && (second.amplitude_m - 0.2).abs() < 0.02, "{second:?}");
        assert!((spread(&samples) / 0.1 - 1.0).abs() < 0.05, "{}", spread(&samples));
    }

    /// From 0.6 s before a surge that dies away: the whole record tells the frequency to a tenth of its own
    /// resolution.
    #[test]
    fn a_whole_record_sharpens_a_frequency() {
        let mut dice = Gauss::new(5);
        let time_s: Vec<f64> = (0..20_000).map(|i| 2e-3 * f64::from(i)).collect();
        let mut head_m: Vec<f64> = time_s.iter().map(|t| 0.2 * (TAU * 50.013 * t).sin() + 0.1 * dice.next()).collect();
        let mut before = head_m[..300].to_vec();
        let found = take_hum(&mut before, 2e-3);
        for (head, t) in head_m.iter_mut().zip(&time_s).filter(|(_, t)| **t > 0.6) {
            let surge_m = 50.0 * (-0.2 * (t - 0.6)).exp();
            *head += 80.0 + if (1.3 * (t - 0.6)).fract() < 0.5 { surge_m } else { -surge_m };
        }
        let sharp = sharpened(&found, 0.1, 0.6, &time_s, &head_m);
        let [(rough, fine)] = std::array::from_fn(|i| (found[i].hz - 50.013, sharp[i].hz - 50.013));
        assert!(found.len() == 1 && rough.abs() > 0.01, "{rough}");
        // a tenth of the record's resolution
        assert!(fine.abs() < 0.1 / 40.0, "{fine}");
    }

    /// Neither noise, white or coloured, nor a motor's tone, which is slower by its slip, is hum.
    #[test]
    fn nothing_else_is_hum() {
        for seed in 2..60 {
            assert_eq!(take_hum(&mut record(seed, &[]), 1e-3), []);
            let mut slow = 0.0;
            let mut coloured: Vec<f64> = record(seed, &[]);
            coloured.iter_mut().for_each(|v| {
                slow = 0.9 * slow + *v;
                *v = slow;
            });
            assert_eq!(take_hum(&mut coloured, 1e-3), []);
        }
        assert_eq!(take_hum(&mut record(2, &[(48.3, 0.6), (3.1, 2.0)]), 1e-3), []);
    }
}
