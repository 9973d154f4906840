//! The copper pipe of Adelaide and its two tests: what was published of them, a run, and what is read off a record.

use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, Resolution, RunValues};
use surgescope_core::rig::Rig;

pub(crate) const G: f64 = 9.81;
pub(crate) const ATMOSPHERE_PA: f64 = 101_325.0;
pub(crate) const WAVE_SPEED_M_S: f64 = 1319.0;
/// The head of the supply as published, m above the lower end of the pipe.
pub(crate) const SUPPLY_M: f64 = 22.0;
/// At 0.3 m/s: the highest pressure at the valve, absolute.
pub(crate) const HIGHEST_KPA: f64 = 1015.0;
/// At 1.4 m/s: the peak after the first cavity, absolute.
pub(crate) const SECOND_PEAK_KPA: f64 = 2057.0;
/// At 1.4 m/s: how long both cavities last, read off the digitised trace where it crosses 500 kPa: 0.0629 to 0.3864 s
/// and 0.4435 to 0.7287 s. (Half way up its steep fronts its doubtful zero moves a crossing by less than a
/// millisecond.)
pub(crate) const CAVITIES_S: [f64; 2] = [0.3864 - 0.0629, 0.7287 - 0.4435];

pub(crate) fn rig() -> Rig {
    Rig::from_toml(include_str!("../../rigs/adelaide-copper.toml"), "adelaide-copper.toml").unwrap()
}

/// Time, s, and absolute pressure at the valve, kPa.
pub(crate) type Record = Vec<(f64, f64)>;

/// The head before the valve, m, where the supply has another and pipe friction is `friction_scale` times that of the
/// rig.
pub(crate) fn valve_head_m(rig: &Rig, velocity: f64, supply_m: f64, friction_scale: f64) -> f64 {
    let water = rig.fluid.properties(rig.fluid.temperature_degc);
    let pipe = &rig.pipes[0];
    let reynolds = velocity * pipe.inner_diameter_m / water.kinematic_viscosity_m2_s;
    let factor = pipe.friction_factor.unwrap_or_else(|| surgescope_core::rig::darcy_friction_factor(reynolds, 0.0));
    supply_m - friction_scale * factor * pipe.length_m / pipe.inner_diameter_m * velocity * velocity / (2.0 * G)
}

/// Absolute pressure at the valve.
pub(crate) fn kpa(rig: &Rig, head_m: f64) -> f64 {
    let water = rig.fluid.properties(rig.fluid.temperature_degc);
    ((head_m - 2.03) * water.density_kg_m3 * G + ATMOSPHERE_PA) / 1e3
}

/// A run of the rig; effects at their defaults but for `values` of the first ones. Pipe friction is `friction_scale`
/// times that of the rig.
pub(crate) fn scaled(
    rig: &Rig,
    effects: &str,
    values: &[f64],
    velocity: f64,
    supply_m: f64,
    friction_scale: f64,
    reaches: usize,
) -> Record {
    let water = rig.fluid.properties(rig.fluid.temperature_degc);
    let mut model = Model::new(rig, &water, &parse_list(effects).unwrap());
    model.closure = |closing_time_s| Closure::Linear { closing_time_s };
    let mut shared: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
    shared[0] = WAVE_SPEED_M_S;
    shared[1..=values.len()].copy_from_slice(values);
    let run = RunValues {
        initial_velocity_m_s: velocity,
        valve_head_m: valve_head_m(rig, velocity, supply_m, friction_scale),
        closing_time_s: 0.009,
        friction_scale,
    };
    let conditions = Conditions::of(water);
    let resolution = Resolution { reaches, duration_s: if velocity > 1.0 { 0.8 } else { 0.3 } };
    let probe = [Probe::head(rig.pipes[0].length_m)];
    let trace = model.simulate(&conditions, &shared, &run, resolution, &probe).unwrap().traces.remove(0);
    trace.values.iter().enumerate().map(|(i, &h)| (trace.dt_s * i as f64, kpa(rig, h))).collect()
}

pub(crate) fn highest_kpa(record: &Record, from_s: f64, to_s: f64) -> f64 {
    record.iter().filter(|(t, _)| (from_s..to_s).contains(t)).map(|r| r.1).fold(0.0, f64::max)
}

/// How long each cavity at the valve lasts, s: below 500 kPa, spikes bridged.
pub(crate) fn cavities_s(record: &Record) -> Vec<f64> {
    let mut lows: Vec<(f64, f64)> = Vec::new();
    for pair in record.windows(2).filter(|pair| pair[1].1 < 500.0) {
        match lows.last_mut() {
            Some(last) if pair[0].0 - last.1 < 0.012 => last.1 = pair[1].0,
            _ => lows.push((pair[0].0, pair[1].0)),
        }
    }
    lows.into_iter().map(|(start, end)| end - start).filter(|duration| *duration > 0.1).collect()
}
