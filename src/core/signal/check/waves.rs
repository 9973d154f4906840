//! Checks whether the waves travel as fast as the walls allow.

use crate::recording::Recording;
use crate::rig::check::{Finding, Level, judge_wave_speed};
use crate::rig::{Pipe, Rig, WaterProperties};
use crate::signal::check::track::{Front, SAMPLES_OF_A_FRONT};
use crate::signal::inspect::inspect;

/// A wave speed beyond those of the walls by this factor cannot be explained by their modulus.
const FAR_OFF: f64 = 1.3;

/// Compares the speed of the first wave between neighbouring sensors of one pipe with that of its material.
pub(crate) fn check_travel(rig: &Rig, fronts: &[Front<'_>], water: &WaterProperties) -> Vec<Finding> {
    let mut arrived: Vec<(f64, f64, &Front<'_>)> =
        fronts.iter().filter_map(|f| Some((rig.on_way_m(f.track.sensor.place()), f.arrival_s?, f))).collect();
    arrived.sort_by(|a, b| b.0.total_cmp(&a.0));
    let pair = |w: &[(f64, f64, &Front<'_>)]| {
        let [(near_m, near_s, near), (far_m, far_s, far)] = w else { return None };
        let pipe = pipe_between(rig, *far_m, *near_m)?;
        let (apart_m, later_s) = (near_m - far_m, far_s - near_s);
        let names = format!("wave from '{}' to '{}'", near.track.sensor.name, far.track.sensor.name);
        let interval = near.track.interval_s()?.max(far.track.interval_s()?);
        if apart_m <= 0.0 || apart_m / pipe.wave_speed_start(water).0 < SAMPLES_OF_A_FRONT * interval {
            return None; // too near to each other to tell
        }
        if later_s <= interval {
            let message = format!(
                "arrives {:.4} s early, but it comes from the valve: sensors swapped, a clock off, or another source",
                -later_s
            );
            return Some(Finding::new(Level::Contradiction, names, message, &[("delay_s", later_s)]));
        }
        // each arrival is uncertain by a sample, and the front changes its shape on the way
        let slack = (2.0 * interval + 0.05 * rig.valve.closing_time_s) / later_s;
        Some(judge_wave_speed(pipe, names, apart_m / later_s, slack, water))
    };
    arrived.windows(2).filter_map(pair).collect()
}

/// Compares the recording's wave speed, mean over all pipes, with what their walls allow. Only what no gas, support or
/// wrong diameter explains is a contradiction.
pub(crate) fn check_speeds(rig: &Rig, recording: &Recording, water: &WaterProperties) -> Vec<Finding> {
    let Some(features) = recording.clone().on_rig(rig.clone()).ok().and_then(|r| inspect(&r).ok()) else {
        return Vec::new();
    };
    // a wave speed that the rig file gives is more reliable than the material's
    let mean = |end: usize, pick: fn(f64, f64) -> f64| {
        let speed = |p: &Pipe| p.material_wave_speeds_m_s(water)[end];
        let travel = |p: &Pipe| p.length_m / p.wave_speed_m_s.map_or(speed(p), |given| pick(speed(p), given));
        rig.length_m() / rig.way_pipes().map(travel).sum::<f64>()
    };
    let (lo, hi) = (mean(0, f64::min), mean(1, f64::max));
    let crossings = features.wave_speed.crossings.map(|c| (c.value, c.standard_error));
    let arrival = features.wave_speed.arrival.map(|a| (a.value, a.standard_error));
    let judge = |(name, speed): (&str, Option<(f64, f64)>)| {
        let (value, error) = speed?;
        let (above, below) = (value > FAR_OFF * hi && value - error > hi, value < lo / FAR_OFF && value + error < lo);
        let message = format!(
            "{value:.0} ± {error:.0} m/s, where the walls allow {lo:.0}-{hi:.0} m/s: are the times in seconds, and length, wall and \
             material those of this pipe?"
        );
        let numbers = [("wave_speed_m_s", value), ("lo_m_s", lo), ("hi_m_s", hi)];
        (above || below).then(|| Finding::new(Level::Contradiction, format!("wave speed by {name}"), message, &numbers))
    };
    [("the period of the first peak", crossings), ("the arrival at two sensors", arrival)]
        .into_iter()
        .filter_map(judge)
        .collect()
}

fn pipe_between(rig: &Rig, from_m: f64, to_m: f64) -> Option<&Pipe> {
    let mut start = 0.0;
    rig.way_pipes().find(|pipe| {
        let inside = from_m >= start - 1e-6 && to_m <= start + pipe.length_m + 1e-6;
        start += pipe.length_m;
        inside
    })
}
