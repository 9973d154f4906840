//! One simulation: the state of the line, its steps from the start of the closure on, and the heads it leaves at sensors.

use super::ModelError;
use super::boundary::{Supply, ValveEnd};
use super::friction::ReachFriction;
use super::grid::Grid;
use super::kernel::{self, Terms};
use super::trace::Trace;

/// The steady state before the closure.
pub struct Steady<'a> {
    /// The grid.
    pub grid: &'a Grid,
    /// Head at every node, m.
    pub head_m: &'a [f64],
    /// Flow, m³/s.
    pub flow_m3_s: f64,
    /// Density of the water, kg/m³.
    pub density_kg_m3: f64,
}

/// The implicit parts of a line term: the shares of head and of flow that it adds at the new time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Implicit {
    /// Storage: multiplies the head.
    pub kappa: f64,
    /// Momentum: multiplies `u = B Q`.
    pub mu: f64,
}

/// A term of the equations along the line, computed once a step over all nodes of a segment.
///
/// In the notation of [`kernel`]: half of what the term takes over one reach and one step is `κH - b` of head (storage)
/// and `μu - d` (momentum) at the new time; `κ, μ` are constants of the segment, `b, d` known before the step.
pub trait LineTerm: Send {
    /// `κ` and `μ` of a segment.
    fn implicit(&self, segment: usize) -> Implicit;
    /// Adds `b` and `d` of the first step, in steady state.
    fn known(&self, segment: usize, storage: &mut [f64], momentum: &mut [f64]);
    /// Takes in the new heads and `u` of a segment's nodes and adds `b` and `d` of the step to come.
    fn advance(&mut self, segment: usize, head: &[f64], u: &[f64], storage: &mut [f64], momentum: &mut [f64]);
}

/// Heads and flow before the closure, from the valve back to the supply.
pub fn steady_heads(grid: &Grid, frictions: &[ReachFriction], flow_m3_s: f64, valve_head_m: f64) -> Vec<f64> {
    let mut heads = vec![valve_head_m; grid.nodes()];
    let mut head = valve_head_m;
    for (segment, friction) in grid.segments.iter().zip(frictions).rev() {
        let loss = 2.0 * friction.half_loss_and_slope(segment.impedance * flow_m3_s).0;
        for node in segment.nodes().rev() {
            heads[node] = head;
            head += loss;
        }
        head -= loss;
    }
    heads
}

/// Everything that a simulation needs.
pub struct Line<'a> {
    /// Steady state and grid.
    pub steady: Steady<'a>,
    /// Friction of each segment's reach.
    pub frictions: Vec<ReachFriction>,
    /// Terms along the line.
    pub terms: Vec<Box<dyn LineTerm>>,
    /// Upstream end.
    pub supply: Box<dyn Supply>,
    /// Downstream end.
    pub valve: ValveEnd,
}

/// State of the line: waves, heads and scaled flows at all nodes, segment after segment.
struct State {
    fwd: Vec<f64>,
    bwd: Vec<f64>,
    new_fwd: Vec<f64>,
    new_bwd: Vec<f64>,
    head: Vec<f64>,
    u: Vec<f64>,
    storage: Vec<f64>,
    momentum: Vec<f64>,
    /// No line terms: interior heads are not kept but read from the waves.
    elastic: bool,
}

/// The characteristic that reaches an end of a segment, `H ± z Q = e` (+ at its last node), linear in `H` and `Q`.
struct Arriving {
    z: f64,
    e: f64,
}

impl Line<'_> {
    /// Simulates `steps` steps and gives the head at each stencil (weights of nodes).
    ///
    /// # Errors
    /// If the solution stops being finite.
    pub fn run(mut self, steps: usize, stencils: &[Vec<(usize, f64)>]) -> Result<Vec<Trace>, ModelError> {
        let grid = self.steady.grid;
        let implicit: Vec<Implicit> = (0..grid.segments.len())
            .map(|s| {
                self.terms
                    .iter()
                    .map(|t| t.implicit(s))
                    .fold(Implicit::default(), |a, b| Implicit { kappa: a.kappa + b.kappa, mu: a.mu + b.mu })
            })
            .collect();
        let mut state = self.initial_state();
        let mut traces: Vec<Trace> =
            stencils.iter().map(|_| Trace { dt_s: grid.dt_s, head_m: Vec::with_capacity(steps + 1) }).collect();
        state.read(&mut traces, stencils);
        for step in 1..=steps {
            let time_s = step as f64 * grid.dt_s;
            self.step(&mut state, &implicit, time_s);
            state.read(&mut traces, stencils);
            let valve_head = state.head[state.head.len() - 1];
            if !valve_head.is_finite() {
                return Err(ModelError::NotFinite { time_s });
            }
        }
        Ok(traces)
    }

    fn initial_state(&self) -> State {
        let grid = self.steady.grid;
        let n = grid.nodes();
        let head = self.steady.head_m.to_vec();
        let mut u = vec![0.0; n];
        let (mut fwd, mut bwd) = (vec![0.0; n], vec![0.0; n]);
        let (mut storage, mut momentum) = (vec![0.0; n], vec![0.0; n]);
        for (s, (segment, friction)) in grid.segments.iter().zip(&self.frictions).enumerate() {
            let steady_u = segment.impedance * self.steady.flow_m3_s;
            let half_loss = friction.half_loss_and_slope(steady_u).0;
            for node in segment.nodes() {
                u[node] = steady_u;
                fwd[node] = head[node] + steady_u - half_loss;
                bwd[node] = head[node] - steady_u + half_loss;
            }
            for term in &self.terms {
                term.known(s, &mut storage[segment.nodes()], &mut momentum[segment.nodes()]);
            }
        }
        let elastic = self.terms.is_empty();
        State { new_fwd: fwd.clone(), new_bwd: bwd.clone(), fwd, bwd, head, u, storage, momentum, elastic }
    }

    fn step(&mut self, state: &mut State, implicit: &[Implicit], time_s: f64) {
        let grid = self.steady.grid;
        for (s, segment) in grid.segments.iter().enumerate() {
            state.interior(segment.nodes(), implicit[s], &self.frictions[s]);
        }
        // Supply: the first node of the first segment.
        let first = self.arriving_upstream(state, implicit, 0);
        let head = self.supply.head_m(time_s);
        self.leave_first(state, implicit, 0, head, (head - first.e) / first.z);
        // Joints: head and flow are common.
        for s in 0..grid.segments.len() - 1 {
            let left = self.arriving_downstream(state, implicit, s);
            let right = self.arriving_upstream(state, implicit, s + 1);
            let flow = (left.e - right.e) / (left.z + right.z);
            let head = left.e - left.z * flow;
            self.leave_last(state, implicit, s, head, flow);
            self.leave_first(state, implicit, s + 1, head, flow);
        }
        // Valve: the last node of the last segment.
        let s = grid.segments.len() - 1;
        let last = self.arriving_downstream(state, implicit, s);
        let flow = self.valve.flow_m3_s(time_s, last.z, last.e);
        self.leave_last(state, implicit, s, last.e - last.z * flow, flow);

        if !self.terms.is_empty() {
            state.storage.fill(0.0);
            state.momentum.fill(0.0);
            for (s, segment) in grid.segments.iter().enumerate() {
                let nodes = segment.nodes();
                for term in &mut self.terms {
                    term.advance(
                        s,
                        &state.head[nodes.clone()],
                        &state.u[nodes.clone()],
                        &mut state.storage[nodes.clone()],
                        &mut state.momentum[nodes.clone()],
                    );
                }
            }
        }
        std::mem::swap(&mut state.fwd, &mut state.new_fwd);
        std::mem::swap(&mut state.bwd, &mut state.new_bwd);
    }

    /// `½R` linearised about the last flow at a node: value at `u = 0` and slope.
    fn half_loss_line(&self, segment: usize, u: f64, mu: f64) -> (f64, f64) {
        let (loss, slope) = self.frictions[segment].half_loss_and_slope(u);
        ((loss - slope * u) * (1.0 + mu), slope * (1.0 + mu))
    }

    /// The characteristic from inside segment `s` that reaches its first node: `H - z Q = e`.
    fn arriving_upstream(&self, state: &State, implicit: &[Implicit], s: usize) -> Arriving {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset;
        let Implicit { kappa, mu } = implicit[s];
        let (constant, slope) = self.half_loss_line(s, state.u[node], mu);
        let known = state.bwd[node + 1] + state.storage[node] - state.momentum[node] + constant;
        Arriving { z: segment.impedance * (1.0 + mu + slope) / (1.0 + kappa), e: known / (1.0 + kappa) }
    }

    /// The characteristic from inside segment `s` that reaches its last node: `H + z Q = e`.
    fn arriving_downstream(&self, state: &State, implicit: &[Implicit], s: usize) -> Arriving {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset + segment.reaches;
        let Implicit { kappa, mu } = implicit[s];
        let (constant, slope) = self.half_loss_line(s, state.u[node], mu);
        let known = state.fwd[node - 1] + state.storage[node] + state.momentum[node] - constant;
        Arriving { z: segment.impedance * (1.0 + mu + slope) / (1.0 + kappa), e: known / (1.0 + kappa) }
    }

    /// Sets the first node of segment `s` and the wave that leaves it downstream.
    fn leave_first(&self, state: &mut State, implicit: &[Implicit], s: usize, head: f64, flow: f64) {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset;
        let u = segment.impedance * flow;
        let stored = head * (1.0 + implicit[s].kappa) - state.storage[node];
        let moved = stored - state.bwd[node + 1];
        state.head[node] = head;
        state.u[node] = u;
        state.new_fwd[node] = (2.0 * head - stored) + (2.0 * u - moved);
        state.new_bwd[node] = 2.0 * head - state.new_fwd[node];
    }

    /// Sets the last node of segment `s` and the wave that leaves it upstream.
    fn leave_last(&self, state: &mut State, implicit: &[Implicit], s: usize, head: f64, flow: f64) {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset + segment.reaches;
        let u = segment.impedance * flow;
        let stored = head * (1.0 + implicit[s].kappa) - state.storage[node];
        let moved = state.fwd[node - 1] - stored;
        state.head[node] = head;
        state.u[node] = u;
        state.new_bwd[node] = (2.0 * head - stored) - (2.0 * u - moved);
        state.new_fwd[node] = 2.0 * head - state.new_bwd[node];
    }
}

impl State {
    /// Steps the nodes of a segment between its ends.
    fn interior(&mut self, nodes: std::ops::Range<usize>, Implicit { kappa, mu }: Implicit, friction: &ReachFriction) {
        let (fwd, bwd) = (&self.fwd[nodes.clone()], &self.bwd[nodes.clone()]);
        let (new_fwd, new_bwd) = (&mut self.new_fwd[nodes.clone()], &mut self.new_bwd[nodes.clone()]);
        if self.elastic {
            match friction {
                ReachFriction::Quadratic(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f),
                ReachFriction::Tabulated(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f),
            }
            return;
        }
        let terms = Terms { storage: &self.storage[nodes.clone()], kappa, momentum: &self.momentum[nodes.clone()], mu };
        let (head, u) = (&mut self.head[nodes.clone()], &mut self.u[nodes]);
        match friction {
            ReachFriction::Quadratic(f) => kernel::with_terms(fwd, bwd, new_fwd, new_bwd, head, u, &terms, f),
            ReachFriction::Tabulated(f) => kernel::with_terms(fwd, bwd, new_fwd, new_bwd, head, u, &terms, f),
        }
    }

    /// Appends the present head at each stencil.
    fn read(&self, traces: &mut [Trace], stencils: &[Vec<(usize, f64)>]) {
        for (trace, stencil) in traces.iter_mut().zip(stencils) {
            let head = |node: usize| {
                if self.elastic { 0.5 * (self.fwd[node] + self.bwd[node]) } else { self.head[node] }
            };
            trace.head_m.push(stencil.iter().map(|&(node, weight)| weight * head(node)).sum());
        }
    }
}
