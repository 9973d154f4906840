//! The places where something may force the water or a reading.

use crate::diagnose::rest::cells::Run;
use crate::rig::Rig;

/// Places of a line at which a flow out is tried, evenly spaced over its length, and the shape modes of a strain of the wall.
const PLACES: usize = 20;
/// Own modes of a line in which its wall strains: the first three, which hold 98% of the energy of a wave between a tank and a closed valve
/// (`Σ 1/(2m+1)²` of `π²/8`).
pub(crate) const MODES: usize = 3;

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

/// Distance between the places that are tried on a line, m.
pub(crate) fn spacing_m(rig: &Rig, pipe: Option<&str>) -> f64 {
    let own = pipe.and_then(|name| rig.pipes.iter().position(|p| p.name == name));
    let line = own.and_then(|i| rig.graph.lines.iter().position(|line| line.pipes.contains(&i)));
    rig.line_length_m(line.unwrap_or_else(|| rig.graph.line_to_valve())) / PLACES as f64
}
