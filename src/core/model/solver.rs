//! One simulation: steps the line with its ends and joints from the start of the closure.

use crate::model::boundary::{Supply, ValveEnd};
use crate::model::contribution::{Implicit, LineTerm, NodeField};
use crate::model::energy::{Balance, Energy, Owners};
use crate::model::error::ModelError;
use crate::model::node::{Arriving, Node, Spread};
use crate::model::state::{Reading, State};
use crate::model::steady::Steady;
use crate::model::trace::{Probe, Trace};

/// Rounds in which elements that meet at a joint learn of each other's flows. A round gains digits: what one takes at once changes the other's head little.
const SWEEPS: usize = 4;

/// The line with everything on it.
pub struct Line<'a> {
    /// Steady state, grid and friction.
    pub steady: &'a Steady<'a>,
    /// Terms along the line.
    pub terms: Vec<Box<dyn LineTerm>>,
    /// Takes water out of every node.
    pub field: Option<Box<dyn NodeField>>,
    /// Upstream end.
    pub supply: Box<dyn Supply>,
    /// The joints between segments, one fewer than there are segments.
    pub joints: Vec<Node>,
    /// Elements over several joints.
    pub spread: Vec<Spread>,
    /// The node at the pipe's end, before the valve.
    pub at_valve: Node,
    /// Downstream end.
    pub valve: ValveEnd,
}

impl Line<'_> {
    /// Simulates `steps` steps and returns the reading of each probe; with `owners` also the energy balance.
    ///
    /// # Errors
    /// If the solution stops being finite.
    pub fn run(
        mut self,
        steps: usize,
        probes: &[Probe],
        owners: Option<Owners>,
    ) -> Result<(Vec<Trace>, Option<Energy>), ModelError> {
        let grid = self.steady.grid;
        let sweeps = self.sweeps();
        let heads_only = probes.iter().all(|p| matches!(p, Probe::Head(_)));
        let mut state = self.initial_state(heads_only && owners.is_none());
        let mut balance = owners.map(|owners| Balance::new(self.steady, owners, &self.terms, &state, steps));
        let readings: Vec<Reading> = probes.iter().map(|&probe| Reading::new(probe, self.steady)).collect();
        let mut traces: Vec<Trace> = readings.iter().map(|_| Trace::with_capacity(grid.dt_s, steps + 1)).collect();
        state.read(&mut traces, &readings);
        for step in 1..=steps {
            let time_s = step as f64 * grid.dt_s;
            self.step(&mut state, time_s, sweeps, balance.as_mut());
            state.read(&mut traces, &readings);
            // At the valve, which all waves reach within L/a; the whole line once, at the end.
            let seen = if step < steps { state.fwd.len() - 1..state.fwd.len() } else { 0..state.fwd.len() };
            if !seen.into_iter().all(|i| state.fwd[i].is_finite() && state.bwd[i].is_finite()) {
                return Err(self.not_finite(&state, time_s));
            }
        }
        Ok((traces, balance.map(Balance::close)))
    }

    fn not_finite(&self, state: &State, time_s: f64) -> ModelError {
        let bad = (0..state.fwd.len()).find(|&i| !(state.fwd[i].is_finite() && state.bwd[i].is_finite())).unwrap_or(0);
        let segment = self.steady.grid.segments.iter().find(|s| s.nodes().contains(&bad));
        let position_m = segment.map_or(0.0, |s| s.start_m + s.reach_m * (bad - s.offset) as f64);
        ModelError::NotFinite { time_s, position_m, effects: String::new() }
    }

    fn initial_state(&self, heads_only: bool) -> State {
        let grid = self.steady.grid;
        let n = grid.nodes();
        let mut u = vec![0.0; n];
        let (mut fwd, mut bwd) = (vec![0.0; n], vec![0.0; n]);
        let (mut storage, mut momentum) = (vec![0.0; n], vec![0.0; n]);
        let mut steady_half_loss = Vec::new();
        let mut implicit = Vec::new();
        let mut inner_frictions = Vec::new();
        for (s, (segment, friction)) in grid.segments.iter().zip(self.steady.frictions).enumerate() {
            let nodes = segment.nodes();
            let steady_u = segment.impedance * self.steady.flow_m3_s[s];
            u[nodes.clone()].fill(steady_u);
            // h = 0, and the loss of the steady flow cancels: the waves carry u alone.
            fwd[nodes.clone()].fill(steady_u);
            bwd[nodes.clone()].fill(-steady_u);
            let mut total = Implicit::default();
            for term in &self.terms {
                term.known(s, &mut storage[nodes.clone()], &mut momentum[nodes.clone()]);
                let Implicit { kappa, mu } = term.implicit(s);
                total = Implicit { kappa: total.kappa + kappa, mu: total.mu + mu };
            }
            let inner = friction.of_twice_u(1.0 + total.mu);
            steady_half_loss.push(0.5 * (1.0 + total.mu) * inner.steady_half_loss(2.0 * steady_u));
            inner_frictions.push(inner);
            implicit.push(total);
        }
        let elastic = self.terms.is_empty() && self.field.is_none() && heads_only;
        State {
            arriving: vec![[Arriving { z: 1.0, e: 0.0 }; 2]; grid.segments.len() - 1],
            new_fwd: fwd.clone(),
            new_bwd: bwd.clone(),
            fwd,
            bwd,
            h: vec![0.0; n],
            u,
            storage,
            momentum,
            outflow: vec![0.0; n],
            scratch: vec![0.0; n],
            elastic,
            steady_half_loss,
            by_kappa: implicit.iter().map(|own| 1.0 / (1.0 + own.kappa)).collect(),
            implicit,
            frictions: inner_frictions,
        }
    }

    /// How often the flows of elements over several joints are computed in a step: once, unless two of them meet.
    fn sweeps(&self) -> usize {
        let meet = |a: &Spread, b: &Spread| a.at.iter().any(|(s, _)| b.at.iter().any(|(t, _)| s == t));
        let met = self.spread.iter().enumerate().any(|(i, a)| self.spread[..i].iter().any(|b| meet(a, b)));
        if met { SWEEPS } else { 1 }
    }

    fn step(&mut self, state: &mut State, time_s: f64, sweeps: usize, mut balance: Option<&mut Balance>) {
        let grid = self.steady.grid;
        for (s, segment) in grid.segments.iter().enumerate() {
            match &mut self.field {
                None => state.interior(s, segment.nodes()),
                Some(field) => state.interior_with(field.as_mut(), s, segment),
            }
        }
        // Supply: the first node of the first segment.
        let first = self.arriving_upstream(state, 0);
        let head = self.supply.head_m(time_s);
        let flow = (head - first.e) / first.z;
        self.leave_first(state, 0, head, flow);
        if let Some(balance) = &mut balance {
            balance.supply(state.h[0], flow);
        }
        // Joints.
        let mut arriving = std::mem::take(&mut state.arriving);
        for (s, both) in arriving.iter_mut().enumerate() {
            *both = [self.arriving_downstream(state, s), self.arriving_upstream(state, s + 1)];
        }
        self.find_spread(state, &arriving, sweeps);
        for (s, &[left, right]) in arriving.iter().enumerate() {
            let joint = &mut self.joints[s];
            if joint.is_plain() {
                let flow = (left.e - right.e - left.z * joint.taken_m3_s) / (left.z + right.z);
                let head = right.e + right.z * flow;
                let arriving = flow + joint.taken_m3_s;
                self.leave_last(state, s, head, arriving);
                self.leave_first(state, s + 1, head, flow);
                continue;
            }
            let node = grid.segments[s + 1].offset;
            let guess = self.steady.head_m[node] + state.h[node];
            let solved = joint.find(left, |h| ((h - right.e) / right.z, 1.0 / right.z), guess);
            if let Some(balance) = &mut balance {
                balance.node(s, joint, &solved);
            }
            joint.advance(&solved);
            self.leave_last(state, s, solved.left_head_m, solved.left_flow_m3_s);
            self.leave_first(state, s + 1, solved.right_head_m, solved.right_flow_m3_s);
        }
        state.arriving = arriving;
        for one in &mut self.spread {
            if let Some(balance) = &mut balance {
                balance.spread(one, state);
            }
            one.advance();
        }
        // Valve: the last node of the last segment.
        let s = grid.segments.len() - 1;
        let last = self.arriving_downstream(state, s);
        if self.at_valve.is_plain() {
            let flow = self.valve.flow_m3_s(time_s, last.z, last.e);
            let head = last.e - last.z * flow;
            self.leave_last(state, s, head, flow);
            if let Some(balance) = &mut balance {
                balance.valve(head, flow);
            }
        } else {
            let node = self.steady.head_m.len() - 1;
            let guess = self.steady.head_m[node] + state.h[node];
            let valve = &self.valve;
            let solved = self.at_valve.find(last, |h| valve.flow_at_m3_s(time_s, h), guess);
            if let Some(balance) = &mut balance {
                balance.node(s, &self.at_valve, &solved);
                balance.valve(solved.right_head_m, solved.right_flow_m3_s);
            }
            self.at_valve.advance(&solved);
            self.leave_last(state, s, solved.left_head_m, solved.left_flow_m3_s);
        }

        match balance {
            Some(balance) => {
                balance.line(state);
                balance.advance(&mut self.terms, state);
            }
            None if self.terms.is_empty() => {}
            None => self.advance_terms(state),
        }
        std::mem::swap(&mut state.fwd, &mut state.new_fwd);
        std::mem::swap(&mut state.bwd, &mut state.new_bwd);
    }

    /// Finds the flows of elements over several joints. Where two of them meet, each sees what the other takes.
    fn find_spread(&mut self, state: &State, arriving: &[[Arriving; 2]], sweeps: usize) {
        for _ in 0..sweeps {
            for i in 0..self.spread.len() {
                let (mut free_m, mut z) = (0.0, 0.0);
                for k in 0..self.spread[i].at.len() {
                    let (s, weight) = self.spread[i].at[k];
                    let [left, right] = arriving[s];
                    let joint = &mut self.joints[s];
                    joint.taken_m3_s -= weight * self.spread[i].flow_m3_s;
                    let node = self.steady.grid.segments[s + 1].offset;
                    let by_both = 1.0 / (left.z + right.z);
                    let own = left.z * right.z * by_both;
                    let head_m = if joint.is_plain() {
                        (left.e * right.z + right.e * left.z) * by_both - own * joint.taken_m3_s
                    } else {
                        let guess = self.steady.head_m[node] + state.h[node];
                        joint.find(left, |h| ((h - right.e) / right.z, 1.0 / right.z), guess).right_head_m
                    };
                    free_m += weight * head_m;
                    z += weight * weight * own;
                }
                let one = &mut self.spread[i];
                one.find(free_m, z);
                for &(s, weight) in &one.at {
                    self.joints[s].taken_m3_s += weight * one.flow_m3_s;
                }
            }
        }
    }

    fn advance_terms(&mut self, state: &mut State) {
        state.storage.fill(0.0);
        state.momentum.fill(0.0);
        for (s, segment) in self.steady.grid.segments.iter().enumerate() {
            let n = segment.nodes();
            let (h, u) = (&state.h[n.clone()], &state.u[n.clone()]);
            for term in &mut self.terms {
                term.advance(s, h, u, &mut state.storage[n.clone()], &mut state.momentum[n.clone()]);
            }
        }
    }

    /// `½R - ½R0` linearised about the last flow at a node: value at `u = 0` and slope.
    #[inline]
    fn half_loss_line(&self, state: &State, segment: usize, u: f64) -> (f64, f64) {
        let (loss, slope) = self.steady.frictions[segment].half_loss_and_slope(u);
        (loss - slope * u - state.steady_half_loss[segment], slope)
    }

    /// The characteristic from inside segment `s` that reaches its first node: `H - z Q = e`.
    #[inline]
    fn arriving_upstream(&self, state: &State, s: usize) -> Arriving {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset;
        let (mu, by_kappa) = (state.implicit[s].mu, state.by_kappa[s]);
        let (constant, slope) = self.half_loss_line(state, s, state.u[node]);
        let known = state.bwd[node + 1] + state.storage[node] - state.momentum[node] + constant;
        Arriving {
            z: segment.impedance * (1.0 + mu + slope) * by_kappa,
            e: self.steady.head_m[node] + known * by_kappa,
        }
    }

    /// The characteristic from inside segment `s` that reaches its last node: `H + z Q = e`.
    #[inline]
    fn arriving_downstream(&self, state: &State, s: usize) -> Arriving {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset + segment.reaches;
        let (mu, by_kappa) = (state.implicit[s].mu, state.by_kappa[s]);
        let (constant, slope) = self.half_loss_line(state, s, state.u[node]);
        let known = state.fwd[node - 1] + state.storage[node] + state.momentum[node] - constant;
        Arriving {
            z: segment.impedance * (1.0 + mu + slope) * by_kappa,
            e: self.steady.head_m[node] + known * by_kappa,
        }
    }

    /// Sets the first node of segment `s` and the wave that leaves it downstream.
    #[inline]
    fn leave_first(&self, state: &mut State, s: usize, head: f64, flow: f64) {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset;
        let (h, u) = (head - self.steady.head_m[node], segment.impedance * flow);
        let stored = h * (1.0 + state.implicit[s].kappa) - state.storage[node];
        let moved = stored - state.bwd[node + 1];
        state.h[node] = h;
        state.u[node] = u;
        state.new_fwd[node] = (2.0 * h - stored) + (2.0 * u - moved);
        state.new_bwd[node] = 2.0 * h - state.new_fwd[node];
    }

    /// Sets the last node of segment `s` and the wave that leaves it upstream.
    #[inline]
    fn leave_last(&self, state: &mut State, s: usize, head: f64, flow: f64) {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset + segment.reaches;
        let (h, u) = (head - self.steady.head_m[node], segment.impedance * flow);
        let stored = h * (1.0 + state.implicit[s].kappa) - state.storage[node];
        let moved = state.fwd[node - 1] - stored;
        state.h[node] = h;
        state.u[node] = u;
        state.new_bwd[node] = (2.0 * h - stored) - (2.0 * u - moved);
        state.new_fwd[node] = 2.0 * h - state.new_bwd[node];
    }
}
