//! How the valve closed, read back from the head measured before it (the ITA curve, for inverse transient analysis).
//!
//! The measured head drives the line at its end; the characteristic that arrives there then gives the velocity, `V`,
//! and with the orifice's law the relative opening, `τ = (V/V₀) √(ΔH₀/ΔH)`.

use crate::model::boundary::{GivenEnd, OpeningLaw};
use crate::model::definition::Model;
use crate::model::error::ModelError;
use crate::model::run::{Conditions, Resolution, RunValues};
use crate::model::trace::{Probe, Trace};
use crate::rig::Place;

/// Velocity at the valve and relative opening, step by step.
#[derive(Debug, Clone, PartialEq)]
pub struct ValveCurve {
    /// Times after the start of the closure, s.
    pub time_s: Vec<f64>,
    /// Mean velocity in the pipe's end, m/s.
    pub velocity_m_s: Vec<f64>,
    /// Opening relative to that before the closure; NaN where the head stands too near the discharge head to tell it.
    pub opening: Vec<f64>,
}

/// Head differences over the valve below this part of the first one tell no opening.
const LEAST_DROP: f64 = 1e-3;

/// The valve's curve from the head before it: `measured` are times after the start of the closure, s, increasing, and
/// heads, m, without the sensor's offset. Between samples the head is linear, beyond them constant; before the closure
/// it is `run`'s.
///
/// Of `run` the closing time is not used. What an effect lets out at the valve's end (a moving valve, trapped air)
/// counts as flow through the valve.
///
/// # Errors
/// As [`Model::simulate`]; also if there is no sample or their times do not increase.
pub fn valve_from_head(
    model: &Model,
    conditions: &Conditions,
    shared: &[f64],
    run: &RunValues,
    resolution: Resolution,
    measured: (&[f64], &[f64]),
) -> Result<ValveCurve, ModelError> {
    let samples: Vec<(f64, f64)> = measured.0.iter().copied().zip(measured.1.iter().copied()).collect();
    let finite = samples.iter().all(|(t, h)| t.is_finite() && h.is_finite());
    if samples.is_empty() || !finite || samples.windows(2).any(|w| w[1].0 <= w[0].0) {
        return Err(ModelError::NoValveHead);
    }
    let head = move |time_s: f64| linear(&samples, time_s);
    let valve = model.rig.valve_place();
    let probes = [Probe::head(valve), Probe::flow(valve)];
    let traces = model.driven(conditions, shared, run, resolution, &probes, GivenEnd::Head(Box::new(head)))?.traces;
    let [heads, flows] = &traces[..] else { return Err(ModelError::NoValveHead) };
    let area_m2 = model.rig.pipe_at_valve().area_m2();
    let discharge_m = model.rig.valve.discharge_head_m;
    let drop_m = run.valve_head_m - discharge_m;
    let kept = ((resolution.duration_s / heads.dt_s).ceil() as usize + 1).min(heads.values.len());
    let velocity_m_s: Vec<f64> = flows.values[..kept].iter().map(|q| q / area_m2).collect();
    let opening = velocity_m_s
        .iter()
        .zip(&heads.values)
        .map(|(v, h)| {
            let ratio = (h - discharge_m) / drop_m;
            if ratio.abs() < LEAST_DROP {
                return f64::NAN;
            }
            v / run.initial_velocity_m_s * ratio.signum() / ratio.abs().sqrt()
        })
        .collect();
    Ok(ValveCurve { time_s: (0..kept).map(|i| heads.dt_s * i as f64).collect(), velocity_m_s, opening })
}

/// What a sensor at `place` shows where the valve closes by `law`, the opening after a part of `run`'s closing time (0
/// to 1), whatever the model says of its valve.
///
/// # Errors
/// As [`Model::simulate`].
pub fn head_from_valve(
    model: &Model,
    conditions: &Conditions,
    shared: &[f64],
    run: &RunValues,
    resolution: Resolution,
    place: Place,
    law: OpeningLaw,
) -> Result<Trace, ModelError> {
    let probes = [Probe::head(place)];
    let mut traces = model.driven(conditions, shared, run, resolution, &probes, GivenEnd::Law(law))?.traces;
    Ok(traces.swap_remove(0))
}

/// Linear between samples, constant beyond them. There is at least one.
fn linear(samples: &[(f64, f64)], time_s: f64) -> f64 {
    let next = samples.partition_point(|s| s.0 <= time_s);
    match (next.checked_sub(1).map(|i| samples[i]), samples.get(next)) {
        (Some((t0, h0)), Some(&(t1, h1))) => h0 + (h1 - h0) * (time_s - t0) / (t1 - t0),
        (Some((_, head)), None) | (None, Some(&(_, head))) => head,
        (None, None) => f64::NAN,
    }
}
