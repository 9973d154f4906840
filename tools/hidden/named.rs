//! Whether the program names what this scheme hides, and explains the record down to its noise.

use surgescope::Study;
use surgescope::diagnose::Verdict;
use surgescope::fit::search::options::Options;
use surgescope::model::effects::parse_list;
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::rig::{Rig, WaterProperties};
use surgescope::storage::import::{ImportOptions, SourceOptions};
use surgescope::study::import::import;

use super::record::{self, Lab, linear};
use super::rig::{Case, Hidden, draw};
use super::scheme::{CAVITY_GAS, CONDENSING_S, VAPOUR_M, solve_on};

/// The effect that a diagnosis of the case's first run names, and what it leaves over the noise.
fn named(case: &Case, random: &mut fastrand::Rng) -> (&'static str, f64) {
    let folder = tempfile::tempdir().unwrap();
    record::write(folder.path(), case, random, Lab { coloured: false, hum: false, wrong_rig: false }).unwrap();
    let rig = Rig::load(&folder.path().join("rig.toml")).unwrap();
    let (table, options) = (folder.path().join("run.csv"), ImportOptions::default());
    let recording = import(&table, &rig, &options, &SourceOptions::default(), true).unwrap().recording;
    let study = Study::from_recordings([("run".to_owned(), recording)]).unwrap();
    let start = if case.start_effects.is_empty() { "none".to_owned() } else { case.start_effects.join(",") };
    let answer = study.diagnose_model(&parse_list(&start).unwrap(), &Options::default()).unwrap();
    assert_eq!(answer.verdict, Verdict::MissingEffect);
    let best = &answer.candidates[0];
    (best.effect, best.over_noise)
}

/// A wall that moves, whose records show what a moving valve or creep would be asked to explain.
#[test]
fn a_wall_that_moves_is_named() {
    let mut random = fastrand::Rng::with_seed(2581 * 1_000_003 + 1);
    let mut case = draw(&mut random, "fluid-structure", &[], false, "wall");
    // A few cycles are enough to tell it from its rivals.
    case.duration_s *= 0.2;
    let (effect, over_noise) = named(&case, &mut random);
    assert_eq!(effect, "fluid-structure");
    assert!(over_noise < 1.1, "{over_noise} times the noise");
}

/// Column separation, down to the noise: the air's pressure, the gas that starts the cavities and their lag are found.
#[test]
fn cavities_are_named_and_followed() {
    let mut random = fastrand::Rng::with_seed(1581 * 1_000_003 + 3);
    let mut case = draw(&mut random, "vapour-cavity", &[], false, "cavities");
    case.duration_s *= 0.25;
    let (effect, over_noise) = named(&case, &mut random);
    assert_eq!(effect, "vapour-cavity");
    assert!(over_noise < 1.5, "{over_noise} times the noise");
}

/// A pipe of 50 m that only differs by what it hides.
fn short_pipe(kind: &'static str, valve_head_m: f64) -> Case {
    Case {
        length_m: 50.0,
        diameter_m: 0.02,
        wall_m: 0.001,
        wave_speed_m_s: 1200.0,
        velocity_m_s: 0.25,
        valve_head_m,
        closing_s: 0.03,
        duration_s: 0.8,
        sensors_m: vec![50.0, 21.0],
        friction: Some(0.03),
        unsteady_friction: false,
        ..draw(&mut fastrand::Rng::with_seed(1), kind, &[], false, "short")
    }
}

/// Times at which two schemes are compared.
fn times_s() -> impl Iterator<Item = f64> {
    (0..400).map(|i| 0.002 * (f64::from(i) + 0.5))
}

/// Heads at both sensors at these times, of this scheme on so many nodes.
fn solved(case: &Case, nodes: usize) -> Vec<f64> {
    let solved = solve_on(case, case.velocity_m_s, case.duration_s, nodes);
    let at = |heads: &Vec<f64>| times_s().map(|t| linear(heads, t / solved.dt_s)).collect::<Vec<_>>();
    solved.heads_m.iter().flat_map(at).collect()
}

/// The rig of such a case.
fn rig_of(case: &Case) -> Rig {
    let Case { length_m, diameter_m, wall_m, .. } = *case;
    let text = format!(
        "name = \"short\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = \
         {length_m}\ninner_diameter_mm = {}\nwall_thickness_mm = {}\nmaterial = \"copper\"\nfriction_factor = {}\n[upstream]\nkind \
         = \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = {}\n[[sensor]]\nname = \"P1\"\nkind = \
         \"pressure\"\nposition_m = {length_m}\nunit = \"kPa\"\n",
        1e3 * diameter_m,
        1e3 * wall_m,
        case.friction.unwrap(),
        case.closing_s
    );
    Rig::from_toml(&text, "short.toml").unwrap()
}

/// Heads at both sensors at these times, of the program on so many reaches, with one effect of these values.
fn modelled(case: &Case, water: &WaterProperties, effect: &str, values: &[f64], reaches: usize) -> Vec<f64> {
    let rig = rig_of(case);
    let model = Model::new(&rig, water, &parse_list(effect).unwrap());
    let shared = [&[case.wave_speed_m_s], values].concat();
    let run = RunValues {
        initial_velocity_m_s: case.velocity_m_s,
        valve_head_m: case.valve_head_m,
        closing_time_s: case.closing_s,
        friction_scale: 1.0,
    };
    let resolution = Resolution { reaches, duration_s: case.duration_s };
    let probes = [Probe::head(case.length_m), Probe::head(case.sensors_m[1])];
    let simulated = model.simulate(&Conditions::of(*water), &shared, &run, resolution, &probes).unwrap();
    simulated.traces.iter().flat_map(|trace| times_s().map(|t| trace.at(t))).collect()
}

/// How far heads are apart, rms, as a share of the case's rise.
fn apart(case: &Case, a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt() / case.joukowsky_m()
}

/// Cavities by two schemes, whose laws of gas and condensation are the same: the finer both grids, the less they differ.
#[test]
fn cavities_open_and_close_as_the_program_has_them() {
    let case = short_pipe("vapour-cavity", 16.0);
    let water = rig_of(&case).fluid.properties(20.0);
    let air_pa = water.vapour_pressure_pa - VAPOUR_M * water.density_kg_m3 * 9.81;
    let values = [CONDENSING_S, CAVITY_GAS, 1e-3 * air_pa];
    let between = [64, 128, 256].map(|reaches| {
        apart(&case, &modelled(&case, &water, "vapour-cavity", &values, reaches), &solved(&case, 4 * reaches))
    });
    println!("{between:?} of the rise");
    assert!(between[2] < 0.005 && between[0] / between[2] > 4.0, "{between:?}");
}

/// Friction of the floor by two schemes that share nothing: each resolves the wall on a grid of its own.
#[test]
fn a_floor_brakes_the_wall_as_the_program_has_it() {
    let mut case = short_pipe("fluid-structure", 60.0);
    let rise_m = case.joukowsky_m();
    let (nu, ct, density, give) = (0.34, 3660.0, 8930.0, 9.81 * 50.0 / 1.44e6);
    let rig = rig_of(&case);
    let mut water = rig.fluid.properties(20.0);
    water.density_kg_m3 = rig.pipes[0].material().density_kg_m3 / density * case.density_kg_m3();
    // The wall slides all along; it sticks in part; it hardly moves.
    for floor_m in [0.2, 1.0, 10.0].map(|part| part * rise_m) {
        case.hidden = vec![Hidden::Wall(nu, ct, density, give, floor_m)];
        let (right, values) = (solved(&case, 200), [nu, ct, 1e3 * give, floor_m]);
        let [coarse, medium, fine] = [40, 80, 160]
            .map(|reaches| apart(&case, &modelled(&case, &water, "fluid-structure/floor", &values, reaches), &right));
        println!("floor {floor_m:.1} m: {coarse:.1e}, {medium:.1e}, {fine:.1e} of the rise");
        assert!(fine < 3e-3, "{floor_m} m: {fine}");
        assert!(coarse / fine > 4.0, "{floor_m} m: no order of one: {coarse} {medium} {fine}");
    }
}
