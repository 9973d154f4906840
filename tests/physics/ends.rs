//! Effects at the valve, at the supply and at one sensor, against closed forms and integrations of their own.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use super::{rig, water};
use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::{Probe, Trace};
use surgescope_core::model::valve_from_head::valve_from_head;
use surgescope_core::model::{Conditions, Model, ModelError, Resolution, RunValues};

const LENGTH_M: f64 = 100.0;
const WAVE_SPEED_M_S: f64 = 400.0;
const DIAMETER_M: f64 = 0.02;
const G: f64 = 9.81;
const RUN: RunValues =
    RunValues { initial_velocity_m_s: 0.5, valve_head_m: 25.0, closing_time_s: 0.2, friction_scale: 1.0 };
const AREA_M2: f64 = FRAC_PI_4 * DIAMETER_M * DIAMETER_M;
const IMPEDANCE: f64 = WAVE_SPEED_M_S / (G * AREA_M2);
const FLOW_M3_S: f64 = 0.5 * AREA_M2;
/// Head that a sudden stop of the flow raises, m.
const JOUKOWSKY_M: f64 = IMPEDANCE * FLOW_M3_S;

type Form = fn(f64) -> Closure;
const ORIFICE: Form = |closing_time_s| Closure::Linear { closing_time_s };
const RAMP: Form = |closing_time_s| Closure::FlowRamp { closing_time_s };

/// What the sensor at the valve shows with effects and their values, in time after the start of the closure.
fn shown(
    effects: &str,
    values: &[f64],
    closure: Form,
    run: &RunValues,
    friction: f64,
    reaches: usize,
    duration_s: f64,
) -> Result<Trace, ModelError> {
    let rig = rig(LENGTH_M, DIAMETER_M * 1e3, 2.0, &format!("friction_factor = {friction}"));
    let water = water(&rig, 998.2);
    let mut model = Model::new(&rig, &water, &parse_list(effects).unwrap());
    model.closure = closure;
    let shared = [&[WAVE_SPEED_M_S], values].concat();
    assert_eq!(shared.len(), model.shared.len(), "{effects}");
    let conditions = Conditions::of(water);
    let probes = [Probe::head(LENGTH_M)];
    let simulated = model.simulate(&conditions, &shared, run, Resolution { reaches, duration_s }, &probes)?;
    model.sensed(&shared, &rig.sensors[0], simulated.traces[0].clone())
}

fn at_times(trace: &Trace, times: &[f64]) -> Vec<f64> {
    times.iter().map(|&t| trace.at(t)).collect()
}

fn times(duration_s: f64) -> Vec<f64> {
    (0..1000).map(|i| duration_s * f64::from(i) / 1000.0).collect()
}

/// Without friction and before the first reflection comes back, head and flow at the valve follow from the orifice and
/// one characteristic alone (Wylie & Streeter, ch. 3): `Q = τ Q0 √(H/H0)`, `H = H0 + B (Q0 - Q)`.
fn orifice_head(opening: f64) -> f64 {
    let (mut low, mut high) = (RUN.valve_head_m, RUN.valve_head_m + JOUKOWSKY_M);
    for _ in 0..200 {
        let head = 0.5 * (low + high);
        let flow = opening * FLOW_M3_S * (head / RUN.valve_head_m).sqrt();
        if head < RUN.valve_head_m + IMPEDANCE * (FLOW_M3_S - flow) { low = head } else { high = head }
    }
    low
}

/// The gap that lets through this part of what flowed before the closure.
fn seat_cda_mm2(opening: f64) -> f64 {
    1e6 * opening * FLOW_M3_S / (2.0 * G * RUN.valve_head_m).sqrt()
}

#[test]
fn the_first_rise_follows_the_valves_law() {
    let run = RunValues { closing_time_s: 0.4, ..RUN };
    let two_stage = |s: f64| if s < 0.25 { 1.0 - 0.4 * s / 0.25 } else { 0.6 * (1.0 - s) / 0.75 };
    type Law<'a> = &'a dyn Fn(f64) -> f64;
    let seat = [seat_cda_mm2(0.04)];
    let cases: [(&str, &[f64], Law); 4] = [
        ("valve-law", &[0.25, 0.6], &two_stage),
        ("valve-law/power", &[2.5], &|s: f64| (1.0 - s).powf(2.5)),
        ("valve-seat-leak/stroke", &[0.04], &|s: f64| 0.04 + 0.96 * (1.0 - s)),
        ("valve-seat-leak", &seat, &|s: f64| 0.04 + 0.96 * (1.0 - s)),
    ];
    for (effect, values, law) in cases {
        let trace = shown(effect, values, ORIFICE, &run, 0.0, 50, 1.0).unwrap();
        for step in [5, 20, 21, 40, 79, 80, 99] {
            let opening = law((f64::from(step) * trace.dt_s / 0.4).min(1.0));
            let error = trace.values[step as usize] - orifice_head(opening);
            assert!(error.abs() < 1e-9, "{effect}, step {step}: {error}");
        }
    }
}

/// In the end the water runs through the seat at the flow where friction eats the rest of the supply's head.
#[test]
fn through_a_leaking_seat_the_flow_ends_where_friction_and_seat_share_the_head() {
    let (friction, opening) = (0.03, 0.05);
    let trace = shown("valve-seat-leak", &[seat_cda_mm2(opening)], ORIFICE, &RUN, friction, 40, 400.0).unwrap();
    let loss_m = friction * LENGTH_M / DIAMETER_M * RUN.initial_velocity_m_s.powi(2) / (2.0 * G);
    // With q = Q/Q0: H = Hs - loss q², q = r √(H/H0).
    let share = opening * opening / RUN.valve_head_m;
    let end = (RUN.valve_head_m + loss_m) / (1.0 + loss_m * share);
    assert!((trace.at(400.0) - end).abs() < 1e-6, "{} {end}", trace.at(400.0));
}

/// What runs out through the seat during the first plateau is missing from Joukowsky's rise, and it is the gap's,
/// whatever flowed before.
#[test]
fn the_gap_of_a_seat_is_the_same_in_every_run() {
    for velocity in [0.5, 0.25] {
        let run = RunValues { initial_velocity_m_s: velocity, ..RUN };
        let plateau_m = shown("valve-seat-leak", &[2.0], ORIFICE, &run, 0.0, 40, 0.4).unwrap().at(0.3);
        let through_m_s = 2e-6 * (2.0 * G * plateau_m).sqrt() / AREA_M2;
        let exact = RUN.valve_head_m + WAVE_SPEED_M_S / G * (velocity - through_m_s);
        assert!((plateau_m - exact).abs() < 1e-9, "{velocity} m/s: {plateau_m} {exact}");
    }
}

/// With the valve shut and no friction the line is linear: the drift arrives after L/a, doubled by the shut end.
#[test]
fn a_drift_of_the_supply_arrives_after_the_travel_time_and_doubles() {
    let (change_m, time_constant_s) = (-3.0, 0.7);
    let run = RunValues { closing_time_s: 0.1, ..RUN };
    let base = shown("none", &[], RAMP, &run, 0.0, 100, 1.0).unwrap();
    let drifted = shown("supply-drift", &[change_m, time_constant_s], RAMP, &run, 0.0, 100, 1.0).unwrap();
    let travel_s = LENGTH_M / WAVE_SPEED_M_S;
    for (i, (b, d)) in base.values.iter().zip(&drifted.values).enumerate() {
        let t = base.dt_s * i as f64 - travel_s;
        if t > 2.0 * travel_s {
            break;
        }
        let exact = if t > 0.0 { -2.0 * change_m * (-t / time_constant_s).exp_m1() } else { 0.0 };
        assert!((d - b - exact).abs() < 1e-9, "{t}: {} {exact}", d - b);
    }
}

/// Without friction each return of a sudden wave to the supply is one quadratic (Contractor 1965): a shut pipe at rest
/// has the head `h` over the supply's, of which a flow `q` out of it takes `B q + k q|q|`, and is left with `h - 2Bq`.
#[test]
fn losses_in_the_mouth_weaken_a_wave_at_each_return() {
    let run = RunValues { closing_time_s: 0.0, ..RUN };
    for (loss, ratio) in [(40.0, 0.0), (40.0, 1.0), (300.0, 0.3), (5e3, 2.0)] {
        let trace = shown("inlet-jet", &[loss, ratio, 0.0], RAMP, &run, 0.0, 20, 6.0).unwrap();
        let k = loss / (2.0 * G * AREA_M2 * AREA_M2);
        let supply_m = RUN.valve_head_m + k * FLOW_M3_S * FLOW_M3_S;
        let mut over_m = RUN.valve_head_m + JOUKOWSKY_M - supply_m;
        for plateau in 0..11 {
            let seen = trace.at(0.25 + 0.5 * f64::from(plateau)) - supply_m;
            assert!((seen - over_m).abs() < 1e-7, "{loss} {ratio}, plateau {plateau}: {seen} {over_m}");
            let k = if over_m > 0.0 { ratio * k } else { k };
            let root = (IMPEDANCE * IMPEDANCE + 4.0 * k * over_m.abs()).sqrt();
            over_m -= 2.0 * IMPEDANCE * 2.0 * over_m / (IMPEDANCE + root);
        }
    }
}

/// What the steady flow lost in pipe and mouth stands at the valve when all is still (Bernoulli).
#[test]
fn at_rest_the_supply_stands_higher_by_what_the_inlet_took() {
    let (friction, loss) = (0.03, 200.0);
    let trace = shown("inlet-jet", &[loss, 1.0, 0.1], ORIFICE, &RUN, friction, 20, 4000.0).unwrap();
    let velocity_head_m = RUN.initial_velocity_m_s.powi(2) / (2.0 * G);
    let exact = RUN.valve_head_m + (friction * LENGTH_M / DIAMETER_M + loss) * velocity_head_m;
    // What still swings, swings about it.
    let mean = (0..80).map(|i| trace.at(3999.0 + f64::from(i) / 80.0)).sum::<f64>() / 80.0;
    assert!((mean - exact).abs() < 2e-3, "{mean} {exact}");
}

/// The water outside answers a wave `w` that arrives with `r = y - w`, `y' + (a/l) y = 2w'`: closed at first, open in
/// the end. Integrated here by Runge and Kutta, up to the second return.
#[test]
fn the_water_outside_rounds_what_comes_back() {
    let length_m = 5.0;
    let stopped = |t: f64| JOUKOWSKY_M * 0.5 * (1.0 - (PI * (t / 0.2).clamp(0.0, 1.0)).cos());
    let rate = |t: f64| if t > 0.2 { 0.0 } else { JOUKOWSKY_M * 0.5 * PI / 0.2 * (PI * t / 0.2).sin() };
    let slope = |t: f64, y: f64| 2.0 * rate(t) - WAVE_SPEED_M_S / length_m * y;
    let trace = shown("inlet-jet", &[0.0, 1.0, length_m], RAMP, &RUN, 0.0, 400, 1.0).unwrap();
    let there_and_back = 2 * 400;
    let (mut y, mut worst) = (0.0, 0.0f64);
    for i in 0..800 {
        let (t, dt) = (f64::from(i) * trace.dt_s, trace.dt_s);
        let over_m = stopped(t + 0.5) + 2.0 * (y - stopped(t));
        worst = worst.max((trace.values[(there_and_back + i) as usize] - RUN.valve_head_m - over_m).abs());
        let k1 = slope(t, y);
        let k2 = slope(t + dt / 2.0, y + dt / 2.0 * k1);
        let k3 = slope(t + dt / 2.0, y + dt / 2.0 * k2);
        let k4 = slope(t + dt, y + dt * k3);
        y += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    assert!(worst < 2e-4 * JOUKOWSKY_M, "{worst} of {JOUKOWSKY_M}");
    let plain = shown("none", &[], RAMP, &RUN, 0.0, 400, 1.0).unwrap();
    assert!((plain.at(0.6) - trace.at(0.6)).abs() > 0.02 * JOUKOWSKY_M, "the case shows the effect");
}

/// Before the first reflection the moving end is an oscillator damped by the waves it sends out:
/// `u'' + (2ζω + ω² C B A) u' + ω² u = ω² C B ΔQ(t)`, integrated here by Runge and Kutta; `h = B (ΔQ - A u')`.
#[test]
fn a_moving_valve_swings_against_its_own_waves() {
    let (hz, compliance_mm_per_m, damping) = (9.0, 0.4, 0.06);
    let (w, c) = (TAU * hz, compliance_mm_per_m * 1e-3);
    let stopped = |t: f64| FLOW_M3_S * 0.5 * (1.0 - (PI * (t / 0.2).min(1.0)).cos());
    let slope = |t: f64, [u, v]: [f64; 2]| {
        let head = IMPEDANCE * (stopped(t) - AREA_M2 * v);
        [v, w * w * (c * head - u) - 2.0 * damping * w * v]
    };
    let trace = shown("moving-valve", &[hz, compliance_mm_per_m, damping], RAMP, &RUN, 0.0, 400, 0.5).unwrap();
    let (mut y, mut worst, parts) = ([0.0, 0.0], 0.0f64, 10);
    let step = trace.dt_s / f64::from(parts);
    for i in 0..790 {
        let head = IMPEDANCE * (stopped(f64::from(i) * trace.dt_s) - AREA_M2 * y[1]);
        worst = worst.max((trace.values[i as usize] - RUN.valve_head_m - head).abs());
        for p in 0..parts {
            let t = f64::from(i) * trace.dt_s + f64::from(p) * step;
            let add = |k: [f64; 2], by: f64| [y[0] + by * k[0], y[1] + by * k[1]];
            let k1 = slope(t, y);
            let k2 = slope(t + step / 2.0, add(k1, step / 2.0));
            let k3 = slope(t + step / 2.0, add(k2, step / 2.0));
            let k4 = slope(t + step, add(k3, step));
            for j in 0..2 {
                y[j] += step / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
            }
        }
    }
    assert!(worst < 2e-4 * JOUKOWSKY_M, "{worst} of {JOUKOWSKY_M}");
    let plain = shown("none", &[], RAMP, &RUN, 0.0, 400, 0.5).unwrap();
    assert!((plain.at(0.15) - trace.at(0.15)).abs() > 0.02 * JOUKOWSKY_M, "the case shows the effect");
}

#[test]
fn a_skewed_clock_and_a_wrong_gain_do_what_they_say() {
    let base = shown("none", &[], RAMP, &RUN, 0.02, 100, 3.0).unwrap();
    for skew_s in [0.0371, -0.0371] {
        let skewed = shown("clock-skew", &[skew_s], RAMP, &RUN, 0.02, 100, 3.0).unwrap();
        // Up to the end: a clock that is behind shows at the record's end what happens after it.
        let longer = shown("none", &[], RAMP, &RUN, 0.02, 100, 3.5).unwrap();
        for t in times(3.0) {
            assert!((skewed.at(t) - longer.at(t - skew_s)).abs() < 1e-9, "{t}");
        }
    }
    let gained = shown("sensor-gain", &[0.05], RAMP, &RUN, 0.02, 100, 3.0).unwrap();
    for t in times(3.0) {
        assert!((gained.at(t) - 1.05 * base.at(t)).abs() < 1e-9, "a sensor at elevation 0");
    }
}

#[test]
fn values_that_cannot_be_are_refused_by_name() {
    let cases: [(&str, &[f64], &str); 21] = [
        ("valve-law", &[0.0, 0.5], "inflection_time_fraction"),
        ("valve-law", &[0.5, 1.2], "inflection_opening"),
        ("valve-law/power", &[0.0], "valve_exponent"),
        ("valve-seat-leak", &[-0.01], "seat_cda_mm2"),
        ("valve-seat-leak/stroke", &[1.0], "residual_opening"),
        ("supply-drift", &[f64::NAN, 1.0], "supply_head_change_m"),
        ("supply-drift", &[1.0, 0.0], "supply_time_constant_s"),
        ("inlet-jet", &[-1.0, 0.5, 0.1], "inlet_K"),
        ("inlet-jet", &[1.0, -0.5, 0.1], "jet_ratio"),
        ("inlet-jet", &[1.0, 0.5, f64::INFINITY], "jet_length_m"),
        ("moving-valve", &[0.0, 1e-3, 0.1], "valve_frequency_Hz"),
        ("moving-valve", &[10.0, -1e-3, 0.1], "valve_compliance_mm_per_m"),
        ("moving-valve", &[10.0, 1e-3, 0.0], "valve_damping_ratio"),
        ("fluid-structure", &[0.7, 1200.0, 1.0], "wall_poisson_ratio"),
        ("fluid-structure", &[0.4, 410.0, 1.0], "stress_wave_speed_m_s"),
        ("fluid-structure", &[0.4, 1200.0, -1.0], "valve_give_mm_per_m"),
        ("fluid-structure/dry", &[0.4, 1200.0, 1.0, -1.0], "dry_friction_m"),
        ("fluid-structure/floor", &[0.4, 1200.0, 1.0, -1.0], "floor_friction_m"),
        ("sensor-lag", &[-1.0, 1.0], "lag_time_s"),
        ("clock-skew", &[f64::NAN], "clock_skew_s"),
        ("sensor-gain", &[-1.0], "gain_error"),
    ];
    for (effect, values, name) in cases {
        let error = shown(effect, values, ORIFICE, &RUN, 0.02, 20, 1.0).unwrap_err().to_string();
        assert!(error.contains(name), "{effect}: {error}");
    }
    let far = shown("clock-skew", &[-1e12], ORIFICE, &RUN, 0.02, 20, 1.0).unwrap_err().to_string();
    assert!(far.contains("GiB"), "{far}");
    let both = parse_list("valve-law,valve-law/power").unwrap_err().to_string();
    assert!(both.contains("one law"), "{both}");
}

/// The head of a run with a known law gives the law back, with friction, creep and a sampled record.
#[test]
fn the_law_of_the_valve_comes_back_from_the_head_before_it() {
    let run = RunValues { closing_time_s: 0.9, ..RUN };
    let creep = [0.2, 0.03];
    let law = [0.3, 0.55];
    let effects = "viscoelastic-wall:1,valve-law";
    let record = shown(effects, &[creep, law].concat(), ORIFICE, &run, 0.03, 300, 1.4).unwrap();
    let time_s: Vec<f64> = (0..2800).map(|i| f64::from(i) * 5e-4).collect();
    let head_m = at_times(&record, &time_s);
    let rig = rig(LENGTH_M, DIAMETER_M * 1e3, 2.0, "friction_factor = 0.03");
    let water = water(&rig, 998.2);
    let conditions = Conditions::of(water);
    let resolution = Resolution { reaches: 150, duration_s: 1.2 };
    let opening = |s: f64| if s < 0.3 { 1.0 - 0.45 * s / 0.3 } else { 0.55 * (1.0 - s).max(0.0) / 0.7 };
    // Also where the model has something at the valve's end: of no strength, so that the curve is the same.
    for (effects, values) in
        [("viscoelastic-wall:1", vec![0.2, 0.03]), ("viscoelastic-wall:1,moving-valve", vec![0.2, 0.03, 9.0, 0.0, 0.1])]
    {
        let model = Model::new(&rig, &water, &parse_list(effects).unwrap());
        let shared = [vec![WAVE_SPEED_M_S], values].concat();
        let curve = valve_from_head(&model, &conditions, &shared, &run, resolution, (&time_s, &head_m)).unwrap();
        assert_eq!(curve.velocity_m_s[0], RUN.initial_velocity_m_s);
        for (t, found) in curve.time_s.iter().zip(&curve.opening) {
            assert!((found - opening(t / 0.9)).abs() < 0.01, "{effects}, {t}: {found} {}", opening(t / 0.9));
        }
        assert!(curve.time_s.last().is_some_and(|t| *t >= 1.2));
        for bad in [(&[][..], &[][..]), (&[0.0, 0.0], &[1.0, 2.0]), (&[0.0, 1.0], &[1.0, f64::NAN])] {
            assert!(valve_from_head(&model, &conditions, &shared, &run, resolution, bad).is_err());
        }
    }
}
