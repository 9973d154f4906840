//! Whether the program names what this scheme hides, and explains the record down to its noise.

use surgescope::Study;
use surgescope::diagnose::Verdict;
use surgescope::fit::search::options::Options;
use surgescope::model::effects::parse_list;
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, Resolution, RunValues};
use surgescope::rig::Rig;
use surgescope::storage::import::{ImportOptions, SourceOptions};
use surgescope::study::import::import;

use super::record::{self, Lab, linear};
use super::rig::{Case, Hidden, draw};
use super::scheme::solve_on;

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
    let mut case = draw(&mut random, "fluid-structure", None, false, "wall");
    // A few cycles are enough to tell it from its rivals.
    case.duration_s *= 0.2;
    let (effect, over_noise) = named(&case, &mut random);
    assert_eq!(effect, "fluid-structure");
    assert!(over_noise < 1.1, "{over_noise} times the noise");
}

/// Heads at the valve of a pipe on a floor: of the program on so many reaches, at these times, for the same values.
fn modelled(case: &Case, reaches: usize, times_s: &[f64]) -> Vec<f64> {
    let Case { length_m, diameter_m, wall_m, .. } = *case;
    let text = format!(
        "name = \"floor\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = \
         {length_m}\ninner_diameter_mm = {}\nwall_thickness_mm = {}\nmaterial = \"copper\"\nfriction_factor = {}\n[upstream]\nkind \
         = \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = {}\n[[sensor]]\nname = \"P1\"\nkind = \
         \"pressure\"\nposition_m = {length_m}\nunit = \"kPa\"\n",
        1e3 * diameter_m,
        1e3 * wall_m,
        case.friction.unwrap(),
        case.closing_s
    );
    let rig = Rig::from_toml(&text, "floor.toml").unwrap();
    let Hidden::Wall(nu, ct, density_kg_m3, give, floor_m) = case.hidden[0] else { panic!() };
    let mut water = rig.fluid.properties(20.0);
    water.density_kg_m3 = rig.pipes[0].material().density_kg_m3 / density_kg_m3 * case.density_kg_m3();
    let model = Model::new(&rig, &water, &parse_list("fluid-structure/floor").unwrap());
    let shared = [case.wave_speed_m_s, nu, ct, 1e3 * give, floor_m];
    let run = RunValues {
        initial_velocity_m_s: case.velocity_m_s,
        valve_head_m: case.valve_head_m,
        closing_time_s: case.closing_s,
        friction_scale: 1.0,
    };
    let resolution = Resolution { reaches, duration_s: case.duration_s };
    let probes = [Probe::head(length_m), Probe::head(case.sensors_m[1])];
    let simulated = model.simulate(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap();
    simulated.traces.iter().flat_map(|trace| times_s.iter().map(|&t| trace.at(t))).collect()
}

/// Friction of the floor by two schemes that share nothing: each resolves the wall on a grid of its own.
#[test]
fn a_floor_brakes_the_wall_as_the_program_has_it() {
    let give = 1.0 * 9.81 * 50.0 / 1.44e6;
    let mut case = draw(&mut fastrand::Rng::with_seed(1), "fluid-structure", None, false, "floor");
    case = Case {
        length_m: 50.0,
        diameter_m: 0.02,
        wall_m: 0.001,
        wave_speed_m_s: 1200.0,
        velocity_m_s: 0.25,
        valve_head_m: 60.0,
        closing_s: 0.03,
        duration_s: 0.8,
        sensors_m: vec![50.0, 21.0],
        friction: Some(0.03),
        unsteady_friction: false,
        ..case
    };
    let times_s: Vec<f64> = (0..400).map(|i| 0.002 * (f64::from(i) + 0.5)).collect();
    let rise_m = case.joukowsky_m();
    let apart = |a: &[f64], b: &[f64]| {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt() / rise_m
    };
    // The wall slides all along; it sticks in part; it hardly moves.
    for floor_m in [0.2, 1.0, 10.0].map(|part| part * rise_m) {
        case.hidden = vec![Hidden::Wall(0.34, 3660.0, 8930.0, give, floor_m)];
        let solved = solve_on(&case, case.velocity_m_s, case.duration_s, 200);
        let at = |heads: &Vec<f64>| times_s.iter().map(|t| linear(heads, t / solved.dt_s)).collect::<Vec<_>>();
        let right: Vec<f64> = solved.heads_m.iter().flat_map(at).collect();
        let [coarse, medium, fine] = [40, 80, 160].map(|reaches| apart(&modelled(&case, reaches, &times_s), &right));
        println!("floor {floor_m:.1} m: {coarse:.1e}, {medium:.1e}, {fine:.1e} of the rise");
        assert!(fine < 3e-3, "{floor_m} m: {fine}");
        assert!(coarse / fine > 4.0, "{floor_m} m: no order of one: {coarse} {medium} {fine}");
    }
}
