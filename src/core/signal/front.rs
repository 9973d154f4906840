//! The first pressure front: where the head leaves its steady level, how long it rises, and when it has fallen back
//! half way.

use std::ops::Range;

use crate::robust::median;
use crate::signal::period::repeats;
use crate::signal::project::{Projector, profile_minimum};
use crate::signal::trace::{Trace, mean, moving_mean};

/// The first rise at one sensor and the fall after it. Indices count grid points and may be fractional.
#[derive(Debug, Clone)]
pub(crate) struct Front {
    /// Index at which the extrapolated flank meets the level before it.
    pub onset: f64,
    /// Rise time of the extrapolated flank from the level before it to the top, in grid points.
    pub rise: f64,
    /// Head just before the front, m.
    pub base_m: f64,
    /// Highest head of the first peak, m.
    pub top_m: f64,
    /// Index of the top.
    pub top: f64,
    /// Index at which the head has fallen half way from the top to the base, or to the next trough where that lies
    /// higher.
    pub half_fall: f64,
    /// Range of grid points before the front in which nothing happens.
    pub quiet: Range<usize>,
}

/// Why a sensor shows no front.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoFront {
    /// The head stays within its noise.
    Quiet,
    /// The head rises, but the record ends before it falls back.
    NoReturn,
}

impl Front {
    /// Height from base to top, m.
    pub fn height_m(&self) -> f64 {
        self.top_m - self.base_m
    }

    /// End of the rise: the bend of two straight lines fitted to the upper part of the flank and to the plateau, which
    /// ends `back` grid points later when the front returns. The extrapolated flank would end elsewhere if the valve
    /// closes in two stages.
    pub fn knee(&self, trace: &Trace, back: f64) -> f64 {
        self.upper_bend(trace, self.onset + (0.97 * back).min(2.5 * self.rise)).unwrap_or(self.onset + self.rise)
    }

    fn upper_bend(&self, trace: &Trace, until: f64) -> Option<f64> {
        let from = self.rises_through(trace, self.base_m + 0.6 * self.height_m())?.ceil() as usize;
        let to = (until.max(0.0) as usize).min(trace.len());
        if to < from + 8 || !trace.intact(from..to) {
            return None;
        }
        let head = &trace.head_m[from..to];
        let left_over = |knee: usize| {
            let after = |i: usize| i.saturating_sub(knee) as f64;
            let columns = vec![
                vec![1.0; head.len()],
                (0..head.len()).map(|i| i as f64).collect(),
                (0..head.len()).map(after).collect(),
            ];
            Projector::new(columns).map_or(f64::INFINITY, |p| p.residual(head, 2).all)
        };
        let sums: Vec<f64> = (1..head.len() - 2).map(left_over).collect();
        let lowest = (0..sums.len()).min_by(|&a, &b| sums[a].total_cmp(&sums[b]))?;
        Some((from + 1) as f64 + profile_minimum(&sums, lowest, f64::INFINITY).0)
    }

    /// First index at or after the onset where the head passes `level_m` upwards.
    pub fn rises_through(&self, trace: &Trace, level_m: f64) -> Option<f64> {
        let from = (self.onset - 0.3 * self.rise - 2.0).max(0.0) as usize;
        crossing(&trace.head_m, from, level_m, true)
    }

    /// First index after the rise where the head passes `level_m` downwards.
    pub fn falls_through(&self, trace: &Trace, level_m: f64) -> Option<f64> {
        let from = self.rises_through(trace, self.base_m + 0.8 * self.height_m())?;
        crossing(&trace.head_m, from as usize + 1, level_m, false)
    }
}

/// A swing below a millimetre of head is not a closure, however quiet the sensor.
const SMALLEST_M: f64 = 1e-3;

/// First crossing of a level from index `from` on, by linear interpolation between grid points.
pub(crate) fn crossing(head_m: &[f64], from: usize, level_m: f64, upwards: bool) -> Option<f64> {
    let sign = if upwards { 1.0 } else { -1.0 };
    let start = from.min(head_m.len());
    head_m[start..].windows(2).enumerate().find_map(|(i, w)| {
        let (a, b) = (sign * (w[0] - level_m), sign * (w[1] - level_m));
        (a < 0.0 && b >= 0.0).then(|| (start + i) as f64 - a / (b - a))
    })
}

/// Median of five: a solenoid valve leaves spikes of a sample or two when it switches, which are not fronts.
fn despiked(head_m: &[f64]) -> Vec<f64> {
    let mut out = head_m.to_vec();
    for (i, five) in head_m.windows(5).enumerate() {
        let mut five = [five[0], five[1], five[2], five[3], five[4]];
        five.sort_unstable_by(f64::total_cmp);
        out[i + 2] = five[2];
    }
    out
}

/// Finds the first front. It starts from the swing of the whole record, so neither the length of the lead-in nor its
/// drift matters: the first place where the head has risen a fifth of the swing above its lowest value so far belongs
/// to the front.
pub(crate) fn find(trace: &Trace, white_sd_m: f64) -> Result<Front, NoFront> {
    let clean = despiked(&trace.head_m);
    let swing = {
        let mut heads = moving_mean(&clean, 1);
        let (count, cut) = (heads.len(), heads.len() / 2000);
        let highest = *heads.select_nth_unstable_by(count - 1 - cut, f64::total_cmp).1;
        highest - *heads.select_nth_unstable_by(cut, f64::total_cmp).1
    };
    if swing.is_nan() || swing <= (8.0 * white_sd_m).max(SMALLEST_M) {
        return Err(NoFront::Quiet);
    }
    // smooth until noise is a sixtieth of the swing, or noise would end a slow rise early
    let half = (0.5 * (60.0 * white_sd_m / swing).powi(2)).clamp(1.0, 50.0) as usize;
    let head = moving_mean(&clean, half);
    let mut lowest = f64::INFINITY;
    let high = head.iter().position(|&h| {
        lowest = lowest.min(h);
        h - lowest > 0.2 * swing
    });
    let high = high.ok_or(NoFront::Quiet)?;

    // the level before the front, from samples ever closer to it
    let mut base = head[..high].iter().copied().fold(f64::INFINITY, f64::min);
    let mut start = 0;
    for _ in 0..4 {
        let limit = base + (0.08 * (head[high] - base)).max(2.0 * white_sd_m);
        start = head[..high].iter().rposition(|&h| h <= limit).unwrap_or(0);
        let reach = 2 * (high - start) + 10;
        let from = start.saturating_sub(reach).max(trace.unbroken_from(start));
        // clear of the bend; a record that begins with the closure has only its first sample
        let end = start.saturating_sub((high - start) / 3);
        base = if end < from + 3 { head[from] } else { median(&mut head[from..end].to_vec()) };
    }
    let (top_at, fallen) = fall(&head, high, base).ok_or(NoFront::NoReturn)?;
    let top = head[top_at];
    let height = top - base;
    if height < 0.15 * swing {
        return Err(NoFront::Quiet); // a drift: the level before it follows right behind
    }

    // 10 % to 60 %: above that, the slow rise of the plateau by friction would count as part of the front
    let level = |part: f64| crossing(&head, start, base + part * height, true);
    let (Some(low), Some(upper)) = (level(0.1), level(0.6)) else { return Err(NoFront::Quiet) };
    let rise = ((upper - low) / 0.5).max(1.0);
    let onset = (low - 0.1 * rise).max(0.0);
    let end = ((onset - 0.2 * rise - 2.0).max(0.0)) as usize;
    let quiet = trace.unbroken_from(end)..end;
    let lead = &head[quiet.clone()];
    let level = mean(lead);
    let spread = (lead.iter().map(|h| (h - level).powi(2)).sum::<f64>() / lead.len().max(1) as f64).sqrt();
    let worth = if lead.len() >= 30 { height > 5.0 * spread } else { height > 8.0 * white_sd_m };
    if !worth {
        return Err(NoFront::Quiet);
    }
    Ok(Front { onset, rise, base_m: base, top_m: top, top: top_at as f64, half_fall: fallen as f64, quiet })
}

/// The top of the first peak and where the head has fallen from it by half. A closure that lasts long raises the head
/// to the supply's for good, and leaves but a small oscillation about it: its trough does not come half way down to the
/// base.
fn fall(head: &[f64], from: usize, base_m: f64) -> Option<(usize, usize)> {
    let mut top = from;
    for (i, &h) in head.iter().enumerate().skip(from) {
        if h > head[top] {
            top = i;
        }
        if h < base_m + 0.5 * (head[top] - base_m) {
            return Some((top, i));
        }
    }
    let period = repeats(&head[from..])?.period as usize;
    let next = |i: usize| &head[i..(i + period).min(head.len())];
    let top = (from..head.len()).find(|&i| next(i).iter().all(|&h| h <= head[i]))?;
    let trough_m = next(top).iter().copied().fold(f64::INFINITY, f64::min);
    let fallen = next(top).iter().position(|&h| h < 0.5 * (head[top] + trough_m))?;
    Some((top, top + fallen))
}
