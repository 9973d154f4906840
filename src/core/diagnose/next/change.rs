//! What a lab can do otherwise in the next test, and how that changes the first run.

use crate::diagnose::limits::{SAME_HEAD_M, SAME_PLACE, SAME_SHARE};
use crate::fit::data::run_data::{RunData, SensorData};
use crate::fit::problem::thresholds::VALVE_SENSOR_SHARE;
use crate::model::effects::Chosen;
use crate::model::{Model, RunValues};
use crate::rig::{Place, Rig, WaterProperties};

/// A change of the first run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Velocity before the closure, as a multiple.
    pub velocity: f64,
    /// Closing time, as a multiple.
    pub closing: f64,
    /// Static head on top, m.
    pub head_m: f64,
    /// Temperature of the water on top, K.
    pub warmer_k: f64,
    /// Length of the pipe, as a multiple; the end is lengthened.
    pub length: f64,
    /// Place of one more pressure sensor, as a share of the length.
    pub sensor: Option<f64>,
    /// What the first answer blames is put right.
    pub remedied: bool,
}

const SAME: Change =
    Change { velocity: 1.0, closing: 1.0, head_m: 0.0, warmer_k: 0.0, length: 1.0, sensor: None, remedied: false };

/// What can be done on any rig, the first run repeated among it.
pub(crate) fn changes() -> Vec<Change> {
    let velocities = [0.25, 0.5, 1.5, 2.0].map(|velocity| Change { velocity, ..SAME });
    let closings = [0.25, 4.0].map(|closing| Change { closing, ..SAME });
    let heads = [-10.0, 20.0].map(|head_m| Change { head_m, ..SAME });
    let sensors = (1..10).map(|i| Change { sensor: Some(0.1 * f64::from(i)), ..SAME });
    let once = [SAME, Change { length: 1.5, ..SAME }, Change { warmer_k: 20.0, ..SAME }];
    velocities.into_iter().chain(closings).chain(heads).chain(sensors).chain(once).collect()
}

/// The first answer's cause put right: what it blames is gone in the next record, or it is not.
pub(crate) const REMEDY: Change = Change { remedied: true, ..SAME };

impl Change {
    /// The run under this change.
    pub fn of(&self, run: &RunValues) -> RunValues {
        RunValues {
            initial_velocity_m_s: run.initial_velocity_m_s * self.velocity,
            closing_time_s: run.closing_time_s * self.closing,
            valve_head_m: run.valve_head_m + self.head_m,
            friction_scale: run.friction_scale,
        }
    }

    /// Whether one of the `runs` was made so already; the first is what the change starts from.
    pub(crate) fn is_made(&self, runs: &[RunValues], places_m: &[f64], length_m: f64) -> bool {
        if let Some(share) = self.sensor {
            return places_m.iter().any(|place_m| (place_m - share * length_m).abs() < SAME_PLACE * length_m);
        }
        let Some(first) = runs.first().filter(|first| self.of(first) != **first) else { return false };
        runs.iter().any(|run| alike(run, &self.of(first), first))
    }

    /// Whether a lab can make it: the head stays above zero.
    pub(crate) fn is_possible(&self, run: &RunValues) -> bool {
        run.valve_head_m + self.head_m > 5.0
    }

    /// The instruction for the lab. `remedy` is what puts the first answer's cause right.
    pub fn instruction(&self, first: &RunValues, rig: &Rig, remedy: &str) -> String {
        let (run, length_m) = (self.of(first), rig.length_m());
        if self.remedied {
            return remedy.to_owned();
        }
        if let Some(share) = self.sensor {
            return format!("add a pressure sensor at {}", rig.place_words(rig.at_way_m(share * length_m)));
        }
        if self.length != 1.0 {
            return format!("lengthen the pipe before the valve by {:.1} m", (self.length - 1.0) * length_m);
        }
        if self.warmer_k != 0.0 {
            return format!("repeat the test with water {:.0} K warmer", self.warmer_k);
        }
        if self.closing != 1.0 {
            let how = if self.closing > 1.0 { "more slowly" } else { "faster" };
            return format!("close the valve {how}, in {:.3} s", run.closing_time_s);
        }
        if self.head_m != 0.0 {
            let how = if self.head_m > 0.0 { "raise" } else { "lower" };
            return format!(
                "{how} the static head by {:.0} m, to {:.1} m before the valve",
                self.head_m.abs(),
                run.valve_head_m
            );
        }
        if self.velocity != 1.0 {
            return format!("repeat the test at {:.3} m/s", run.initial_velocity_m_s);
        }
        "repeat the test as it was".to_owned()
    }

    /// The rig and its water under this change.
    pub(crate) fn stage(&self, rig: &Rig, first: &RunData) -> Stage {
        let (mut rig, mut run) = (rig.clone(), first.clone());
        let length_m = rig.length_m();
        if self.length != 1.0 {
            let at_valve = |s: &crate::rig::Sensor| length_m - rig.on_way_m(s.place()) < VALVE_SENSOR_SHARE * length_m;
            let moved: Vec<bool> = run.sensors.iter().map(|s| at_valve(&s.sensor)).collect();
            let last = rig.graph.lines[rig.graph.line_to_valve()].pipes.end - 1;
            rig.pipes[last].length_m += (self.length - 1.0) * length_m;
            // what stands at the valve goes with it
            let valve = rig.valve_place();
            for (sensor, _) in run.sensors.iter_mut().zip(moved).filter(|(_, moved)| *moved) {
                (sensor.sensor.line, sensor.sensor.position_m) = (valve.line, valve.position_m);
            }
        }
        if let (Some(share), Some(known)) = (self.sensor, run.sensors.first()) {
            let Place { line, position_m } = rig.at_way_m(share * length_m);
            let sensor = crate::rig::Sensor { name: NEW_SENSOR.to_owned(), line, position_m, ..known.sensor.clone() };
            run.sensors.push(SensorData { sensor, ..known.clone() });
            run.extrema.push(Vec::new());
        }
        if self.warmer_k != 0.0 {
            // The wall's creep changes as well, but no model knows how: only the change in the water is compared.
            run.conditions.water = rig.fluid.properties(rig.fluid.temperature_degc + self.warmer_k);
        }
        let water = run.conditions.water;
        Stage { rig, water, run }
    }
}

/// The name of the sensor that would be added.
pub(crate) const NEW_SENSOR: &str = "new sensor";

/// Where a test is made.
pub(crate) struct Stage {
    rig: Rig,
    water: WaterProperties,
    /// Sensors, conditions and sampling.
    pub(crate) run: RunData,
}

impl Stage {
    /// A model on this rig.
    pub(crate) fn model<'a>(&'a self, effects: &[Chosen]) -> Model<'a> {
        Model::new(&self.rig, &self.water, effects)
    }
}

/// Whether a run resembles the one asked for in every value that the test changes in the first run.
fn alike(run: &RunValues, asked: &RunValues, first: &RunValues) -> bool {
    let near = |of: fn(&RunValues) -> f64| of(asked) == of(first) || (of(run) / of(asked)).ln().abs() < SAME_SHARE;
    let head = asked.valve_head_m == first.valve_head_m || (run.valve_head_m - asked.valve_head_m).abs() < SAME_HEAD_M;
    near(|v| v.initial_velocity_m_s) && near(|v| v.closing_time_s) && head
}

#[cfg(test)]
mod tests {
    use super::*;

    const RUN: RunValues =
        RunValues { initial_velocity_m_s: 0.4, valve_head_m: 30.0, closing_time_s: 0.1, friction_scale: 1.0 };

    #[test]
    fn a_test_that_was_made_is_not_asked_for_again() {
        let half = RunValues { initial_velocity_m_s: 0.21, ..RUN };
        let slow = changes().into_iter().find(|c| c.velocity == 0.5).unwrap();
        assert!(slow.is_made(&[RUN, half], &[], 100.0) && !slow.is_made(&[RUN], &[], 100.0));
        assert!(!SAME.is_made(&[RUN], &[], 100.0), "a repetition is always possible");
        let sensor = Change { sensor: Some(0.5), ..SAME };
        assert!(sensor.is_made(&[RUN], &[52.0], 100.0) && !sensor.is_made(&[RUN], &[70.0], 100.0));
    }

    #[test]
    fn an_instruction_has_the_settings_in_figures() {
        let branched = Rig::from_toml(include_str!("../../../../rigs/branched.toml"), "rig.toml").unwrap();
        let mut rig = branched.clone();
        (rig.graph, rig.pipes) = (crate::rig::Graph::in_series(1), vec![rig.pipes.swap_remove(0)]);
        rig.pipes[0].length_m = 80.0;
        let said = |change: Change| change.instruction(&RUN, &rig, "clamp the leak");
        assert_eq!(said(Change { velocity: 0.5, ..SAME }), "repeat the test at 0.200 m/s");
        assert_eq!(said(Change { closing: 4.0, ..SAME }), "close the valve more slowly, in 0.400 s");
        assert_eq!(said(Change { head_m: -10.0, ..SAME }), "lower the static head by 10 m, to 20.0 m before the valve");
        assert_eq!(said(Change { sensor: Some(0.3), ..SAME }), "add a pressure sensor at 24.0 m");
        let sensor = Change { sensor: Some(0.9), ..SAME }.instruction(&RUN, &branched, "");
        assert_eq!(sensor, "add a pressure sensor at 78.0 m along run");
        assert_eq!(said(REMEDY), "clamp the leak");
    }
}
