//! The model against what is not ours: exact solutions, published numbers, conservation, orders of convergence.

mod adelaide;
mod catalogue;
mod column;
mod ends;
mod energy;
mod exact;
mod gas;
mod network;
mod own;
mod place;
mod quasi_2d;
mod unsteady_friction;
mod wall;
mod wall_recursion;

use exact::{Exact, Ramp, Shear};
use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, Resolution, RunValues};
use surgescope_core::rig::{Rig, WaterProperties};

pub(crate) fn cosine(closing_time_s: f64) -> Closure {
    Closure::FlowRamp { closing_time_s }
}

pub(crate) fn cycloid(closing_time_s: f64) -> Closure {
    Closure::FlowCycloid { closing_time_s }
}

pub(crate) fn linear(closing_time_s: f64) -> Closure {
    Closure::Linear { closing_time_s }
}

/// A rig of one uniform pipe, built as a user would: from a file's text.
pub(crate) fn rig(length_m: f64, diameter_mm: f64, wall_mm: f64, friction: &str) -> Rig {
    let text = format!(
        r#"
name = "reference"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = {length_m}
inner_diameter_mm = {diameter_mm}
wall_thickness_mm = {wall_mm}
material = "HDPE"
constraint = 1.0
{friction}
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.1
[[sensor]]
name = "P1"
kind = "pressure"
position_m = {length_m}
unit = "kPa"
"#
    );
    Rig::from_toml(&text, "reference.toml").unwrap()
}

fn water(rig: &Rig, density_kg_m3: f64) -> WaterProperties {
    WaterProperties { density_kg_m3, ..rig.fluid.properties(20.0) }
}

/// Deviation of the head at `places` and `times` for a frictionless pipe with the exact problem's data.
fn simulate(problem: &Exact, reaches: usize, places: &[f64], times: &[f64]) -> Vec<Vec<f64>> {
    let rig = rig(problem.length, problem.diameter * 1e3, problem.wall * 1e3, "friction_factor = 0.0");
    let water = water(&rig, problem.density);
    let effects = match problem.creep.len() {
        0 => parse_list("none"),
        n => parse_list(&format!("viscoelastic-wall:{n}")),
    };
    let mut model = Model::new(&rig, &water, &effects.unwrap());
    model.closure = match problem.ramp {
        Ramp::Cosine(_) => |closing_time_s| Closure::FlowRamp { closing_time_s },
        Ramp::Cycloid(_) => |closing_time_s| Closure::FlowCycloid { closing_time_s },
    };
    let (Ramp::Cosine(closing_time_s) | Ramp::Cycloid(closing_time_s)) = problem.ramp;
    let mut shared = vec![problem.wave_speed];
    shared.extend(problem.creep.iter().flat_map(|&(j, tau)| [j * 1e9, tau]));
    let run =
        RunValues { initial_velocity_m_s: problem.velocity, valve_head_m: 30.0, closing_time_s, friction_scale: 1.0 };
    let duration_s = times.iter().copied().fold(0.0, f64::max);
    let conditions = Conditions::of(water);
    let probes: Vec<Probe> = places.iter().map(|&x| Probe::head(x)).collect();
    let traces =
        model.simulate(&conditions, &shared, &run, Resolution { reaches, duration_s }, &probes).unwrap().traces;
    traces.iter().map(|trace| times.iter().map(|&t| trace.at(t) - 30.0).collect()).collect()
}

pub(crate) fn relative_rms(value: &[f64], exact: &[f64]) -> f64 {
    let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
    (square(&mut value.iter().zip(exact).map(|(v, e)| v - e)) / square(&mut exact.iter().copied())).sqrt()
}

pub(crate) fn largest_error(value: &[f64], exact: &[f64]) -> f64 {
    value.iter().zip(exact).map(|(v, e)| (v - e).abs()).fold(0.0, f64::max)
}

/// The columns of a reference file.
pub(crate) fn reference(text: &str) -> Vec<Vec<f64>> {
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter(|l| !l.starts_with('#') && !l.is_empty())
        .map(|l| l.split(',').map(|c| c.trim().parse().unwrap()).collect())
        .collect();
    (0..rows[0].len()).map(|c| rows.iter().map(|r| r[c]).collect()).collect()
}

fn b1() -> Exact {
    let creep = [(1.057, 0.05), (1.054, 0.5), (0.9051, 1.5), (0.2617, 5.0), (0.7456, 10.0)];
    Exact {
        length: 277.0,
        diameter: 0.0506,
        wall: 0.0063,
        wave_speed: 395.0,
        density: 1000.0,
        velocity: 0.5,
        ramp: Ramp::Cycloid(0.10),
        creep: creep.iter().map(|&(j, tau)| (j * 1e-10, tau)).collect(),
        shear: Shear::None,
    }
}

fn b3(ramp: Ramp) -> Exact {
    Exact {
        length: 37.8,
        diameter: 0.014,
        wall: 0.003,
        wave_speed: 470.0,
        density: 997.0,
        velocity: 1.0,
        ramp,
        creep: vec![(1e-10, 0.0225), (8e-10, 1.1)],
        shear: Shear::None,
    }
}

/// Orders of convergence from errors at halved steps.
pub(crate) fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|w| (w[0] / w[1]).log2()).collect()
}

/// Both ways to the exact solution agree: the reference files were made by another inversion.
#[test]
fn the_exact_solution_meets_the_reference_files() {
    let file = reference(include_str!("../reference/B1_kv5.csv"));
    let problem = b1();
    assert!(largest_error(&problem.head(277.0, &file[0]), &file[1]) < 2e-4);
    assert!(largest_error(&problem.head(138.5, &file[0]), &file[2]) < 2e-4);
    let file = reference(include_str!("../reference/B3_seed2kv.csv"));
    assert!(largest_error(&b3(Ramp::Cycloid(0.04)).head(37.8, &file[0]), &file[1]) < 2e-4);
}

#[test]
fn five_kelvin_voigt_elements_converge_to_b1() {
    let file = reference(include_str!("../reference/B1_kv5.csv"));
    let at = |reaches| {
        let heads = simulate(&b1(), reaches, &[277.0, 138.5], &file[0]);
        [largest_error(&heads[0], &file[1]), largest_error(&heads[1], &file[2])]
    };
    let errors = [64, 128, 256].map(at);
    assert!(errors[1][0] < 0.02 && errors[1][1] < 0.02, "{errors:?}");
    for place in 0..2 {
        // An extremum between two steps is written no higher than they are: an error of second order, too, but of a
        // size that goes by where the steps fall. So the order is that over both halvings.
        let [first, second] = orders(&errors.map(|e| e[place]))[..] else { panic!("{errors:?}") };
        assert!(0.5 * (first + second) > 1.9 && first.min(second) > 1.8, "{first} {second}");
    }
}

#[test]
fn two_kelvin_voigt_elements_converge_to_b3() {
    let file = reference(include_str!("../reference/B3_seed2kv.csv"));
    let problem = b3(Ramp::Cycloid(0.04));
    let errors = [64, 128, 256].map(|n| largest_error(&simulate(&problem, n, &[37.8], &file[0])[0], &file[1]));
    assert!(errors[1] < 0.02, "{errors:?}");
    assert!(orders(&errors).iter().all(|&o| o > 1.9), "{errors:?}");
}

/// Relative rms at valve and middle, both closures, a short stiff rig and a long soft one.
#[test]
fn two_elements_at_240_reaches_are_exact_to_a_ten_thousandth() {
    let soft = |ramp| Exact { creep: vec![(1e-10, 0.05), (1e-10, 0.5)], ramp, ..b1() };
    let cases = [
        (b3(Ramp::Cosine(0.04)), 2.0),
        (b3(Ramp::Cycloid(0.04)), 2.0),
        (soft(Ramp::Cosine(0.1)), 8.0),
        (soft(Ramp::Cycloid(0.1)), 8.0),
    ];
    for (problem, duration) in cases {
        let times: Vec<f64> = (0..400).map(|i| f64::from(i) * duration / 400.0).collect();
        let places = [problem.length, 0.5 * problem.length];
        let exact = places.map(|x| problem.head(x, &times));
        let errors = [60, 120, 240].map(|n| {
            let heads = simulate(&problem, n, &places, &times);
            [relative_rms(&heads[0], &exact[0]), relative_rms(&heads[1], &exact[1])]
        });
        for place in 0..2 {
            let errors = errors.map(|e| e[place]);
            assert!(errors[2] <= 1e-4, "{errors:?}");
            assert!(orders(&errors).iter().all(|&o| o > 1.85), "{errors:?}");
        }
    }
}

/// An elastic frictionless pipe: the scheme is exact, so a sudden closure gives Joukowsky's `a V0/g`, square, for ever.
#[test]
fn without_friction_and_creep_joukowskys_head_neither_decays_nor_grows() {
    let problem = Exact { creep: vec![], ramp: Ramp::Cosine(1e-9), ..b3(Ramp::Cosine(1e-9)) };
    let period = 4.0 * problem.length / problem.wave_speed;
    let joukowsky = problem.wave_speed * problem.velocity / 9.81;
    let middles: Vec<f64> = (0..400).map(|half| (f64::from(half) + 0.5) * period / 2.0).collect();
    let heads = &simulate(&problem, 50, &[problem.length], &middles)[0];
    for (half, head) in heads.iter().enumerate() {
        let exact = if half % 2 == 0 { joukowsky } else { -joukowsky };
        assert!((head - exact).abs() < 1e-9 * joukowsky, "half period {half}: {head}");
    }
}

/// A positioned sensor between nodes sees what the exact solution says, to second order.
#[test]
fn a_sensor_between_nodes_is_as_good_as_one_on_a_node() {
    let problem = b1();
    let times: Vec<f64> = (0..300).map(|i| f64::from(i) * 0.02).collect();
    let x = 101.7;
    let exact = problem.head(x, &times);
    let errors = [64, 128, 256].map(|n| relative_rms(&simulate(&problem, n, &[x], &times)[0], &exact));
    assert!(errors[1] < 5e-4, "{errors:?}");
    assert!(orders(&errors).iter().all(|&o| o > 1.7), "{errors:?}");
}

/// A rig of two pipes and the heads at its valve, `t` after a sudden closure.
fn two_pipes(reaches: usize, times: &[f64]) -> Vec<f64> {
    let text = rig_of_two_pipes();
    let rig = Rig::from_toml(&text, "two.toml").unwrap();
    let water = water(&rig, 1000.0);
    let mut model = Model::new(&rig, &water, &[]);
    model.closure = |closing_time_s| Closure::FlowRamp { closing_time_s };
    let run = RunValues { initial_velocity_m_s: 1.0, valve_head_m: 50.0, closing_time_s: 0.02, friction_scale: 1.0 };
    let conditions = Conditions::of(water);
    let resolution = Resolution { reaches, duration_s: 2.0 };
    let trace = model.simulate(&conditions, &[1200.0, 400.0], &run, resolution, &[Probe::head(160.0)]).unwrap().traces;
    times.iter().map(|&t| trace[0].at(t) - 50.0).collect()
}

fn rig_of_two_pipes() -> String {
    let pipe = |name: &str, length: f64, diameter: f64| {
        format!(
            "[[pipe]]\nname = \"{name}\"\nlength_m = {length}\ninner_diameter_mm = {diameter}\nwall_thickness_mm = 4.0\nmaterial = \
             \"steel\"\nfriction_factor = 0.0\n"
        )
    };
    format!(
        "name = \"two\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n{}{}[upstream]\nkind = \"reservoir\"\n[downstream]\nkind = \
         \"valve\"\nclosing_time_s = 0.02\n[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nposition_m = 160.0\nunit = \"kPa\"\n",
        pipe("up", 97.3, 60.0),
        pipe("down", 62.7, 50.0)
    )
}

/// Pipes in series: first rise `B2 Q0`, then the reflection `r = (B1 - B2)/(B1 + B2)` of the joint, `2 r` of the rise,
/// although the joint lies on no node.
#[test]
fn a_joint_between_nodes_reflects_as_its_impedances_say() {
    let area = |d: f64| std::f64::consts::FRAC_PI_4 * d * d;
    let (b1, b2) = (1200.0 / (9.81 * area(0.06)), 400.0 / (9.81 * area(0.05)));
    let flow = area(0.05);
    let rise = b2 * flow;
    let reflection = (b1 - b2) / (b1 + b2);
    let back_s = 2.0 * 62.7 / 400.0;
    let heads = two_pipes(400, &[0.1, back_s - 0.01, back_s + 0.04]);
    assert!((heads[0] / rise - 1.0).abs() < 1e-9, "{heads:?}");
    assert!((heads[1] / rise - 1.0).abs() < 1e-3, "{heads:?}");
    assert!((heads[2] / (rise * (1.0 + 2.0 * reflection)) - 1.0).abs() < 1e-3, "{heads:?} {rise} {reflection}");
}

/// The same, as convergence of the whole trace: no bent wave speeds, no lost length.
#[test]
fn pipes_in_series_converge_smoothly() {
    let times: Vec<f64> = (0..800).map(|i| f64::from(i) * 0.0025).collect();
    let finest = two_pipes(3201, &times);
    let errors = [101, 201, 401].map(|n| relative_rms(&two_pipes(n, &times), &finest));
    assert!(errors[2] < 5e-3, "{errors:?}");
    assert!(orders(&errors).iter().all(|&o| o > 1.7), "{errors:?}");
}

/// Energy that enters at the valve and the supply equals what friction and the wall take: with the valve shut and a
/// constant supply the line comes to rest at the supply's head.
#[test]
fn the_line_comes_to_rest_at_the_supplys_head() {
    let rig = rig(100.0, 20.0, 2.0, "friction_factor = 0.05");
    let water = water(&rig, 998.2);
    let effects = parse_list("viscoelastic-wall:1").unwrap();
    let model = Model::new(&rig, &water, &effects);
    let run = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.1, friction_scale: 1.0 };
    let conditions = Conditions::of(water);
    let probes = [Probe::head(100.0), Probe::head(0.0), Probe::flow(50.0)];
    let resolution = Resolution { reaches: 40, duration_s: 600.0 };
    let traces = model.simulate(&conditions, &[300.0, 0.5, 0.3], &run, resolution, &probes).unwrap().traces;
    let loss = 0.05 * 100.0 / 0.02 * 0.25 / (2.0 * 9.81);
    assert!((traces[1].at(0.0) - 20.0 - loss).abs() < 1e-9, "steady state with Darcy-Weisbach's loss");
    assert!((traces[0].at(600.0) - traces[1].at(0.0)).abs() < 1e-3, "{}", traces[0].at(600.0));
    let area = std::f64::consts::FRAC_PI_4 * 0.02 * 0.02;
    assert!((traces[2].at(0.0) / (0.5 * area) - 1.0).abs() < 1e-12);
    assert!(traces[2].at(600.0).abs() < 1e-5 * area);
}

/// Before the valve moves nothing moves: the steady state is one of the scheme, with every friction law.
#[test]
fn the_steady_state_stays() {
    for friction in ["friction_factor = 0.03", "roughness_mm = 0.1", ""] {
        for velocity in [0.05, 0.9] {
            let rig = rig(200.0, 20.0, 2.0, friction);
            let water = water(&rig, 998.2);
            let mut model = Model::new(&rig, &water, &[]);
            model.closure = |closing_time_s| Closure::Linear { closing_time_s: 1e12 + closing_time_s };
            let run = RunValues {
                initial_velocity_m_s: velocity,
                valve_head_m: 20.0,
                closing_time_s: 1.0,
                friction_scale: 1.0,
            };
            let conditions = Conditions::of(water);
            let resolution = Resolution { reaches: 60, duration_s: 20.0 };
            let traces =
                model.simulate(&conditions, &[400.0], &run, resolution, &[Probe::head(200.0), Probe::head(90.0)]);
            for trace in traces.unwrap().traces {
                assert!(
                    (trace.at(20.0) - trace.at(0.0)).abs() < 1e-5,
                    "{friction} {velocity}: {}",
                    trace.at(20.0) - trace.at(0.0)
                );
            }
        }
    }
}

/// Small creep: the logarithmic decrement is `π F Σ J wτ/(1 + w²τ²)` and the period stretches by `F/2 Σ J/(1 + w²τ²)`.
#[test]
fn small_creep_damps_and_stretches_as_perturbation_theory_says() {
    let (j, tau) = (2e-12, 0.1);
    let problem = Exact { creep: vec![(j, tau)], ramp: Ramp::Cosine(0.3), ..b3(Ramp::Cosine(0.3)) };
    let f = problem.wave_speed.powi(2) * problem.density * problem.diameter / problem.wall;
    let w = std::f64::consts::PI * problem.wave_speed / (2.0 * problem.length);
    let period = 4.0 * problem.length / problem.wave_speed;
    let decrement = std::f64::consts::PI * f * j * w * tau / (1.0 + (w * tau).powi(2));
    let stretch = 0.5 * f * j / (1.0 + (w * tau).powi(2));
    // First harmonic over a window of one period, early and late: the phase turns by 2π n stretch, the size shrinks by
    // n decrements.
    let n = 100.0;
    let harmonic = |from: f64| {
        let samples = 2000;
        let times: Vec<f64> = (0..samples).map(|i| from + period * f64::from(i) / f64::from(samples)).collect();
        let heads = &simulate(&problem, 200, &[problem.length], &times)[0];
        let sum = |g: fn(f64) -> f64| heads.iter().zip(&times).map(|(h, t)| h * g(w * t)).sum::<f64>();
        (sum(f64::cos), sum(f64::sin))
    };
    let (early, late) = (harmonic(2.0 * period), harmonic((2.0 + n) * period));
    let size = |(c, s): (f64, f64)| c.hypot(s);
    let measured_decrement = (size(early) / size(late)).ln() / n;
    let turn = late.1.atan2(late.0) - early.1.atan2(early.0);
    let measured_stretch = turn.rem_euclid(std::f64::consts::TAU) / (std::f64::consts::TAU * n);
    assert!((measured_decrement / decrement - 1.0).abs() < 0.02, "{measured_decrement} {decrement}");
    assert!((measured_stretch / stretch - 1.0).abs() < 0.03, "{measured_stretch} {stretch}");
}

/// An upstream end that is measured drives the model: with a constant record it is a reservoir, with a step the step
/// arrives.
#[test]
fn a_measured_head_drives_the_line() {
    let mut rig = rig(100.0, 20.0, 2.0, "friction_factor = 0.0");
    rig.upstream = surgescope_core::rig::Upstream::Measured;
    let water = water(&rig, 998.2);
    let model = Model::new(&rig, &water, &[]);
    let run = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.1, friction_scale: 1.0 };
    let resolution = Resolution { reaches: 50, duration_s: 4.0 };
    let with = |supply_deviation| {
        let conditions = Conditions { supply_deviation, ..Conditions::of(water) };
        model.simulate(&conditions, &[400.0], &run, resolution, &[Probe::head(100.0)]).map(|t| t.traces[0].clone())
    };
    assert!(with(None).unwrap_err().to_string().contains("position 0"));
    let constant = with(Some((vec![0.0, 4.0], vec![0.0, 0.0]))).unwrap();
    let stepped = with(Some((vec![0.0, 1.0, 1.001, 4.0], vec![0.0, 0.0, 3.0, 3.0]))).unwrap();
    assert!((constant.at(1.2) - stepped.at(1.2)).abs() < 1e-9, "it takes L/a to arrive");
    let arrived = stepped.at(1.3) - constant.at(1.3);
    assert!((arrived - 6.0).abs() < 0.1, "and doubles at the shut valve: {arrived}");
    rig.upstream = surgescope_core::rig::Upstream::Reservoir;
    let conditions = Conditions::of(water);
    let reservoir =
        Model::new(&rig, &water, &[]).simulate(&conditions, &[400.0], &run, resolution, &[Probe::head(100.0)]).unwrap();
    assert_eq!(reservoir.traces[0], constant);
}

#[test]
fn what_cannot_be_simulated_is_said_before_the_run() {
    let rig = rig(100.0, 20.0, 2.0, "");
    let water = water(&rig, 998.2);
    let effects = parse_list("viscoelastic-wall:1").unwrap();
    let model = Model::new(&rig, &water, &effects);
    let fine = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.1, friction_scale: 1.0 };
    let attempt = |shared: &[f64], run: &RunValues, reaches: usize, duration_s: f64| {
        let conditions = Conditions::of(water);
        let resolution = Resolution { reaches, duration_s };
        model.simulate(&conditions, shared, run, resolution, &[Probe::head(100.0)]).map(|_| ()).unwrap_err().to_string()
    };
    let good = [400.0, 0.1, 0.1];
    assert!(attempt(&[-1.0, 0.1, 0.1], &fine, 50, 1.0).contains("wave_speed_m_s = -1"));
    assert!(attempt(&[400.0, -0.1, 0.1], &fine, 50, 1.0).contains("J1_per_GPa"));
    assert!(attempt(&[400.0, 0.1, 0.0], &fine, 50, 1.0).contains("tau1_s"));
    assert!(attempt(&good, &RunValues { valve_head_m: -1.0, ..fine }, 50, 1.0).contains("valve_head_m"));
    assert!(attempt(&good, &RunValues { closing_time_s: f64::NAN, ..fine }, 50, 1.0).contains("closing_time_s"));
    assert!(attempt(&good, &fine, 1, 1.0).contains("at least 2"));
    assert!(attempt(&good, &fine, 500, 1e7).contains("GiB"));
    let rough = RunValues { friction_scale: 500.0, ..fine };
    assert!(attempt(&good, &rough, 10, 1.0).contains("at least"));
}
