//! The steady state before the closure.

use crate::model::error::ModelError;
use crate::model::friction::ReachFriction;
use crate::model::grid::Grid;
use crate::model::network::Network;
use crate::model::node::{Node, Spread};
use crate::rig::Graph;

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

/// The lines on their grid, with what is given of the steady state.
pub(crate) struct Given<'a> {
    pub grid: &'a Grid,
    pub graph: &'a Graph,
    pub frictions: &'a [ReachFriction],
    /// Head at each node of the graph that holds one, up to a common constant, m.
    pub held_m: &'a [Option<f64>],
    /// Flow drawn from each node of the graph, m³/s.
    pub drawn_m3_s: &'a [f64],
    /// Flow in each line without elements, m³/s.
    pub line_m3_s: &'a [f64],
    /// Head before the valve, m.
    pub valve_head_m: f64,
}

/// Steady heads and flows.
pub(crate) struct Found {
    /// Head at every node of the grid, m.
    pub head_m: Vec<f64>,
    /// Flow in each segment, m³/s.
    pub flow_m3_s: Vec<f64>,
    /// Head at each node of the graph, m.
    pub at_node_m: Vec<f64>,
}

impl Given<'_> {
    /// The steady state; also settles the elements of the nodes.
    ///
    /// # Errors
    /// If the flows of a network are not found.
    pub(crate) fn settle(&self, nodes: &mut [Node], spread: &mut [Spread]) -> Result<Found, ModelError> {
        let mut found = self.pass(nodes)?;
        let whole_m3_s: f64 = self.drawn_m3_s.iter().map(|q| q.abs()).sum();
        for _ in 0..MOST_PASSES {
            let mut moved: f64 = 0.0;
            for one in spread.iter_mut() {
                let head_m = one.at.iter().map(|&(s, w)| w * found.head_m[self.grid.segments[s + 1].offset]).sum();
                let before = one.flow_m3_s;
                let by = one.settle(head_m) - before;
                one.at.iter().for_each(|&(s, w)| nodes[s].taken_m3_s += w * by);
                moved = moved.max(by.abs());
            }
            if moved <= 1e-15 * whole_m3_s {
                break;
            }
            found = self.pass(nodes)?;
        }
        Ok(found)
    }

    /// Flows, then heads from the valve on.
    fn pass(&self, nodes: &mut [Node]) -> Result<Found, ModelError> {
        let (grid, graph) = (self.grid, self.graph);
        let links: Vec<(usize, usize)> = graph.lines.iter().map(|line| (line.from, line.to)).collect();
        let joints = |line: usize| grid.lines[line].start..grid.lines[line].end - 1;
        let taken: Vec<f64> = (0..links.len()).map(|k| joints(k).rev().map(|s| nodes[s].taken_m3_s).sum()).collect();
        let network = Network {
            links: &links,
            held_m: self.held_m,
            drawn_m3_s: self.drawn_m3_s,
            taken_m3_s: &taken,
            usual_m3_s: self.line_m3_s,
        };
        let flows = network.flows(|k, q| self.loss(k, q, nodes))?;
        let mut found = Found {
            head_m: vec![self.valve_head_m; grid.nodes()],
            flow_m3_s: vec![0.0; grid.segments.len()],
            at_node_m: vec![f64::NAN; graph.nodes.len()],
        };
        found.at_node_m[graph.valve] = self.valve_head_m;
        for (k, from_end) in graph.from_valve() {
            let line = &graph.lines[k];
            let end_m = if from_end {
                found.at_node_m[line.to]
            } else {
                found.at_node_m[line.from] - self.loss(k, flows[k], nodes).0
            };
            let start_m = self.line(k, end_m, flows[k], nodes, &mut found);
            for (node, head_m) in [(line.to, end_m), (line.from, start_m)] {
                if found.at_node_m[node].is_nan() {
                    found.at_node_m[node] = head_m;
                }
            }
        }
        let elements = &mut nodes[grid.segments.len()..];
        elements.iter_mut().zip(&found.at_node_m).for_each(|(node, &head_m)| _ = node.settle(head_m, 0.0));
        Ok(found)
    }

    /// Heads and flows of a line from its end back to its beginning; returns the head there.
    fn line(&self, k: usize, end_m: f64, end_m3_s: f64, nodes: &mut [Node], found: &mut Found) -> f64 {
        let (mut head, mut flow) = (end_m, end_m3_s);
        let own = self.grid.lines[k].clone();
        for s in own.clone().rev() {
            let segment = &self.grid.segments[s];
            if s + 1 < own.end {
                (head, flow) = nodes[s].settle(head, flow);
            }
            found.flow_m3_s[s] = flow;
            let loss = 2.0 * self.frictions[s].half_loss_and_slope(segment.impedance * flow).0;
            for node in segment.nodes().rev() {
                found.head_m[node] = head;
                head += loss;
            }
            head -= loss;
        }
        head
    }

    /// Head that a line takes of a flow at its end, m, and its slope.
    fn loss(&self, k: usize, end_m3_s: f64, nodes: &[Node]) -> (f64, f64) {
        let own = self.grid.lines[k].clone();
        let (mut flow, mut total) = (end_m3_s, (0.0, 0.0));
        for s in own.clone().rev() {
            let segment = &self.grid.segments[s];
            if s + 1 < own.end {
                flow += nodes[s].taken_m3_s;
                let (drop_m, slope) = nodes[s].steady_drop_m(flow);
                total = (total.0 + drop_m, total.1 + slope);
            }
            let (half_m, by_u) = self.frictions[s].half_loss_and_slope(segment.impedance * flow);
            let twice = 2.0 * segment.reaches as f64;
            total = (total.0 + twice * half_m, total.1 + twice * by_u * segment.impedance);
        }
        total
    }
}
