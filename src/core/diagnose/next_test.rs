//! Which test would tell two rivals apart: both are simulated where they have not been fitted.

use rayon::prelude::*;

use crate::diagnose::baseline::Ground;
use crate::diagnose::candidate_fit::Rival;
use crate::model::effects::Chosen;
use crate::model::trace::Probe;
use crate::model::{Conditions, Model, ModelError, Resolution, RunValues};
use crate::rig::{Rig, Sensor};

/// Times the noise that two rivals must differ by for a test to be worth making.
const TELLING: f64 = 3.0;
/// How many tests are named.
const NAMED: usize = 2;
/// Periods that are compared.
const PERIODS: f64 = 8.0;
/// How many times the other's creep one rival's must be at least for a creep test to tell them.
const CREEP_APART: f64 = 1.2;
/// What is as good as the same test: velocities and closing times within a fifth, heads within 5 m, sensors within a tenth of the length.
const SAME_SHARE: f64 = 0.2;
const SAME_HEAD_M: f64 = 5.0;
const SAME_PLACE: f64 = 0.1;
/// Share of the length within which a sensor stands at the valve.
const AT_THE_VALVE: f64 = 0.01;
/// Points a sensor at which two predictions are compared.
const POINTS: usize = 2000;

/// A test as it would be made.
struct Setup {
    rig: Rig,
    conditions: Conditions,
    run: RunValues,
    sensors: Vec<Sensor>,
}

/// A test that could be made: what it changes of the first run, and what to do, given the run as changed.
struct Test {
    change: fn(&mut Setup),
    instruction: fn(&RunValues) -> String,
}

const TESTS: [Test; 7] = [
    Test { change: |s| s.run.initial_velocity_m_s *= 0.5, instruction: at_velocity },
    Test { change: |s| s.run.initial_velocity_m_s *= 1.5, instruction: at_velocity },
    Test {
        change: |s| s.run.closing_time_s *= 4.0,
        instruction: |run| format!("close the valve more slowly, in {:.3} s", run.closing_time_s),
    },
    Test {
        change: |s| s.run.valve_head_m += 20.0,
        instruction: |run| format!("raise the static head by 20 m, to {:.1} m before the valve", run.valve_head_m),
    },
    Test { change: add_sensor, instruction: |_| "add a pressure sensor at mid-length".to_owned() },
    Test { change: lengthen, instruction: |_| "put half as much pipe again before the valve".to_owned() },
    Test { change: warm, instruction: |_| "repeat the test with water 20 K warmer".to_owned() },
];

fn at_velocity(run: &RunValues) -> String {
    format!("repeat the test at {:.3} m/s", run.initial_velocity_m_s)
}

fn add_sensor(setup: &mut Setup) {
    if let Some(known) = setup.sensors.first() {
        let position_m = 0.5 * setup.rig.length_m();
        setup.sensors.push(Sensor { name: String::new(), position_m, ..known.clone() });
    }
}

fn lengthen(setup: &mut Setup) {
    let length_m = setup.rig.length_m();
    if let Some(last) = setup.rig.pipes.last_mut() {
        last.length_m += 0.5 * length_m;
    }
    for sensor in &mut setup.sensors {
        if length_m - sensor.position_m < AT_THE_VALVE * length_m {
            sensor.position_m = 1.5 * length_m;
        }
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
        let first = &ground.runs[0];
        let sensors = first.sensors.iter().map(|s| s.sensor.clone()).collect();
        let (rig, conditions) = (ground.rig.clone(), first.conditions.clone());
        let mut setup = Setup { rig, conditions, run: self.runs[0], sensors };
        (test.change)(&mut setup);
        setup
    }

    /// What each sensor would show.
    fn predicted(&self, ground: &Ground, test: &Test) -> Result<Vec<Vec<f64>>, ModelError> {
        let setup = self.setup(ground, test);
        let model = Model::new(&setup.rig, &setup.conditions.water, self.effects);
        let duration_s = PERIODS * model.period_s(&self.shared);
        let probes: Vec<Probe> = setup.sensors.iter().map(|s| Probe::Head(s.position_m)).collect();
        let resolution = Resolution { reaches: ground.reaches, duration_s };
        let simulated = model.simulate(&setup.conditions, &self.shared, &setup.run, resolution, &probes)?;
        let shown = setup.sensors.iter().zip(simulated.traces).map(|(sensor, trace)| {
            let trace = model.sensed(&self.shared, sensor, trace)?;
            Ok((0..POINTS).map(|i| trace.at(i as f64 / POINTS as f64 * duration_s)).collect())
        });
        shown.collect()
    }

    /// Whether the recordings hold such a test already.
    fn has_seen(&self, ground: &Ground, test: &Test) -> bool {
        let setup = self.setup(ground, test);
        let first = &self.runs[0];
        if setup.run != *first {
            return self.runs.iter().any(|run| alike(run, &setup.run, first));
        }
        let near = |a: &Sensor, b: &Sensor| (a.position_m - b.position_m).abs() < SAME_PLACE * ground.rig.length_m();
        let known = ground.runs[0].sensors.len();
        setup.sensors[known..].iter().any(|new| setup.sensors[..known].iter().any(|old| near(old, new)))
    }

    /// The sensor that its added effect concerns.
    fn suspect(&self) -> Option<&str> {
        self.effects.last()?.sensor.as_deref()
    }

    /// What the wall creeps by in the end, 1/GPa.
    fn creep_per_gpa(&self, ground: &Ground) -> f64 {
        let shared = ground.model(self.effects).shared;
        shared.iter().zip(&self.shared).filter(|(p, _)| p.unit == "1/GPa").map(|(_, v)| v).sum()
    }
}

/// Whether a run is like the one that is asked for in what that changes of the first.
fn alike(run: &RunValues, asked: &RunValues, first: &RunValues) -> bool {
    let near = |of: fn(&RunValues) -> f64| of(asked) == of(first) || (of(run) / of(asked)).ln().abs() < SAME_SHARE;
    let head = asked.valve_head_m == first.valve_head_m || (run.valve_head_m - asked.valve_head_m).abs() < SAME_HEAD_M;
    near(|v| v.initial_velocity_m_s) && near(|v| v.closing_time_s) && head
}

/// Deviation of two predictions, rms, less their mean: a sensor's zero would take that up.
fn deviation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().max(1) as f64;
    let mean = a.iter().zip(b).map(|(x, y)| x - y).sum::<f64>() / n;
    (a.iter().zip(b).map(|(x, y)| (x - y - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// The tests in which two rivals, as fitted, differ most, in words, of those that have not been made; `None` where none would tell.
pub(crate) fn next_test(ground: &Ground, one: &Rival, other: &Rival) -> Option<String> {
    let (one, other) = (Fitted::of(ground, one), Fitted::of(ground, other));
    let difference_m = |test: &Test| {
        let (a, b) = (one.predicted(ground, test).ok()?, other.predicted(ground, test).ok()?);
        a.iter().zip(&b).map(|(a, b)| deviation(a, b)).max_by(f64::total_cmp)
    };
    let noise_m = ground.noise_m();
    let mut telling: Vec<(&Test, f64)> = TESTS
        .par_iter()
        .filter(|test| !one.has_seen(ground, test))
        .filter_map(|test| Some((test, difference_m(test).filter(|d| *d >= TELLING * noise_m)?)))
        .collect();
    telling.sort_by(|a, b| b.1.total_cmp(&a.1));
    let simulated = telling.iter().take(NAMED).map(|(test, d)| {
        let instruction = (test.instruction)(&one.setup(ground, test).run);
        format!("{instruction} (the two models differ by {d:.3} m rms there, {:.1} times the noise)", d / noise_m)
    });
    let exchange = (one.suspect() != other.suspect() && ground.runs[0].sensors.len() > 1)
        .then(|| one.suspect().or(other.suspect()))
        .flatten()
        .map(|sensor| format!("exchange {sensor} with another sensor (a fault of the sensor goes with it)"));
    let creep = creep_test(one.creep_per_gpa(ground), other.creep_per_gpa(ground));
    let tests: Vec<String> = exchange.into_iter().chain(simulated).chain(creep).collect();
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
