//! Joints of two segments of a line, and the elements that are spread over several of them.

use crate::model::end::End;
use crate::model::energy::Balance;
use crate::model::node::{Arriving, Node, Spread};
use crate::model::state::State;
use crate::model::wall::joint::WallJoint;
use crate::model::wall::waves::WallWaves;

/// Rounds in which elements that meet at a joint learn of each other's flows. A round gains digits: what one takes at
/// once changes the other's head little.
const SWEEPS: usize = 4;

/// A joint, with what arrives there in a step.
struct Joint<'a> {
    left: End<'a, true>,
    right: End<'a, false>,
    /// Its elements.
    node: Node,
    /// The segment before it.
    segment: usize,
    from_left: Arriving,
    from_right: Arriving,
    /// `1/(z + z)`.
    by_both: f64,
}

/// All joints, line after line.
pub(crate) struct Joints<'a> {
    joints: Vec<Joint<'a>>,
    /// Elements over several joints.
    spread: Vec<Spread>,
    sweeps: usize,
}

impl<'a> Joints<'a> {
    /// From the ends on both sides and the elements of each joint, with the segment before it. `spread` names joints.
    pub(crate) fn new(
        joints: impl Iterator<Item = (End<'a, true>, End<'a, false>, Node, usize)>,
        spread: Vec<Spread>,
    ) -> Self {
        let (from_left, from_right, by_both) = (Arriving::NOTHING, Arriving::NOTHING, 0.0);
        let joint = |(left, right, node, segment)| Joint { left, right, node, segment, from_left, from_right, by_both };
        // Once a step, unless two of them meet.
        let meet = |a: &Spread, b: &Spread| a.at.iter().any(|(s, _)| b.at.iter().any(|(t, _)| s == t));
        let met = spread.iter().enumerate().any(|(i, a)| spread[..i].iter().any(|b| meet(a, b)));
        Joints { joints: joints.map(joint).collect(), spread, sweeps: if met { SWEEPS } else { 1 } }
    }

    /// Solves all joints at the new time and sends the waves back into the segments.
    #[inline(always)]
    pub(crate) fn step(
        &mut self,
        state: &mut State,
        mut wall: Option<&mut WallWaves>,
        balance: &mut Option<&mut Balance>,
    ) {
        for joint in &mut self.joints {
            (joint.from_left, joint.from_right) = (joint.left.arriving(state), joint.right.arriving(state));
            if let Some(wall) = wall.as_mut().and_then(|wall| wall.behind(joint.segment)) {
                joint.from_left = wall.meets(joint.from_left);
            }
            joint.by_both = 1.0 / (joint.from_left.z + joint.from_right.z);
        }
        if !self.spread.is_empty() {
            (0..self.sweeps).for_each(|_| self.find_spread(state));
        }
        for joint in &mut self.joints {
            let wall = wall.as_mut().and_then(|wall| wall.behind(joint.segment));
            joint.step(state, wall, balance);
        }
        for one in &mut self.spread {
            if let Some(balance) = balance {
                let head_m = |&(j, weight): &(usize, f64)| weight * self.joints[j].right.deviation_m(state);
                balance.spread(one, one.at.iter().map(head_m).sum());
            }
            one.advance(one.at.last().map_or(0.0, |(j, _)| self.joints[*j].right.flow_m3_s(state)));
        }
    }

    /// Finds the flows of elements over several joints. Where two of them meet, each sees what the other takes.
    fn find_spread(&mut self, state: &State) {
        for one in &mut self.spread {
            let (mut free_m, mut z) = (0.0, 0.0);
            for &(j, weight) in &one.at {
                let joint = &mut self.joints[j];
                joint.node.taken_m3_s -= weight * one.flow_m3_s;
                let own = joint.from_left.z * joint.from_right.z * joint.by_both;
                free_m += weight * joint.head_m(own, state);
                z += weight * weight * own;
            }
            one.find(free_m, z);
            for &(j, weight) in &one.at {
                self.joints[j].node.taken_m3_s += weight * one.flow_m3_s;
            }
        }
    }
}

impl Joint<'_> {
    #[inline(always)]
    fn step(&mut self, state: &mut State, wall: Option<&mut WallJoint>, balance: &mut Option<&mut Balance>) {
        let Joint { left, right, node, from_left, from_right, by_both, .. } = self;
        if node.is_plain() {
            let flow = (from_left.e - from_right.e - from_left.z * node.taken_m3_s) * *by_both;
            let head = from_right.e + from_right.z * flow;
            leave_left(state, left, (head, flow + node.taken_m3_s), wall, balance);
            right.leave(state, head, flow);
            return;
        }
        let solved = node.find_between(*from_left, *from_right, right.head_m(state));
        if let Some(balance) = balance {
            balance.node(self.segment, node, &solved, [left.steady_head_m, right.steady_head_m]);
        }
        node.advance(&solved);
        leave_left(state, left, (solved.left_head_m, solved.left_flow_m3_s), wall, balance);
        right.leave(state, solved.right_head_m, solved.right_flow_m3_s);
    }

    /// Head behind its losses, m, where `own` is the impedance of both sides together.
    fn head_m(&self, own: f64, state: &State) -> f64 {
        let Joint { node, from_left, from_right, by_both, .. } = self;
        if node.is_plain() {
            (from_left.e * from_right.z + from_right.e * from_left.z) * by_both - own * node.taken_m3_s
        } else {
            node.find_between(*from_left, *from_right, self.right.head_m(state)).right_head_m
        }
    }
}

/// Sends the wave back into the segment before a joint of this head and flow; behind a joint of walls that move, they
/// are those of the pipe behind it.
#[inline(always)]
fn leave_left(
    state: &mut State,
    left: &End<true>,
    (head_m, flow_m3_s): (f64, f64),
    wall: Option<&mut WallJoint>,
    balance: &mut Option<&mut Balance>,
) {
    let Some(wall) = wall else { return left.leave(state, head_m, flow_m3_s) };
    let (own_m, own_m3_s) = wall.leaves(flow_m3_s);
    if let Some(balance) = balance {
        let steady_m = left.steady_head_m;
        balance.wall((own_m - steady_m, own_m3_s), (head_m - steady_m, flow_m3_s));
    }
    left.leave(state, own_m, own_m3_s);
}
