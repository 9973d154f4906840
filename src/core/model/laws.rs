//! The law of each node of the graph in a simulation.

use std::collections::BTreeMap;

use crate::model::boundary::{ConstantHead, Supply, ValveEnd};
use crate::model::junction::Law;
use crate::model::line_flows::System;
use crate::model::passage::{Passage, Turning};
use crate::rig::NodeKind;

/// What the laws are made from.
pub(crate) struct Laws<'a> {
    pub system: &'a System<'a>,
    /// Each head of the system before the closure, m.
    pub at_m: &'a [f64],
    /// Flow in each of its links, m³/s.
    pub link_m3_s: &'a [f64],
    pub dt_s: f64,
    pub density_kg_m3: f64,
    /// The supply nearest to the valve, and the valves that close by their nodes, with what effects make of them.
    pub supply: Option<Box<dyn Supply>>,
    pub valves: BTreeMap<usize, ValveEnd>,
}

impl Laws<'_> {
    /// The law of a node into which lines bring `inflow_m3_s` before the closure.
    pub(crate) fn of(&mut self, node: usize, inflow_m3_s: f64) -> Law {
        let System { graph, passed, behind, .. } = self.system;
        let head_m = self.at_m[node];
        let behind_m = behind[node].map_or(head_m, |b| self.at_m[b]);
        if let Some(valve) = self.valves.remove(&node) {
            return Law::Passage(Passage::Valve(valve));
        }
        match &graph.nodes[node].kind {
            NodeKind::Junction { outlet, .. } => {
                Law::Open(outlet.as_ref().map(|opening| Passage::Opening(opening.clone(), behind_m)))
            }
            NodeKind::Reservoir { .. } => {
                let own = if node == graph.supply() { self.supply.take() } else { None };
                Law::Supply(own.unwrap_or_else(|| Box::new(ConstantHead(head_m))))
            }
            NodeKind::Tank { area_m2, .. } => Law::Tank { rate_m2_s: 2.0 * area_m2 / self.dt_s, head_m, inflow_m3_s },
            NodeKind::Valve => Law::Open(None),
            NodeKind::Opening(opening) => Law::Passage(Passage::Opening(opening.clone(), behind_m)),
            NodeKind::CheckValve => Law::Passage(Passage::Check),
            NodeKind::Pump(pump) => {
                let link = passed.binary_search(&node).ok().map(|i| graph.lines.len() + i);
                let flow_m3_s = link.map_or(0.0, |k| self.link_m3_s[k].max(0.0));
                Law::Passage(Passage::Pump(Turning::new(pump, self.density_kg_m3, flow_m3_s, behind_m - head_m)))
            }
        }
    }
}
