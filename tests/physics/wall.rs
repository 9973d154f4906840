//! Pipes that move, against the exact recursion along characteristics ([`Exact`]), and that against an independent one.

use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, Resolution, RunValues, Simulated};
use surgescope_core::rig::Rig;
use surgescope_core::rig::material::Material;

use super::wall_recursion::{Exact, G, Held, Pipe};
use super::{orders, reference, relative_rms, rig_of_two_pipes, water};

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
};
const VELOCITY: f64 = 1.0;
const ENDS: [[Held; 2]; 4] = [
    [Held::Anchored, Held::Anchored],
    [Held::Anchored, Held::Free],
    [Held::Free, Held::Free],
    [Held::Free, Held::Anchored],
];

/// Steel, then PVC, whose walls are as the program's table has them.
fn steel_then_pvc() -> [Pipe; 2] {
    let of = |material: &str, length, diameter, wall| {
        let material = Material::by_name(material).unwrap();
        Pipe {
            length,
            diameter,
            wall,
            modulus: material.youngs_modulus_pa,
            wall_density: material.density_kg_m3,
            poisson: material.poisson_ratio,
            bulk: 2.1e9,
            density: 1000.0,
        }
    };
    [of("steel", 30.0, 0.3, 0.006), of("PVC", 20.0, 0.2, 0.0077)]
}

/// The program's run of an exact case for a valve that closes by `closure`, with places as probes. Materials are of
/// the program's table, by their names; of a single pipe only the density's ratio to the water's counts.
struct Case<'a> {
    exact: &'a Exact,
    materials: &'a [&'a str],
    effect: &'a str,
    more: &'a [f64],
    closure: fn(f64) -> Closure,
    closing_time_s: f64,
}

impl<'a> Case<'a> {
    /// Closed at once.
    fn new(exact: &'a Exact, materials: &'a [&'a str]) -> Self {
        let closure = |_| Closure::FlowRamp { closing_time_s: 0.0 };
        Case { exact, materials, effect: "fluid-structure", more: &[], closure, closing_time_s: 0.0 }
    }

    fn rig(&self) -> Rig {
        let length = self.exact.length();
        let held = if self.exact.held[0] == Held::Free { "constraint = \"free\"" } else { "constraint = \"anchored\"" };
        let pipe = |(i, (pipe, material)): (usize, (Pipe, &&str))| {
            format!(
                "[[pipe]]\nname = \"pipe {i}\"\nlength_m = {}\ninner_diameter_mm = {}\nwall_thickness_mm = {}\nmaterial = \
                 \"{material}\"\nfriction_factor = 0.0\n{held}\n",
                pipe.length,
                1e3 * pipe.diameter,
                1e3 * pipe.wall
            )
        };
        let pipes: String = self.exact.pipes().zip(self.materials).enumerate().map(pipe).collect();
        let text = format!(
            "name = \"moving\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n{pipes}[upstream]\nkind = \
             \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n[[sensor]]\nname = \"P1\"\nkind = \
             \"pressure\"\nposition_m = {length}\nunit = \"kPa\"\n"
        );
        Rig::from_toml(&text, "moving.toml").unwrap()
    }

    fn run(&self, places: &[f64], reaches: usize, duration_s: f64) -> Simulated {
        let rig = self.rig();
        let last = self.exact.pipes().last().unwrap();
        let material = rig.pipe_at_valve().material().density_kg_m3;
        let water = water(&rig, last.density / last.wall_density * material);
        let mut model = Model::new(&rig, &water, &parse_list(self.effect).unwrap());
        model.closure = self.closure;
        let give = if self.exact.held[1] == Held::Free { 1e12 } else { 0.0 };
        let own = [last.poisson, (last.modulus / last.wall_density).sqrt(), give];
        let shared = [&self.exact.slow_speeds()[..], &own, self.more].concat();
        let run = RunValues {
            initial_velocity_m_s: self.exact.velocity,
            valve_head_m: 500.0,
            closing_time_s: self.closing_time_s,
            friction_scale: 1.0,
        };
        let probes: Vec<Probe> = places.iter().map(|&x| Probe::head(x)).collect();
        let resolution = Resolution { reaches, duration_s };
        model.simulate_with_energy(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap()
    }

    /// Heads over those of the steady flow at places, step by step, over so many periods, and the step.
    fn heads(&self, places: &[f64], reaches: usize, periods: f64) -> (Vec<Vec<f64>>, f64) {
        let traces = self.run(places, reaches, periods * 4.0 * self.exact.travel_s()).traces;
        let dt_s = traces[0].dt_s;
        (traces.into_iter().map(|trace| trace.values.iter().map(|h| h - 500.0).collect()).collect(), dt_s)
    }
}

/// The pipe of problem A with a steel so soft or stiff that stress waves are just four times as fast.
fn four_times_as_fast() -> Pipe {
    tuned(2e10, 4e11, 4.0, |modulus| Pipe { modulus, ..PROBLEM_A })
}

/// The pipe whose stress waves are just so many times as fast; they are relatively faster the larger its value.
fn tuned(mut low: f64, mut high: f64, times: f64, pipe: impl Fn(f64) -> Pipe) -> Pipe {
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        let [slow, fast] = pipe(middle).speeds();
        if fast < times * slow { low = middle } else { high = middle }
    }
    pipe(low)
}

/// Steel, then PVC, in which stress waves are just five and six times as fast, and pressure waves pass in 40 and 24 of
/// 64 steps.
fn two_whole() -> [Pipe; 2] {
    let [steel, pvc] = steel_then_pvc();
    // Wave speeds are free: a softer water makes them slower.
    let softer = |pipe: Pipe, times| tuned(1e-10, 1e-8, times, |soft| Pipe { bulk: 1.0 / soft, ..pipe });
    let (steel, pvc) = (softer(steel, 5.0), softer(pvc, 6.0));
    let length = 24.0 / 40.0 * steel.length / steel.speeds()[0] * pvc.speeds()[0];
    [steel, Pipe { length, ..pvc }]
}

/// Speeds of problem A in Tijsseling (2003): 1024.7 and 5280.5 m/s.
#[test]
fn waves_of_problem_a_have_the_published_speeds() {
    let [slow, fast] = PROBLEM_A.speeds();
    assert!((slow - 1024.7).abs() < 0.1 && (fast - 5280.5).abs() < 0.5, "{slow} {fast}");
}

/// Where stress waves are a whole number of times as fast, the program has no error but rounding.
#[test]
fn fronts_are_those_of_the_exact_recursion() {
    let (one, two) = ([four_times_as_fast()], two_whole());
    for (pipes, materials, reaches) in [(&one[..], &["steel"][..], 40), (&two[..], &["steel", "PVC"], 64)] {
        for held in ENDS {
            let exact = Exact::new(pipes, held, VELOCITY);
            let places = [exact.length(), pipes[0].length, 0.5 * pipes[0].length, 0.0];
            let (heads, dt_s) = Case::new(&exact, materials).heads(&places, reaches, 1.5);
            let rise = exact.slow_speeds()[pipes.len() - 1] * VELOCITY / G;
            let mut moved: f64 = 0.0;
            for (values, x) in heads.iter().zip(places) {
                for (i, head) in values.iter().enumerate().take(6 * reaches) {
                    // The valve closes within the first step.
                    let right = exact.head_m(x, (i as f64 - 0.5) * dt_s);
                    assert!((head - right).abs() < 1e-7 * rise, "{x} m, step {i}: {head} {right}");
                    moved = moved.max((right - rise).abs());
                }
            }
            assert!(moved > 0.5 * rise, "the wave went there and back: {moved} of {rise}");
        }
    }
}

/// Nothing takes energy here, and neither does the scheme: after hundreds of periods the head swings as in the first,
/// where stress waves take a whole number of steps and where they do not.
#[test]
fn the_scheme_has_no_damping_of_its_own() {
    let (one, two) = ([four_times_as_fast()], two_whole());
    for (pipes, materials, all_reaches) in
        [(&one[..], &["steel"][..], [40, 37]), (&two[..], &["steel", "PVC"], [64, 57])]
    {
        for reaches in all_reaches {
            for held in &ENDS[..3] {
                let exact = Exact::new(pipes, *held, VELOCITY);
                let (heads, _) = Case::new(&exact, materials).heads(&[exact.length()], reaches, 400.0);
                let rms = |part: &[f64]| (part.iter().map(|h| h * h).sum::<f64>() / part.len() as f64).sqrt();
                let half = heads[0].len() / 2;
                let kept = rms(&heads[0][half..]) / rms(&heads[0][..half]);
                let free = held.map(|h| h == Held::Free).map(u8::from).iter().sum::<u8>();
                println!("{} pipes, {reaches} reaches, {free} free ends: {kept:.5}", pipes.len());
                assert!((kept - 1.0).abs() < 2e-3, "{reaches} reaches: {kept}");
            }
        }
    }
}

/// Between whole numbers the delay of stress waves disperses their fronts over a few steps; plateaus stay exact.
#[test]
fn plateaus_of_problem_a_are_those_of_the_exact_recursion() {
    let exact = Exact::new(&[PROBLEM_A], [Held::Anchored, Held::Free], VELOCITY);
    let reaches = 400;
    let (heads, dt_s) = Case::new(&exact, &["steel"]).heads(&[PROBLEM_A.length], reaches, 1.0);
    let rise = exact.slow_speeds()[0] * VELOCITY / G;
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

/// Share of the flow that the closure of the reference file has stopped.
fn cycloid(t: f64) -> f64 {
    let (s, turn) = ((t / 0.05).clamp(0.0, 1.0), std::f64::consts::TAU);
    s - (turn * s).sin() / turn
}

/// The recursion of tools/wall_recursion.py runs forwards, and finds its waves by formulas.
#[test]
fn two_independent_recursions_agree() {
    let held = [Held::Anchored, Held::Free];
    let one = Exact::new(&[PROBLEM_A], held, VELOCITY);
    let two = Exact::new(&steel_then_pvc(), held, VELOCITY).closing(cycloid);
    for (exact, file, rows) in [
        (one, include_str!("../reference/wall_problem_a.csv"), 320),
        (two, include_str!("../reference/wall_two_pipes.csv"), 60),
    ] {
        let file = reference(file);
        for (i, &t) in file[0].iter().enumerate().take(rows) {
            let [velocity, stress] = exact.wall_at_valve(t);
            let head = exact.head_m(exact.length(), t);
            assert!((head - file[1][i]).abs() < 2e-6, "{t} s: {head} {}", file[1][i]);
            assert!((velocity - file[2][i]).abs() < 2e-8 && (stress - file[3][i]).abs() < 2e-6, "{t} s: {velocity}");
        }
    }
}

/// Two pipes of different section, wall and material, with joint and stress waves between steps. Without friction, all
/// that errs is the phase of the filters and the cubic between steps: third order.
#[test]
fn two_pipes_converge_to_the_exact_recursion() {
    let file = reference(include_str!("../reference/wall_two_pipes.csv"));
    let exact = Exact::new(&steel_then_pvc(), [Held::Anchored, Held::Free], VELOCITY);
    let closure = |closing_time_s| Closure::FlowCycloid { closing_time_s };
    let case = Case { closure, closing_time_s: 0.05, ..Case::new(&exact, &["steel", "PVC"]) };
    let errors = [64, 128, 256, 512].map(|reaches| {
        let trace = &case.run(&[exact.length()], reaches, 0.61).traces[0];
        let heads: Vec<f64> = file[0].iter().map(|&t| trace.at(t) - 500.0).collect();
        relative_rms(&heads, &file[1])
    });
    println!("two pipes: errors {errors:?}, orders {:.2?}", orders(&errors));
    assert!(errors[2] < 2e-3, "{errors:?}");
    assert!(orders(&errors).iter().sum::<f64>() / 3.0 >= 0.9 * 3.0, "{errors:?}");
}

/// With friction the order is that of the scheme, 2.
#[test]
fn two_pipes_with_friction_converge() {
    let text = rig_of_two_pipes().replace("friction_factor = 0.0", "friction_factor = 0.03");
    let rig = Rig::from_toml(&text, "two.toml").unwrap();
    let water = water(&rig, 998.2);
    let mut model = Model::new(&rig, &water, &parse_list("fluid-structure").unwrap());
    model.closure = |closing_time_s| Closure::FlowCycloid { closing_time_s };
    let run = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 60.0, closing_time_s: 0.2, friction_scale: 1.0 };
    let shared = [1200.0, 400.0, 0.3, 5100.0, 0.2];
    let times: Vec<f64> = (0..400).map(|i| f64::from(i) * 5e-3).collect();
    let heads = |reaches| {
        let resolution = Resolution { reaches, duration_s: 2.0 };
        let probes = [160.0, 60.0].map(Probe::head);
        let traces = model.simulate(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap().traces;
        traces
            .iter()
            .flat_map(|trace| times.iter().map(|&t| trace.at(t) - 60.0).collect::<Vec<_>>())
            .collect::<Vec<f64>>()
    };
    let finest = heads(2048);
    let errors = [64, 128, 256].map(|reaches| relative_rms(&heads(reaches), &finest));
    println!("two pipes with friction: errors {errors:?}, orders {:.2?}", orders(&errors));
    assert!(errors[2] < 1e-3, "{errors:?}");
    assert!(orders(&errors).iter().sum::<f64>() / 2.0 >= 0.9 * 2.0, "{errors:?}");
}

/// Water and walls hold what the shut valve has given them since: `ρg Q0 ∫H dt`, since neither end takes work. The
/// integral is the program's, the energy that of the literature's variables from the recursion.
#[test]
fn energy_of_two_pipes_is_the_work_at_the_valve() {
    let pipes = two_whole();
    for held in ENDS {
        let exact = Exact::new(&pipes, held, VELOCITY);
        let run = Case::new(&exact, &["steel", "PVC"]).run(&[exact.length()], 64, 6.0 * exact.travel_s());
        let trace = &run.traces[0];
        let power = pipes[1].density * G * VELOCITY * pipes[1].area();
        for steps in [10, 37, 64, 101, 200, 311] {
            // A quarter of a step on, no front lies within one of the cells.
            let heads: f64 =
                (1..=steps).map(|i| trace.values[i] - 500.0).sum::<f64>() + 0.25 * (trace.values[steps + 1] - 500.0);
            let given = power * trace.dt_s * heads;
            let held_j = exact.energy_j((steps as f64 + 0.25) * trace.dt_s, &[8 * 40, 8 * 24]);
            assert!((held_j / given - 1.0).abs() < 1e-6, "{steps}: {held_j} {given}");
        }
        let energy = run.energy.unwrap();
        let share = energy.largest_imbalance_j() / energy.initial_kinetic_j();
        assert!(share < 1e-6, "{share:.1e} of the kinetic energy is unaccounted for");
    }
}

/// A joint of equal pipes is none: 24 and 16 of 40 steps, of which stress waves take six and four. On a floor that is
/// so in the limit, for its friction is gathered at other places then.
#[test]
fn two_equal_pipes_are_one() {
    let whole = four_times_as_fast();
    let part = |share: f64| Pipe { length: share * whole.length, ..whole };
    let apart = |effect, more, held, finer: usize| {
        let one = Exact::new(&[whole], held, VELOCITY);
        let two = Exact::new(&[part(0.6), part(0.4)], held, VELOCITY);
        let places = [whole.length, 0.6 * whole.length, 0.25 * whole.length, 0.0];
        let one = Case { effect, more, ..Case::new(&one, &["steel"]) }.heads(&places, 40 * finer, 3.0).0;
        let two = Case { effect, more, ..Case::new(&two, &["steel", "steel"]) }.heads(&places, 40 * finer, 3.0).0;
        relative_rms(&two.concat(), &one.concat())
    };
    for held in ENDS {
        for (effect, more) in [("fluid-structure", &[][..]), ("fluid-structure/dry", &[30.0][..])] {
            let apart = apart(effect, more, held, 1);
            assert!(apart < 1e-12, "{effect}: {apart}");
        }
        let errors = [1, 4, 16].map(|finer| apart("fluid-structure/floor", &[30.0][..], held, finer));
        println!("floor: {errors:?}");
        assert!(orders(&errors).iter().all(|&o| o > 2.0), "a quarter of the step leaves a quarter: {errors:?}");
    }
}

/// Before the valve moves nothing moves, though a leak makes the flow into the pipes larger than that out of them.
#[test]
fn the_steady_flow_stays_beside_a_leak() {
    let text = rig_of_two_pipes().replace("friction_factor = 0.0", "friction_factor = 0.03");
    let rig = Rig::from_toml(&text, "two.toml").unwrap();
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

/// A pipe through which stress waves would pass within a step asks for a finer grid, and is refused on a coarser one.
#[test]
fn a_short_pipe_gets_the_steps_that_its_stress_waves_need() {
    let rig =
        Rig::from_toml(&rig_of_two_pipes().replace("62.7", "1.5").replace("160.0", "98.8"), "short.toml").unwrap();
    let water = water(&rig, 998.2);
    let reaches = |effects: &str| {
        let model = Model::new(&rig, &water, &parse_list(effects).unwrap());
        let starts: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
        model.least_reaches(&starts)
    };
    let [base, moving] = [reaches("none"), reaches("fluid-structure")];
    assert!(reaches("fluid-structure/floor") > moving && moving > 2 * base, "{base} {moving}");
    let model = Model::new(&rig, &water, &parse_list("fluid-structure").unwrap());
    let starts: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
    let run = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 60.0, closing_time_s: 0.05, friction_scale: 1.0 };
    let simulate = |reaches| {
        let resolution = Resolution { reaches, duration_s: 0.1 };
        model.simulate(&Conditions::of(water), &starts, &run, resolution, &[Probe::head(98.8)]).map(|_| ())
    };
    assert_eq!(simulate(moving), Ok(()));
    let refused = simulate(base).unwrap_err().to_string();
    assert!(refused.contains("too few") && refused.contains("at least"), "{refused}");
}
