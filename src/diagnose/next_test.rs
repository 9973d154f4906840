//! Which test would tell two rivals apart: both are simulated where they have not been fitted.

use rayon::prelude::*;

use super::ground::Ground;
use super::rival::Rival;
use crate::model::effects::Chosen;
use crate::model::trace::Probe;
use crate::model::{Conditions, Model, ModelError, Resolution, RunValues};
use crate::rig::Rig;

/// Times the noise that two rivals must differ by for a test to be worth making.
const TELLING: f64 = 3.0;
/// Periods that are compared.
const PERIODS: f64 = 8.0;
/// How many times the other's creep one rival's must be at least for a creep test to tell them.
const CREEP_APART: f64 = 1.2;
/// What is as good as the same test: velocities and closing times within a fifth, heads within 5 m, sensors within a tenth of the length.
const SAME_SHARE: f64 = 0.2;
const SAME_HEAD_M: f64 = 5.0;
const SAME_PLACE: f64 = 0.1;

/// A test as it would be made.
struct Setup {
    rig: Rig,
    conditions: Conditions,
    run: RunValues,
    /// Where heads are read, as a share of the length.
    at: f64,
}

/// A test that could be made: what to do, and what that changes.
struct Test {
    instruction: &'static str,
    change: fn(&mut Setup),
}

const TESTS: [Test; 7] = [
    Test { instruction: "repeat the test at half the flow", change: |s| s.run.initial_velocity_m_s *= 0.5 },
    Test {
        instruction: "repeat the test at one and a half times the flow",
        change: |s| s.run.initial_velocity_m_s *= 1.5,
    },
    Test { instruction: "close the valve four times as slowly", change: |s| s.run.closing_time_s *= 4.0 },
    Test { instruction: "raise the static head by 20 m", change: |s| s.run.valve_head_m += 20.0 },
    Test { instruction: "add a pressure sensor at mid-length", change: |s| s.at = 0.5 },
    Test { instruction: "put half as much pipe again before the valve", change: lengthen },
    Test { instruction: "repeat the test with water 20 K warmer", change: warm },
];

fn lengthen(setup: &mut Setup) {
    let more_m = 0.5 * setup.rig.length_m();
    if let Some(last) = setup.rig.pipes.last_mut() {
        last.length_m += more_m;
    }
}

/// The wall's creep changes, too, in a way that neither model knows: what is compared is the water's part.
fn warm(setup: &mut Setup) {
    let fluid = &setup.rig.fluid;
    setup.conditions.water = fluid.properties(fluid.temperature_degc + 20.0);
}

/// A model with values for its variables.
struct Fitted<'a> {
    name: &'static str,
    effects: &'a [Chosen],
    shared: Vec<f64>,
    /// What each run has of its own.
    runs: Vec<RunValues>,
}

impl<'a> Fitted<'a> {
    fn of(ground: &Ground, rival: &'a Rival) -> Self {
        let (effects, values) = rival.model();
        let model = ground.model(effects);
        let problem = ground.problem(&model);
        let runs = (0..ground.runs.len()).map(|r| problem.run_values(r, &values)).collect();
        Fitted { name: rival.refit.form.effect, effects, shared: values[..model.shared.len()].to_vec(), runs }
    }

    /// The first run, changed.
    fn setup(&self, ground: &Ground, test: &Test) -> Setup {
        let conditions = ground.runs[0].conditions.clone();
        let mut setup = Setup { rig: ground.rig.clone(), conditions, run: self.runs[0], at: 1.0 };
        (test.change)(&mut setup);
        setup
    }

    fn predicted(&self, ground: &Ground, test: &Test) -> Result<Vec<f64>, ModelError> {
        let setup = self.setup(ground, test);
        let model = Model::new(&setup.rig, &setup.conditions.water, self.effects);
        let duration_s = PERIODS * model.period_s(&self.shared);
        let probe = Probe::Head(setup.at * setup.rig.length_m());
        let resolution = Resolution { reaches: ground.reaches, duration_s };
        let mut simulated = model.simulate(&setup.conditions, &self.shared, &setup.run, resolution, &[probe])?;
        let trace = simulated.traces.remove(0);
        Ok((0..2000).map(|i| trace.at(f64::from(i) / 2000.0 * duration_s)).collect())
    }

    /// Whether the recordings hold such a test already.
    fn has_seen(&self, ground: &Ground, test: &Test) -> bool {
        let setup = self.setup(ground, test);
        if setup.run != self.runs[0] {
            return self.runs.iter().any(|run| alike(run, &setup.run));
        }
        let sensors = ground.runs.iter().flat_map(|r| &r.sensors);
        let mut places = sensors.map(|s| s.sensor.position_m / ground.rig.length_m());
        setup.at < 1.0 && places.any(|place| (place - setup.at).abs() < SAME_PLACE)
    }

    /// What the wall creeps by in the end, 1/GPa.
    fn creep_per_gpa(&self, ground: &Ground) -> f64 {
        let shared = ground.model(self.effects).shared;
        shared.iter().zip(&self.shared).filter(|(p, _)| p.unit == "1/GPa").map(|(_, v)| v).sum()
    }
}

fn alike(one: &RunValues, other: &RunValues) -> bool {
    let near = |a: f64, b: f64| (a / b).ln().abs() < SAME_SHARE;
    near(one.initial_velocity_m_s, other.initial_velocity_m_s)
        && near(one.closing_time_s, other.closing_time_s)
        && (one.valve_head_m - other.valve_head_m).abs() < SAME_HEAD_M
}

/// The test in which two rivals, as fitted, differ most, in words, of those that have not been made; `None` where none would tell.
pub(super) fn next_test(ground: &Ground, one: &Rival, other: &Rival) -> Option<String> {
    let (one, other) = (Fitted::of(ground, one), Fitted::of(ground, other));
    let difference_m = |test: &Test| {
        let (a, b) = (one.predicted(ground, test).ok()?, other.predicted(ground, test).ok()?);
        let n = a.len().min(b.len()).max(1) as f64;
        // A sensor's zero would take up what differs throughout.
        let mean = a.iter().zip(&b).map(|(x, y)| x - y).sum::<f64>() / n;
        Some((a.iter().zip(&b).map(|(x, y)| (x - y - mean).powi(2)).sum::<f64>() / n).sqrt())
    };
    let noise_m = ground.noise_m();
    let mut telling: Vec<(&Test, f64)> = TESTS
        .par_iter()
        .filter(|test| !one.has_seen(ground, test))
        .filter_map(|test| Some((test, difference_m(test).filter(|d| *d >= TELLING * noise_m)?)))
        .collect();
    telling.sort_by(|a, b| b.1.total_cmp(&a.1));
    let times = |d: f64| format!("{d:.3} m rms, {:.1} times the noise", d / noise_m);
    let simulated = telling.first().map(|(test, d)| {
        let second =
            telling.get(1).map_or(String::new(), |(test, d)| format!("; or {} ({})", test.instruction, times(*d)));
        format!("{} (there the two models, as fitted, differ by {}){second}", test.instruction, times(*d))
    });
    let creep = creep_test(one.creep_per_gpa(ground), other.creep_per_gpa(ground));
    let tests: Vec<String> = simulated.into_iter().chain(creep).collect();
    (!tests.is_empty()).then(|| {
        format!("{} and {} cannot be told apart by these recordings: {}", one.name, other.name, tests.join("; or "))
    })
}

/// A creep test of the wall, where the two models ask for different walls.
fn creep_test(one: f64, other: f64) -> Option<String> {
    let apart = one.max(other) > CREEP_APART * one.min(other).max(0.0);
    apart.then(|| {
        format!("make a creep test of the wall, which creeps by {one:.3} 1/GPa for the one, {other:.3} for the other")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_creep_test_is_worth_making_where_the_walls_differ() {
        assert!(creep_test(0.0, 0.0).is_none());
        assert!(creep_test(0.30, 0.31).is_none());
        assert!(creep_test(0.30, 0.0).is_some() && creep_test(0.2, 0.3).unwrap().contains("0.200 1/GPa"));
    }
}
