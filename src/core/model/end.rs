//! The two ends of a segment: the characteristic that arrives from inside, and the wave that goes back.
//!
//! What stays the same from step to step is computed once: a line with elements along it has many ends, and short
//! segments between them.

use crate::model::contribution::Implicit;
use crate::model::friction::ReachFriction;
use crate::model::grid::Segment;
use crate::model::node::Arriving;
use crate::model::state::State;
use crate::model::steady::Steady;

/// The last node of a segment if it is `DOWNSTREAM`, else its first.
pub(crate) struct End<'a, const DOWNSTREAM: bool> {
    node: usize,
    /// Its neighbour in the segment, from which the wave arrives.
    inside: usize,
    impedance: f64,
    one_plus_kappa: f64,
    by_kappa: f64,
    one_plus_mu: f64,
    pub(crate) steady_head_m: f64,
    /// `½R0`, m.
    steady_half_loss_m: f64,
    friction: &'a ReachFriction,
}

impl<'a, const DOWNSTREAM: bool> End<'a, DOWNSTREAM> {
    /// Of segment `s` of a line in its initial state.
    pub(crate) fn new(steady: &Steady<'a>, state: &State, s: usize) -> Self {
        let Implicit { kappa, mu } = state.implicit[s];
        let Segment { offset, reaches, impedance, .. } = steady.grid.segments[s];
        let (node, inside) = if DOWNSTREAM { (offset + reaches, offset + reaches - 1) } else { (offset, offset + 1) };
        End {
            node,
            inside,
            impedance,
            one_plus_kappa: 1.0 + kappa,
            by_kappa: 1.0 / (1.0 + kappa),
            one_plus_mu: 1.0 + mu,
            steady_head_m: steady.head_m[node],
            steady_half_loss_m: state.steady_half_loss[s],
            friction: &steady.frictions[s],
        }
    }

    /// 1 where flow leaves the segment, -1 where it enters.
    pub(crate) const SIGN: f64 = if DOWNSTREAM { 1.0 } else { -1.0 };

    /// The wave that arrives from inside.
    #[inline(always)]
    fn incoming(&self, state: &State) -> f64 {
        if DOWNSTREAM { state.fwd[self.inside] } else { state.bwd[self.inside] }
    }

    /// The characteristic that arrives: `H ± z Q = e`, friction linearised about the last flow.
    #[inline(always)]
    pub(crate) fn arriving(&self, state: &State) -> Arriving {
        let u = state.u[self.node];
        let (loss, slope) = self.friction.half_loss_and_slope(u);
        let constant = loss - slope * u - self.steady_half_loss_m;
        let known =
            self.incoming(state) + state.storage[self.node] + Self::SIGN * (state.momentum[self.node] - constant);
        Arriving {
            z: self.impedance * (self.one_plus_mu + slope) * self.by_kappa,
            e: self.steady_head_m + known * self.by_kappa,
        }
    }

    /// Head at the last step, m.
    #[inline(always)]
    pub(crate) fn head_m(&self, state: &State) -> f64 {
        self.steady_head_m + state.h[self.node]
    }

    /// Flow along the line at the last step, m³/s.
    #[inline(always)]
    pub(crate) fn flow_m3_s(&self, state: &State) -> f64 {
        state.u[self.node] / self.impedance
    }

    /// The head as a deviation from that before the closure.
    #[inline(always)]
    pub(crate) fn deviation_m(&self, state: &State) -> f64 {
        state.h[self.node]
    }

    /// Sets the node and the wave that goes back into the segment.
    #[inline(always)]
    pub(crate) fn leave(&self, state: &mut State, head_m: f64, flow_m3_s: f64) {
        let (h, u) = (head_m - self.steady_head_m, self.impedance * flow_m3_s);
        let stored = h * self.one_plus_kappa - state.storage[self.node];
        let back = self.incoming(state) + 2.0 * (h - stored - Self::SIGN * u);
        state.h[self.node] = h;
        state.u[self.node] = u;
        let (fwd, bwd) = if DOWNSTREAM { (2.0 * h - back, back) } else { (back, 2.0 * h - back) };
        state.new_fwd[self.node] = fwd;
        state.new_bwd[self.node] = bwd;
    }
}
