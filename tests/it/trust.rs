//! How far to trust a number: the program says what a record cannot show, and intervals hold the truth.

use surgescope::fit::data::run_data::{Meter, RunData, RunStart, SensorData};
use surgescope::fit::outcome::fit::{Fit, FittedParameter};
use surgescope::fit::search::calibrate::calibrate;
use surgescope::fit::search::options::Options;
use surgescope::fit::validate::profile::profiles;
use surgescope::model::effects::parse_list;
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::rig::Rig;

use crate::common::normal;

const RIG: &str = r#"
name = "slow creep"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 60.0
inner_diameter_mm = 50.0
wall_thickness_mm = 5.0
material = "HDPE"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.06
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 60.0
unit = "kPa"
"#;

/// 3 s of a closure in a pipe whose second element takes 40 s: what it has crept by then is as J₂/τ₂.
fn record(rig: &Rig) -> RunData {
    let water = rig.fluid.properties(20.0);
    let model = Model::new(rig, &water, &parse_list("viscoelastic-wall:2").unwrap());
    let run = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 40.0, closing_time_s: 0.06, friction_scale: 1.0 };
    let conditions = Conditions::of(water);
    let resolution = Resolution { reaches: 400, duration_s: 3.5 };
    let simulated =
        model.simulate(&conditions, &[360.0, 0.1, 0.05, 0.6, 40.0], &run, resolution, &[Probe::head(60.0)]).unwrap();
    let mut noise = normal(7);
    let time_s: Vec<f64> = (0..3500).map(|i| f64::from(i) * 1e-3).collect();
    let head_m = time_s.iter().map(|t| simulated.traces[0].at(t - 0.5) + 0.05 * noise()).collect();
    let meter = Meter { place: 0.0.into(), flow_m3_s: simulated.steady_flow_m3_s(0.0), relative_sd: 0.01 };
    RunData {
        file: "run".into(),
        sensors: vec![SensorData {
            sensor: rig.sensors[0].clone(),
            time_s,
            head_m,
            noise_m: 0.05,
            total_noise_m: 0.05,
            hum: Vec::new(),
            lines: Vec::new(),
            offset_sd_m: 0.1,
            saturated: 0,
        }],
        conditions,
        start: RunStart {
            closure_s: (0.5, 1e-3),
            velocity_m_s: (0.5, 0.01),
            valve_head_m: (40.0, None),
            wave_speed_ratio: None,
            closing_time: None,
        },
        meter: Some(meter),
        extrema: vec![Vec::new()],
    }
}

fn parameter<'a>(fit: &'a Fit, name: &str) -> &'a FittedParameter {
    fit.parameters.iter().find(|p| p.name == name).unwrap()
}

#[test]
fn creep_slower_than_the_record_is_known_by_its_rate_alone() {
    let rig = Rig::from_toml(RIG, "rig.toml").unwrap();
    let runs = [record(&rig)];
    let options = Options::default();
    let fit = calibrate(&rig, &runs, &parse_list("viscoelastic-wall:2").unwrap(), &options, &|_| {}).unwrap();
    let slow = fit.unidentifiable.iter().find(|u| u.parameters == ["J2_per_GPa", "tau2_s"]);
    let slow = slow.unwrap_or_else(|| panic!("{:?}\n{:?}", fit.unidentifiable, fit.parameters));
    assert!(slow.in_words.contains("does not separate"), "{slow:?}");
    let rate = parameter(&fit, "J2_per_GPa").value / parameter(&fit, "tau2_s").value;
    assert!((rate / (0.6 / 40.0) - 1.0).abs() < 0.2, "{rate}: {slow:?}");
    for name in ["wave_speed_m_s", "J1_per_GPa", "tau1_s"] {
        assert!(fit.unidentifiable.iter().all(|u| !u.parameters.iter().any(|p| p == name)), "{:?}", fit.unidentifiable);
    }
    // Its profile does not end before the longest time that a fit may take. That of the wave speed ends where the slow
    // element cannot follow as far as the linear interval believes, so it is the narrower one.
    let which: Vec<usize> =
        ["wave_speed_m_s", "tau2_s"].map(|name| fit.parameters.iter().position(|p| p.name == name).unwrap()).to_vec();
    let profiles = profiles(&rig, &runs, &fit, &which, &options, &|_| {}).unwrap();
    // The fit has ended at its optimum; each profile descends at eight points or so.
    assert!(
        profiles.below_fit.abs() < 0.5 && profiles.evaluations > 50,
        "{} {}",
        profiles.below_fit,
        profiles.evaluations
    );
    let found = profiles.of_each;
    let (low, high) = found[0].interval_95;
    assert!(low < 360.0 && 360.0 < high, "{:?}", found[0]);
    let (linear_low, linear_high) = found[0].linear_95;
    assert!((0.5..1.2).contains(&((high - low) / (linear_high - linear_low))), "{:?}", found[0]);
    let (low, high) = found[1].interval_95;
    assert!(high == f64::INFINITY && low < 40.0, "{:?}", found[1]);
}
