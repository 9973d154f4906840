//! One simulation: the state of the line, its steps from the start of the closure on, and the heads it leaves at sensors.

use super::ModelError;
use super::boundary::{Supply, ValveEnd};
use super::friction::ReachFriction;
use super::grid::Grid;
use super::kernel::{self, Terms};
use super::trace::{Probe, Trace};

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
/// In the notation of [`kernel`]: half of what the term takes over one reach and one step is `κh - b` of head (storage)
/// and `μu - d` (momentum) at the new time; `κ, μ` are constants of the segment, `b, d` known before the step. Heads are deviations
/// `h` from the steady state, in which `b` and, with `μ`, `d` must balance.
pub trait LineTerm: Send {
    /// `κ` and `μ` of a segment.
    fn implicit(&self, segment: usize) -> Implicit;
    /// Adds `b` and `d` of the first step, from the steady state; nothing by default.
    fn known(&self, segment: usize, storage: &mut [f64], momentum: &mut [f64]) {
        let _ = (segment, storage, momentum);
    }
    /// Takes in the new head deviations and `u` of a segment's nodes and adds `b` and `d` of the step to come.
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

/// State of the line: waves, head deviations and scaled flows `u = B Q` at all nodes, segment after segment.
struct State {
    fwd: Vec<f64>,
    bwd: Vec<f64>,
    new_fwd: Vec<f64>,
    new_bwd: Vec<f64>,
    h: Vec<f64>,
    u: Vec<f64>,
    storage: Vec<f64>,
    momentum: Vec<f64>,
    /// No line terms and no flow to read: interior heads are not kept but read from the waves.
    elastic: bool,
    /// Half of what the steady flow loses over one reach, `½R0`, of each segment, m.
    steady_half_loss: Vec<f64>,
}

/// The characteristic that reaches an end of a segment, `h ± z Q = e` (+ at its last node), linear in `h` and `Q`.
struct Arriving {
    z: f64,
    e: f64,
}

impl Line<'_> {
    /// Simulates `steps` steps and gives what each probe reads.
    ///
    /// # Errors
    /// If the solution stops being finite.
    pub fn run(mut self, steps: usize, probes: &[Probe]) -> Result<Vec<Trace>, ModelError> {
        let grid = self.steady.grid;
        let implicit: Vec<Implicit> = (0..grid.segments.len())
            .map(|s| {
                self.terms
                    .iter()
                    .map(|t| t.implicit(s))
                    .fold(Implicit::default(), |a, b| Implicit { kappa: a.kappa + b.kappa, mu: a.mu + b.mu })
            })
            .collect();
        let mut state = self.initial_state(probes.iter().all(|p| matches!(p, Probe::Head(_))));
        let readings: Vec<Reading> = probes.iter().map(|&probe| Reading::new(probe, &self.steady)).collect();
        let mut traces: Vec<Trace> =
            readings.iter().map(|_| Trace { dt_s: grid.dt_s, values: Vec::with_capacity(steps + 1) }).collect();
        state.read(&mut traces, &readings);
        for step in 1..=steps {
            let time_s = step as f64 * grid.dt_s;
            self.step(&mut state, &implicit, time_s);
            state.read(&mut traces, &readings);
            let at_valve = state.h[state.h.len() - 1];
            if !at_valve.is_finite() {
                return Err(ModelError::NotFinite { time_s });
            }
        }
        Ok(traces)
    }

    fn initial_state(&self, heads_only: bool) -> State {
        let grid = self.steady.grid;
        let n = grid.nodes();
        let mut u = vec![0.0; n];
        let (mut fwd, mut bwd) = (vec![0.0; n], vec![0.0; n]);
        let (mut storage, mut momentum) = (vec![0.0; n], vec![0.0; n]);
        for (s, segment) in grid.segments.iter().enumerate() {
            let nodes = segment.nodes();
            let steady_u = segment.impedance * self.steady.flow_m3_s;
            u[nodes.clone()].fill(steady_u);
            // h = 0, and the loss of the steady flow drops out: the waves carry u alone.
            fwd[nodes.clone()].fill(steady_u);
            bwd[nodes.clone()].fill(-steady_u);
            for term in &self.terms {
                term.known(s, &mut storage[nodes.clone()], &mut momentum[nodes.clone()]);
            }
        }
        let elastic = self.terms.is_empty() && heads_only;
        let steady_half_loss = self
            .frictions
            .iter()
            .zip(&grid.segments)
            .map(|(friction, segment)| friction.steady_half_loss(segment.impedance * self.steady.flow_m3_s))
            .collect();
        State {
            new_fwd: fwd.clone(),
            new_bwd: bwd.clone(),
            fwd,
            bwd,
            h: vec![0.0; n],
            u,
            storage,
            momentum,
            elastic,
            steady_half_loss,
        }
    }

    fn step(&mut self, state: &mut State, implicit: &[Implicit], time_s: f64) {
        let grid = self.steady.grid;
        for (s, segment) in grid.segments.iter().enumerate() {
            state.interior(s, segment.nodes(), implicit[s], &self.frictions[s]);
        }
        // Supply: the first node of the first segment.
        let first = self.arriving_upstream(state, implicit, 0);
        let h = self.supply.head_m(time_s) - self.steady.head_m[0];
        self.leave_first(state, implicit, 0, h, (h - first.e) / first.z);
        // Joints: head and flow are common.
        for s in 0..grid.segments.len() - 1 {
            let left = self.arriving_downstream(state, implicit, s);
            let right = self.arriving_upstream(state, implicit, s + 1);
            let flow = (left.e - right.e) / (left.z + right.z);
            let h = left.e - left.z * flow;
            self.leave_last(state, implicit, s, h, flow);
            self.leave_first(state, implicit, s + 1, h, flow);
        }
        // Valve: the last node of the last segment.
        let s = grid.segments.len() - 1;
        let last = self.arriving_downstream(state, implicit, s);
        let steady_head = self.steady.head_m[self.steady.head_m.len() - 1];
        let flow = self.valve.flow_m3_s(time_s, last.z, last.e + steady_head);
        self.leave_last(state, implicit, s, last.e - last.z * flow, flow);

        if !self.terms.is_empty() {
            state.storage.fill(0.0);
            state.momentum.fill(0.0);
            for (s, segment) in grid.segments.iter().enumerate() {
                let nodes = segment.nodes();
                for term in &mut self.terms {
                    term.advance(
                        s,
                        &state.h[nodes.clone()],
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

    /// `½R - ½R0` linearised about the last flow at a node: value at `u = 0` and slope.
    fn half_loss_line(&self, state: &State, segment: usize, u: f64) -> (f64, f64) {
        let (loss, slope) = self.frictions[segment].half_loss_and_slope(u);
        (loss - slope * u - state.steady_half_loss[segment], slope)
    }

    /// The characteristic from inside segment `s` that reaches its first node: `h - z Q = e`.
    fn arriving_upstream(&self, state: &State, implicit: &[Implicit], s: usize) -> Arriving {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset;
        let Implicit { kappa, mu } = implicit[s];
        let (constant, slope) = self.half_loss_line(state, s, state.u[node]);
        let known = state.bwd[node + 1] + state.storage[node] - state.momentum[node] + constant;
        Arriving { z: segment.impedance * (1.0 + mu + slope) / (1.0 + kappa), e: known / (1.0 + kappa) }
    }

    /// The characteristic from inside segment `s` that reaches its last node: `h + z Q = e`.
    fn arriving_downstream(&self, state: &State, implicit: &[Implicit], s: usize) -> Arriving {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset + segment.reaches;
        let Implicit { kappa, mu } = implicit[s];
        let (constant, slope) = self.half_loss_line(state, s, state.u[node]);
        let known = state.fwd[node - 1] + state.storage[node] + state.momentum[node] - constant;
        Arriving { z: segment.impedance * (1.0 + mu + slope) / (1.0 + kappa), e: known / (1.0 + kappa) }
    }

    /// Sets the first node of segment `s` and the wave that leaves it downstream.
    fn leave_first(&self, state: &mut State, implicit: &[Implicit], s: usize, h: f64, flow: f64) {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset;
        let u = segment.impedance * flow;
        let stored = h * (1.0 + implicit[s].kappa) - state.storage[node];
        let moved = stored - state.bwd[node + 1];
        state.h[node] = h;
        state.u[node] = u;
        state.new_fwd[node] = (2.0 * h - stored) + (2.0 * u - moved);
        state.new_bwd[node] = 2.0 * h - state.new_fwd[node];
    }

    /// Sets the last node of segment `s` and the wave that leaves it upstream.
    fn leave_last(&self, state: &mut State, implicit: &[Implicit], s: usize, h: f64, flow: f64) {
        let segment = &self.steady.grid.segments[s];
        let node = segment.offset + segment.reaches;
        let u = segment.impedance * flow;
        let stored = h * (1.0 + implicit[s].kappa) - state.storage[node];
        let moved = state.fwd[node - 1] - stored;
        state.h[node] = h;
        state.u[node] = u;
        state.new_bwd[node] = (2.0 * h - stored) - (2.0 * u - moved);
        state.new_fwd[node] = 2.0 * h - state.new_bwd[node];
    }
}

impl State {
    /// Steps the nodes of a segment between its ends.
    fn interior(
        &mut self,
        segment: usize,
        nodes: std::ops::Range<usize>,
        Implicit { kappa, mu }: Implicit,
        friction: &ReachFriction,
    ) {
        let steady_half_loss = self.steady_half_loss[segment];
        let (fwd, bwd) = (&self.fwd[nodes.clone()], &self.bwd[nodes.clone()]);
        let (new_fwd, new_bwd) = (&mut self.new_fwd[nodes.clone()], &mut self.new_bwd[nodes.clone()]);
        if self.elastic {
            match friction {
                ReachFriction::Quadratic(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_half_loss),
                ReachFriction::Linear(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_half_loss),
                ReachFriction::Tabulated(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_half_loss),
            }
            return;
        }
        let terms = Terms {
            storage: &self.storage[nodes.clone()],
            kappa,
            momentum: &self.momentum[nodes.clone()],
            mu,
            steady_half_loss,
        };
        let (h, u) = (&mut self.h[nodes.clone()], &mut self.u[nodes]);
        match friction {
            ReachFriction::Linear(f) => kernel::with_terms(fwd, bwd, new_fwd, new_bwd, h, u, &terms, f),
            ReachFriction::Quadratic(f) => kernel::with_terms(fwd, bwd, new_fwd, new_bwd, h, u, &terms, f),
            ReachFriction::Tabulated(f) => kernel::with_terms(fwd, bwd, new_fwd, new_bwd, h, u, &terms, f),
        }
    }

    /// Appends what each probe reads now.
    fn read(&self, traces: &mut [Trace], readings: &[Reading]) {
        for (trace, reading) in traces.iter_mut().zip(readings) {
            let weigh = |of: &dyn Fn(usize) -> f64| reading.stencil.iter().map(|&(node, w)| w * of(node)).sum::<f64>();
            trace.values.push(match reading.flow_by_u {
                None if self.elastic => reading.base + weigh(&|node| 0.5 * (self.fwd[node] + self.bwd[node])),
                None => reading.base + weigh(&|node| self.h[node]),
                Some(by_u) => by_u * weigh(&|node| self.u[node]),
            });
        }
    }
}

/// A probe on the grid.
struct Reading {
    stencil: Vec<(usize, f64)>,
    /// Steady head, which the state's deviations are counted from.
    base: f64,
    /// `1/B` where the flow is read.
    flow_by_u: Option<f64>,
}

impl Reading {
    fn new(probe: Probe, steady: &Steady) -> Reading {
        let (segment, stencil) = steady.grid.stencil(probe.position_m());
        let base = stencil.iter().map(|&(node, weight)| weight * steady.head_m[node]).sum();
        let flow_by_u = matches!(probe, Probe::Flow(_)).then(|| 1.0 / steady.grid.segments[segment].impedance);
        Reading { stencil, base, flow_by_u }
    }
}
