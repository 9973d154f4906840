//! The period of an oscillation from all of a record at once: the delay after which the head repeats itself.
//!
//! Crossings and extrema mistake the echoes of a leak, a joint or a branch for cycles; these echoes come back with
//! every cycle, so the whole record still repeats itself after the period, and after nothing less. And since a pipe
//! that is shut at one end has odd harmonics only, it is its own mirror image after half of it. So a period is judged
//! by the autocorrelation there less that at half of it, each normalised by the energy of what it compares: an
//! oscillation that decays by a factor `exp(-δ)` a cycle repeats itself with `1/cosh δ`. What moves slowly under it (a
//! valve that still closes, creep, a drift) hides the repetition. It is taken out at ever shorter scales until the
//! record repeats itself.

use realfft::RealFftPlanner;

use crate::signal::trace::{mean, moving_mean};

/// A record repeats itself where it is judged by more than this: a decay to a sixth a cycle still does. Chosen.
const REPEATS: f64 = 0.3;
/// Delays that are judged by this share of the best one are as good: the shortest of them is the period, the others are
/// multiples of it. Chosen.
const AS_GOOD: f64 = 0.9;
/// Below this share of the best one a peak has ended. Chosen.
const PEAK_ENDS: f64 = 0.5;
/// Of the scales, the longest counts that is judged by this share of the best one: at shorter ones only echoes may be
/// left. Chosen.
const GOOD_ENOUGH: f64 = 0.6;
/// Periods that differ by a smaller share are the same one. Chosen.
const SAME: f64 = 0.1;
/// Fewest samples of a period.
const FEWEST: usize = 4;
/// Most points that are looked at: a window around a closure holds no more than 400 periods, so that each keeps 40.
/// More only cost time.
const MOST_POINTS: usize = 1 << 14;
/// What is slow is a moving mean over a half, a quarter … of the record. Chosen: 1/64 is still a period where there are
/// as many.
const SCALES: [usize; 6] = [2, 4, 8, 16, 32, 64];

/// How a record repeats itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Repeats {
    /// After how many samples.
    pub period: f64,
    /// Logarithmic decrement a period that would leave as much correlation; noise adds to it.
    pub decrement: f64,
    /// Half the correlation after the period less that after half of it.
    likeness: f64,
}

/// The period of an oscillating record; none where it does not hold two periods, or does not repeat itself.
pub(crate) fn repeats(head_m: &[f64]) -> Option<Repeats> {
    let factor = head_m.len().div_ceil(MOST_POINTS).max(1);
    let points: Vec<f64> = head_m.chunks_exact(factor).map(mean).collect();
    let scaled = |scale: &usize| {
        let window = points.len() / scale;
        let slow = moving_mean(&points, window / 2);
        let x: Vec<f64> = points.iter().zip(slow).map(|(v, slow)| v - slow).collect();
        // a shorter mean takes out the oscillation itself and leaves its fronts
        repetition(&x).filter(|r| r.period <= window as f64)
    };
    let whole = repetition(&without_line(&points));
    let found: Vec<Repeats> = whole.into_iter().chain(SCALES.iter().filter_map(scaled)).collect();
    let best = found.iter().map(|r| r.likeness).fold(0.0, f64::max);
    let longest = *found.iter().find(|r| r.likeness >= GOOD_ENOUGH * best)?;
    let same = found.into_iter().filter(|r| (r.period / longest.period - 1.0).abs() < SAME);
    let clearest = same.max_by(|a, b| a.likeness.total_cmp(&b.likeness))?;
    Some(Repeats { period: clearest.period * factor as f64, ..clearest })
}

/// The same of a record without a trend.
fn repetition(x: &[f64]) -> Option<Repeats> {
    let correlation = autocorrelation(x)?;
    let likeness: Vec<f64> =
        (0..correlation.len()).map(|lag| 0.5 * (correlation[lag] - correlation[lag / 2])).collect();
    let best = likeness.iter().copied().fold(0.0, f64::max);
    if best < REPEATS {
        return None;
    }
    let rises = likeness.iter().position(|l| *l >= AS_GOOD * best)?;
    let ends = (rises..likeness.len()).find(|&lag| likeness[lag] < PEAK_ENDS * best)?;
    let at = (rises..ends).max_by(|a, b| correlation[*a].total_cmp(&correlation[*b]))?;
    let (a, b, c) = (*correlation.get(at.checked_sub(1)?)?, correlation[at], *correlation.get(at + 1)?);
    let aside = 0.5 * (a - c) / (a - 2.0 * b + c);
    let period = at as f64 + if aside.abs() <= 1.0 { aside } else { 0.0 };
    let decrement = (1.0 / b.clamp(REPEATS, 1.0)).acosh();
    (at >= FEWEST).then_some(Repeats { period, decrement, likeness: likeness[at] })
}

/// The values less the straight line through them.
fn without_line(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let (middle, mean) = (0.5 * (n - 1.0), mean(values));
    let along = values.iter().enumerate().map(|(i, v)| (i as f64 - middle) * (v - mean)).sum::<f64>();
    let slope = along / (n * (n * n - 1.0) / 12.0).max(1.0);
    values.iter().enumerate().map(|(i, v)| v - mean - slope * (i as f64 - middle)).collect()
}

/// Correlation of the values with themselves at delays of 0, 1, … up to half their number.
fn autocorrelation(x: &[f64]) -> Option<Vec<f64>> {
    let n = x.len();
    let mut padded = x.to_vec();
    padded.resize((2 * n).next_power_of_two(), 0.0);
    let mut planner = RealFftPlanner::<f64>::new();
    let forward = planner.plan_fft_forward(padded.len());
    let mut bins = forward.make_output_vec();
    forward.process(&mut padded, &mut bins).ok()?;
    bins.iter_mut().for_each(|b| *b = (*b * b.conj()) / padded.len() as f64);
    planner.plan_fft_inverse(padded.len()).process(&mut bins, &mut padded).ok()?;
    let mut energy = vec![0.0];
    energy.extend(x.iter().scan(0.0, |sum, v| {
        *sum += v * v;
        Some(*sum)
    }));
    let of = |lag: usize| 2.0 * padded[lag] / (energy[n - lag] + energy[n] - energy[lag]).max(f64::MIN_POSITIVE);
    Some((0..=n / 2).map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::testing::Gauss;
    use std::f64::consts::TAU;

    /// Odd harmonics of a period of 300 samples, each with its own amplitude, that decay by `decrement` a cycle.
    fn wave(amplitudes: &[f64], decrement: f64, noise: f64) -> Vec<f64> {
        let mut gauss = Gauss::new(11);
        let at = |t: f64| {
            let harmonic = |(k, a): (usize, &f64)| a * ((2 * k + 1) as f64 * TAU * t / 300.0).sin();
            (-decrement * t / 300.0).exp() * amplitudes.iter().enumerate().map(harmonic).sum::<f64>()
        };
        (0..4000).map(|i| 7.0 + 1e-4 * f64::from(i) + at(f64::from(i)) + noise * gauss.next()).collect()
    }

    #[test]
    fn the_period_is_that_of_the_fundamental_whatever_lies_over_it() {
        let square = [1.0, 1.0 / 3.0, 0.2, 1.0 / 7.0];
        for (amplitudes, decrement, noise) in [
            (&square[..], 0.0, 0.0),
            (&square, 0.8, 0.02),
            (&square, 0.1, 0.3),
            (&[1.0, 0.0, 0.8, 0.0, 0.5], 0.4, 0.05),
            (&[0.4, 1.0], 0.2, 0.02),
        ] {
            let found = repeats(&wave(amplitudes, decrement, noise)).unwrap();
            assert!((found.period / 300.0 - 1.0).abs() < 0.01, "{amplitudes:?} {decrement} {noise}: {found:?}");
            assert!(noise > 0.1 || (found.decrement - decrement).abs() < 0.12, "{decrement}: {found:?}");
        }
    }

    #[test]
    fn a_head_that_still_rises_repeats_itself_on_its_way() {
        let rising = |i: usize| 30.0 * (1.0 - (-(i as f64) / 1500.0).exp());
        let head: Vec<f64> = wave(&[1.0, 0.1], 0.0, 0.1).iter().enumerate().map(|(i, v)| v + rising(i)).collect();
        assert!((repeats(&head).unwrap().period / 300.0 - 1.0).abs() < 0.01, "{:?}", repeats(&head));
    }

    #[test]
    fn what_does_not_repeat_itself_has_no_period() {
        let noise = wave(&[0.0], 0.0, 1.0);
        let creeping: Vec<f64> = (0..4000).map(|i| (-f64::from(i) / 900.0).exp()).collect();
        let short = &wave(&[1.0], 0.0, 0.0)[..500];
        for head in [&noise[..], &creeping, short, &[1.0; 400], &[], &[3.0]] {
            assert_eq!(repeats(head), None, "{} samples", head.len());
        }
    }
}
