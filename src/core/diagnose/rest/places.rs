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
    /// Whether two places are of one kind: the same, or on one pipe.
    pub(crate) fn is_alike(&self, other: &Spot) -> bool {
        match (self, other) {
            (Spot::Pipe(a, _), Spot::Pipe(b, _)) => a == b,
            (a, b) => a == b,
        }
    }

    /// Distance from the middle of its pipe, m; none of a place that is not on one.
    pub(crate) fn off_middle_m(&self, rig: &Rig) -> f64 {
        self.position_m().map_or(0.0, |at| (at - 0.5 * rig.line_length_m(self.line(rig))).abs())
    }

    /// Its kind in words that are the same in all runs.
    pub(crate) fn name(&self, run: &Run) -> String {
        match self {
            Spot::Sensor(s) => format!("sensor@{}", run.data().sensors[*s].sensor.name),
            Spot::Pipe(pipe, _) => format!("pipe@{}", pipe.as_deref().unwrap_or_default()),
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

    /// Places along its pipe at some distances, m, as far as they are on it; itself where it is not on a pipe.
    pub(crate) fn moved(&self, rig: &Rig, by_m: &[f64]) -> Vec<Spot> {
        let Spot::Pipe(pipe, position_m) = self else { return vec![self.clone()] };
        let length_m = rig.line_length_m(self.line(rig));
        let inside = by_m.iter().map(|by| position_m + by).filter(|at| (0.01..0.99).contains(&(at / length_m)));
        inside.map(|at| Spot::Pipe(pipe.clone(), at)).collect()
    }
}
