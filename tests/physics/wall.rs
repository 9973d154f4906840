//! A pipe that moves, against the exact recursion along characteristics (Tijsseling 2003, J. Fluids Struct. 18:179-196):
//! the four equations as they stand in the literature, in pressures and stresses, with waves found numerically.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, Resolution, RunValues};
use surgescope_core::rig::Rig;

use super::{rig, water};

const G: f64 = 9.81;
/// Pressures and stresses in MPa keep the matrices well scaled.
const MPA: f64 = 1e6;

/// A pipe of steel with its water; lengths in m, moduli in Pa, densities in kg/m³.
#[derive(Clone, Copy)]
struct Pipe {
    length: f64,
    diameter: f64,
    wall: f64,
    modulus: f64,
    wall_density: f64,
    poisson: f64,
    bulk: f64,
    density: f64,
    velocity: f64,
}

/// Delft Hydraulics' benchmark problem A.
const PROBLEM_A: Pipe = Pipe {
    length: 20.0,
    diameter: 0.797,
    wall: 0.008,
    modulus: 210e9,
    wall_density: 7900.0,
    poisson: 0.3,
    bulk: 2.1e9,
    density: 1000.0,
    velocity: 1.0,
};

/// What holds an end: it does not move, or the valve's end is free and closed, the supply's free and open.
#[derive(Clone, Copy, PartialEq)]
enum Held {
    Anchored,
    Free,
}

/// The exact solution for a valve that closes at once at time 0, in deviations (V, P, u, σ) from the steady flow.
struct Exact {
    pipe: Pipe,
    held: [Held; 2],
    /// Speeds and waves: downstream slow and fast, upstream slow and fast.
    speeds: [f64; 4],
    waves: Matrix4<f64>,
}

impl Exact {
    fn new(pipe: Pipe, held: [Held; 2]) -> Exact {
        let Pipe { diameter: d, wall: e, modulus, wall_density, poisson: nu, bulk, density, .. } = pipe;
        // Coefficients of the derivatives by time, then by place.
        let by_time = Matrix4::new(
            1.0,
            0.0,
            0.0,
            0.0, //
            0.0,
            MPA * (1.0 / bulk + d / (modulus * e)),
            0.0,
            -MPA * 2.0 * nu / modulus, //
            0.0,
            0.0,
            1.0,
            0.0, //
            0.0,
            MPA * nu * d / (2.0 * modulus * e),
            0.0,
            -MPA / modulus,
        );
        let by_place = Matrix4::new(
            0.0,
            MPA / density,
            0.0,
            0.0, //
            1.0,
            0.0,
            0.0,
            0.0, //
            0.0,
            0.0,
            0.0,
            -MPA / wall_density, //
            0.0,
            0.0,
            1.0,
            0.0,
        );
        let flux = by_time.try_inverse().unwrap() * by_place;
        let mut speeds: Vec<f64> = flux.eigenvalues().unwrap().iter().copied().collect();
        speeds.sort_by(|a, b| (*a < 0.0, a.abs()).partial_cmp(&(*b < 0.0, b.abs())).unwrap());
        let speeds = [speeds[0], speeds[1], speeds[2], speeds[3]];
        let wave = |speed: f64| {
            let svd = (flux - Matrix4::identity() * speed).svd(false, true);
            let least = (0..4).min_by(|a, b| svd.singular_values[*a].total_cmp(&svd.singular_values[*b])).unwrap();
            Vector4::from_iterator(svd.v_t.unwrap().row(least).iter().copied())
        };
        Exact { pipe, held, speeds, waves: Matrix4::from_columns(&speeds.map(wave)) }
    }

    /// Amplitudes of the waves that leave an end (0: supply, 1: valve) at a time.
    fn leaving(&self, end: usize, t: f64) -> Vector2<f64> {
        if t < 0.0 {
            return Vector2::zeros();
        }
        let travel = [0, 1].map(|i| self.pipe.length / self.speeds[i]);
        let arriving = [0, 1].map(|i| self.leaving(1 - end, t - travel[i])[i]);
        // The two laws of the end on (V, P, u, σ).
        let thrust = self.pipe.diameter / (4.0 * self.pipe.wall);
        let water = if end == 0 { Vector4::new(0.0, 1.0, 0.0, 0.0) } else { Vector4::new(1.0, 0.0, -1.0, 0.0) };
        let wall = match (self.held[end], end) {
            (Held::Anchored, _) => Vector4::new(0.0, 0.0, 1.0, 0.0),
            (Held::Free, 0) => Vector4::new(0.0, 0.0, 0.0, 1.0),
            (Held::Free, _) => Vector4::new(0.0, -thrust, 0.0, 1.0),
        };
        let given = Vector2::new(if end == 0 { 0.0 } else { -self.pipe.velocity }, 0.0);
        let (come, go) = if end == 0 { (2, 0) } else { (0, 2) };
        let of = |wave: usize| Vector2::new(water.dot(&self.waves.column(wave)), wall.dot(&self.waves.column(wave)));
        let known = of(come) * arriving[0] + of(come + 1) * arriving[1];
        Matrix2::from_columns(&[of(go), of(go + 1)]).try_inverse().unwrap() * (given - known)
    }

    /// Head over that of the steady flow, m.
    fn head_m(&self, x: f64, t: f64) -> f64 {
        let mut sum = 0.0;
        for i in 0..2 {
            let down = self.leaving(0, t - x / self.speeds[i])[i];
            let up = self.leaving(1, t - (self.pipe.length - x) / self.speeds[i])[i];
            sum += down * self.waves[(1, i)] + up * self.waves[(1, i + 2)];
        }
        sum * MPA / (self.pipe.density * G)
    }
}

fn closed(_closing_time_s: f64) -> Closure {
    Closure::FlowRamp { closing_time_s: 0.0 }
}

/// The program's heads over those of the steady flow at places, step by step, and the step.
fn modelled(exact: &Exact, places: &[f64], reaches: usize, periods: f64) -> (Vec<Vec<f64>>, f64) {
    let Pipe { length, diameter, wall, modulus, wall_density, poisson, density, velocity, .. } = exact.pipe;
    let held = if exact.held[0] == Held::Free { "constraint = \"free\"" } else { "constraint = \"anchored\"" };
    let text = format!(
        "name = \"moving\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = {length}\n\
         inner_diameter_mm = {}\nwall_thickness_mm = {}\nmaterial = \"steel\"\nfriction_factor = 0.0\n{held}\n[upstream]\nkind = \
         \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nposition_m = \
         {length}\nunit = \"kPa\"\n",
        1e3 * diameter,
        1e3 * wall
    );
    let rig = Rig::from_toml(&text, "moving.toml").unwrap();
    // The program has a steel of its own: what counts is the ratio.
    let steel = rig.pipes[0].material().density_kg_m3;
    let water = water(&rig, density / wall_density * steel);
    let mut model = Model::new(&rig, &water, &parse_list("fluid-structure").unwrap());
    model.closure = closed;
    let give = if exact.held[1] == Held::Free { 1e12 } else { 0.0 };
    let shared = [exact.speeds[0], poisson, (modulus / wall_density).sqrt(), give];
    let run =
        RunValues { initial_velocity_m_s: velocity, valve_head_m: 500.0, closing_time_s: 0.0, friction_scale: 1.0 };
    let probes: Vec<Probe> = places.iter().map(|&x| Probe::head(x)).collect();
    let duration_s = periods * 4.0 * length / exact.speeds[0];
    let resolution = Resolution { reaches, duration_s };
    let traces = model.simulate(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap().traces;
    let dt_s = traces[0].dt_s;
    (traces.into_iter().map(|trace| trace.values.iter().map(|h| h - 500.0).collect()).collect(), dt_s)
}

/// The pipe of problem A with a steel so soft or stiff that stress waves are just four times as fast.
fn four_times_as_fast() -> Pipe {
    let ratio = |modulus: f64| {
        let exact = Exact::new(Pipe { modulus, ..PROBLEM_A }, [Held::Anchored; 2]);
        exact.speeds[1] / exact.speeds[0]
    };
    let (mut low, mut high) = (2e10, 4e11);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if ratio(middle) < 4.0 { low = middle } else { high = middle }
    }
    Pipe { modulus: low, ..PROBLEM_A }
}

/// Speeds of problem A in Tijsseling (2003): 1024.7 and 5280.5 m/s.
#[test]
fn waves_of_problem_a_have_the_published_speeds() {
    let exact = Exact::new(PROBLEM_A, [Held::Anchored, Held::Free]);
    assert!((exact.speeds[0] - 1024.7).abs() < 0.1, "{:?}", exact.speeds);
    assert!((exact.speeds[1] - 5280.5).abs() < 0.5, "{:?}", exact.speeds);
}

/// Where stress waves are a whole number of times as fast, the program has no error but rounding.
#[test]
fn fronts_are_those_of_the_exact_recursion() {
    let pipe = four_times_as_fast();
    for held in [
        [Held::Anchored, Held::Anchored],
        [Held::Anchored, Held::Free],
        [Held::Free, Held::Free],
        [Held::Free, Held::Anchored],
    ] {
        let exact = Exact::new(pipe, held);
        let (heads, dt_s) = modelled(&exact, &[pipe.length, 0.5 * pipe.length, 0.0], 40, 1.5);
        let rise = exact.speeds[0] * pipe.velocity / G;
        let mut moved: f64 = 0.0;
        for (values, x) in heads.iter().zip([pipe.length, 0.5 * pipe.length, 0.0]) {
            for (i, head) in values.iter().enumerate().take(240) {
                // The valve closes within the first step.
                let right = exact.head_m(x, (i as f64 - 0.5) * dt_s);
                assert!((head - right).abs() < 1e-7 * rise, "{x} m, step {i}: {head} {right}");
                moved = moved.max((right - rise).abs());
            }
        }
        assert!(moved > 1.5 * rise, "the wave went there and back");
    }
}

/// Nothing takes energy here, and neither does the scheme: after hundreds of periods the head swings as in the first,
/// where stress waves take a whole number of steps and where they do not.
#[test]
fn the_scheme_has_no_damping_of_its_own() {
    let pipe = four_times_as_fast();
    for reaches in [40, 37] {
        for held in [[Held::Anchored, Held::Anchored], [Held::Anchored, Held::Free], [Held::Free, Held::Free]] {
            let exact = Exact::new(pipe, held);
            let (heads, _) = modelled(&exact, &[pipe.length], reaches, 400.0);
            let rms = |part: &[f64]| (part.iter().map(|h| h * h).sum::<f64>() / part.len() as f64).sqrt();
            let half = heads[0].len() / 2;
            let kept = rms(&heads[0][half..]) / rms(&heads[0][..half]);
            println!(
                "{reaches} reaches, {}: {:.5}",
                held.map(|h| h == Held::Free).map(u8::from).iter().sum::<u8>(),
                kept
            );
            assert!((kept - 1.0).abs() < 2e-3, "{reaches} reaches: {kept}");
        }
    }
}

/// Between whole numbers the delay of stress waves disperses their fronts over a few steps; plateaus stay exact.
#[test]
fn plateaus_of_problem_a_are_those_of_the_exact_recursion() {
    let exact = Exact::new(PROBLEM_A, [Held::Anchored, Held::Free]);
    let reaches = 400;
    let (heads, dt_s) = modelled(&exact, &[PROBLEM_A.length], reaches, 1.0);
    let rise = exact.speeds[0] * PROBLEM_A.velocity / G;
    let right: Vec<f64> = (0..1600).map(|i| exact.head_m(PROBLEM_A.length, (f64::from(i) - 0.5) * dt_s)).collect();
    let (mut counted, mut worst, mut square, mut own) = (0, 0.0f64, 0.0, 0.0);
    for i in 0..1600 {
        let error = heads[0][i] - right[i];
        square += error * error;
        own += right[i] * right[i];
        let near = &right[i.saturating_sub(30)..(i + 3).min(1600)];
        if near.iter().all(|h| (h - right[i]).abs() < 1e-9 * rise) {
            counted += 1;
            worst = worst.max(error.abs());
        }
    }
    println!(
        "problem A: {counted} steps on plateaus, worst {:.1e} of the rise; rms {:.1e}",
        worst / rise,
        f64::sqrt(square / own)
    );
    assert!(counted > 300 && worst < 2e-3 * rise, "{counted} {}", worst / rise);
    // The beat of a free valve: the first rise is well below Joukowsky's, the highest above it.
    let first = right[10] / rise;
    let most = right.iter().copied().fold(0.0, f64::max) / rise;
    assert!(first < 0.98 && most > 1.05, "{first} {most}");
}

/// Before the valve moves nothing moves, though a leak makes the flow into the pipes larger than that out of them.
#[test]
fn the_steady_flow_stays_beside_a_leak() {
    let rig = rig(160.0, 50.0, 4.0, "friction_factor = 0.03");
    let water = water(&rig, 998.2);
    for form in ["fluid-structure", "fluid-structure/dry", "fluid-structure/floor"] {
        let mut model = Model::new(&rig, &water, &parse_list(&format!("{form},leak")).unwrap());
        model.closure = |closing_time_s| Closure::Linear { closing_time_s: 1e12 + closing_time_s };
        let shared: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
        let run = RunValues { initial_velocity_m_s: 0.9, valve_head_m: 20.0, closing_time_s: 1.0, friction_scale: 1.0 };
        let resolution = Resolution { reaches: 60, duration_s: 5.0 };
        let probes = [160.0, 97.3, 40.0].map(Probe::head);
        let traces = model.simulate(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap().traces;
        for trace in traces {
            let moved = trace.values.iter().map(|h| (h - trace.values[0]).abs()).fold(0.0, f64::max);
            assert!(moved < 1e-6, "{form}: {moved} m");
        }
    }
}
