//! The places where something may force the water or a reading.

use crate::diagnose::rest::cells::Run;
use crate::rig::Rig;

/// Places of a line at which a flow out is tried, evenly spaced over its length, and the shape modes of a strain of the
/// wall.
const PLACES: usize = 20;
/// Own modes of a line in which its wall strains: the first two, which hold 90% of the energy of a wave between a tank
/// and a closed valve (`Σ 1/(2m+1)²` of `π²/8`).
pub(crate) const MODES: usize = 2;

/// One place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Spot {
    /// The supply's head, m.
    Supply,
    /// Flow out before the valve, m³/s.
    Valve,
    /// Flow out of a pipe, m³/s; in a network with the first pipe of its line.
    Pipe(Option<String>, f64),
    /// Head added to what a sensor of the run shows, m.
    Sensor(usize),
    /// Strain of the wall.
    Wall,
}

/// Every place of a run's rig.
pub(crate) fn places(rig: &Rig, run: &Run) -> Vec<Spot> {
    let graph = &rig.graph;
    let mut all = vec![Spot::Valve, Spot::Wall];
    if graph.nodes[graph.supply()].kind.holds_given_head() {
        all.push(Spot::Supply);
    }
    all.extend((0..run.data().sensors.len()).map(Spot::Sensor));
    for (l, line) in graph.lines.iter().enumerate() {
        let length_m = rig.line_length_m(l);
        let pipe = (graph.lines.len() > 1).then(|| rig.pipes[line.pipes.start].name.clone());
        all.extend((1..PLACES).map(|i| Spot::Pipe(pipe.clone(), length_m * i as f64 / PLACES as f64)));
    }
    all
}

impl Spot {
    /// Whether two places are of one kind: the same, or on one pipe, either both before all sensors or neither.
    pub(crate) fn is_alike(&self, other: &Spot, run: &Run) -> bool {
        match (self, other) {
            (Spot::Pipe(a, _), Spot::Pipe(b, _)) => {
                a == b && self.before_sensors_m(run).is_some() == other.before_sensors_m(run).is_some()
            }
            (a, b) => a == b,
        }
    }

    /// Position of the first sensor, m, where the place lies on the pipe between the supply and it: what leaves there
    /// sends on the same waves as the supply could.
    pub(crate) fn before_sensors_m(&self, run: &Run) -> Option<f64> {
        let rig = run.problem.model.rig;
        let graph = &rig.graph;
        let alone = graph.lines.len() == 1 && graph.nodes[graph.supply()].kind.holds_given_head();
        let first_m = run.data().sensors.iter().map(|s| s.sensor.position_m).fold(f64::INFINITY, f64::min);
        // A place next to the sensor may be on either side of it.
        let is_before = self.position_m().is_some_and(|at| at < first_m + self.spacing_m(rig));
        (alone && is_before).then_some(first_m)
    }

    /// Distance from the middle of its pipe, m; none of a place that is not on one.
    pub(crate) fn off_middle_m(&self, rig: &Rig) -> f64 {
        self.position_m().map_or(0.0, |at| (at - 0.5 * rig.line_length_m(self.line(rig))).abs())
    }

    /// Its kind in words that are the same in all runs.
    pub(crate) fn name(&self, run: &Run) -> String {
        match self {
            Spot::Sensor(s) => format!("sensor@{}", run.data().sensors[*s].sensor.name),
            Spot::Pipe(pipe, _) => {
                let side = if self.before_sensors_m(run).is_some() { "before" } else { "pipe" };
                format!("{side}@{}", pipe.as_deref().unwrap_or_default())
            }
            Spot::Supply | Spot::Valve | Spot::Wall => format!("{self:?}"),
        }
    }

    /// Position along a pipe, m.
    pub(crate) fn position_m(&self) -> Option<f64> {
        if let Spot::Pipe(_, position_m) = self { Some(*position_m) } else { None }
    }

    /// Distance between the places that are tried on its line, m.
    pub(crate) fn spacing_m(&self, rig: &Rig) -> f64 {
        rig.line_length_m(self.line(rig)) / PLACES as f64
    }

    /// The line that it is on.
    pub(crate) fn line(&self, rig: &Rig) -> usize {
        let Spot::Pipe(Some(pipe), _) = self else { return rig.graph.line_to_valve() };
        let own = rig.pipes.iter().position(|p| p.name == *pipe);
        let line = own.and_then(|i| rig.graph.lines.iter().position(|line| line.pipes.contains(&i)));
        line.unwrap_or_else(|| rig.graph.line_to_valve())
    }

    /// Places of its kind at some distances along its pipe, m; itself where it is not on a pipe.
    pub(crate) fn moved(&self, run: &Run, by_m: &[f64]) -> Vec<Spot> {
        let Spot::Pipe(pipe, position_m) = self else { return vec![self.clone()] };
        let rig = run.problem.model.rig;
        let length_m = rig.line_length_m(self.line(rig));
        let inside = by_m.iter().map(|by| position_m + by).filter(|at| (0.01..0.99).contains(&(at / length_m)));
        inside.map(|at| Spot::Pipe(pipe.clone(), at)).filter(|near| near.is_alike(self, run)).collect()
    }
}
