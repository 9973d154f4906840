//! The variables of a calibration, described: the model's shared parameters and the places of sensors, then each run's
//! own.

use crate::fit::data::run_data::{RunData, RunStart};
use crate::fit::problem::thresholds::FARTHEST_SD;
use crate::model::Model;
use crate::model::parameter::Parameter;
use crate::rig::{Rig, Sensor};

/// All variables, and the index of each run's first.
pub fn of(model: &Model, runs: &[RunData]) -> (Vec<Parameter>, Vec<usize>) {
    let period_s = model.period_s(&model.shared.iter().map(|p| p.start).collect::<Vec<_>>());
    let mut parameters = model.shared.clone();
    let ratios: Vec<f64> = runs.iter().filter_map(|r| r.start.wave_speed_ratio).collect();
    if !ratios.is_empty() {
        let ratio = ratios.iter().sum::<f64>() / ratios.len() as f64;
        for wave_speed in &mut parameters[..model.rig.pipes.len()] {
            wave_speed.start = (wave_speed.start * ratio).clamp(wave_speed.lower, wave_speed.upper);
        }
    }
    for sensor in runs.iter().flat_map(|run| &run.sensors) {
        let place = place_of(model.rig, &sensor.sensor);
        parameters.extend(place.filter(|place| parameters.iter().all(|known| known.name != place.name)));
    }
    let mut run_offsets = Vec::new();
    for run in runs {
        run_offsets.push(parameters.len());
        let RunStart { closure_s, velocity_m_s, valve_head_m, .. } = run.start;
        let [velocity, head, closing, friction] = model.per_run.clone();
        // With a flow meter the model's flow is compared at the meter's place; without, the velocity itself has a
        // prior.
        let prior = if run.meter.is_some() { None } else { Some(velocity_m_s) };
        parameters.push(Parameter { start: velocity_m_s.0, prior, ..velocity });
        parameters.push(Parameter {
            start: valve_head_m.0,
            prior: valve_head_m.1.map(|sd| (valve_head_m.0, sd)),
            ..head
        });
        let valve = &model.rig.valve;
        let closing = started_at(closing, run.start.closing_time.map(|shown| shown.seen_s.0))
            .known_within(valve.closing_time_s, valve.closing_time_tolerance);
        // A valve that closes slowly hardly moves the head at first.
        let reach = (10.0 * closure_s.1).max(0.25 * period_s.max(closing.start));
        parameters.extend([closing, friction]);
        parameters.push(Parameter::linear(
            "closure_start_s",
            "s",
            "start of the closure on the recording's clock",
            closure_s.0,
            closure_s.0 - reach,
            closure_s.0 + reach,
        ));
        for sensor in &run.sensors {
            let sd = sensor.offset_sd_m;
            parameters.push(
                Parameter::linear(
                    format!("offset_m[{}]", sensor.sensor.name),
                    "m",
                    "zero error of the sensor",
                    0.0,
                    -20.0 * sd,
                    20.0 * sd,
                )
                .with_prior(0.0, sd),
            );
        }
    }
    for (j, parameter) in parameters.iter_mut().enumerate() {
        let run = run_offsets.iter().rposition(|&first| j >= first).map(|r| runs[r].file.as_str());
        if let Some(given) = model.starts.iter().find(|g| g.concerns(&parameter.name, run)) {
            parameter.start = given.value;
        }
        parameter.start = parameter.start.clamp(parameter.lower, parameter.upper);
        if let Some(settled) = model.constraints.iter().find(|c| c.concerns(&parameter.name, run)) {
            settled.narrow(parameter);
        }
    }
    (parameters, run_offsets)
}

/// The variables that all runs share: the model's, and the places of sensors.
pub fn shared(model: &Model, runs: &[RunData]) -> Vec<Parameter> {
    let (mut parameters, run_offsets) = of(model, runs);
    parameters.truncate(run_offsets.first().copied().unwrap_or(parameters.len()));
    parameters
}

/// The sensor whose place the variable of this name is.
pub fn placed_sensor(name: &str) -> Option<&str> {
    name.strip_prefix("position_m[")?.strip_suffix(']')
}

/// The place of a sensor as a variable: where the record shows it, between the ends, and the rig file knows it within a
/// tolerance only.
fn place_of(rig: &Rig, sensor: &Sensor) -> Option<Parameter> {
    let (at, sd_m, length_m) = (sensor.position_m, rig.place_sd_m(sensor), rig.line_length_m(sensor.line));
    let name = format!("position_m[{}]", sensor.name);
    let about = "distance of the sensor from the supply: sets when fronts pass it";
    let (lower, upper) = ((at - FARTHEST_SD * sd_m).max(0.0), (at + FARTHEST_SD * sd_m).min(length_m));
    let variable = at > 0.0 && at < length_m && sd_m > 0.0;
    variable.then(|| Parameter::linear(name, "m", about, at, lower, upper).with_prior(at, sd_m))
}

/// A closing time that starts at the one that the pressures show, with bounds that include it amply.
fn started_at(closing: Parameter, seen_s: Option<f64>) -> Parameter {
    let Some(seen_s) = seen_s else { return closing };
    let (lower, upper) = (closing.lower.min(seen_s / 5.0), closing.upper.max(seen_s * 5.0));
    Parameter { start: seen_s, lower, upper, ..closing }
}
