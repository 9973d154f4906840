//! The steady state before the closure.

use std::collections::VecDeque;

use crate::model::error::ModelError;
use crate::model::friction::ReachFriction;
use crate::model::grid::Grid;
use crate::model::line_flows::System;
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

/// Most passes until elements that are spread over several nodes agree with the heads that their flows lead to. A pass
/// gains digits.
const MOST_PASSES: usize = 50;

/// A flow below this does not pass a check valve, m³/s: rounding.
const SHUT_M3_S: f64 = 1e-9;

/// The lines on their grid, with what is given of the steady state.
pub(crate) struct Given<'a> {
    pub grid: &'a Grid,
    pub system: &'a System<'a>,
    pub frictions: &'a [ReachFriction],
    /// Head before the valve, m.
    pub valve_head_m: f64,
    /// Flow in each link from the pipes alone, m³/s.
    pub start_m3_s: &'a [f64],
}

/// Steady heads and flows.
pub(crate) struct Found {
    /// Head at every node of the grid, m.
    pub head_m: Vec<f64>,
    /// Flow in each segment, m³/s.
    pub flow_m3_s: Vec<f64>,
    /// Each head of the system, m.
    pub at_m: Vec<f64>,
    /// The same behind what its node takes of the flow into it, m.
    pub behind_m: Vec<f64>,
    /// Flow in each of its links, m³/s.
    pub link_m3_s: Vec<f64>,
}

impl Given<'_> {
    /// The steady state; also settles the elements of the nodes.
    ///
    /// # Errors
    /// If the flows of a network are not found.
    pub(crate) fn settle(&self, nodes: &mut [Node], spread: &mut [Spread]) -> Result<Found, ModelError> {
        let mut found = self.pass(nodes)?;
        let whole_m3_s: f64 = self.system.drawn_m3_s.iter().map(|q| q.abs()).sum();
        // A loss of any law may read the head behind it, which the flows of a network give only once they are found.
        let has_laws = self.grid.lines.len() > 1 && nodes.iter().any(|node| !node.laws.is_empty());
        let mut are_flows_open = has_laws;
        for _ in 0..MOST_PASSES {
            let mut moved: f64 = 0.0;
            for one in spread.iter_mut() {
                let head_m = one.at.iter().map(|&(s, w)| w * found.head_m[self.grid.segments[s + 1].offset]).sum();
                let passing_m3_s = one.at.last().map_or(0.0, |(s, _)| found.flow_m3_s[s + 1]);
                let before = one.flow_m3_s;
                let by = one.settle(head_m, passing_m3_s) - before;
                one.at.iter().for_each(|&(s, w)| nodes[s].taken_m3_s += w * by);
                moved = moved.max(by.abs());
            }
            if moved <= 1e-15 * whole_m3_s && !are_flows_open {
                break;
            }
            let next = self.pass(nodes)?;
            let change = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-12 * whole_m3_s;
            are_flows_open = has_laws && next.link_m3_s.iter().zip(&found.link_m3_s).any(change);
            found = next;
        }
        Ok(found)
    }

    /// Flows, then heads.
    fn pass(&self, nodes: &mut [Node]) -> Result<Found, ModelError> {
        let (grid, system) = (self.grid, self.system);
        let joints = |line: usize| grid.lines[line].start..grid.lines[line].end - 1;
        let mut taken: Vec<f64> =
            (0..grid.lines.len()).map(|k| joints(k).rev().map(|s| nodes[s].taken_m3_s).sum()).collect();
        taken.resize(system.network.links.len(), 0.0);
        let mut found = Found {
            head_m: vec![self.valve_head_m; grid.nodes()],
            flow_m3_s: vec![0.0; grid.segments.len()],
            at_m: vec![f64::NAN; system.network.held_m.len()],
            behind_m: Vec::new(),
            link_m3_s: system.flows(&taken, self.start_m3_s, |k, q| self.loss(k, q, nodes))?,
        };
        self.heads(nodes, &mut found);
        let mut inflow_m3_s = vec![0.0; found.at_m.len()];
        for (own, line) in grid.lines.iter().zip(&system.graph.lines) {
            inflow_m3_s[line.from] -= found.flow_m3_s[own.start];
            inflow_m3_s[line.to] += found.flow_m3_s[own.end - 1];
        }
        found.behind_m.clone_from(&found.at_m);
        let elements = nodes[grid.segments.len()..].iter_mut().zip(&mut found.behind_m).zip(&inflow_m3_s);
        for ((node, head_m), &inflow) in elements.filter(|((_, head_m), _)| head_m.is_finite()) {
            *head_m -= node.settle(*head_m, inflow).0 - *head_m;
        }
        Ok(found)
    }

    /// Heads from the valve on. What it does not reach, because nothing flows between, has the level of a supply of its
    /// own, on the datum that the valve's head gives the others.
    fn heads(&self, nodes: &mut [Node], found: &mut Found) {
        let system = self.system;
        let lines = self.grid.lines.len();
        let mut near = vec![Vec::new(); system.network.held_m.len()];
        for (k, &(a, b)) in system.network.links.iter().enumerate() {
            near[a].push(k);
            near[b].push(k);
        }
        let mut done = vec![false; system.network.links.len()];
        let mut datum_m = None;
        let valve = system.graph.valve;
        let mut open = VecDeque::from([(valve, self.valve_head_m)]);
        loop {
            while let Some((at, head_m)) = open.pop_front() {
                if !found.at_m[at].is_nan() {
                    continue;
                }
                found.at_m[at] = head_m;
                datum_m = datum_m.or(system.network.held_m[at].map(|held_m| head_m - held_m));
                for &k in &near[at] {
                    let ((a, b), q) = (system.network.links[k], found.link_m3_s[k]);
                    if done[k] || (k >= lines && q.abs() < SHUT_M3_S) {
                        continue;
                    }
                    done[k] = true;
                    let loss_m = |this: &Self| if k < lines { this.loss(k, q, nodes).0 } else { system.loss(k, q).0 };
                    let end_m = if at == b { head_m } else { head_m - loss_m(self) };
                    let start_m =
                        if k < lines { self.line(k, end_m, q, nodes, found) } else { end_m + system.loss(k, q).0 };
                    open.extend([(a, start_m), (b, end_m)].into_iter().filter(|(n, _)| found.at_m[*n].is_nan()));
                }
            }
            let unseen = |n: &usize| found.at_m[*n].is_nan();
            let level = |n: usize| Some((n, system.network.held_m[n]? + datum_m.unwrap_or(0.0)));
            // Behind a shut valve without a supply, the head is that before it.
            let shut = || {
                let mut passed = system.network.links[lines..].iter();
                passed.find_map(|&(a, b)| match (found.at_m[a], found.at_m[b]) {
                    (head_m, other) if other.is_nan() && !head_m.is_nan() => Some((b, head_m)),
                    (other, head_m) if other.is_nan() && !head_m.is_nan() => Some((a, head_m)),
                    _ => None,
                })
            };
            match (0..found.at_m.len()).filter(unseen).find_map(level).or_else(shut) {
                Some(next) => open.push_back(next),
                None => break,
            }
        }
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
