//! Gas, vapour and air against what is known of them: exact periods and cavities, and energy.

use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::{Probe, Trace};
use surgescope_core::model::{Conditions, Model, ModelError, Resolution, RunValues};
use surgescope_core::rig::Rig;

use super::{rig, rig_of_two_pipes, water};

const G: f64 = 9.81;
const ATMOSPHERE_PA: f64 = 101_325.0;

/// One run: what differs between the tests.
struct Run<'a> {
    effects: &'a str,
    shared: &'a [f64],
    velocity: f64,
    head: f64,
    closing_s: f64,
    closure: fn(f64) -> Closure,
    reaches: usize,
    duration_s: f64,
}

fn smooth(closing_time_s: f64) -> Closure {
    Closure::FlowCycloid { closing_time_s }
}

impl Run<'_> {
    fn try_on(&self, rig: &Rig, probes: &[Probe]) -> Result<Vec<Trace>, ModelError> {
        let water = rig.fluid.properties(rig.fluid.temperature_degc);
        let mut model = Model::new(rig, &water, &parse_list(self.effects).unwrap());
        model.closure = self.closure;
        let run = RunValues {
            initial_velocity_m_s: self.velocity,
            valve_head_m: self.head,
            closing_time_s: self.closing_s,
            friction_scale: 1.0,
        };
        let conditions = Conditions::of(water);
        let resolution = Resolution { reaches: self.reaches, duration_s: self.duration_s };
        model.simulate(&conditions, self.shared, &run, resolution, probes).map(|s| s.traces)
    }

    fn on(&self, rig: &Rig, probes: &[Probe]) -> Vec<Trace> {
        self.try_on(rig, probes).unwrap()
    }
}

/// 100 m of 50 mm pipe without friction.
fn plain() -> Rig {
    rig(100.0, 50.0, 4.0, "friction_factor = 0.0")
}

fn usual<'a>(effects: &'a str, shared: &'a [f64]) -> Run<'a> {
    Run { effects, shared, velocity: 0.2, head: 40.0, closing_s: 0.3, closure: smooth, reaches: 64, duration_s: 2.0 }
}

#[test]
fn before_the_valve_moves_nothing_moves() {
    let rig = Rig::from_toml(include_str!("../../rigs/adelaide-copper.toml"), "adelaide-copper.toml").unwrap();
    for (effects, values) in [
        ("none", &[][..]),
        ("entrained-gas", &[1e-3, 1e-4][..]),
        ("vapour-cavity", &[1e-4, 1e-8, 101.325][..]),
        ("air-pocket", &[50.0, 1.2][..]),
    ] {
        let shared = [&[1319.0], values].concat();
        let shut_late = |closing_time_s| Closure::FlowRamp { closing_time_s: 1e9 + closing_time_s };
        let run = Run { velocity: 1.0, head: 15.0, closure: shut_late, duration_s: 5.0, ..usual(effects, &shared) };
        for trace in run.on(&rig, &[Probe::head(37.23), Probe::head(11.0), Probe::flow(20.0)]) {
            let moved = trace.values.iter().map(|v| (v - trace.values[0]).abs()).fold(0.0, f64::max);
            assert!(moved < 1e-8, "{effects}: {moved}");
        }
    }
}

/// The pressure falls to a metre above that of vapour: no cavity opens, and with cavities the run is the same.
#[test]
fn cavities_that_do_not_open_change_nothing() {
    let rig = plain();
    let head = |velocity| {
        let run = |effects, shared| Run { velocity, head: 2.0, ..usual(effects, shared) };
        let with =
            run("vapour-cavity", &[1200.0, 2e-4, 1e-8, 101.325]).on(&rig, &[Probe::head(100.0), Probe::head(40.0)]);
        let without = run("none", &[1200.0]).on(&rig, &[Probe::head(100.0), Probe::head(40.0)]);
        let apart =
            |(a, b): (&Trace, &Trace)| a.values.iter().zip(&b.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let least = without.iter().flat_map(|trace| &trace.values).copied().fold(f64::INFINITY, f64::min);
        (least, with.iter().zip(&without).map(apart).fold(0.0, f64::max))
    };
    let vapour_m = -10.1;
    let (least, apart) = head(0.12);
    assert!((vapour_m + 1.0..vapour_m + 2.0).contains(&least), "the trough is near vapour pressure: {least}");
    assert!(apart < 1e-8, "{apart}");
    let (least, apart) = head(0.16);
    assert!(least < vapour_m, "without cavities the head falls below that of vapour: {least}");
    assert!(apart > 1.0, "{apart}");
}

/// The period of small oscillations about the head at rest, from the zeros of the head at the valve.
fn period_s(trace: &Trace, rest_m: f64, from_s: f64) -> f64 {
    let mut rises = Vec::new();
    for (i, pair) in trace.values.windows(2).enumerate() {
        let (a, b) = (pair[0] - rest_m, pair[1] - rest_m);
        let time_s = (i as f64 + a / (a - b)) * trace.dt_s;
        if a < 0.0 && b >= 0.0 && time_s > from_s {
            rises.push(time_s);
        }
    }
    (rises[rises.len() - 1] - rises[0]) / (rises.len() - 1) as f64
}

/// Wylie & Streeter's wave speed of water with gas: `1/a_m² = 1/a² + α H_atm/(g y²)`, `y` the head above that of
/// vapour.
#[test]
fn waves_in_gassy_water_have_wylies_speed() {
    let rig = plain();
    let water = water(&rig, rig.fluid.properties(20.0).density_kg_m3);
    let per_m = water.density_kg_m3 * G;
    let a = 1200.0f64;
    for (gas_fraction, head) in [(1e-5, 20.0), (1e-4, 40.0), (1e-3, 30.0)] {
        let y = head + (ATMOSPHERE_PA - water.vapour_pressure_pa) / per_m;
        let wylie = (1.0 / (1.0 / (a * a) + gas_fraction * ATMOSPHERE_PA / per_m / (G * y * y))).sqrt();
        let period = 4.0 * 100.0 / wylie;
        let shared = [a, gas_fraction, 0.0];
        let run = Run {
            velocity: 1e-4,
            head,
            closing_s: 0.75 * period,
            duration_s: 12.0 * period,
            reaches: 128,
            ..usual("entrained-gas", &shared)
        };
        let found = period_s(&run.on(&rig, &[Probe::head(100.0)])[0], head, period);
        assert!((found / period - 1.0).abs() < 2e-3, "{gas_fraction} {head}: {found} {period}");
    }
}

/// Pipe and spring: `gA/a cot(ωL/a) = ω V/(n y)` for small oscillations.
#[test]
fn small_oscillations_on_a_pocket_have_their_exact_period() {
    let rig = plain();
    let density = rig.fluid.properties(20.0).density_kg_m3;
    let (a, area) = (1000.0f64, std::f64::consts::FRAC_PI_4 * 0.05 * 0.05);
    for (volume_ml, exponent) in [(20.0, 1.0), (300.0, 1.2), (5000.0, 1.4)] {
        let head = 30.0;
        let spring = volume_ml * 1e-6 / (exponent * (head + ATMOSPHERE_PA / (density * G)));
        let (mut low, mut high) = (1e-3, 0.5 * std::f64::consts::PI);
        while high - low > 1e-13 {
            let x = 0.5 * (low + high);
            if G * area / a / x.tan() > x * a / 100.0 * spring { low = x } else { high = x }
        }
        let period = std::f64::consts::TAU * 100.0 / (a * low);
        let shared = [a, volume_ml, exponent];
        let run = Run {
            velocity: 1e-4,
            head,
            closing_s: 0.75 * period,
            duration_s: 12.0 * period,
            reaches: 100,
            ..usual("air-pocket", &shared)
        };
        let found = period_s(&run.on(&rig, &[Probe::head(100.0)])[0], head, period);
        assert!((found / period - 1.0).abs() < 1e-3, "{volume_ml} {exponent}: {found} {period}");
    }
}

/// A pocket much softer than the water stops the column: its work, `∫ (p - p0) dV` from the first volume to the least,
/// is what the column's motion held, and the other way on the way back.
#[test]
fn a_pocket_takes_in_and_gives_back_the_energy_of_the_column() {
    let rig = plain();
    let density = rig.fluid.properties(20.0).density_kg_m3;
    let (head, volume, exponent) = (20.0, 2e-3, 1.2);
    let y0 = head + ATMOSPHERE_PA / (density * G);
    let velocity = 0.5;
    let motion_j = 0.5 * density * 0.25 * std::f64::consts::PI * 0.05f64.powi(2) * 100.0 * velocity * velocity;
    let shared = [1400.0, volume * 1e6, exponent];
    let shut = |_| Closure::FlowRamp { closing_time_s: 1e-9 };
    let run = Run { velocity, head, closure: shut, duration_s: 4.0, reaches: 200, ..usual("air-pocket", &shared) };
    let trace = &run.on(&rig, &[Probe::head(100.0)])[0];
    let work_j = |head: f64| {
        let y = head + y0 - 20.0;
        let v = volume * (y0 / y).powf(1.0 / exponent);
        let stored = density * G * (y * v - y0 * volume) / (exponent - 1.0);
        stored - density * G * y0 * (volume - v)
    };
    let highest = trace.values.iter().copied().fold(f64::MIN, f64::max);
    let lowest = trace.values.iter().copied().fold(f64::MAX, f64::min);
    for extreme in [highest, lowest] {
        assert!((work_j(extreme) / motion_j - 1.0).abs() < 0.02, "{extreme}: {} {motion_j}", work_j(extreme));
    }
}

/// One cavity at the valve of a level pipe without friction, after a sudden closure: with `d = g y0/a`, `y0` the head
/// above that of vapour, the water leaves the valve with `V0 - d` in the first `2L/a` after `2L/a`, and `2d` slower in
/// each one after. The cavity is full when that adds up to nothing, and the head rises by `a/g` of the last velocity.
#[test]
fn a_cavity_at_the_valve_lasts_as_long_as_it_must() {
    let rig = plain();
    let water = rig.fluid.properties(20.0);
    let vapour_m = (water.vapour_pressure_pa - ATMOSPHERE_PA) / (water.density_kg_m3 * G);
    let (a, velocity, head) = (1200.0, 1.0, 20.0);
    let d = G * (head - vapour_m) / a;
    let (mut volume, mut periods, mut leaving) = (0.0, 1.0, velocity - d);
    while volume + leaving > 0.0 {
        volume += leaving;
        periods += 1.0;
        leaving -= 2.0 * d;
    }
    let return_s = 2.0 * 100.0 / a;
    let end_s = return_s * (periods + volume / -leaving);
    let shut = |_| Closure::FlowRamp { closing_time_s: 1e-9 };
    let last = |effects: &str, values: &[f64], reaches: usize| {
        let shared = [&[a], values].concat();
        let run = Run { velocity, head, closure: shut, duration_s: 1.2, reaches, ..usual(effects, &shared) };
        let trace = run.on(&rig, &[Probe::head(100.0)]).remove(0);
        let lowest = trace.values.iter().copied().fold(f64::MAX, f64::min);
        assert!(lowest > vapour_m - 1e-3, "{effects}: {lowest}");
        let full = (0..trace.values.len())
            .find(|&i| trace.dt_s * i as f64 > 1.1 * return_s && trace.values[i] > vapour_m + 5.0)
            .unwrap();
        (trace.dt_s * full as f64 - end_s, trace.at(end_s + 6.0 * trace.dt_s) - vapour_m)
    };
    let jump = -leaving * a / G;
    // Hardly any gas: the vapour cavity alone, to the step.
    let errors = [50, 100, 200].map(|n| last("entrained-gas", &[1e-11, 0.0], n));
    for ((late_s, rise), reaches) in errors.iter().zip([50.0, 100.0, 200.0]) {
        let dt_s = 100.0 / a / reaches;
        assert!(late_s.abs() < 2.0 * dt_s, "{reaches} reaches: {late_s} s late");
        assert!((rise / jump - 1.0).abs() < 0.01, "{reaches} reaches: {rise} {jump}");
    }
    // The gas that starts the cavities of `vapour-cavity` shows by a hundredth.
    let (late_s, rise) = last("vapour-cavity", &[0.0, 1e-7, 101.325], 200);
    assert!((late_s / (end_s - return_s)).abs() < 0.02, "{late_s}");
    assert!((rise / jump - 1.0).abs() < 0.05, "{rise} {jump}");
}

/// The joint of two equal pipes is solved by another way than the nodes beside it, and changes nothing.
#[test]
fn a_joint_is_a_node_like_any_other() {
    let text = rig_of_two_pipes();
    let mut joined = Rig::from_toml(&text, "two.toml").unwrap();
    for pipe in &mut joined.pipes {
        pipe.length_m = 50.0;
        pipe.inner_diameter_m = 0.05;
    }
    let whole = plain();
    let at = |rig: &Rig, effects: &str, shared: &[f64]| {
        let run = Run { velocity: 0.7, closing_s: 0.02, duration_s: 1.0, ..usual(effects, shared) };
        run.on(rig, &[Probe::head(100.0)]).remove(0)
    };
    for (effects, values) in [("entrained-gas", [1e-5, 1e-4]), ("entrained-gas", [1e-3, 0.0])] {
        let one = at(&whole, effects, &[&[1000.0], &values[..]].concat());
        let two = at(&joined, effects, &[&[1000.0, 1000.0], &values[..]].concat());
        let worst = one.values.iter().zip(&two.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-5, "{effects} {values:?}: {worst}");
    }
}

#[test]
fn what_gas_cannot_be_is_refused() {
    let rig = plain();
    let refusal = |effects: &str, values: &[f64], head: f64| {
        let shared = [&[1000.0], values].concat();
        Run { head, ..usual(effects, &shared) }.try_on(&rig, &[Probe::head(100.0)]).map(|_| ()).unwrap_err().to_string()
    };
    assert!(refusal("entrained-gas", &[-1e-6, 0.0], 40.0).contains("gas_fraction"));
    assert!(refusal("entrained-gas", &[1.5, 0.0], 40.0).contains("gas_fraction"));
    assert!(refusal("entrained-gas", &[f64::NAN, 0.0], 40.0).contains("gas_fraction"));
    assert!(refusal("entrained-gas", &[1e-6, -1.0], 40.0).contains("gas_lag_s"));
    assert!(refusal("vapour-cavity", &[-1.0, 1e-8, 101.325], 40.0).contains("cavity_lag_s"));
    assert!(refusal("vapour-cavity", &[0.0, 1.5, 101.325], 40.0).contains("cavity_gas_fraction"));
    assert!(refusal("vapour-cavity", &[0.0, 1e-8, f64::NAN], 40.0).contains("air_pressure_kPa"));
    assert!(refusal("vapour-cavity", &[0.0, 1e-8, 101.325], -11.0).contains("boils"));
    assert!(refusal("air-pocket", &[-1.0, 1.2], 40.0).contains("air_volume_mL"));
    assert!(refusal("air-pocket", &[10.0, 0.9], 40.0).contains("polytropic_exponent"));
    assert!(refusal("air-pocket", &[10.0, 1.2], -11.0).contains("valve_head_m"));
    assert!(parse_list("entrained-gas,vapour-cavity").unwrap_err().to_string().contains("cavities"));
    assert!(parse_list("vapour-cavity,air-pocket").is_ok());
}
