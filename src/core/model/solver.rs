//! One simulation: steps the lines with their joints and nodes from the start of the closure.

use crate::model::contribution::{Implicit, LineTerm, NodeField};
use crate::model::end::End;
use crate::model::energy::{Balance, Energy, Owners};
use crate::model::error::ModelError;
use crate::model::junction::{Ends, Junction};
use crate::model::late::Late;
use crate::model::node::{Arriving, Node, Spread};
use crate::model::state::{Reading, State};
use crate::model::steady::Steady;
use crate::model::stop::Heeded;
use crate::model::trace::{Probe, Trace};

/// Rounds in which elements that meet at a joint learn of each other's flows. A round gains digits: what one takes at once changes the other's head little.
const SWEEPS: usize = 4;

/// All lines with everything on them.
pub struct Lines<'a> {
    /// Steady state, grid and friction.
    pub steady: &'a Steady<'a>,
    /// Terms along the line.
    pub terms: Vec<Box<dyn LineTerm>>,
    /// Takes water out of every node.
    pub field: Option<Box<dyn NodeField>>,
    /// The nodes of the graph.
    pub junctions: Vec<Junction>,
    /// Elements behind each segment, then those at the nodes of the graph.
    pub nodes: Vec<Node>,
    /// Elements over several joints.
    pub spread: Vec<Spread>,
}

/// The characteristics that meet at a joint of two segments.
#[derive(Clone, Copy)]
struct Meeting {
    left: Arriving,
    right: Arriving,
    /// `1/(z + z)`.
    by_both: f64,
}

impl<'a> Lines<'a> {
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
        let ends = self.ends(&state);
        let nothing = Arriving { z: 1.0, e: 0.0 };
        let mut meetings = vec![Meeting { left: nothing, right: nothing, by_both: 0.0 }; grid.segments.len()];
        let mut traces: Vec<Trace> = readings.iter().map(|_| Trace::with_capacity(grid.dt_s, steps + 1)).collect();
        state.read(&mut traces, &readings);
        let heeded = Heeded::by_this_thread();
        for step in 1..=steps {
            heeded.stop_if_told();
            let time_s = step as f64 * grid.dt_s;
            self.step(&mut state, &ends, &mut meetings, time_s, sweeps, balance.as_mut());
            state.read(&mut traces, &readings);
            // At the end of the last line, which all waves reach within L/a; everywhere once, at the end.
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
        let late = Late::of(grid, &fwd, &bwd);
        let elastic = self.terms.is_empty() && self.field.is_none() && heads_only;
        State {
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
            late,
            elastic,
            steady_half_loss,
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

    fn ends(&self, state: &State) -> Ends<'a> {
        let segments = 0..self.steady.grid.segments.len();
        Ends {
            first: segments.clone().map(|s| End::new(self.steady, state, s)).collect(),
            last: segments.map(|s| End::new(self.steady, state, s)).collect(),
        }
    }

    fn step(
        &mut self,
        state: &mut State,
        ends: &Ends,
        meetings: &mut [Meeting],
        time_s: f64,
        sweeps: usize,
        mut balance: Option<&mut Balance>,
    ) {
        let grid = self.steady.grid;
        let Ends { first, last } = ends;
        state.pass_late();
        for (s, segment) in grid.segments.iter().enumerate().filter(|(_, segment)| segment.reaches > 1) {
            match &mut self.field {
                None => state.interior(s, segment.nodes()),
                Some(field) => state.interior_with(field.as_mut(), s, segment),
            }
        }
        for junction in &mut self.junctions {
            let node = &mut self.nodes[junction.index];
            junction.step(node, state, ends, (time_s, grid.dt_s), &mut balance);
        }
        // Joints.
        for s in grid.joints() {
            let (left, right) = (last[s].arriving(state), first[s + 1].arriving(state));
            meetings[s] = Meeting { left, right, by_both: 1.0 / (left.z + right.z) };
        }
        for _ in 0..sweeps {
            self.find_spread(state, first, meetings);
        }
        for s in grid.joints() {
            let Meeting { left, right, by_both } = meetings[s];
            let joint = &mut self.nodes[s];
            if joint.is_plain() {
                let flow = (left.e - right.e - left.z * joint.taken_m3_s) * by_both;
                let head = right.e + right.z * flow;
                last[s].leave(state, head, flow + joint.taken_m3_s);
                first[s + 1].leave(state, head, flow);
                continue;
            }
            let solved = joint.find_between(left, right, first[s + 1].head_m(state));
            if let Some(balance) = &mut balance {
                balance.node(s, joint, &solved, [last[s].steady_head_m, first[s + 1].steady_head_m]);
            }
            joint.advance(&solved);
            last[s].leave(state, solved.left_head_m, solved.left_flow_m3_s);
            first[s + 1].leave(state, solved.right_head_m, solved.right_flow_m3_s);
        }
        for one in &mut self.spread {
            if let Some(balance) = &mut balance {
                balance.spread(one, state);
            }
            one.advance();
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
    fn find_spread(&mut self, state: &State, first: &[End<false>], meetings: &[Meeting]) {
        for one in &mut self.spread {
            let (mut free_m, mut z) = (0.0, 0.0);
            for &(s, weight) in &one.at {
                let (joint, Meeting { left, right, by_both }) = (&mut self.nodes[s], meetings[s]);
                joint.taken_m3_s -= weight * one.flow_m3_s;
                let own = left.z * right.z * by_both;
                let head_m = if joint.is_plain() {
                    (left.e * right.z + right.e * left.z) * by_both - own * joint.taken_m3_s
                } else {
                    joint.find_between(left, right, first[s + 1].head_m(state)).right_head_m
                };
                free_m += weight * head_m;
                z += weight * weight * own;
            }
            one.find(free_m, z);
            for &(s, weight) in &one.at {
                self.nodes[s].taken_m3_s += weight * one.flow_m3_s;
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
}
