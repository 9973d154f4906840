//! A node of the graph: the ends of lines that meet there, and the law by which water leaves it.
//!
//! Each end sends one characteristic, linear in head and flow. Those of several ends at one head `H` make one, `Q = (e - H)/z` into the node,
//! with `1/z = Σ 1/z_i` and `e = z Σ e_i/z_i`.

use crate::model::boundary::{Outlet, Supply, ValveEnd};
use crate::model::end::End;
use crate::model::energy::Balance;
use crate::model::node::{Arriving, Node};
use crate::model::state::State;

/// What is at a node.
pub enum Law {
    /// Nothing but its elements and what is drawn off.
    Plain,
    /// A given head.
    Supply(Box<dyn Supply>),
    /// The valve that closes.
    Valve(ValveEnd),
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
    /// Head before the closure, m.
    pub steady_head_m: f64,
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
        time_s: f64,
        balance: &mut Option<&mut Balance>,
    ) {
        self.arrived.clear();
        self.arrived.extend(self.last.iter().map(|&s| ends.last[s].arriving(state)));
        self.arrived.extend(self.first.iter().map(|&s| ends.first[s].arriving(state)));
        let reached = together(&self.arrived);
        // Head, flow into the node, and what of it the elements leave.
        let (head_m, inflow_m3_s, out_m3_s) = match &mut self.law {
            Law::Supply(supply) => {
                let head_m = supply.head_m(time_s);
                let flow = (reached.e - head_m) / reached.z;
                (head_m, flow, flow)
            }
            Law::Plain if node.is_plain() => {
                (reached.e - reached.z * node.taken_m3_s, node.taken_m3_s, node.taken_m3_s)
            }
            law => {
                let outlet = if let Law::Valve(valve) = law { valve.at(time_s) } else { Outlet::Flow(0.0) };
                if node.is_plain() {
                    let flow = outlet.flow_m3_s(reached.z, reached.e);
                    (reached.e - reached.z * flow, flow, flow)
                } else {
                    let last_m = self.last.first().map(|&s| ends.last[s].head_m(state));
                    let guess_m = last_m.or(self.first.first().map(|&s| ends.first[s].head_m(state))).unwrap_or(0.0);
                    let solved = node.find(reached, |h| outlet.flow_at_m3_s(h), guess_m);
                    if let Some(balance) = balance {
                        balance.node(self.index, node, &solved, [self.steady_head_m; 2]);
                    }
                    node.advance(&solved);
                    (solved.left_head_m, solved.left_flow_m3_s, solved.right_flow_m3_s + node.taken_m3_s)
                }
            }
        };
        let own = |arrived: &Arriving| (arrived.e - head_m) / arrived.z;
        let (last, first) = self.arrived.split_at(self.last.len());
        for (&s, arrived) in self.last.iter().zip(last) {
            let flow = if self.arrived.len() == 1 { inflow_m3_s } else { own(arrived) };
            ends.last[s].leave(state, head_m, flow);
        }
        for (&s, arrived) in self.first.iter().zip(first) {
            let flow = if self.arrived.len() == 1 { -inflow_m3_s } else { -own(arrived) };
            ends.first[s].leave(state, head_m, flow);
        }
        if let Some(balance) = balance {
            balance.leaves(matches!(self.law, Law::Supply(_)), head_m - self.steady_head_m, out_m3_s);
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
