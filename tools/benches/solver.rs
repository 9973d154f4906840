//! What the solver's generality costs: `Model::simulate` against bare loops of the same arithmetic (`bare.rs`), one
//! thread, in one run. `cargo bench --bench solver` prints node-steps a second and the ratio; it fails where a ratio
//! falls under its bar.
//!
//! Both sides take turns, and each counts its best turn: what else runs on the machine slows a turn, nothing speeds one
//! up.
//!
//! `RUSTFLAGS="-C target-cpu=native" cargo bench --bench solver` builds the bare loops for this machine alone, as a
//! specialist would.

mod bare;

use std::hint::black_box;
use std::process::ExitCode;
use std::time::Instant;

use bare::Pipe;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, Resolution, RunValues};
use surgescope_core::rig::Rig;
use surgescope_core::units::GRAVITY_M_S2;

const LENGTH_M: f64 = 1000.0;
/// Inner diameter over wall thickness.
const SLENDERNESS: f64 = 50.0;
/// Unsteady friction is compared in a pipe so thin that a step of 1 ms remembers just ten terms of its kernel.
const THIN_M: f64 = 0.0107;
const WIDE_M: f64 = 0.5;
/// Zielke's function as a sum of exponentials of `4νt/D²` (Kagawa et al. 1983): rate, weight.
const ZIELKE: [(f64, f64); 10] = [
    (26.3744, 1.0),
    (72.8033, 1.16725),
    (187.424, 2.20064),
    (536.626, 3.92861),
    (1570.60, 6.78788),
    (4618.13, 11.6761),
    (13601.1, 20.0612),
    (40082.5, 34.4541),
    (118153.0, 59.1642),
    (348316.0, 101.590),
];
const WAVE_SPEED_M_S: f64 = 1000.0;
const FACTOR: f64 = 0.02;
const TURNS: usize = 30;
const NODE_STEPS: usize = 3_000_000;

fn rig(diameter_m: f64) -> Rig {
    let text = format!(
        "name = \"bench\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = {LENGTH_M}\n\
         inner_diameter_mm = {}\nwall_thickness_mm = {}\nmaterial = \"steel\"\nconstraint = 1.0\nfriction_factor = {FACTOR}\n\
         [upstream]\nkind = \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = 0.5\n[[sensor]]\nname = \"P1\"\n\
         kind = \"pressure\"\nposition_m = {LENGTH_M}\nunit = \"kPa\"\n",
        diameter_m * 1e3,
        diameter_m / SLENDERNESS * 1e3
    );
    Rig::from_toml(&text, "bench.toml").expect("the bench's own rig is valid")
}

/// One pair to compare.
struct Pair {
    name: &'static str,
    reaches: usize,
    /// Ratio under which it fails; none where it is only shown.
    bar: Option<f64>,
    ours: Box<dyn Fn(usize) -> Vec<f64>>,
    bare: Box<dyn Fn(usize) -> Vec<f64>>,
    /// `a V/g`.
    joukowsky_m: f64,
    /// Largest difference of the two traces as a share of Joukowsky's head: that they do the same.
    within: f64,
}

/// The model with `effects` and the values of their parameters.
fn ours(effects: &'static str, values: Vec<f64>, pipe: &Pipe) -> Box<dyn Fn(usize) -> Vec<f64>> {
    let Pipe { reaches, velocity_m_s: velocity, .. } = *pipe;
    let rig = rig(pipe.diameter_m);
    Box::new(move |steps| {
        let water = rig.fluid.properties(20.0);
        let model = Model::new(&rig, &water, &parse_list(effects).expect("known effects"));
        let run =
            RunValues { initial_velocity_m_s: velocity, valve_head_m: 200.0, closing_time_s: 0.5, friction_scale: 1.0 };
        let shared: Vec<f64> = std::iter::once(WAVE_SPEED_M_S).chain(values.iter().copied()).collect();
        let dt_s = LENGTH_M / WAVE_SPEED_M_S / reaches as f64;
        // `simulate` adds two steps.
        let resolution = Resolution { reaches, duration_s: (steps as f64 - 2.5) * dt_s };
        let conditions = Conditions::of(water);
        let simulated = model.simulate(&conditions, &shared, &run, resolution, &[Probe::head(LENGTH_M)]);
        simulated.expect("the bench's own case is valid").traces.swap_remove(0).values
    })
}

fn pipe(reaches: usize, diameter_m: f64, velocity_m_s: f64) -> Pipe {
    let dt_s = LENGTH_M / WAVE_SPEED_M_S / reaches as f64;
    Pipe {
        reaches,
        diameter_m,
        b_s: WAVE_SPEED_M_S / GRAVITY_M_S2,
        r: FACTOR * LENGTH_M / reaches as f64 / diameter_m / (2.0 * GRAVITY_M_S2),
        dt_s,
        closing_time_s: 0.5,
        velocity_m_s,
        valve_head_m: 200.0,
    }
}

fn pairs() -> Vec<Pair> {
    let water = rig(WIDE_M).fluid.properties(20.0);
    let per_gpa = WAVE_SPEED_M_S.powi(2) * water.density_kg_m3 * SLENDERNESS * 1e-9;
    let creep = [(0.002, 0.3), (0.004, 3.0)];
    let values: Vec<f64> = creep.iter().flat_map(|&(j, tau)| [j, tau]).collect();
    let scaled = creep.map(|(j, tau)| (j * per_gpa, tau));
    let diffusion_hz = 4.0 * water.kinematic_viscosity_m2_s / (THIN_M * THIN_M);
    let mut pairs = Vec::new();
    for reaches in [1000, 64] {
        let bar = |ratio| (reaches == 1000).then_some(ratio);
        let (wide, thin) = (pipe(reaches, WIDE_M, 1.0), pipe(reaches, THIN_M, 0.1));
        let reach_m = LENGTH_M / reaches as f64;
        let shear = ZIELKE.map(|(n, m)| (4.0 * diffusion_hz / GRAVITY_M_S2 * reach_m * m, n * diffusion_hz));
        pairs.push(Pair {
            name: "elastic",
            joukowsky_m: WAVE_SPEED_M_S * 1.0 / GRAVITY_M_S2,
            reaches,
            bar: bar(0.8),
            ours: ours("none", vec![], &wide),
            bare: Box::new(move |steps| wide.elastic(steps)),
            within: 1e-3,
        });
        pairs.push(Pair {
            name: "two Kelvin-Voigt",
            joukowsky_m: WAVE_SPEED_M_S * 1.0 / GRAVITY_M_S2,
            reaches,
            bar: bar(0.8),
            ours: ours("viscoelastic-wall:2", values.clone(), &wide),
            bare: Box::new(move |steps| wide.two_kelvin_voigt(steps, scaled)),
            within: 2e-2,
        });
        pairs.push(Pair {
            name: "unsteady friction",
            joukowsky_m: WAVE_SPEED_M_S * 0.1 / GRAVITY_M_S2,
            reaches,
            bar: bar(0.8),
            ours: ours("unsteady-friction", vec![1.0], &thin),
            // At 64 reaches a step forgets three of the terms.
            bare: match reaches {
                1000 => Box::new(move |steps| thin.unsteady_friction(steps, shear)),
                _ => Box::new(move |steps| thin.unsteady_friction::<7>(steps, std::array::from_fn(|i| shear[i]))),
            },
            // The bare loop leaves the terms out that a step forgets.
            within: if reaches == 1000 { 2e-2 } else { 5e-2 },
        });
    }
    pairs
}

/// Elements at nodes, whose step is not the bare loop's: their own cost is shown as many times an elastic step.
const ELEMENTS: [&str; 5] = ["leak", "side-branch", "blockage", "air-pocket", "entrained-gas"];
/// Reaches of the grid on which a diagnosis compares effects.
const COARSE_REACHES: usize = 48;

/// The model with `effects` as a fit begins with them.
fn begun(effects: &'static str, pipe: &Pipe) -> Box<dyn Fn(usize) -> Vec<f64>> {
    let rig = rig(pipe.diameter_m);
    let chosen = parse_list(effects).expect("known effects");
    let model = Model::new(&rig, &rig.fluid.properties(20.0), &chosen);
    ours(effects, model.shared[1..].iter().map(|p| p.start).collect(), pipe)
}

fn seconds(of: &dyn Fn(usize) -> Vec<f64>, steps: usize) -> f64 {
    let start = Instant::now();
    black_box(of(black_box(steps)));
    start.elapsed().as_secs_f64()
}

fn main() -> ExitCode {
    println!(
        "{:<18} {:>7} {:>14} {:>14} {:>6} {:>5}",
        "one thread", "reaches", "ours, Mnode/s", "bare, Mnode/s", "ratio", "bar"
    );
    let mut done = ExitCode::SUCCESS;
    for pair in pairs() {
        let steps = 8 * pair.reaches;
        let (a, b) = ((pair.ours)(steps), (pair.bare)(steps));
        let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / pair.joukowsky_m;
        let steps = NODE_STEPS / pair.reaches;
        let (mut own, mut bare) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..TURNS {
            own = own.min(seconds(&*pair.ours, steps));
            bare = bare.min(seconds(&*pair.bare, steps));
        }
        let rate = |s: f64| ((pair.reaches + 1) * steps) as f64 / s / 1e6;
        let ratio = bare / own;
        let bar = pair.bar.map_or(String::new(), |bar| format!("{bar:.1}"));
        println!(
            "{:<18} {:>7} {:>14.0} {:>14.0} {:>6.2} {:>5}",
            pair.name,
            pair.reaches,
            rate(own),
            rate(bare),
            ratio,
            bar
        );
        if apart > pair.within {
            println!("  the two differ by {apart:.1e} of Joukowsky's head: not the same arithmetic");
            done = ExitCode::FAILURE;
        }
        if pair.bar.is_some_and(|bar| ratio < bar) {
            done = ExitCode::FAILURE;
        }
    }
    let (wide, steps) = (pipe(COARSE_REACHES, WIDE_M, 1.0), NODE_STEPS / COARSE_REACHES / 10);
    println!("\na step of {COARSE_REACHES} reaches, as many times an elastic one");
    for effects in ELEMENTS {
        let (with, without) = (begun(effects, &wide), begun("none", &wide));
        let (mut own, mut elastic) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..10 * TURNS {
            own = own.min(seconds(&*with, steps));
            elastic = elastic.min(seconds(&*without, steps));
        }
        println!("{effects:<18} {:>7.2}", own / elastic);
    }
    done
}
