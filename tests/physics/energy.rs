//! The energy book: it closes for every model, and its accounts are the energies of textbooks.

use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::{CATALOGUE, Chosen, Effect, excluded, parse_list};
use surgescope_core::model::energy::Energy;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, Resolution, RunValues, Simulated};
use surgescope_core::rig::{Rig, Upstream, WaterProperties};

use super::{rig, rig_of_two_pipes, water};

const RUN: RunValues =
    RunValues { initial_velocity_m_s: 0.5, valve_head_m: 30.0, closing_time_s: 0.2, friction_scale: 1.0 };

/// What the balance may leave over, as a share of the kinetic energy before the closure.
const BAR: f64 = 1e-6;

struct Case<'a> {
    rig: &'a Rig,
    water: WaterProperties,
    effects: Vec<Chosen>,
    closure: fn(f64) -> Closure,
    reaches: usize,
    run: RunValues,
    supply_deviation: Option<(Vec<f64>, Vec<f64>)>,
}

impl<'a> Case<'a> {
    fn new(rig: &'a Rig, effects: &str) -> Self {
        Case {
            rig,
            water: water(rig, 998.2),
            effects: parse_list(effects).unwrap(),
            closure: |closing_time_s| Closure::FlowCycloid { closing_time_s },
            reaches: 60,
            run: RUN,
            supply_deviation: None,
        }
    }

    /// The model at its parameters' starts, over `periods`, with and without the book.
    fn simulate(&self, periods: f64) -> [Simulated; 2] {
        let mut model = Model::new(self.rig, &self.water, &self.effects);
        model.closure = self.closure;
        let shared: Vec<f64> = model.shared.iter().map(|p| p.start).collect();
        let conditions = Conditions { supply_deviation: self.supply_deviation.clone(), ..Conditions::of(self.water) };
        let resolution = Resolution { reaches: self.reaches, duration_s: periods * model.period_s(&shared) };
        let probes = [Probe::head(self.rig.length_m()), Probe::head(0.4 * self.rig.length_m())];
        let plain = model.simulate(&conditions, &shared, &self.run, resolution, &probes).unwrap();
        let booked = model.simulate_with_energy(&conditions, &shared, &self.run, resolution, &probes).unwrap();
        [plain, booked]
    }

    /// Keeps the book over ten periods; it must close, and keeping it must change nothing.
    fn closes(&self) -> Energy {
        let [plain, booked] = self.simulate(10.0);
        for (a, b) in plain.traces.iter().zip(&booked.traces) {
            let apart = a.values.iter().zip(&b.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-8, "{:?}: keeping the book moves a head by {apart} m", self.effects);
        }
        assert!(plain.energy.is_none());
        let energy = booked.energy.unwrap();
        let share = energy.largest_imbalance_j() / energy.initial_kinetic_j();
        assert!(share < BAR, "{:?}: {share:.1e} of the kinetic energy is unaccounted for", self.effects);
        energy
    }
}

fn last(energy: &Energy, column: &str) -> f64 {
    let at = energy.columns().iter().position(|c| c == column).unwrap();
    energy.steps().last().unwrap()[at]
}

#[test]
fn it_closes_for_every_law_of_steady_friction() {
    for friction in ["friction_factor = 0.03", "roughness_mm = 0.1", ""] {
        for velocity in [0.05, 0.5] {
            let rig = rig(200.0, 20.0, 2.0, friction);
            let run = RunValues { initial_velocity_m_s: velocity, ..RUN };
            let energy = Case { run, ..Case::new(&rig, "none") }.closes();
            let area = std::f64::consts::FRAC_PI_4 * 0.02f64.powi(2);
            let kinetic = 0.5 * 998.2 * area * 200.0 * velocity * velocity;
            assert!((energy.initial_kinetic_j() / kinetic - 1.0).abs() < 1e-12);
            assert!(last(&energy, "friction_J") > 0.0);
        }
    }
}

#[test]
fn it_closes_for_creep_and_the_wall_takes_most() {
    let rig = rig(277.0, 50.6, 6.3, "roughness_mm = 0.0015");
    for elements in 1..=3 {
        let energy = Case::new(&rig, &format!("viscoelastic-wall:{elements}")).closes();
        assert!(last(&energy, "viscoelastic-wall_J") > last(&energy, "friction_J"));
        let duration_s = energy.steps().len() as f64 * energy.dt_s;
        assert_eq!(energy.takers(duration_s)[0].0, "viscoelastic-wall");
    }
}

#[test]
fn it_closes_for_pipes_in_series_and_for_a_supply_that_moves() {
    let text = rig_of_two_pipes().replace("friction_factor = 0.0", "friction_factor = 0.02");
    let two = Rig::from_toml(&text, "two.toml").unwrap();
    // A leak, a loss and gas at the joint are the pressure waves' own.
    let halves = text.replace("97.3", "80.0").replace("62.7", "80.0");
    let halves = Rig::from_toml(&halves, "halves.toml").unwrap();
    for rig in [&two, &halves] {
        for effects in ["none", "viscoelastic-wall:2"] {
            Case::new(rig, effects).closes();
        }
        for form in ["", "/dry", "/floor"] {
            for others in ["", ",leak", ",blockage", ",entrained-gas", ",section-change", ",viscoelastic-wall:2"] {
                let energy = Case::new(rig, &format!("fluid-structure{form}{others}")).closes();
                let taken = last(&energy, &format!("fluid-structure{form}_J"));
                assert!(taken.abs() > BAR * energy.initial_kinetic_j(), "{form} {others}: {taken} J");
            }
        }
    }
    let mut measured = rig(100.0, 20.0, 2.0, "");
    measured.upstream = Upstream::Measured;
    let times: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.05).collect();
    let heads = times.iter().map(|t| 2.0 * (3.0 * t).sin() * (-0.1 * t).exp()).collect();
    let energy =
        Case { supply_deviation: Some((times, heads)), ..Case::new(&measured, "viscoelastic-wall:1") }.closes();
    assert!(last(&energy, "supply_J").abs() > 0.01 * energy.initial_kinetic_j());
}

/// Every effect and its variants, at their starts, alone.
fn all_effects() -> Vec<&'static dyn Effect> {
    CATALOGUE.iter().flat_map(|e| std::iter::once(*e).chain(e.variants().iter().copied())).collect()
}

fn chosen(effect: &'static dyn Effect) -> Chosen {
    Chosen::of(effect)
}

#[test]
fn it_closes_for_every_effect() {
    let rig = rig(100.0, 20.0, 2.0, "friction_factor = 0.03");
    for effect in all_effects() {
        // The second at a head so low that cavities open and gas expands.
        for (closure, valve_head_m) in [
            ((|closing_time_s| Closure::FlowCycloid { closing_time_s }) as fn(f64) -> Closure, 30.0),
            (|closing_time_s| Closure::Linear { closing_time_s }, 6.0),
        ] {
            let run = RunValues { valve_head_m, ..RUN };
            Case { effects: vec![chosen(effect)], closure, run, ..Case::new(&rig, "none") }.closes();
        }
    }
}

#[test]
fn it_closes_for_ten_random_mixtures() {
    let all = all_effects();
    let mut random = fastrand::Rng::with_seed(20);
    let frictions = ["friction_factor = 0.03", "roughness_mm = 0.05", ""];
    for round in 0..10 {
        let rig = rig(100.0, 20.0, 2.0, frictions[round % 3]);
        let mut effects: Vec<Chosen> = Vec::new();
        for _ in 0..1 + random.usize(..4) {
            let effect = all[random.usize(..all.len())];
            let fits = |c: &Chosen| c.effect.name() != effect.name() && excluded(effect, c.effect).is_ok();
            if effects.iter().all(fits) {
                effects.push(chosen(effect));
            }
        }
        let velocity = random.f64() * 0.8 + 0.05;
        let run = RunValues { initial_velocity_m_s: velocity, ..RUN };
        Case { effects, run, reaches: 100 + random.usize(..60), ..Case::new(&rig, "none") }.closes();
    }
}

/// A sudden closure without friction turns motion into strain: half of it after L/2a, all of it after L/a, and back.
#[test]
fn motion_becomes_strain_and_back() {
    let rig = rig(100.0, 20.0, 2.0, "friction_factor = 0.0");
    let run = RunValues { closing_time_s: 1e-9, ..RUN };
    let energy = Case { run, reaches: 50, ..Case::new(&rig, "none") }.simulate(2.0)[1].energy.clone().unwrap();
    let initial = energy.initial_kinetic_j();
    let quarter_s = 50.0 * energy.dt_s;
    for (quarters, kinetic) in [(0.5, 0.5), (1.0, 0.0), (1.5, 0.5), (2.0, 1.0), (3.0, 0.0), (4.0, 1.0), (5.0, 0.0)] {
        let row = energy.at(quarters * quarter_s);
        assert!((row[0] / initial - kinetic).abs() < 1e-9, "{quarters}: {row:?} of {initial}");
        assert!((row[0] + row[1] - initial).abs() < 1e-9 * initial);
    }
}

/// Before the valve moves friction takes what the supply gives, `ρ g Q (R L) t`, and nothing else moves.
#[test]
fn in_a_steady_flow_friction_takes_the_supplys_power() {
    let rig = rig(200.0, 20.0, 2.0, "friction_factor = 0.03");
    let still: fn(f64) -> Closure = |closing_time_s| Closure::Linear { closing_time_s: 1e12 + closing_time_s };
    let energy = Case { closure: still, ..Case::new(&rig, "viscoelastic-wall:1") }.closes();
    let area = std::f64::consts::FRAC_PI_4 * 0.02f64.powi(2);
    let loss_m = 0.03 * 200.0 / 0.02 * 0.25 / (2.0 * 9.81);
    let duration_s = (energy.steps().len() - 1) as f64 * energy.dt_s;
    let work = 998.2 * 9.81 * loss_m * 0.5 * area * duration_s;
    for column in ["friction_J", "supply_J"] {
        assert!((last(&energy, column) / work - 1.0).abs() < 1e-6, "{column}: {} of {work}", last(&energy, column));
    }
    assert!(last(&energy, "viscoelastic-wall_J").abs() < 1e-6 * energy.initial_kinetic_j());
}

/// A book that had lost an account would not close: what creep takes is no rounding error.
#[test]
fn the_balance_can_fail() {
    let rig = rig(100.0, 20.0, 2.0, "friction_factor = 0.03");
    let energy = Case::new(&rig, "viscoelastic-wall:1").closes();
    let initial = energy.initial_kinetic_j();
    for column in ["friction_J", "viscoelastic-wall_J", "valve_J", "supply_J"] {
        assert!(last(&energy, column).abs() > 1e3 * BAR * initial, "{column} is nothing here");
    }
}
