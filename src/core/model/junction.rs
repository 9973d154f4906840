//! A node of the graph: the ends of lines that meet there, and the law by which water leaves it or passes it.
//!
//! Each end sends one characteristic, linear in head and flow. Those of several ends at one head `H` make one,
//! `Q = (e - H)/z` into the node, with `1/z = Σ 1/z_i` and `e = z Σ e_i/z_i`. A supply, a valve and a tee are one node
//! each; no other place has code for them.

use crate::model::boundary::{Outlet, Supply};
use crate::model::end::End;
use crate::model::energy::Balance;
use crate::model::node::{Arriving, Node};
use crate::model::passage::Passage;
use crate::model::state::State;
use crate::model::wall::end::WallEnd;

/// What is at a node.
pub enum Law {
    /// Pipes meet; water may leave by an opening.
    Open(Option<Passage>),
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

impl Law {
    /// Whether water passes from the lines that end there to those that begin there.
    pub(crate) fn passes(&self) -> bool {
        matches!(self, Law::Passage(_))
    }

    /// What the node is at a time, for lines that share its head.
    #[inline(always)]
    fn at(&mut self, time_s: f64) -> Outlet {
        match self {
            Law::Open(None) => Outlet::Flow(0.0),
            Law::Open(Some(opening)) => opening.at(time_s),
            Law::Supply(supply) => Outlet::Head(supply.head_m(time_s)),
            Law::Tank { rate_m2_s, head_m, inflow_m3_s } => {
                Outlet::Surface { rate_m2_s: *rate_m2_s, known_m3_s: *rate_m2_s * *head_m + *inflow_m3_s }
            }
            Law::Passage(passage) => passage.at(time_s),
        }
    }
}

/// The lines that end at a node (`DOWNSTREAM`), or those that begin there, each with what arrives from it.
pub(crate) struct Side<'a, const DOWNSTREAM: bool>(Vec<(End<'a, DOWNSTREAM>, Arriving)>);

impl<'a, const DOWNSTREAM: bool> Side<'a, DOWNSTREAM> {
    pub(crate) fn new(ends: impl Iterator<Item = End<'a, DOWNSTREAM>>) -> Self {
        Side(ends.map(|end| (end, Arriving::NOTHING)).collect())
    }

    /// What arrives, as one characteristic.
    #[inline(always)]
    fn arriving(&mut self, state: &State) -> Arriving {
        let mut all = Arriving::NOTHING;
        for (end, arrived) in &mut self.0 {
            *arrived = end.arriving(state);
            all = all.and(*arrived);
        }
        all
    }

    /// Sends the waves back for the node's head and what all bring into it together, m³/s.
    #[inline(always)]
    fn leave(&self, state: &mut State, head_m: f64, inflow_m3_s: f64) {
        let sign = End::<DOWNSTREAM>::SIGN;
        if let [(end, _)] = &self.0[..] {
            return end.leave(state, head_m, sign * inflow_m3_s);
        }
        for (end, arrived) in &self.0 {
            end.leave(state, head_m, sign * arrived.inflow_m3_s(head_m));
        }
    }

    /// Head at the last step, m.
    fn head_m(&self, state: &State) -> Option<f64> {
        self.0.first().map(|(end, _)| end.head_m(state))
    }
}

/// Steps a bare node ([`Junction::is_bare`]): its head and what flows out, m and m³/s.
#[inline(always)]
fn step_bare<const DOWNSTREAM: bool>(
    end: &End<DOWNSTREAM>,
    law: &mut Law,
    drawn_m3_s: f64,
    state: &mut State,
    time_s: f64,
) -> (f64, f64) {
    let reached = end.arriving(state);
    let (head_m, flow) = law.at(time_s).solve(reached.z, reached.e - reached.z * drawn_m3_s);
    let flow = flow + drawn_m3_s;
    if let Law::Tank { head_m: level_m, inflow_m3_s, .. } = law {
        (*level_m, *inflow_m3_s) = (head_m, flow);
    }
    end.leave(state, head_m, End::<DOWNSTREAM>::SIGN * flow);
    (head_m, flow)
}

/// See the module.
pub(crate) struct Junction<'a> {
    /// Lines that end here.
    pub(crate) last: Side<'a, true>,
    /// Lines that begin here.
    pub(crate) first: Side<'a, false>,
    /// What is there.
    pub(crate) law: Law,
    /// Its elements, and the constant flow that is drawn off.
    pub(crate) node: Node,
    /// Its index among all nodes that may have elements.
    pub(crate) index: usize,
    /// Head before the closure, m: before what is there, and behind it. Where no line ends, the first is that of the
    /// water a pump takes.
    pub(crate) steady_m: [f64; 2],
    /// It is the end of one line, with nothing but its law. On a short line most of a step is that of such ends.
    pub(crate) is_bare: bool,
}

impl Junction<'_> {
    /// Solves the node at the new time and sends the waves back into its lines.
    #[inline(always)]
    pub(crate) fn step(
        &mut self,
        state: &mut State,
        (time_s, dt_s): (f64, f64),
        mut wall: Option<&mut WallEnd>,
        balance: &mut Option<&mut Balance>,
    ) {
        if self.is_bare {
            let Junction { last, first, law, node, steady_m, .. } = self;
            let (head_m, out_m3_s) = match (&last.0[..], &first.0[..]) {
                ([(end, _)], _) => step_bare(end, law, node.taken_m3_s, state, time_s),
                (_, [(end, _)]) => step_bare(end, law, node.taken_m3_s, state, time_s),
                _ => return,
            };
            if let Some(balance) = balance {
                let into_supply = matches!(law, Law::Supply(_) | Law::Tank { .. });
                balance.leaves(into_supply, head_m - steady_m[usize::from(into_supply)], out_m3_s);
            }
            return;
        }
        let (last, first) = (self.last.arriving(state), self.first.arriving(state));
        if self.law.passes() && first.is_something() {
            return self.pass(state, (last, first), (time_s, dt_s), balance);
        }
        let (node, mut reached, outlet) = (&mut self.node, last.and(first), self.law.at(time_s));
        if let Some(wall) = &mut wall {
            reached = wall.meets(reached);
        }
        // Head, flow into the node, and what of it the elements leave.
        let drawn = node.taken_m3_s;
        let into_supply = matches!(self.law, Law::Supply(_) | Law::Tank { .. });
        // Elements of a supply stand before it.
        let steady_m = [self.steady_m[0], self.steady_m[usize::from(into_supply)]];
        let mut behind_m = None;
        let (head_m, inflow_m3_s, out_m3_s) = if node.is_plain() {
            let (head_m, flow) = outlet.solve(reached.z, reached.e - reached.z * drawn);
            (head_m, flow + drawn, flow + drawn)
        } else {
            let guess_m = self.last.head_m(state).or(self.first.head_m(state)).unwrap_or(0.0);
            let solved = match outlet {
                Outlet::Head(held_m) if node.shunts.is_empty() => {
                    node.find_before(reached, held_m, reached.inflow_m3_s(guess_m))
                }
                _ => node.find(reached, |h| outlet.flow_at_m3_s(h), guess_m),
            };
            if let Some(balance) = balance {
                balance.node(self.index, node, &solved, steady_m);
            }
            node.advance(&solved);
            behind_m = Some(solved.right_head_m);
            (solved.left_head_m, solved.left_flow_m3_s, solved.right_flow_m3_s + drawn)
        };
        if let Law::Tank { head_m: level_m, inflow_m3_s, .. } = &mut self.law {
            (*level_m, *inflow_m3_s) = (head_m, out_m3_s);
        }
        let behind_m = behind_m.unwrap_or(head_m);
        let (head_m, inflow_m3_s) = match wall {
            Some(wall) => {
                let of_line = wall.leaves(inflow_m3_s);
                if let Some(balance) = balance {
                    let deviation = |(at_m, flow): (f64, f64)| (at_m - steady_m[0], flow);
                    balance.wall(deviation(of_line), deviation((head_m, inflow_m3_s)));
                }
                of_line
            }
            None => (head_m, inflow_m3_s),
        };
        self.last.leave(state, head_m, if first.is_something() { last.inflow_m3_s(head_m) } else { inflow_m3_s });
        self.first.leave(state, head_m, if last.is_something() { first.inflow_m3_s(head_m) } else { inflow_m3_s });
        if let Some(balance) = balance {
            balance.leaves(into_supply, behind_m - steady_m[1], out_m3_s);
        }
    }

    /// The same where water passes from the lines that end here into those that begin here.
    fn pass(
        &mut self,
        state: &mut State,
        (left, right): (Arriving, Arriving),
        (time_s, dt_s): (f64, f64),
        balance: &mut Option<&mut Balance>,
    ) {
        let (Law::Passage(law), node) = (&mut self.law, &mut self.node) else { return };
        let left = if left.is_something() { left } else { Arriving { z: 0.0, e: self.steady_m[0] } };
        let (left_m, left_m3_s, flow) = if node.is_plain() {
            let flow = match law.at(time_s) {
                // A given head drives what ends here.
                given @ Outlet::Head(_) => given.flow_m3_s(left.z, left.e),
                _ => law.through(time_s, left.e - right.e, left.z + right.z).0,
            };
            (left.e - left.z * flow, flow, flow)
        } else {
            let guess_m = self.last.head_m(state).unwrap_or(self.steady_m[0]);
            let solved = node.find(left, |h| law.through(time_s, h - right.e, right.z), guess_m);
            if let Some(balance) = balance {
                balance.node(self.index, node, &solved, [self.steady_m[0]; 2]);
            }
            node.advance(&solved);
            (solved.left_head_m, solved.left_flow_m3_s, solved.right_flow_m3_s)
        };
        let right_m = right.e + right.z * flow;
        law.advance(time_s, dt_s, flow, right_m - left_m);
        self.last.leave(state, left_m, left_m3_s);
        self.first.leave(state, right_m, -flow);
        if let Some(balance) = balance {
            balance.leaves(false, left_m - self.steady_m[0], flow);
            balance.leaves(false, right_m - self.steady_m[1], -flow);
        }
    }
}
