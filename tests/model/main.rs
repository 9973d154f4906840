//! The model against what is not ours: exact solutions, published numbers, conservation, orders of convergence.

mod exact;

use exact::{Exact, Ramp};
use surgescope::model::boundary::Closure;
use surgescope::model::effects::parse_list;
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::rig::{Rig, WaterProperties};

/// A rig of one uniform pipe, built as a user would: from a file's text.
fn rig(length_m: f64, diameter_mm: f64, wall_mm: f64, friction: &str) -> Rig {
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
    let conditions = Conditions { water, supply_deviation: None };
    let probes: Vec<Probe> = places.iter().map(|&x| Probe::Head(x)).collect();
    let traces = model.simulate(&conditions, &shared, &run, Resolution { reaches, duration_s }, &probes).unwrap();
    traces.iter().map(|trace| times.iter().map(|&t| trace.at(t) - 30.0).collect()).collect()
}

fn relative_rms(value: &[f64], exact: &[f64]) -> f64 {
    let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
    (square(&mut value.iter().zip(exact).map(|(v, e)| v - e)) / square(&mut exact.iter().copied())).sqrt()
}

fn largest_error(value: &[f64], exact: &[f64]) -> f64 {
    value.iter().zip(exact).map(|(v, e)| (v - e).abs()).fold(0.0, f64::max)
}

/// The columns of a reference file.
fn reference(text: &str) -> Vec<Vec<f64>> {
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
    }
}

#[test]
fn explore() {
    let file = reference(include_str!("../reference/B1_kv5.csv"));
    let ours = b1().head(277.0, &file[0]);
    println!("B1 exact vs file {:e}", largest_error(&ours, &file[1]));
    for n in [32, 64, 128, 256, 512] {
        let s = simulate(&b1(), n, &[277.0, 138.5], &file[0]);
        println!("B1 {n}: {:.6} {:.6}", largest_error(&s[0], &file[1]), largest_error(&s[1], &file[2]));
    }
    let file = reference(include_str!("../reference/B3_seed2kv.csv"));
    let ours = b3(Ramp::Cycloid(0.04)).head(37.8, &file[0]);
    println!("B3 exact vs file {:e}", largest_error(&ours, &file[1]));
    for n in [32, 64, 128, 256, 512] {
        let s = simulate(&b3(Ramp::Cycloid(0.04)), n, &[37.8], &file[0]);
        println!("B3 {n}: {:.6}", largest_error(&s[0], &file[1]));
    }
    for ramp in [Ramp::Cosine(0.04), Ramp::Cycloid(0.04), Ramp::Cosine(0.1), Ramp::Cycloid(0.1)] {
        let p = b3(ramp);
        let times: Vec<f64> = (0..400).map(|i| i as f64 * 0.005).collect();
        let (e1, e2) = (p.head(37.8, &times), p.head(18.9, &times));
        for n in [60, 120, 240] {
            let s = simulate(&p, n, &[37.8, 18.9], &times);
            println!("rms {n}: {:.3e} {:.3e}", relative_rms(&s[0], &e1), relative_rms(&s[1], &e2));
        }
    }
    let mut p = b1();
    p.creep = vec![(1e-10, 0.05), (1e-10, 0.5)];
    for ramp in [Ramp::Cosine(0.1), Ramp::Cycloid(0.1)] {
        p.ramp = ramp;
        let times: Vec<f64> = (0..400).map(|i| i as f64 * 0.02).collect();
        let (e1, e2) = (p.head(277.0, &times), p.head(138.5, &times));
        for n in [60, 120, 240] {
            let s = simulate(&p, n, &[277.0, 138.5], &times);
            println!("cov rms {n}: {:.3e} {:.3e}", relative_rms(&s[0], &e1), relative_rms(&s[1], &e2));
        }
    }
}
#[test]
fn explore2() {
    let file = reference(include_str!("../reference/B3_seed2kv.csv"));
    for n in [256, 512, 1024] {
        let s = simulate(&b3(Ramp::Cycloid(0.04)), n, &[37.8], &file[0]);
        let mut e: Vec<(f64, f64)> = s[0].iter().zip(&file[1]).zip(&file[0]).map(|((a, b), t)| (a - b, *t)).collect();
        println!("{n} mean {:e}", e.iter().map(|x| x.0).sum::<f64>() / e.len() as f64);
        e.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
        println!("{:?}", &e[..6]);
    }
}
