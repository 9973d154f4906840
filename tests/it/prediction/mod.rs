//! What a model predicts, and what a record shows by frequency: on synthetic runs whose truth is known, and on
//! recordings that ship.

mod frequency;
mod predict;

use surgescope::fit::data::run_data::{Meter, RunData, RunStart, SensorData};
use surgescope::model::effects::parse_list;
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::rig::Rig;

pub(crate) const NOISE_M: f64 = 0.03;
pub(crate) const WAVE_SPEED: f64 = 361.0;
pub(crate) const CREEP: (f64, f64) = (0.14, 0.05);

/// A plastic pipe with a sensor at the valve and one in the middle.
pub(crate) fn plastic() -> Rig {
    let text = r#"
name = "plastic"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 90.0
inner_diameter_mm = 40.0
wall_thickness_mm = 4.0
material = "HDPE"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.08
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 90.0
unit = "kPa"
[[sensor]]
name = "P2"
kind = "pressure"
position_m = 45.0
unit = "kPa"
"#;
    Rig::from_toml(text, "plastic.toml").unwrap()
}

/// Noise of the first order: white, of a standard deviation in m, that carries a share of the sample before along.
#[derive(Clone, Copy)]
pub(crate) struct Noise {
    pub white_m: f64,
    pub carried: f64,
    pub seed: u64,
}

/// A run of a creeping wall at a flow, made on a finer grid than fits take, with white noise.
pub(crate) fn creeping(rig: &Rig, file: &str, velocity: f64, closing_time_s: f64) -> RunData {
    let noise = Noise { white_m: NOISE_M, carried: 0.0, seed: (1e3 * velocity) as u64 };
    creeping_in(noise, rig, file, velocity, closing_time_s)
}

/// The same in any noise.
pub(crate) fn creeping_in(of: Noise, rig: &Rig, file: &str, velocity: f64, closing_time_s: f64) -> RunData {
    let water = rig.fluid.properties(20.0);
    let model = Model::new(rig, &water, &parse_list("viscoelastic-wall:1").unwrap());
    let conditions = Conditions::of(water);
    let run = RunValues { initial_velocity_m_s: velocity, valve_head_m: 25.0, closing_time_s, friction_scale: 1.0 };
    let probes = [Probe::head(90.0), Probe::head(45.0)];
    let resolution = Resolution { reaches: 700, duration_s: 9.0 };
    let shared = [WAVE_SPEED, CREEP.0, CREEP.1];
    let simulated = model.simulate(&conditions, &shared, &run, resolution, &probes).unwrap();
    let meter = Meter { place: 0.0.into(), flow_m3_s: simulated.steady_flow_m3_s(0.0), relative_sd: 0.005 };
    let mut rng = fastrand::Rng::with_seed(of.seed);
    let total_m = of.white_m / (1.0 - of.carried * of.carried).sqrt();
    let time_s: Vec<f64> = (0..4600).map(|i| f64::from(i) * 2e-3).collect();
    let mut normal = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
    let mut last = total_m * normal();
    let mut noise = || {
        last = of.carried * last + of.white_m * normal();
        last
    };
    let sensors = rig.pressure_sensors().zip(&simulated.traces).map(|((_, sensor), trace)| SensorData {
        sensor: sensor.clone(),
        head_m: time_s.iter().map(|t| trace.at(t - 0.4) + noise()).collect(),
        time_s: time_s.clone(),
        noise_m: of.white_m,
        total_noise_m: total_m,
        hum: Vec::new(),
        lines: Vec::new(),
        offset_sd_m: 0.1,
        saturated: 0,
    });
    RunData {
        file: file.into(),
        sensors: sensors.collect(),
        conditions,
        start: RunStart {
            closure_s: (0.402, 1e-3),
            velocity_m_s: (meter.flow_m3_s / rig.pipes[0].area_m2(), 0.005),
            valve_head_m: (25.01, None),
            wave_speed_ratio: None,
            closing_time: None,
        },
        meter: Some(meter),
        extrema: vec![Vec::new(); 2],
    }
}
