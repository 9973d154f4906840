//! Records with a known truth for tests, simulated on a grid of their own.

use crate::fit::data::run_data::{Meter, RunData, RunStart, SensorData};
use crate::model::effects::{Chosen, parse_list};
use crate::model::trace::Probe;
use crate::model::{Conditions, Model, Resolution, RunValues};
use crate::rig::Rig;

/// A plastic pipe with a sensor at its valve.
pub(crate) const HDPE: &str = r#"
name = "one pipe"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 80.0
inner_diameter_mm = 50.0
wall_thickness_mm = 5.0
material = "HDPE"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.1
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 80.0
unit = "kPa"
"#;

/// The same pipe of copper, which does not creep.
pub(crate) fn copper() -> Rig {
    Rig::from_toml(&HDPE.replace("HDPE", "copper"), "rig.toml").unwrap()
}

/// When the valve starts to close, s.
const CLOSURE_S: f64 = 0.2;

/// A plastic pipe with a short branch 89.9 m from its supply, and its record. Beside too little creep a fit finds the
/// branch elsewhere.
pub(crate) fn short_branch() -> (Rig, RunData) {
    let rig = Rig::from_toml(&HDPE.replace("80.0", "109.15").replace("50.0", "16.0"), "rig.toml").unwrap();
    let effects = parse_list("viscoelastic-wall:2,side-branch").unwrap();
    let run = RunValues { initial_velocity_m_s: 0.74, valve_head_m: 51.4, closing_time_s: 0.196, friction_scale: 1.03 };
    let record = record(&rig, &effects, &[474.9, 0.0749, 0.0204, 0.0807, 0.221, 89.9, 3.9, 0.95], run, 0.086, 9.0);
    (rig, record)
}

/// A record at 1 kHz of the rig's first sensor, with even noise of `noise_m`.
pub(crate) fn record(
    rig: &Rig,
    effects: &[Chosen],
    shared: &[f64],
    run: RunValues,
    noise_m: f64,
    duration_s: f64,
) -> RunData {
    let water = rig.fluid.properties(20.0);
    let model = Model::new(rig, &water, effects);
    let conditions = Conditions::of(water);
    let resolution = Resolution { reaches: 601, duration_s };
    let sensor = rig.sensors[0].clone();
    let probes = [Probe::head(sensor.place())];
    let simulated = model.simulate(&conditions, shared, &run, resolution, &probes).unwrap();
    let meter = Meter { place: 0.0.into(), flow_m3_s: simulated.steady_flow_m3_s(0.0), relative_sd: 0.003 };
    let velocity = meter.flow_m3_s / rig.pipes[0].area_m2();
    let mut random = fastrand::Rng::with_seed(1);
    let mut noise = || noise_m * 12f64.sqrt() * (random.f64() - 0.5);
    let time_s: Vec<f64> = (0..(1e3 * duration_s) as usize).map(|i| i as f64 * 1e-3).collect();
    let head_m: Vec<f64> = time_s.iter().map(|t| simulated.traces[0].at(t - CLOSURE_S) + noise()).collect();
    let period_s = model.period_s(shared);
    // Extrema a quarter of a period after each front.
    let extrema = (0..)
        .map(|i| {
            (CLOSURE_S + run.closing_time_s + period_s * (0.25 + 0.5 * f64::from(i)), i as usize / 2 + 1, i % 2 == 0)
        })
        .take_while(|(t, ..)| *t < duration_s - 0.3 * period_s)
        .collect();
    RunData {
        file: "run".into(),
        sensors: vec![SensorData {
            sensor,
            time_s,
            head_m,
            noise_m,
            total_noise_m: noise_m,
            hum: Vec::new(),
            lines: Vec::new(),
            offset_sd_m: 0.2,
            saturated: 0,
        }],
        conditions,
        start: RunStart {
            closure_s: (CLOSURE_S, 1e-3),
            velocity_m_s: (velocity, 0.01),
            valve_head_m: (run.valve_head_m, None),
            wave_speed_ratio: None,
            closing_time: None,
        },
        meter: Some(meter),
        extrema: vec![extrema],
    }
}
