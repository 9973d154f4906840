//! The flow in every line before the closure, from the pipes alone: it decides each pipe's law of friction before there is a grid.

use crate::model::error::ModelError;
use crate::model::friction::WallFriction;
use crate::model::network::Network;
use crate::rig::{Graph, NodeKind, Pipe, Regime, Rig, WaterProperties};

/// Reynolds numbers between which a flow goes over from one law to the other: with a jump, a loop might have no solution.
const TRANSITION: std::ops::Range<f64> = 2000.0..4000.0;
/// Velocity from which the iteration starts, m/s.
const USUAL_M_S: f64 = 0.3;

/// Head at each node that holds one, as the rig file has it, m.
pub(crate) fn held_m(graph: &Graph) -> Vec<Option<f64>> {
    let of = |kind: &NodeKind| match kind {
        NodeKind::Reservoir { head_m } => Some(head_m.unwrap_or(0.0)),
        _ => None,
    };
    graph.nodes.iter().map(|node| of(&node.kind)).collect()
}

/// Flow drawn from each node while the valve passes `valve_m3_s`, m³/s.
pub(crate) fn drawn_m3_s(graph: &Graph, valve_m3_s: f64) -> Vec<f64> {
    let of = |kind: &NodeKind| match kind {
        NodeKind::Valve => valve_m3_s,
        NodeKind::Junction { demand_m3_s } => *demand_m3_s,
        NodeKind::Reservoir { .. } => 0.0,
    };
    graph.nodes.iter().map(|node| of(&node.kind)).collect()
}

/// Flow in every line from its beginning to its end while the valve passes `valve_m3_s`, m³/s.
///
/// # Errors
/// [`ModelError::NoSteadyFlow`].
pub fn line_flows(rig: &Rig, water: &WaterProperties, valve_m3_s: f64, scale: f64) -> Result<Vec<f64>, ModelError> {
    let graph = &rig.graph;
    let links: Vec<(usize, usize)> = graph.lines.iter().map(|line| (line.from, line.to)).collect();
    let usual: Vec<f64> = (0..links.len()).map(|k| USUAL_M_S * rig.pipes_of(k)[0].area_m2()).collect();
    let network = Network {
        links: &links,
        held_m: &held_m(graph),
        drawn_m3_s: &drawn_m3_s(graph, valve_m3_s),
        taken_m3_s: &vec![0.0; links.len()],
        usual_m3_s: &usual,
    };
    network.flows(|k, q| {
        let loss = |q: f64| rig.pipes_of(k).iter().map(|p| loss_m(p, water, q)).sum::<f64>() * scale;
        let (here, step) = (loss(q), 1e-6 * q.abs().max(1e-6 * usual[k]));
        (here, (loss(q + step) - here) / step)
    })
}

/// Head that friction takes from the supply to the valve while the valve passes `valve_m3_s`, m.
///
/// # Errors
/// [`ModelError::NoSteadyFlow`].
pub fn way_loss_m(rig: &Rig, water: &WaterProperties, valve_m3_s: f64) -> Result<f64, ModelError> {
    let flows = line_flows(rig, water, valve_m3_s, 1.0)?;
    let losses = rig.graph.way.iter().flat_map(|&(line, backwards)| {
        let q = flows[line];
        let of = move |p: &Pipe| WallFriction::of(p, water, q).slope(p.inner_diameter_m, q) * p.length_m;
        rig.pipes_of(line).iter().map(move |p| if backwards { -of(p) } else { of(p) })
    });
    Ok(losses.sum())
}

/// What a pipe takes of a flow, m.
fn loss_m(pipe: &Pipe, water: &WaterProperties, flow_m3_s: f64) -> f64 {
    let of = |regime| {
        WallFriction::in_regime(pipe, water, flow_m3_s, regime).slope(pipe.inner_diameter_m, flow_m3_s) * pipe.length_m
    };
    let past = (pipe.reynolds(water, flow_m3_s).abs() - TRANSITION.start) / (TRANSITION.end - TRANSITION.start);
    match past.clamp(0.0, 1.0) {
        0.0 => of(Regime::Laminar),
        1.0 => of(Regime::Turbulent),
        part => (1.0 - part) * of(Regime::Laminar) + part * of(Regime::Turbulent),
    }
}
