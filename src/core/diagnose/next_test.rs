//! Which test would tell two candidates apart: both are simulated under conditions to which they have not been fitted.

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate_fit::CandidateFit;
use crate::diagnose::limits::{
    AT_THE_VALVE, COMPARED_PERIODS, COMPARED_POINTS, CREEP_RATIO, NAMED_TESTS, SAME_HEAD_M, SAME_PLACE, SAME_SHARE,
    TELLING_OVER_NOISE,
};
use crate::model::effects::Chosen;
use crate::model::trace::Probe;
use crate::model::{Conditions, Model, ModelError, Resolution, RunValues};
use crate::rig::{Rig, Sensor};

/// The conditions of a test.
struct Setup {
    rig: Rig,
    conditions: Conditions,
    run: RunValues,
    sensors: Vec<Sensor>,
}

/// A test that could be made: how it changes the first run, and the instruction for the lab.
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
    Test { change: lengthen, instruction: |_| "lengthen the pipe before the valve by half".to_owned() },
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

/// The wall's creep changes as well, but neither model knows how: only the change in the water is compared.
fn warm(setup: &mut Setup) {
    let fluid = &setup.rig.fluid;
    setup.conditions.water = fluid.properties(fluid.temperature_degc + 20.0);
}

/// A model with values for its variables.
struct Fitted<'a> {
    name: &'static str,
    effects: &'a [Chosen],
    shared: Vec<f64>,
    /// The parameters of each run.
    runs: Vec<RunValues>,
}

impl<'a> Fitted<'a> {
    fn of(baseline: &Baseline, candidate_fit: &'a CandidateFit) -> Self {
        let (effects, values) = candidate_fit.model();
        let model = baseline.model(effects);
        let problem = baseline.problem(&model);
        let runs = (0..baseline.runs.len()).map(|r| problem.run_values(r, &values)).collect();
        Fitted { name: candidate_fit.refit.form.effect, effects, shared: values[..model.shared.len()].to_vec(), runs }
    }

    /// The conditions of the first run, changed by the test.
    fn setup(&self, baseline: &Baseline, test: &Test) -> Setup {
        let first = &baseline.runs[0];
        let sensors = first.sensors.iter().map(|s| s.sensor.clone()).collect();
        let (rig, conditions) = (baseline.rig.clone(), first.conditions.clone());
        let mut setup = Setup { rig, conditions, run: self.runs[0], sensors };
        (test.change)(&mut setup);
        setup
    }

    /// Predicted heads of each sensor.
    fn predicted(&self, baseline: &Baseline, test: &Test) -> Result<Vec<Vec<f64>>, ModelError> {
        let setup = self.setup(baseline, test);
        let model = Model::new(&setup.rig, &setup.conditions.water, self.effects);
        let duration_s = COMPARED_PERIODS * model.period_s(&self.shared);
        let probes: Vec<Probe> = setup.sensors.iter().map(|s| Probe::Head(s.position_m)).collect();
        let resolution = Resolution { reaches: baseline.reaches, duration_s };
        let simulated = model.simulate(&setup.conditions, &self.shared, &setup.run, resolution, &probes)?;
        let shown = setup.sensors.iter().zip(simulated.traces).map(|(sensor, trace)| {
            let trace = model.sensed(&self.shared, sensor, trace)?;
            Ok((0..COMPARED_POINTS).map(|i| trace.at(i as f64 / COMPARED_POINTS as f64 * duration_s)).collect())
        });
        shown.collect()
    }

    /// Whether the recordings already contain such a test.
    fn has_seen(&self, baseline: &Baseline, test: &Test) -> bool {
        let setup = self.setup(baseline, test);
        let first = &self.runs[0];
        if setup.run != *first {
            return self.runs.iter().any(|run| alike(run, &setup.run, first));
        }
        let near = |a: &Sensor, b: &Sensor| (a.position_m - b.position_m).abs() < SAME_PLACE * baseline.rig.length_m();
        let known = baseline.runs[0].sensors.len();
        setup.sensors[known..].iter().any(|new| setup.sensors[..known].iter().any(|old| near(old, new)))
    }

    /// The sensor that the added effect concerns.
    fn suspect(&self) -> Option<&str> {
        self.effects.last()?.sensor.as_deref()
    }

    /// Final creep compliance of the wall, 1/GPa.
    fn creep_per_gpa(&self, baseline: &Baseline) -> f64 {
        let shared = baseline.model(self.effects).shared;
        shared.iter().zip(&self.shared).filter(|(p, _)| p.unit == "1/GPa").map(|(_, v)| v).sum()
    }
}

/// Whether a run resembles the one asked for in every value that the test changes in the first run.
fn alike(run: &RunValues, asked: &RunValues, first: &RunValues) -> bool {
    let near = |of: fn(&RunValues) -> f64| of(asked) == of(first) || (of(run) / of(asked)).ln().abs() < SAME_SHARE;
    let head = asked.valve_head_m == first.valve_head_m || (run.valve_head_m - asked.valve_head_m).abs() < SAME_HEAD_M;
    near(|v| v.initial_velocity_m_s) && near(|v| v.closing_time_s) && head
}

/// Deviation of two predictions without their mean, rms: a sensor's zero would absorb the mean.
fn deviation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().max(1) as f64;
    let mean = a.iter().zip(b).map(|(x, y)| x - y).sum::<f64>() / n;
    (a.iter().zip(b).map(|(x, y)| (x - y - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// The tests that have not been made and in which the two models differ most, in words; `None` if no test would tell
/// them apart.
pub(crate) fn next_test(baseline: &Baseline, one: &CandidateFit, other: &CandidateFit) -> Option<String> {
    let (one, other) = (Fitted::of(baseline, one), Fitted::of(baseline, other));
    let difference_m = |test: &Test| {
        let (a, b) = (one.predicted(baseline, test).ok()?, other.predicted(baseline, test).ok()?);
        a.iter().zip(&b).map(|(a, b)| deviation(a, b)).max_by(f64::total_cmp)
    };
    let noise_m = baseline.noise_m();
    let mut telling: Vec<(&Test, f64)> = TESTS
        .par_iter()
        .filter(|test| !one.has_seen(baseline, test))
        .filter_map(|test| Some((test, difference_m(test).filter(|d| *d >= TELLING_OVER_NOISE * noise_m)?)))
        .collect();
    telling.sort_by(|a, b| b.1.total_cmp(&a.1));
    let simulated = telling.iter().take(NAMED_TESTS).map(|(test, d)| {
        let instruction = (test.instruction)(&one.setup(baseline, test).run);
        format!("{instruction} (the two models differ by {d:.3} m rms there, {:.1} times the noise)", d / noise_m)
    });
    let exchange = (one.suspect() != other.suspect() && baseline.runs[0].sensors.len() > 1)
        .then(|| one.suspect().or(other.suspect()))
        .flatten()
        .map(|sensor| format!("exchange {sensor} with another sensor (a fault of the sensor goes with it)"));
    let creep = creep_test(one.creep_per_gpa(baseline), other.creep_per_gpa(baseline));
    let tests: Vec<String> = exchange.into_iter().chain(simulated).chain(creep).collect();
    (!tests.is_empty()).then(|| {
        format!("{} and {} cannot be told apart by these recordings: {}", one.name, other.name, tests.join("; or "))
    })
}

/// A creep test of the wall, if the two models need different walls.
fn creep_test(one: f64, other: f64) -> Option<String> {
    let apart = one.max(other) > CREEP_RATIO * one.min(other).max(0.0);
    apart.then(|| {
        format!("make a creep test of the wall, which creeps by {one:.3} 1/GPa in the first model and by {other:.3} in the second")
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
