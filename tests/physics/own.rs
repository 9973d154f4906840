//! Effects of one's own: effects of the catalogue, written as files, give the same traces; each place of a law does
//! what its equation says.

use super::{relative_rms, rig, water};
use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, Resolution, RunValues};
use surgescope_core::rig::Rig;

const LENGTH_M: f64 = 100.0;
const WAVE_SPEED_M_S: f64 = 400.0;

/// An effect with the parameters `a` and `b`.
fn file(name: &str, at: &str, gives: &str, law: &str, more: &str) -> String {
    format!(
        "name = \"{name}\"\nsays = \"A test.\"\nat = \"{at}\"\ngives = \"{gives}\"\nlaw = \"{law}\"\n\
         [parameter.a]\nunit = \"1\"\nstart = 1.0\nbounds = [-1e9, 1e9]\nvanishes_at = 0\n\
         [parameter.b]\nunit = \"1\"\nstart = 1.0\nbounds = [0.1, 1e3]\n{more}"
    )
}

/// The rig, with a text as its own effect.
fn rig_with(name: &str, text: &str) -> Rig {
    let mut plain = rig(LENGTH_M, 20.0, 2.0, "friction_factor = 0.02\nelevation_start_m = 2.0\nelevation_end_m = 5.0");
    plain.own_effects.insert(name.to_owned(), text.to_owned());
    // As read from a recording: only then is the effect known by its name.
    Rig::from_toml(&plain.stored_text(), "rig.toml").unwrap()
}

/// The readings of a sensor at the valve and the heads in the middle.
fn traces(rig: &Rig, effects: &str, values: &[f64], reaches: usize) -> Vec<f64> {
    let water = water(rig, 998.2);
    let mut model = Model::new(rig, &water, &parse_list(effects).unwrap());
    model.closure = |closing_time_s| Closure::Linear { closing_time_s };
    let shared = [&[WAVE_SPEED_M_S], values].concat();
    assert_eq!(shared.len(), model.shared.len(), "{effects}");
    let run = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 60.0, closing_time_s: 0.2, friction_scale: 1.0 };
    let resolution = Resolution { reaches, duration_s: 4.0 };
    let probes = [Probe::head(LENGTH_M), Probe::head(0.5 * LENGTH_M)];
    let traces = model.simulate(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap().traces;
    let shown = model.sensed(&shared, &rig.sensors[0], traces[0].clone()).unwrap();
    [&shown, &traces[1]].iter().flat_map(|trace| (0..1000).map(|i| trace.at(4e-3 * f64::from(i)))).collect()
}

fn largest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / (1.0 + b.abs())).fold(0.0, f64::max)
}

#[test]
fn leak_drift_and_gain_written_as_files_give_the_same_traces() {
    for (name, at, gives, law, of_catalogue, values, own_values) in [
        (
            "my-leak",
            "node",
            "flow_out_m3_s",
            "if(H > z, a * 1e-6 * sqrt(2 * g * (H - z)), 0 * b)",
            "leak",
            &[41.3, 3.0][..],
            &[41.3, 3.0, 1.0][..],
        ),
        ("my-drift", "supply", "head_m", "H + a * (1 - exp(-t / b))", "supply-drift", &[3.0, 2.0], &[3.0, 2.0]),
        ("my-gain", "sensor", "reading_m", "H + a * (H - z) * b", "sensor-gain", &[0.05], &[0.05, 1.0]),
    ] {
        let rig = rig_with(name, &file(name, at, gives, law, ""));
        let (own, known) = (traces(&rig, name, own_values, 60), traces(&rig, of_catalogue, values, 60));
        let base = traces(&rig, "none", &[], 60);
        assert!(largest(&own, &known) < 1e-12, "{name}: {}", largest(&own, &known));
        assert!(largest(&own, &base) > 1e-3, "{name} does nothing");
        let mut gone = own_values.to_vec();
        gone[usize::from(at == "node")] = 0.0;
        assert_eq!(traces(&rig, name, &gone, 60), base, "{name}");
    }
}

/// A loss of the form that the catalogue has, too, by the general solution of a node.
#[test]
fn a_head_loss_of_any_law_is_that_of_a_blockage() {
    let text = file("my-loss", "node", "head_loss_m", "a * Q * abs(Q) / Q0^2 * b", "");
    let rig = rig_with("my-loss", &text);
    let k = 40.0;
    let loss_m = k * 0.5f64.powi(2) / (2.0 * surgescope_core::units::GRAVITY_M_S2);
    let own = traces(&rig, "my-loss", &[41.3, loss_m, 1.0], 60);
    let known = traces(&rig, "blockage", &[41.3, k], 60);
    assert!(largest(&own, &known) < 1e-9, "{}", largest(&own, &known));
}

/// Halving the step halves the change at least, and the effect is far larger than what is left.
#[test]
fn states_and_walls_converge_with_the_grid() {
    let lagged = "[state.x]\nstart = \"H0\"\nrate = \"(H - x) / 0.05\"\n";
    for (name, at, gives, law, more, values) in [
        ("my-wall", "wall", "friction_m_per_m", "a * Q * abs(Q) * b", "", &[2e5, 1.0][..]),
        ("my-vessel", "valve", "flow_out_m3_s", "a * 1e-6 * (H - x) * b", lagged, &[2.0, 1.0]),
        ("my-regulator", "node", "head_loss_m", "a * 1e5 * Q * H / H0 * b", "", &[41.3, 30.0, 1.0]),
        ("my-throttle", "valve", "head_loss_m", "a * 1e9 * Q * abs(Q) * b", "", &[3.0, 1.0]),
        ("my-lag", "sensor", "reading_m", "H + a * (x - H) * b", lagged, &[1.0, 1.0]),
    ] {
        let rig = rig_with(name, &file(name, at, gives, law, more));
        let grids = [40, 80, 160].map(|reaches| traces(&rig, name, values, reaches));
        let base = traces(&rig, "none", &[], 160);
        let (first, second) = (relative_rms(&grids[0], &grids[1]), relative_rms(&grids[1], &grids[2]));
        assert!(first / second > 1.5, "{name}: {first} {second}");
        assert!(relative_rms(&grids[2], &base) > 10.0 * second, "{name}");
    }
}

/// A loss at the supply is that of the catalogue's inlet, whose water outside has no inertia.
#[test]
fn a_loss_at_the_supply_is_that_of_an_inlet() {
    let text = file("my-inlet", "supply", "head_loss_m", "a * Q * abs(Q) / Q0^2 * b", "");
    let rig = rig_with("my-inlet", &text);
    let k = 300.0;
    let loss_m = k * 0.5f64.powi(2) / (2.0 * surgescope_core::units::GRAVITY_M_S2);
    let own = traces(&rig, "my-inlet", &[loss_m, 1.0], 60);
    let known = traces(&rig, "inlet-jet", &[k, 1.0, 0.0], 60);
    assert!(largest(&own, &known) < 1e-9, "{}", largest(&own, &known));
    assert!(largest(&own, &traces(&rig, "none", &[], 60)) > 1e-3, "it does nothing");
}

/// A flow out that is the share `s` of the flow behind it: by the characteristics of a pipe without friction,
/// `ΔH = -z (1 + s) ΔQ` before the node and `ΔH - z ΔQ = 2 ΔH_valve` behind it, the wave of the closure goes on with
/// `2 (1 + s)/(2 + s)` of its head.
#[test]
fn a_law_reads_the_flow_behind_a_flow_out() {
    let rig = rig_with("my-share", &file("my-share", "node", "flow_out_m3_s", "a * Q * b", ""));
    let water = water(&rig, 998.2);
    let mut model = Model::new(&rig, &water, &parse_list("my-share").unwrap());
    model.closure = |closing_time_s| Closure::FlowRamp { closing_time_s };
    let run = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 60.0, closing_time_s: 0.02, friction_scale: 0.0 };
    let resolution = Resolution { reaches: 200, duration_s: 0.4 };
    let probes = [Probe::head(30.0), Probe::Flow(30.0.into()), Probe::Flow(80.0.into())];
    let rise_m = WAVE_SPEED_M_S * 0.5 / surgescope_core::units::GRAVITY_M_S2;
    for (place_m, share) in [(60.0, 0.1), (60.2, 0.4)] {
        let shared = [WAVE_SPEED_M_S, place_m, share, 1.0];
        let traces = model.simulate(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap().traces;
        assert!((traces[1].at(0.0) / traces[2].at(0.0) - 1.0 - share).abs() < 1e-12);
        let seen_m = traces[0].at(0.3) - traces[0].at(0.0);
        let exact_m = rise_m * 2.0 * (1.0 + share) / (2.0 + share);
        assert!((seen_m - exact_m).abs() < 1e-9 * exact_m, "{share}: {seen_m} {exact_m}");
    }
}
