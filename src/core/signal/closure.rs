//! When the valve closed, as the record shows it.

use crate::extent::ends;
use crate::recording::Recording;
use crate::rig::SensorKind;
use crate::signal::features::{Closure, Estimate};
use crate::signal::levels::{finite, of_kind};
use crate::signal::station::Station;
use crate::signal::trace::mean;

/// Start and end of the closure: the start from the trigger if there is one, else from the bend of the pressure; the
/// end from the valve position if it is recorded, else as the pressure shows it.
pub(crate) fn closure(recording: &Recording, onset: Estimate, slow: bool, seen_end_s: Option<f64>) -> Closure {
    let trigger = trigger_start(recording, onset.value);
    let start = trigger.unwrap_or(onset);
    Closure {
        start_s: start.value,
        start_se_s: start.standard_error,
        end_s: position_end_s(recording)
            .filter(|end| *end > start.value)
            .or(seen_end_s.filter(|end| *end > start.value)),
        slow,
        from_trigger: trigger.is_some(),
        pressure_onset_s: onset.value,
    }
}

/// Share of the amplitude by which the head may leave its mirror image. Chosen.
const MIRRORED: f64 = 0.5;
/// Share of the period over which the head is averaged before it is compared with its mirror image. Chosen.
const AVERAGED: f64 = 0.1;
/// An oscillation whose half swing is fewer times the noise has no mirror image. Chosen.
const STANDS_OUT: f64 = 4.0;

/// Where a slow closure ends: once the valve is shut, the head at it is its own mirror image half a period later (no
/// flow, and the supply turns the wave round); until then both add up to the flow that the valve stops in between,
/// `a ΔV/g`. At the end of the closure this falls evenly from twice the amplitude to nothing. In grid points of the
/// station's coarse trace; none where the oscillation does not stand out of the noise.
pub(crate) fn shut(station: &Station) -> Option<f64> {
    let (front, repeats, trace) = (station.front.as_ref().ok()?, station.repeats?, &station.coarse);
    let period = repeats.period * station.trace.step_s / trace.step_s;
    let (half, whole) = ((0.5 * period).round() as usize, period.round() as usize);
    let head_m = trace.smoothed((0.5 * AVERAGED * period) as usize);
    let growth = (0.5 * repeats.decrement).exp();
    let onset = front.onset as usize;
    let last = head_m.len().checked_sub(half + whole)?;
    // the sum of the head and its image, over the half swing; none where that does not stand out
    let off_image = |t: &usize| {
        let next = &head_m[t + half..t + half + whole];
        let (low, high) = ends(next);
        let (middle, swing) = (mean(next), 0.5 * (high - low));
        let sum = (head_m[*t] - middle) + growth * (next[0] - middle);
        (swing > STANDS_OUT * station.coarse_sd_m).then(|| (sum / swing).abs())
    };
    let mut back = (onset..last).rev().map(|t| (t, off_image(&t))).skip_while(|(_, off)| off.is_none()).peekable();
    let (latest, _) = *back.peek()?;
    let (at, _) = back.find(|(_, off)| off.is_none_or(|off| off > MIRRORED))?;
    (at < latest).then_some(at as f64 + 0.5 * MIRRORED * half as f64)
}

/// The change of the trigger nearest to the pressure's bend, halfway between its samples.
fn trigger_start(recording: &Recording, onset_s: f64) -> Option<Estimate> {
    let (_, series) = of_kind(recording, SensorKind::Trigger)?;
    let samples: Vec<(f64, f64)> = finite(series).collect();
    let (lo, hi) = extremes(&samples)?;
    let middle = 0.5 * (lo + hi);
    let changes = samples.windows(2).filter(|w| (w[0].1 > middle) != (w[1].1 > middle));
    changes
        .map(|w| Estimate { value: 0.5 * (w[0].0 + w[1].0), standard_error: (w[1].0 - w[0].0) / 12f64.sqrt() })
        .min_by(|a, b| (a.value - onset_s).abs().total_cmp(&(b.value - onset_s).abs()))
}

/// Time at which the valve position comes within 2 % of its travel of its final value.
fn position_end_s(recording: &Recording) -> Option<f64> {
    let (_, series) = of_kind(recording, SensorKind::ValvePosition)?;
    let samples: Vec<(f64, f64)> = finite(series).collect();
    let (lo, hi) = extremes(&samples)?;
    let last = samples.last()?.1;
    let moving = samples.iter().rposition(|(_, v)| (v - last).abs() > 0.02 * (hi - lo))?;
    samples.get(moving + 1).map(|s| s.0)
}

/// Lowest and highest value, if they differ.
fn extremes(samples: &[(f64, f64)]) -> Option<(f64, f64)> {
    let lo = samples.iter().map(|s| s.1).fold(f64::INFINITY, f64::min);
    let hi = samples.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
    (lo < hi).then_some((lo, hi))
}
