//! Noise of a sensor: its size, its colour, and the resolution of its converter.

use std::borrow::Cow;

use crate::golden::least_between;
use crate::robust::{MEDIAN_TO_SD, NOT_BY_CHANCE, median};
use crate::signal::coloured::log_likelihood;
use crate::signal::hum::{LONGEST_LEAD, Tone, take_hum};
use crate::signal::interpolated::{Corners, corners};
use crate::signal::sine::{Sine, detrended};
use crate::signal::spectrum::Spectrum;

/// Disturbance of a pressure sensor before the closure; heads in m.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Standard deviation of the white part, from second differences (slow disturbances cancel), m.
    pub white_sd_m: f64,
    /// Standard deviation about a straight line before the closure, m; that of the white part if there is no quiet
    /// lead-in.
    pub total_sd_m: f64,
    /// Autocorrelation at a lag of one sample before the closure; 0 without a quiet lead-in.
    pub lag1_autocorrelation: f64,
    /// Independent samples per recorded one (n_eff / n): 1 for white noise, less for coloured noise.
    pub effective_fraction: f64,
    /// Resolution of the converter, m, if the samples fall on a grid.
    pub quantum_m: Option<f64>,
    /// The noise is significantly coloured (three standard deviations beyond white noise).
    pub coloured: bool,
    /// What the wiring picks up of the mains, the strongest tone first.
    pub hum: Vec<Tone>,
    /// Standard deviations of the white part and about a straight line without the hum, m.
    pub without_hum_m: [f64; 2],
    /// Lasting oscillations in the rest, the strongest first: not sensor noise, but something in the pipe.
    pub lines: Vec<Tone>,
    /// Standard deviations as `without_hum_m`, without these too, m.
    pub without_tones_m: [f64; 2],
    /// The points between which the record was interpolated, if it was: its noise is theirs.
    pub corners: Option<Corners>,
}

/// Most lasting oscillations that are looked for: a pump's rotation, its blades, and their harmonics.
const MOST_LINES: usize = 6;
/// A shorter lead-in tells nothing about spread or colour.
const SHORTEST_LEAD: usize = 30;

/// If the rms of the second differences exceeds their median estimate by this factor, the noise has spikes.
const SPIKY: f64 = 1.5;
/// A sample this many standard deviations from the median of its five neighbours is a spike.
const SPIKE: f64 = 8.0;

/// Noise from the samples before the closure (`lead`), `interval_s` apart, or from the whole record if they are too
/// few.
pub(crate) fn noise(lead: &[f64], whole: &[f64], interval_s: f64) -> Noise {
    let quantum_m = quantum(whole);
    let floor = quantum_m.map_or(0.0, |q| q / 12f64.sqrt());
    let corners = corners(whole, quantum_m);
    if let Some(corners) = corners {
        let white = corners.sd_m.max(floor);
        return Noise {
            white_sd_m: white,
            total_sd_m: white,
            lag1_autocorrelation: 1.0 - corners.share,
            effective_fraction: corners.share,
            quantum_m,
            coloured: true,
            hum: Vec::new(),
            without_hum_m: [white; 2],
            lines: Vec::new(),
            without_tones_m: [white; 2],
            corners: Some(corners),
        };
    }
    if lead.len() < SHORTEST_LEAD {
        let white = white_sd_of_whole(whole).max(floor);
        return Noise {
            white_sd_m: white,
            total_sd_m: white,
            lag1_autocorrelation: 0.0,
            effective_fraction: 1.0,
            quantum_m,
            coloured: false,
            hum: Vec::new(),
            without_hum_m: [white; 2],
            lines: Vec::new(),
            without_tones_m: [white; 2],
            corners,
        };
    }
    let lead = &lead[lead.len().saturating_sub(LONGEST_LEAD)..];
    let white_sd_m = white_sd(lead).0.max(floor);
    let residual = detrended(&despiked(lead));
    let n = residual.len() as f64;
    let total_sd_m = spread(&residual).max(floor);
    let correlation = autocorrelation(&residual);
    let lag1_autocorrelation = correlation(1);
    let coloured = lag1_autocorrelation.abs() > 3.0 / n.sqrt();
    // initial positive sequence: stop the sum where the correlation drowns in its own scatter
    let mut sum = 0.0;
    for lag in 1..residual.len().min(400) {
        let rho = correlation(lag);
        if rho < 2.0 / n.sqrt() {
            break;
        }
        sum += rho * (1.0 - lag as f64 / n);
    }
    let mut rest = residual.clone();
    let hum = take_hum(&mut rest, interval_s);
    let without = |rest: &[f64]| [white_sd(rest).0.max(floor), spread(rest).max(floor)];
    let without_hum_m = if hum.is_empty() { [white_sd_m, total_sd_m] } else { without(&rest) };
    let lines = take_lines(&mut rest, interval_s);
    let without_tones_m = if lines.is_empty() { without_hum_m } else { without(&rest) };
    Noise {
        hum,
        without_hum_m,
        lines,
        without_tones_m,
        corners,
        white_sd_m,
        total_sd_m,
        lag1_autocorrelation,
        effective_fraction: 1.0 / (1.0 + 2.0 * sum),
        quantum_m,
        coloured,
    }
}

/// Standard deviation about a straight line that was taken off.
fn spread(residual: &[f64]) -> f64 {
    let energy: f64 = residual.iter().map(|r| r * r).sum();
    robust((energy / (residual.len() as f64 - 2.0)).sqrt(), residual, MEDIAN_TO_SD).0
}

/// Autocorrelation, by its lag.
fn autocorrelation(residual: &[f64]) -> impl Fn(usize) -> f64 {
    let energy: f64 = residual.iter().map(|r| r * r).sum();
    move |lag| residual.iter().zip(&residual[lag..]).map(|(a, b)| a * b).sum::<f64>() / energy.max(f64::MIN_POSITIVE)
}

/// The lasting oscillations of a disturbance, which are taken out of it. One is there where coloured noise and a tone
/// are more probable than coloured noise alone: the tone has three numbers, of which the frequency is the best of half
/// as many as there are samples.
fn take_lines(rest: &mut Vec<f64>, interval_s: f64) -> Vec<Tone> {
    let mut found = Vec::new();
    let mut likelihood = log_likelihood(rest);
    while found.len() < MOST_LINES {
        let Some((tone, left)) = strongest(rest, interval_s) else { break };
        let without = log_likelihood(&left);
        if without - likelihood < NOT_BY_CHANCE + (0.5 * rest.len() as f64).ln() {
            break;
        }
        (*rest, likelihood) = (left, without);
        found.push(tone);
    }
    found.sort_by(|a, b| b.amplitude_m.total_cmp(&a.amplitude_m));
    found
}

/// The strongest tone of a disturbance, of a cycle or more, and what it leaves.
fn strongest(rest: &[f64], interval_s: f64) -> Option<(Tone, Vec<f64>)> {
    let number: Vec<f64> = (0..rest.len()).map(|i| i as f64).collect();
    let resolution = 1.0 / rest.len() as f64;
    let at = Spectrum::of(&number, rest)?.peak_hz(resolution, 0.5)?;
    let left = |cycles: f64| {
        let (sine, mut left) = (Sine::of(rest, cycles), rest.to_vec());
        sine.take(&mut left);
        (sine, left)
    };
    let square = |cycles: f64| left(cycles).1.iter().map(|v| v * v).sum();
    // Half a cycle or less is not told from a straight line that was taken off.
    let (low, high) = ((at - resolution).max(0.75 * resolution), (at + resolution).min(0.5));
    let (sine, left) = left(least_between(square, low, high));
    Some((Tone { hz: sine.cycles_per_sample / interval_s, amplitude_m: sine.amplitude() }, left))
}

/// Root mean square, or the median estimate if the values have spikes; the second value says whether they have.
fn robust(rms: f64, values: &[f64], median_to_sd: f64) -> (f64, bool) {
    let by_median = median_to_sd * median(&mut values.iter().map(|v| v.abs()).collect::<Vec<_>>());
    if by_median > 0.0 && rms > SPIKY * by_median { (by_median, true) } else { (rms, false) }
}

/// Standard deviation of the white noise of a lead-in without its spikes, and whether it has spikes.
fn white_sd(lead: &[f64]) -> (f64, bool) {
    let second: Vec<f64> = lead.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).collect();
    let mean_square = second.iter().map(|d| d * d).sum::<f64>() / (6.0 * second.len().max(1) as f64);
    robust(mean_square.sqrt(), &second, MEDIAN_TO_SD / 6f64.sqrt())
}

/// A lead-in with each spike replaced by the median of its neighbours.
pub(crate) fn despiked(lead: &[f64]) -> Cow<'_, [f64]> {
    let (sd, spiky) = white_sd(lead);
    if !spiky {
        return Cow::Borrowed(lead);
    }
    let clean = |(i, v): (usize, &f64)| {
        let around = median(&mut lead[i.saturating_sub(2)..(i + 3).min(lead.len())].to_vec());
        if (v - around).abs() > SPIKE * sd { around } else { *v }
    };
    Cow::Owned(lead.iter().enumerate().map(clean).collect())
}

/// Standard deviation of the white noise of a whole record, m. Fronts are few, so the median of the differences ignores
/// them.
pub(crate) fn white_sd_of_whole(whole: &[f64]) -> f64 {
    let mut second: Vec<f64> = whole.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    let mut middle = median(&mut second);
    if middle == 0.0 {
        // the converter's resolution hides most of the noise; what is left to see is one step
        middle = second.iter().copied().filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min) / MEDIAN_TO_SD;
    }
    if middle.is_finite() { MEDIAN_TO_SD * middle / 6f64.sqrt() } else { 0.0 }
}

/// The step of the grid on which the samples lie, if they do: most differences of neighbouring levels are whole
/// multiples of it.
fn quantum(values: &[f64]) -> Option<f64> {
    let mut levels: Vec<f64> = values.iter().copied().take(8192).collect();
    levels.sort_unstable_by(f64::total_cmp);
    let span = levels.last()? - levels.first()?;
    // printed decimals scatter equal levels a little
    let same = (1e-9 * levels.first()?.abs().max(span)).max(1e-7);
    let mut gaps: Vec<f64> = levels.windows(2).map(|w| w[1] - w[0]).filter(|g| *g > same).collect();
    if gaps.len() < 3 || levels.len() < 4 * gaps.len() / 3 {
        return None; // hardly any level comes twice: no grid to be seen
    }
    gaps.sort_unstable_by(f64::total_cmp);
    let smallest = gaps[gaps.len() / 20];
    let singles: Vec<f64> = gaps.iter().copied().filter(|g| (g / smallest - 1.0).abs() < 0.3).collect();
    let step = singles.iter().sum::<f64>() / singles.len() as f64;
    let whole = |g: &&f64| ((*g / step) - (*g / step).round()).abs() < 0.1;
    let on_grid = gaps.iter().filter(|g| **g < 8.0 * step).filter(whole).count();
    let near = gaps.iter().filter(|g| **g < 8.0 * step).count();
    (on_grid as f64 > 0.9 * near as f64).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::testing::Gauss;

    #[test]
    fn white_noise_is_white_and_of_its_size() {
        let mut gauss = Gauss::new(1);
        let lead: Vec<f64> = (0..4000).map(|_| 50.0 + 0.03 * gauss.next()).collect();
        let noise = noise(&lead, &lead, 1e-3);
        assert!((noise.white_sd_m / 0.03 - 1.0).abs() < 0.05, "{noise:?}");
        assert!((noise.total_sd_m / 0.03 - 1.0).abs() < 0.05);
        assert!(!noise.coloured && noise.effective_fraction > 0.9 && noise.quantum_m.is_none());
    }

    /// One dropout of a logger that writes -99999 kPa, and two samples of a switching valve.
    #[test]
    fn spikes_do_not_count_as_noise() {
        let mut gauss = Gauss::new(5);
        let mut lead: Vec<f64> = (0..2000).map(|_| 50.0 + 0.03 * gauss.next()).collect();
        let clean = noise(&lead, &lead, 1e-3);
        assert!(matches!(despiked(&lead), Cow::Borrowed(_)));
        lead[700] = -10_200.0;
        lead[1500] += 40.0;
        lead[1501] += 35.0;
        let found = noise(&lead, &lead, 1e-3);
        assert!((found.white_sd_m / clean.white_sd_m - 1.0).abs() < 0.1, "{found:?}");
        assert!((found.total_sd_m / clean.total_sd_m - 1.0).abs() < 0.1, "{found:?}");
        assert!(!found.coloured && found.effective_fraction > 0.9, "{found:?}");
        let mean = despiked(&lead).iter().sum::<f64>() / 2000.0;
        assert!((mean - 50.0).abs() < 0.01, "{mean}");
    }

    #[test]
    fn coloured_noise_counts_for_less() {
        let mut gauss = Gauss::new(2);
        let mut state = 0.0;
        let lead: Vec<f64> = (0..8000)
            .map(|_| {
                state = 0.9 * state + gauss.next();
                0.02 * state
            })
            .collect();
        let noise = noise(&lead, &lead, 1e-3);
        assert!(noise.coloured && (noise.lag1_autocorrelation - 0.9).abs() < 0.03, "{noise:?}");
        // a first-order process has n_eff/n = (1 - phi)/(1 + phi)
        assert!((noise.effective_fraction - 0.1 / 1.9).abs() < 0.02, "{noise:?}");
    }

    #[test]
    fn the_converter_step_is_found() {
        let mut gauss = Gauss::new(3);
        let step = 0.0031;
        let lead: Vec<f64> = (0..3000).map(|_| ((40.0 + 0.02 * gauss.next()) / step).round() * step).collect();
        let found = noise(&lead, &lead, 1e-3).quantum_m.unwrap();
        assert!((found / step - 1.0).abs() < 1e-3, "{found}");
        let constant = noise(&[7.0; 100], &[7.0; 100], 1e-3);
        assert_eq!((constant.white_sd_m, constant.quantum_m), (0.0, None));
    }

    #[test]
    fn without_a_lead_in_the_fronts_do_not_count() {
        let mut gauss = Gauss::new(4);
        let whole: Vec<f64> =
            (0..12_000).map(|i| if (i / 100) % 2 == 0 { 30.0 } else { 60.0 } + 0.05 * gauss.next()).collect();
        let noise = noise(&[], &whole, 1e-3);
        assert!((noise.white_sd_m / 0.05 - 1.0).abs() < 0.1, "{noise:?}");
    }

    /// A slow supply swings once or twice before the closure. Noise that forgets itself in a third of that time, or
    /// never, swings too, but not as a sine.
    #[test]
    fn a_tone_of_few_cycles_is_told_from_slow_noise() {
        for seed in 1..40 {
            let mut gauss = Gauss::new(seed);
            let tone = |i: i32| 0.7 * (std::f64::consts::TAU * 1.7 * f64::from(i) * 1e-3 + 0.1 * seed as f64).sin();
            let lead: Vec<f64> = (0..850).map(|i| 40.0 + tone(i) + 0.1 * gauss.next()).collect();
            let found = noise(&lead, &lead, 1e-3);
            // Rife & Boorstyn 1974: the least standard deviation of a tone alone is 0.004 Hz; the straight line beside it
            // makes it larger.
            assert!((found.lines[0].hz - 1.7).abs() < 0.1, "{:?}", found.lines);
            assert!((found.without_tones_m[1] / 0.1 - 1.0).abs() < 0.1, "{found:?}");
            for kept in [1.0, (-3.0 / 850f64).exp()] {
                let mut slow = 0.0;
                let mut next = || {
                    slow = kept * slow + 0.03 * gauss.next();
                    40.0 + slow + 0.1 * gauss.next()
                };
                let lead: Vec<f64> = (0..850).map(|_| next()).collect();
                assert_eq!(noise(&lead, &lead, 1e-3).lines, []);
            }
        }
    }

    /// First-order noise forgets itself; a pump's ripple does not.
    #[test]
    fn an_oscillation_is_no_coloured_noise() {
        let mut random = fastrand::Rng::with_seed(3);
        let (mut slow, mut lead, mut ripple) = (0.0, Vec::new(), Vec::new());
        for i in 0..2000 {
            let white = random.f64() - 0.5;
            slow = 0.95 * slow + white;
            lead.push(slow + 0.3 * white);
            ripple.push(3.0 * (f64::from(i) * 0.06).sin() + white);
        }
        assert!(noise(&lead, &lead, 1e-3).lines.is_empty() && noise(&lead, &lead, 1e-3).coloured);
        let line = noise(&ripple, &ripple, 1e-3).lines[0];
        assert!((line.hz * 1e-3 * std::f64::consts::TAU - 0.06).abs() < 1e-4, "{line:?}");
        assert!((line.amplitude_m - 3.0).abs() < 0.05, "{line:?}");
    }
}
