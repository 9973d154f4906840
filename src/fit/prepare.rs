//! From a recording and its signals to what a fit needs.

use super::data::{Meter, RunData, RunStart, SensorData};
use crate::model::Conditions;
use crate::recording::Recording;
use crate::rig::{Coupling, Rig, Sensor, Upstream};
use crate::signal::{Features, heads};
use crate::units::GRAVITY_M_S2;

/// Relative uncertainty of a flow meter that states none.
const FLOW_UNCERTAINTY: f64 = 0.01;
/// Relative uncertainty of a velocity taken from the pressure rise, there being no flow meter.
const JOUKOWSKY_UNCERTAINTY: f64 = 0.2;
/// Zero error of a pressure sensor that states none, as a share of the first rise.
const OFFSET_SHARE: f64 = 0.01;

/// Makes a run ready for a fit. `rig` describes the sensors (it may override the recording's own).
pub fn prepare(file: &str, rig: &Rig, recording: &Recording, features: &Features) -> RunData {
    let water = rig.fluid.properties(features.temperature_degc);
    let density = water.density_kg_m3;
    let reference = &features.sensors[features.reference];
    let rise_m = reference.first_peak.map_or(1.0, |p| (p.head_m - reference.steady_before_m.value).abs()).max(1e-3);
    let mut sensors = Vec::new();
    let mut extrema = Vec::new();
    for seen in &features.sensors {
        let sensor = rig.sensors[seen.sensor].clone();
        let (time_s, mut head_m) = heads(recording, seen.sensor, features.temperature_degc);
        if sensor.coupling == Coupling::Ac {
            // It sees no steady pressure: neither an elevation.
            let elevation_m = sensor.elevation_m.unwrap_or_else(|| rig.elevation_m(sensor.position_m));
            head_m.iter_mut().for_each(|h| *h -= elevation_m);
        }
        let offset_sd_m =
            full_scale_error_m(&sensor, density).unwrap_or(OFFSET_SHARE * rise_m).max(seen.noise.white_sd_m);
        // A noiseless record still has errors of its own; without a floor its weights would be infinite.
        let noise_m = seen.noise.white_sd_m.max(1e-5 * rise_m);
        sensors.push(SensorData { sensor, time_s, head_m, noise_m, offset_sd_m });
        extrema.push(seen.extrema.iter().map(|e| (e.time_s, e.cycle, e.peak)).collect());
    }
    let nominal: Vec<f64> = rig.pipes.iter().map(|p| p.wave_speed_start(&water).0).collect();
    let mean_speed = rig.length_m() / rig.pipes.iter().zip(&nominal).map(|(p, a)| p.length_m / a).sum::<f64>();
    let measured_speed = features.wave_speed.best().map(|e| e.value);
    let speed = measured_speed.unwrap_or(mean_speed);
    let velocity_m_s = match features.steady_velocity_m_s {
        Some(v) if v.value > 0.0 => (v.value, (v.standard_error / v.value).hypot(flow_uncertainty(rig, v.value))),
        _ => (GRAVITY_M_S2 * rise_m / speed, JOUKOWSKY_UNCERTAINTY),
    };
    let nearest = features.sensors.iter().max_by(|a, b| a.position_m.total_cmp(&b.position_m)).unwrap_or(reference);
    RunData {
        file: file.to_owned(),
        sensors,
        conditions: Conditions { water, supply_deviation: supply_deviation(rig, recording, features) },
        start: RunStart {
            closure_s: (features.closure.start_s, features.closure.start_se_s),
            velocity_m_s,
            valve_head_m: nearest.steady_before_m.value,
            wave_speed_ratio: measured_speed.map(|a| a / mean_speed),
        },
        meter: flow_meter(rig, features, velocity_m_s),
        extrema,
    }
}

/// The flow meter's reading before the closure, with the uncertainty of `velocity`.
fn flow_meter(rig: &Rig, features: &Features, velocity: (f64, f64)) -> Option<Meter> {
    let flow_m3_s = features.flow_m3_s.map(|q| q.value).filter(|q| *q > 0.0)?;
    let meter = rig.sensors.iter().find(|s| s.kind == crate::rig::SensorKind::Flow)?;
    Some(Meter { position_m: meter.position_m, flow_m3_s, relative_sd: velocity.1 })
}

/// A pressure sensor's stated accuracy as a head, m.
fn full_scale_error_m(sensor: &Sensor, density_kg_m3: f64) -> Option<f64> {
    let [low, high] = sensor.range?;
    let share = sensor.accuracy_percent_fs? / 100.0;
    let span = sensor.unit.to_si(high, density_kg_m3) - sensor.unit.to_si(low, density_kg_m3);
    Some(share * span / (density_kg_m3 * GRAVITY_M_S2))
}

/// Relative uncertainty of the velocity from the flow meter's stated accuracy.
fn flow_uncertainty(rig: &Rig, velocity_m_s: f64) -> f64 {
    let meter = rig.sensors.iter().find(|s| s.kind == crate::rig::SensorKind::Flow);
    let stated = meter.and_then(|m| {
        let [low, high] = m.range?;
        let error = m.accuracy_percent_fs? / 100.0 * (m.unit.to_si(high, 1.0) - m.unit.to_si(low, 1.0));
        let area = rig.pipes.last()?.area_m2();
        Some(error / (area * velocity_m_s))
    });
    stated.unwrap_or(FLOW_UNCERTAINTY).clamp(1e-3, 1.0)
}

/// The head at position 0 minus its mean before the closure, on the recording's clock, where it drives the model.
fn supply_deviation(rig: &Rig, recording: &Recording, features: &Features) -> Option<(Vec<f64>, Vec<f64>)> {
    if rig.upstream != Upstream::Measured {
        return None;
    }
    let at_supply = features.sensors.iter().find(|s| s.position_m == 0.0)?;
    let (time_s, head_m) = heads(recording, at_supply.sensor, features.temperature_degc);
    Some((time_s, head_m.iter().map(|h| h - at_supply.steady_before_m.value).collect()))
}
