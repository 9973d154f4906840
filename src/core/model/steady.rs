//! The steady state before the closure.

use crate::model::friction::ReachFriction;
use crate::model::grid::Grid;
use crate::model::node::{Node, Spread};

/// The steady state before the closure.
pub struct Steady<'a> {
    /// The grid.
    pub grid: &'a Grid,
    /// Friction of each segment's reach.
    pub frictions: &'a [ReachFriction],
    /// Head at every node, m.
    pub head_m: Vec<f64>,
    /// Flow in each segment, m³/s.
    pub flow_m3_s: Vec<f64>,
    /// Density of the water, kg/m³.
    pub density_kg_m3: f64,
    /// Kinematic viscosity of the water, m²/s.
    pub viscosity_m2_s: f64,
}

/// Most passes until elements that are spread over several nodes agree with the heads that their flows lead to. A pass gains digits.
const MOST_PASSES: usize = 50;

/// Steady heads and flows; also settles the elements of the nodes.
pub fn settle(
    grid: &Grid,
    frictions: &[ReachFriction],
    joints: &mut [Node],
    spread: &mut [Spread],
    at_valve: &mut Node,
    valve_flow_m3_s: f64,
    valve_head_m: f64,
) -> (Vec<f64>, Vec<f64>) {
    let mut found = pass(grid, frictions, joints, at_valve, valve_flow_m3_s, valve_head_m);
    for _ in 0..MOST_PASSES {
        let mut moved: f64 = 0.0;
        for one in spread.iter_mut() {
            let head_m = one.at.iter().map(|&(s, w)| w * found.0[grid.segments[s + 1].offset]).sum();
            let before = one.flow_m3_s;
            let by = one.settle(head_m) - before;
            one.at.iter().for_each(|&(s, w)| joints[s].taken_m3_s += w * by);
            moved = moved.max(by.abs());
        }
        if moved <= 1e-15 * valve_flow_m3_s.abs() {
            break;
        }
        found = pass(grid, frictions, joints, at_valve, valve_flow_m3_s, valve_head_m);
    }
    found
}

/// From the valve back to the supply.
fn pass(
    grid: &Grid,
    frictions: &[ReachFriction],
    joints: &mut [Node],
    at_valve: &mut Node,
    valve_flow_m3_s: f64,
    valve_head_m: f64,
) -> (Vec<f64>, Vec<f64>) {
    let mut heads = vec![valve_head_m; grid.nodes()];
    let mut flows = vec![0.0; grid.segments.len()];
    let (mut head, mut flow) = at_valve.settle(valve_head_m, valve_flow_m3_s);
    for (s, (segment, friction)) in grid.segments.iter().zip(frictions).enumerate().rev() {
        if s + 1 < grid.segments.len() {
            (head, flow) = joints[s].settle(head, flow);
        }
        flows[s] = flow;
        let loss = 2.0 * friction.half_loss_and_slope(segment.impedance * flow).0;
        for node in segment.nodes().rev() {
            heads[node] = head;
            head += loss;
        }
        head -= loss;
    }
    (heads, flows)
}
