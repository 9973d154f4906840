//! What records show before any fit: how near to vapour pressure they come, how densely they are sampled, how many
//! features they have.

use crate::diagnose::limits::{FEATURES_PER_HALF_CYCLE, FLOOR_SAMPLES, TELLING_HALF_CYCLES};
use crate::fit::data::run_data::{RunData, SensorData};
use crate::model::effects::{Circumstances, vapour_head_m};
use crate::rig::{Coupling, Rig};

/// What the runs show of the circumstances.
pub(crate) fn circumstances<'a>(rig: &'a Rig, runs: &[RunData]) -> Circumstances<'a> {
    Circumstances { rig, above_vapour_m: above_vapour_m(rig, runs), sample_s: sample_s(runs) }
}

/// Number of independent features of the records if something other than noise is left. However densely it was sampled,
/// a half cycle has only a few (front, plateau, return); and a model errs alike at every sensor and in every later
/// cycle, so each run counts as [`TELLING_HALF_CYCLES`] at most.
pub(crate) fn features(runs: &[RunData]) -> f64 {
    let of_run = |run: &RunData| run.extrema.iter().map(Vec::len).max().unwrap_or(0).min(TELLING_HALF_CYCLES);
    FEATURES_PER_HALF_CYCLE * runs.iter().map(of_run).sum::<usize>().max(1) as f64
}

/// The longest time between samples of any sensor, s.
fn sample_s(runs: &[RunData]) -> f64 {
    let step = |s: &SensorData| match s.time_s.as_slice() {
        [first, .., last] => (last - first) / (s.time_s.len() - 1) as f64,
        _ => 0.0,
    };
    runs.iter().flat_map(|run| &run.sensors).map(step).fold(0.0, f64::max)
}

/// How far the lowest pressure in any record stays above vapour pressure, m.
fn above_vapour_m(rig: &Rig, runs: &[RunData]) -> f64 {
    let margin = |run: &RunData, s: &SensorData| {
        let boiling_m = rig.elevation_m(s.sensor.place()) + vapour_head_m(&run.conditions.water);
        // A single sample may be a dead count; a record that reaches the floor stays there.
        let mut heads = s.head_m.clone();
        let few = (heads.len() / FLOOR_SAMPLES).clamp(1, heads.len()) - 1;
        let (_, low_m, _) = heads.select_nth_unstable_by(few, f64::total_cmp);
        *low_m - boiling_m
    };
    // An AC-coupled sensor does not see the steady pressure, so it cannot show the floor.
    let dc = |s: &&SensorData| s.sensor.coupling == Coupling::Dc;
    runs.iter().flat_map(|run| run.sensors.iter().filter(dc).map(move |s| margin(run, s))).fold(f64::INFINITY, f64::min)
}
