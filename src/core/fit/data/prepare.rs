//! From a recording and its signals to what a fit needs.

use crate::fit::data::run_data::{Meter, RunData, RunStart, SensorData, ShownClosing};
use crate::fit::data::thresholds::{
    CLOSING_TIME_FACTOR, CLOSURE_END_PERIODS, DEFAULT_FLOW_UNCERTAINTY, DEFAULT_OFFSET_SHARE, FEWEST_BEFORE,
    JOUKOWSKY_UNCERTAINTY, SMOOTHING_EXCESS, VAPOUR_MARGIN_PA,
};
use crate::model::Conditions;
use crate::model::effects::ATMOSPHERE_PA;
use crate::model::friction::WallFriction;
use crate::model::line_flows::line_flows;
use crate::recording::Recording;
use crate::rig::{Coupling, Line, Pipe, Regime, Rig, Sensor, Upstream, WaterProperties};
use crate::signal::hum::sharpened;
use crate::signal::{Features, SensorFeatures, heads};
use crate::units::GRAVITY_M_S2;

/// Makes a run ready for a fit. `rig` describes the sensors (it may override the recording's own).
pub fn prepare(file: &str, rig: &Rig, recording: &Recording, features: &Features) -> RunData {
    let water = rig.fluid.properties(features.temperature_degc);
    let density = water.density_kg_m3;
    let reference = &features.sensors[features.reference];
    let rise_m = reference.first_peak.map_or(1.0, |p| (p.head_m - reference.steady_before_m.value).abs()).max(1e-3);
    let mut sensors = Vec::new();
    let mut extrema = Vec::new();
    for seen in features.sensors.iter().filter(|s| !drives(rig, s)) {
        let sensor = rig.sensors[seen.sensor].clone();
        let (mut time_s, mut head_m) = heads(recording, seen.sensor, features.temperature_degc);
        let saturated = leave_saturated_out(rig, recording, seen.sensor, &water, (&mut time_s, &mut head_m));
        if sensor.coupling == Coupling::Ac {
            // It shows no steady pressure, and so no elevation.
            let elevation_m = rig.sensor_elevation_m(&sensor);
            head_m.iter_mut().for_each(|h| *h -= elevation_m);
        }
        let offset_sd_m =
            full_scale_error_m(&sensor, density).unwrap_or(DEFAULT_OFFSET_SHARE * rise_m).max(seen.noise.white_sd_m);
        // A noiseless record still has errors of its own; without a floor its weights would be infinite.
        let [white_sd_m, total_sd_m] = seen.noise.without_tones_m;
        let noise_m = white_sd_m.max(1e-5 * rise_m);
        // What oscillates in the pipe is no noise.
        let total_noise_m = total_sd_m.max(noise_m);
        let hum = sharpened(&seen.noise.hum, noise_m, features.closure.pressure_onset_s, &time_s, &head_m);
        sensors.push(SensorData {
            sensor,
            time_s,
            head_m,
            noise_m,
            total_noise_m,
            hum,
            lines: seen.noise.lines.clone(),
            offset_sd_m,
            saturated,
        });
        extrema.push(seen.extrema.iter().map(|e| (e.time_s, e.cycle, e.peak)).collect());
    }
    let (mean_speed, ..) = rig.wave_speed_start(&water);
    let measured_speed = plausible_speed(rig, &water, features);
    let speed = measured_speed.unwrap_or(mean_speed);
    let velocity_m_s = match features.steady_velocity_m_s {
        Some(v) if v.value > 0.0 => (v.value, (v.standard_error / v.value).hypot(flow_uncertainty(rig, v.value))),
        _ => {
            let by_rise = GRAVITY_M_S2 * rise_m / speed;
            (impulse_velocity(recording, features).unwrap_or(by_rise), JOUKOWSKY_UNCERTAINTY)
        }
    };
    let flow_m3_s = velocity_m_s.0 * rig.pipe_at_valve().area_m2();
    RunData {
        file: file.to_owned(),
        sensors,
        conditions: Conditions {
            water,
            supply_deviation: supply_deviation(rig, recording, features),
            regimes: Some(regimes(rig, &water, flow_m3_s)),
        },
        start: RunStart {
            closure_s: (features.closure.start_s, features.closure.start_se_s),
            velocity_m_s,
            valve_head_m: valve_head(rig, features, &water, velocity_m_s.0, rise_m),
            wave_speed_ratio: measured_speed.map(|a| a / mean_speed),
            closing_time: shown_closing_time(rig, features),
        },
        meter: flow_meter(rig, features, velocity_m_s),
        extrema,
    }
}

/// The velocity that a slow closure stops, m/s, from the impulse of the head that it takes:
/// `V = g/x ∫(H - H_after + h) dt` for the water between the supply and the sensor at `x`. The friction loss `h`, at
/// first what the head lacks of that after the closure, goes with the square of a velocity that falls evenly.
fn impulse_velocity(recording: &Recording, features: &Features) -> Option<f64> {
    let (closure, sensor) = (&features.closure, features.sensors.get(features.reference)?);
    let end_s = closure.end_s.filter(|_| closure.slow)?;
    let after_m = sensor.steady_after_m?.value;
    let (time_s, head_m) = heads(recording, sensor.sensor, features.temperature_degc);
    let closing = time_s.partition_point(|t| *t < closure.pressure_onset_s)..time_s.partition_point(|t| *t <= end_s);
    let above = |i: usize| head_m[i] - after_m;
    let steps = closing.clone().zip(closing.clone().skip(1));
    let impulse: f64 = steps.map(|(i, k)| 0.5 * (above(i) + above(k)) * (time_s[k] - time_s[i])).sum();
    let loss = (after_m - sensor.steady_before_m.value) * (end_s - closure.pressure_onset_s) / 3.0;
    Some(GRAVITY_M_S2 * (impulse + loss) / sensor.position_m).filter(|v| *v > 0.0 && v.is_finite())
}

/// The closing time that the pressures show: always of a slow closure, whose end the oscillation after it tells to a
/// fraction of a period, while the rig file's may be off by many; of a fast one where the rig file's is far from it.
/// Where several valves close, the end is that of the last.
fn shown_closing_time(rig: &Rig, features: &Features) -> Option<ShownClosing> {
    if rig.graph.others_that_close().next().is_some() {
        return None;
    }
    let (nominal_s, closure) = (rig.valve.closing_time_s, &features.closure);
    let seen_s = closure.end_s? - closure.pressure_onset_s;
    let agree = (seen_s / CLOSING_TIME_FACTOR..=seen_s * CLOSING_TIME_FACTOR).contains(&nominal_s);
    let error_s = features.period.map_or(0.0, |period| CLOSURE_END_PERIODS * period.value);
    let shown = ShownClosing {
        seen_s: (seen_s, error_s),
        said_s: (nominal_s, rig.valve.closing_time_tolerance.map(|share| share * nominal_s)),
    };
    (seen_s > 0.0 && (closure.slow || !agree)).then_some(shown)
}

/// Leaves out and counts the samples at which a pressure sensor is at the end of its range. An end below the vapour
/// pressure does not count: the water boils before.
fn leave_saturated_out(
    rig: &Rig,
    recording: &Recording,
    sensor: usize,
    water: &WaterProperties,
    (time_s, head_m): (&mut Vec<f64>, &mut Vec<f64>),
) -> usize {
    let shown = &rig.sensors[sensor];
    let ends = rig.ends(shown);
    let boils = shown.unit.from_si(water.vapour_pressure_pa - ATMOSPHERE_PA + VAPOUR_MARGIN_PA, water.density_kg_m3);
    let beyond = |value: f64| value >= ends.high || (value <= ends.low && ends.low > boils);
    let kept: Vec<bool> =
        recording.series[sensor].value.iter().filter(|v| v.is_finite()).map(|v| !beyond(*v)).collect();
    let before = time_s.len();
    for values in [time_s, head_m] {
        let mut keep = kept.iter();
        values.retain(|_| keep.next().is_none_or(|keep| *keep));
    }
    before - kept.iter().filter(|keep| **keep).count()
}

/// The measured wave speed, by the first method whose result the pipes allow: a joint or a branch can reflect a front
/// that looks like the supply's, and a skewed clock or a wrong velocity misleads the others.
fn plausible_speed(rig: &Rig, water: &WaterProperties, features: &Features) -> Option<f64> {
    let (_, low, high) = rig.wave_speed_start(water);
    let speeds = &features.wave_speed;
    [
        speeds.crossings.map(|c| c.value),
        speeds.arrival.map(|a| a.value),
        speeds.period.map(|p| p.value),
        speeds.joukowsky.map(|j| j.value),
    ]
    .into_iter()
    .flatten()
    .find(|a| (0.8 * low..=1.2 * high).contains(a))
    .or_else(|| speeds.best().map(|e| e.value))
}

/// The flow meter's reading before the closure, with the uncertainty of `velocity`.
fn flow_meter(rig: &Rig, features: &Features, velocity: (f64, f64)) -> Option<Meter> {
    let flow_m3_s = features.flow_m3_s.map(|q| q.value).filter(|q| *q > 0.0)?;
    let meter = rig.sensors.iter().find(|s| s.kind == crate::rig::SensorKind::Flow)?;
    Some(Meter { place: meter.place(), flow_m3_s, relative_sd: velocity.1 })
}

/// A pressure sensor's stated accuracy as a head, m.
fn full_scale_error_m(sensor: &Sensor, density_kg_m3: f64) -> Option<f64> {
    let [low, high] = sensor.range?;
    let share = sensor.accuracy_percent_fs? / 100.0;
    let span = sensor.unit.to_si(high, density_kg_m3) - sensor.unit.to_si(low, density_kg_m3);
    Some(share * span / (density_kg_m3 * GRAVITY_M_S2))
}

/// Relative uncertainty of the velocity from the flow meter's stated accuracy and the tolerance of the bore.
fn flow_uncertainty(rig: &Rig, velocity_m_s: f64) -> f64 {
    let meter = rig.sensors.iter().find(|s| s.kind == crate::rig::SensorKind::Flow);
    let stated = meter.and_then(|m| {
        let [low, high] = m.range?;
        let error = m.accuracy_percent_fs? / 100.0 * (m.unit.to_si(high, 1.0) - m.unit.to_si(low, 1.0));
        let area = rig.pipe_at_valve().area_m2();
        Some(error / (area * velocity_m_s))
    });
    let diameter = rig.pipe_at_valve().tolerance.diameter;
    stated.unwrap_or(DEFAULT_FLOW_UNCERTAINTY).hypot(2.0 * diameter).clamp(1e-3, 1.0)
}

/// Head before the valve: of the nearest sensor that shows steady pressure, less the friction between; where there is
/// none, a guess with its uncertainty.
fn valve_head(
    rig: &Rig,
    features: &Features,
    water: &WaterProperties,
    velocity_m_s: f64,
    rise_m: f64,
) -> (f64, Option<f64>) {
    let flow_m3_s = velocity_m_s * rig.pipe_at_valve().area_m2();
    let steady = features.sensors.iter().filter(|s| rig.sensors[s.sensor].coupling == Coupling::Dc && shows_before(s));
    let on_way_m = |s: &SensorFeatures| rig.on_way_m(rig.sensors[s.sensor].place());
    if let Some(nearest) = steady.max_by(|a, b| on_way_m(a).total_cmp(&on_way_m(b))) {
        let loss_m = loss_m(rig, water, flow_m3_s, on_way_m(nearest));
        return (nearest.steady_before_m.value - loss_m, None);
    }
    let stated = rig.steady.iter().find_map(|s| s.supply_head_m).map(|h| h - loss_m(rig, water, flow_m3_s, 0.0));
    let guess = rig.valve.discharge_head_m + stated.unwrap_or(2.0 * rise_m).max(0.1 * rise_m);
    (guess, Some(0.5 * guess.abs().max(rise_m)))
}

/// Whether a record begins before its front: else its first head belongs to the closure.
fn shows_before(sensor: &SensorFeatures) -> bool {
    let quiet_s = sensor.front_arrival_s.map_or(f64::INFINITY, |arrival| arrival.value - sensor.begin_s);
    quiet_s > FEWEST_BEFORE * sensor.interval_s
}

/// The regime of a measured flow: laminar only where nothing else is possible.
fn regime(pipe: &Pipe, water: &WaterProperties, flow_m3_s: f64) -> Regime {
    Regime::of_disturbed(pipe.reynolds(water, flow_m3_s))
}

/// The regime in every pipe. Where the flow in a network is not found, the simulation says so.
fn regimes(rig: &Rig, water: &WaterProperties, valve_m3_s: f64) -> Vec<Regime> {
    let flows = line_flows(rig, water, valve_m3_s, 1.0).unwrap_or_else(|_| vec![valve_m3_s; rig.graph.lines.len()]);
    let of =
        |(line, &q): (&Line, &f64)| rig.pipes[line.pipes.clone()].iter().map(move |p| regime(p, water, q)).collect();
    rig.graph.lines.iter().zip(&flows).flat_map::<Vec<Regime>, _>(of).collect()
}

/// Steady friction loss from a place to the valve, m.
fn loss_m(rig: &Rig, water: &WaterProperties, flow_m3_s: f64, from_m: f64) -> f64 {
    let mut start = 0.0;
    let mut loss = 0.0;
    for pipe in rig.way_pipes() {
        let end = start + pipe.length_m;
        let length = (end - from_m.max(start)).max(0.0);
        loss += WallFriction::in_regime(pipe, water, flow_m3_s, regime(pipe, water, flow_m3_s))
            .slope(pipe.inner_diameter_m, flow_m3_s)
            * length;
        start = end;
    }
    loss
}

/// A sensor at position 0 of a rig whose upstream end is measured drives the model: it is no evidence for it.
fn drives(rig: &Rig, sensor: &SensorFeatures) -> bool {
    rig.upstream == Upstream::Measured && sensor.position_m == 0.0
}

/// The head at position 0 minus its mean before the closure, on the recording's clock, where it drives the model.
///
/// A frictionless pipe is a resonator that would respond to the sensor's noise as to a wave. So the noise is smoothed
/// out, by the longest window whose residual does not exceed the noise.
fn supply_deviation(rig: &Rig, recording: &Recording, features: &Features) -> Option<(Vec<f64>, Vec<f64>)> {
    let driver = features.sensors.iter().find(|s| drives(rig, s))?;
    let (time_s, head_m) = heads(recording, driver.sensor, features.temperature_degc);
    let smooth = smoothed(&head_m, driver.noise.white_sd_m);
    Some((time_s, smooth.iter().map(|h| h - driver.steady_before_m.value).collect()))
}

/// Cubic Savitzky-Golay smoothing (Savitzky & Golay 1964) over `2m + 1` samples, the window shrinking towards the ends.
fn savitzky_golay(values: &[f64], m: usize) -> Vec<f64> {
    (0..values.len())
        .map(|i| {
            let m = m.min(i).min(values.len() - 1 - i) as f64;
            if m < 1.0 {
                return values[i];
            }
            let norm = (2.0 * m - 1.0) * (2.0 * m + 1.0) * (2.0 * m + 3.0);
            let window = &values[i - m as usize..=i + m as usize];
            let weight = |k: usize| {
                let x = k as f64 - m;
                (3.0 * (3.0 * m * m + 3.0 * m - 1.0) - 15.0 * x * x) / norm
            };
            window.iter().enumerate().map(|(k, v)| weight(k) * v).sum()
        })
        .collect()
}

/// The smoothest version of a series that leaves no more than its noise.
fn smoothed(values: &[f64], noise: f64) -> Vec<f64> {
    let mut best = values.to_vec();
    let mut m = 2;
    while 2 * m + 1 < values.len() / 4 {
        let trial = savitzky_golay(values, m);
        let square: f64 = trial.iter().zip(values).map(|(t, v)| (t - v).powi(2)).sum();
        if (square / values.len() as f64).sqrt() > SMOOTHING_EXCESS * noise {
            break;
        }
        best = trial;
        m = m * 3 / 2;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_keeps_a_cubic_and_halves_noise_many_times() {
        let cubic: Vec<f64> =
            (0..200).map(f64::from).map(|x| 1.0 + 0.1 * x - 1e-3 * x * x + 1e-5 * x.powi(3)).collect();
        for (a, b) in savitzky_golay(&cubic, 9).iter().zip(&cubic) {
            assert!((a - b).abs() < 1e-9);
        }
        let mut state = 7u64;
        let mut noise = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 33) as f64 / (1u64 << 31) as f64 - 0.5) * 12f64.sqrt() * 0.1
        };
        let clean: Vec<f64> = (0..4000).map(|i| (f64::from(i) * 0.004).sin()).collect();
        let noisy: Vec<f64> = clean.iter().map(|c| c + noise()).collect();
        let rms = |v: &[f64]| (v.iter().zip(&clean).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 4000.0).sqrt();
        assert!(rms(&noisy) > 0.09 && rms(&smoothed(&noisy, 0.1)) < 0.02, "{}", rms(&smoothed(&noisy, 0.1)));
    }
}
