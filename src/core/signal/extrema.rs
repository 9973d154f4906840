//! Half cycles, their extrema, the period and the damping.

use crate::extent::ends;
use crate::signal::features::{Estimate, Extremum};
use crate::signal::trace::{Trace, moving_mean};

/// The alternation of the head about its own mean.
#[derive(Debug, Clone, Default)]
pub(crate) struct HalfCycles {
    /// Times of the crossings of the mean level that end the half cycles, s. The first half cycle is a peak.
    pub ends_s: Vec<f64>,
}

/// Share of the period over which the head is averaged before its crossings count: that takes out the third harmonic
/// and most of the higher ones, which echoes carry, and leaves one crossing each half cycle.
const AVERAGED: f64 = 1.0 / 3.0;

/// Splits a trace into half cycles from the start of the closure, by the crossings of its fundamental with the mean
/// over a whole period (which follows drift and decay). A crossing counts once the head has gone through a tenth of the
/// swing on both sides, so neither noise nor a plateau at the mean makes one.
pub(crate) fn half_cycles(trace: &Trace, start_s: f64, period_s: f64, sd_m: f64) -> HalfCycles {
    let start = trace.index(start_s);
    let period = (period_s / trace.step_s).round() as usize;
    if period < 4 || start + period >= trace.len() {
        return HalfCycles::default();
    }
    let after = &trace.head_m[start..];
    let half = period / 2;
    let mut middle = moving_mean(after, half);
    // where a whole period does not fit on both sides, take the nearest place where it does
    let last = after.len() - 1 - half;
    let (first_full, last_full) = (middle[half.min(last)], middle[last.max(half.min(last))]);
    middle[..half.min(last)].fill(first_full);
    middle[last.max(half.min(last))..].fill(last_full);
    let smooth = moving_mean(after, (0.5 * AVERAGED * period as f64) as usize);
    let light = moving_mean(after, (period / 100).min(50));
    // the head itself, where it crosses nearest to its fundamental, has the sharper crossing
    let sharpest = |at: f64, up: bool| {
        let sign = if up { 1.0 } else { -1.0 };
        let reach = period / 16;
        let near = (at as usize).saturating_sub(reach)..(at as usize + reach).min(after.len() - 1);
        let crossing = |i: usize| {
            let (a, b) = (sign * (light[i] - middle[i]), sign * (light[i + 1] - middle[i + 1]));
            (a > 0.0 && b <= 0.0).then(|| i as f64 + a / (a - b))
        };
        near.filter_map(crossing).min_by(|a, b| (a - at).abs().total_cmp(&(b - at).abs())).unwrap_or(at)
    };

    let swing = |from: usize, to: usize| {
        let (lo, hi) = ends((from..to.min(after.len())).map(|i| smooth[i] - middle[i]));
        hi - lo
    };
    let mut cycles = HalfCycles::default();
    let (mut up, mut left_at) = (true, None);
    let mut scale = 0.1 * swing(0, period);
    let mut seen = false;
    for i in 0..after.len() {
        let d = (smooth[i] - middle[i]) * if up { 1.0 } else { -1.0 };
        seen |= d > scale;
        if !seen {
            continue;
        }
        if d > 0.0 {
            left_at = None;
        } else if left_at.is_none() && i > 0 {
            let before = (smooth[i - 1] - middle[i - 1]) * if up { 1.0 } else { -1.0 };
            left_at = Some(i as f64 - if before > d { d / (d - before) } else { 0.0 });
        }
        if d < -scale
            && let Some(at) = left_at
        {
            cycles.ends_s.push(start_s.max(trace.start_s) + sharpest(at, up) * trace.step_s);
            up = !up;
            left_at = None;
            scale = 0.1 * swing(i, i + period);
            if scale < 0.8 * sd_m {
                break;
            }
        }
    }
    cycles
}

/// Period from crossings in the same direction, over at most six cycles, with its scatter among them.
pub(crate) fn period(cycles: &HalfCycles) -> Option<Estimate> {
    let spans: Vec<f64> = cycles.ends_s.windows(3).take(11).map(|w| w[2] - w[0]).collect();
    if spans.is_empty() {
        return None;
    }
    let n = spans.len() as f64;
    let value = spans.iter().sum::<f64>() / n;
    let variance = spans.iter().map(|s| (s - value).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let standard_error = if spans.len() > 1 { (variance / n).sqrt() } else { 0.02 * value };
    Some(Estimate { value, standard_error })
}

/// The highest or lowest head of each half cycle, smoothed over `half_width` samples on either side; none where samples
/// are missing.
pub(crate) fn extrema(trace: &Trace, cycles: &HalfCycles, start_s: f64, half_width: usize) -> Vec<Extremum> {
    let smooth = trace.smoothed(half_width);
    let mut found: Vec<Extremum> = Vec::new();
    let mut from = trace.index(start_s);
    for (k, end_s) in cycles.ends_s.iter().enumerate() {
        let to = trace.index(*end_s).max(from) + 1;
        let peak = k % 2 == 0;
        let better = |a: &usize, b: &usize| {
            let order = smooth[*a].total_cmp(&smooth[*b]);
            if peak { order } else { order.reverse() }
        };
        let range = from..to.min(trace.len());
        from = to;
        if !trace.intact(range.clone()) {
            continue; // the extremum may be what was lost
        }
        let Some(at) = range.max_by(better) else { break };
        found.push(Extremum { time_s: trace.time_s(at as f64), head_m: smooth[at], peak, cycle: k / 2 + 1 });
    }
    found
}

/// How many half cycles pass until an extremum stands out from the one before it by less than `resolution_m`.
pub(crate) fn resolved(extrema: &[Extremum], resolution_m: f64) -> usize {
    let near = extrema.windows(2).find(|w| (w[1].head_m - w[0].head_m).abs() < resolution_m);
    near.map_or(usize::MAX, |w| w[1].half_cycle())
}

/// Logarithmic decrement of the swing from peak to trough, cycle by cycle.
pub(crate) fn damping(extrema: &[Extremum]) -> Vec<f64> {
    let swing = |cycle: usize| {
        let head = |peak| extrema.iter().find(|e| e.cycle == cycle && e.peak == peak).map(|e| e.head_m);
        Some(head(true)? - head(false)?).filter(|s| *s > 0.0)
    };
    let last = extrema.last().map_or(0, |e| e.cycle);
    (1..last).map_while(|c| Some((swing(c)? / swing(c + 1)?).ln())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn decaying(period: f64, decrement: f64) -> Trace {
        let time: Vec<f64> = (0..6000).map(|i| i as f64 * 0.001).collect();
        let head: Vec<f64> = time
            .iter()
            .map(|t| {
                if *t < 1.0 {
                    40.0
                } else {
                    40.0 + 20.0 * (-(t - 1.0) / period * decrement).exp() * (TAU * (t - 1.0) / period).sin()
                }
            })
            .collect();
        Trace::new(&time, &head).unwrap()
    }

    #[test]
    fn a_decaying_oscillation_gives_period_damping_and_extrema() {
        let trace = decaying(0.4, 0.2);
        let cycles = half_cycles(&trace, 1.0, 0.42, 1e-3);
        let period = period(&cycles).unwrap();
        assert!((period.value - 0.4).abs() < 0.002, "{period:?}");
        let extrema = extrema(&trace, &cycles, 1.0, 2);
        assert!(
            extrema.len() > 12
                && extrema.iter().enumerate().all(|(i, e)| e.peak == (i % 2 == 0) && e.cycle == i / 2 + 1)
        );
        assert!((extrema[0].time_s - 1.1).abs() < 0.01);
        let damping = damping(&extrema);
        assert!(damping.len() >= 5 && damping.iter().all(|d| (d - 0.2).abs() < 0.01), "{damping:?}");
    }

    #[test]
    fn a_record_shorter_than_a_period_has_none() {
        let trace = decaying(8.0, 0.2);
        assert!(half_cycles(&trace, 1.0, 8.0, 1e-3).ends_s.is_empty());
        assert!(period(&HalfCycles::default()).is_none());
    }
}
