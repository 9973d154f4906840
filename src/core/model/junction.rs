//! A node of the graph: the ends of lines that meet there, and the law by which water leaves it or passes it.
//!
//! Each end sends one characteristic, linear in head and flow. Those of several ends at one head `H` make one, `Q = (e - H)/z` into the node,
//! with `1/z = Σ 1/z_i` and `e = z Σ e_i/z_i`.

use crate::model::boundary::{Outlet, Supply};
use crate::model::end::End;
use crate::model::energy::Balance;
use crate::model::node::{Arriving, Node};
use crate::model::passage::Passage;
use crate::model::state::State;

/// What is at a node.
pub enum Law {
    /// Nothing but its elements and what is drawn off.
    Plain,
    /// A given head.
    Supply(Box<dyn Supply>),
    /// An open tank: `A dH/dt = Q`, by the trapezoidal rule.
    Tank {
        /// `2A/dt`, m²/s.
        rate_m2_s: f64,
        /// Its level, m.
        head_m: f64,
        /// What flows into it, m³/s.
        inflow_m3_s: f64,
    },
    /// A valve, a check valve or a pump.
    Passage(Passage),
}

/// See the module.
pub struct Junction {
    /// Segments that end here.
    pub last: Vec<usize>,
    /// Segments that begin here.
    pub first: Vec<usize>,
    /// What is there.
    pub law: Law,
    /// Its index among all nodes that may have elements.
    pub index: usize,
    /// Head before the closure, m: before what is there, and behind it. Where no line ends, the first is that of the water a pump takes.
    pub steady_m: [f64; 2],
    /// What arrives, in the order of the ends.
    pub arrived: Vec<Arriving>,
}

/// The two ends of each segment.
pub(crate) struct Ends<'a> {
    pub(crate) first: Vec<End<'a, false>>,
    pub(crate) last: Vec<End<'a, true>>,
}

impl Junction {
    /// Solves the node at the new time and sends the waves back into its lines. `node` has its elements.
    #[inline]
    pub(crate) fn step(
        &mut self,
        node: &mut Node,
        state: &mut State,
        ends: &Ends,
        (time_s, dt_s): (f64, f64),
        balance: &mut Option<&mut Balance>,
    ) {
        self.arrived.clear();
        self.arrived.extend(self.last.iter().map(|&s| ends.last[s].arriving(state)));
        self.arrived.extend(self.first.iter().map(|&s| ends.first[s].arriving(state)));
        if !self.first.is_empty() && matches!(self.law, Law::Passage(_)) {
            return self.pass(node, state, ends, (time_s, dt_s), balance);
        }
        let reached = together(&self.arrived);
        // Head, flow into the node, and what of it the elements leave.
        let (head_m, inflow_m3_s, out_m3_s) = match &mut self.law {
            Law::Supply(supply) => {
                let head_m = supply.head_m(time_s);
                let flow = (reached.e - head_m) / reached.z;
                (head_m, flow, flow)
            }
            Law::Tank { rate_m2_s, head_m, inflow_m3_s } => {
                let known = *rate_m2_s * *head_m + *inflow_m3_s;
                let next_m = (reached.e + reached.z * known) / (1.0 + reached.z * *rate_m2_s);
                *inflow_m3_s = (reached.e - next_m) / reached.z;
                *head_m = next_m;
                (next_m, *inflow_m3_s, *inflow_m3_s)
            }
            Law::Plain if node.is_plain() => {
                (reached.e - reached.z * node.taken_m3_s, node.taken_m3_s, node.taken_m3_s)
            }
            law => {
                let outlet = if let Law::Passage(valve) = law { valve.at(time_s) } else { Outlet::Flow(0.0) };
                if node.is_plain() {
                    let flow = outlet.flow_m3_s(reached.z, reached.e);
                    (reached.e - reached.z * flow, flow, flow)
                } else {
                    let last_m = self.last.first().map(|&s| ends.last[s].head_m(state));
                    let guess_m = last_m.or(self.first.first().map(|&s| ends.first[s].head_m(state))).unwrap_or(0.0);
                    let solved = node.find(reached, |h| outlet.flow_at_m3_s(h), guess_m);
                    if let Some(balance) = balance {
                        balance.node(self.index, node, &solved, [self.steady_m[0]; 2]);
                    }
                    node.advance(&solved);
                    (solved.left_head_m, solved.left_flow_m3_s, solved.right_flow_m3_s + node.taken_m3_s)
                }
            }
        };
        let alone = self.arrived.len() == 1;
        let (last, first) = self.arrived.split_at(self.last.len());
        for (&s, arrived) in self.last.iter().zip(last) {
            ends.last[s].leave(state, head_m, if alone { inflow_m3_s } else { arrived.inflow_m3_s(head_m) });
        }
        for (&s, arrived) in self.first.iter().zip(first) {
            ends.first[s].leave(state, head_m, -if alone { inflow_m3_s } else { arrived.inflow_m3_s(head_m) });
        }
        if let Some(balance) = balance {
            let into_supply = matches!(self.law, Law::Supply(_) | Law::Tank { .. });
            balance.leaves(into_supply, head_m - self.steady_m[0], out_m3_s);
        }
    }

    /// The same where water passes from the lines that end here into those that begin here.
    fn pass(
        &mut self,
        node: &mut Node,
        state: &mut State,
        ends: &Ends,
        (time_s, dt_s): (f64, f64),
        balance: &mut Option<&mut Balance>,
    ) {
        let Law::Passage(law) = &mut self.law else { return };
        let (last, first) = self.arrived.split_at(self.last.len());
        let left = if last.is_empty() { Arriving { z: 0.0, e: self.steady_m[0] } } else { together(last) };
        let right = together(first);
        let (left_m, left_m3_s, flow) = if node.is_plain() {
            let flow = match law.at(time_s) {
                // A given head drives what ends here.
                given @ Outlet::Head(_) => given.flow_m3_s(left.z, left.e),
                _ => law.through(time_s, left.e - right.e, left.z + right.z).0,
            };
            (left.e - left.z * flow, flow, flow)
        } else {
            let guess_m = self.last.first().map_or(self.steady_m[0], |&s| ends.last[s].head_m(state));
            let solved = node.find(left, |h| law.through(time_s, h - right.e, right.z), guess_m);
            if let Some(balance) = balance {
                balance.node(self.index, node, &solved, [self.steady_m[0]; 2]);
            }
            node.advance(&solved);
            (solved.left_head_m, solved.left_flow_m3_s, solved.right_flow_m3_s)
        };
        let right_m = right.e + right.z * flow;
        law.advance(time_s, dt_s, flow, right_m - left_m);
        for (&s, arrived) in self.last.iter().zip(last) {
            let own = if last.len() == 1 { left_m3_s } else { arrived.inflow_m3_s(left_m) };
            ends.last[s].leave(state, left_m, own);
        }
        for (&s, arrived) in self.first.iter().zip(first) {
            let own = if first.len() == 1 { flow } else { -arrived.inflow_m3_s(right_m) };
            ends.first[s].leave(state, right_m, own);
        }
        if let Some(balance) = balance {
            balance.leaves(false, left_m - self.steady_m[0], flow);
            balance.leaves(false, right_m - self.steady_m[1], -flow);
        }
    }
}

/// Characteristics at one head as one.
#[inline]
fn together(all: &[Arriving]) -> Arriving {
    if let [one] = all {
        return *one;
    }
    let (by_z, e_by_z) = all.iter().fold((0.0, 0.0), |(y, h), a| (y + 1.0 / a.z, h + a.e / a.z));
    Arriving { z: 1.0 / by_z, e: e_by_z / by_z }
}
