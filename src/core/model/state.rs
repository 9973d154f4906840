//! The state of the line: the step of the nodes between the ends of a segment, and the readings of probes.

use crate::model::contribution::{Implicit, NodeField};
use crate::model::friction::ReachFriction;
use crate::model::grid::{Segment, Stencil};
use crate::model::kernel;
use crate::model::kernel::Terms;
use crate::model::steady::Steady;
use crate::model::trace::{Probe, Trace, between};

/// State of the line: waves, head deviations and scaled flows `u = B Q` at all nodes, segment after segment.
pub(crate) struct State {
    pub(crate) fwd: Vec<f64>,
    pub(crate) bwd: Vec<f64>,
    pub(crate) new_fwd: Vec<f64>,
    pub(crate) new_bwd: Vec<f64>,
    pub(crate) h: Vec<f64>,
    pub(crate) u: Vec<f64>,
    pub(crate) storage: Vec<f64>,
    pub(crate) momentum: Vec<f64>,
    /// Outflow of each node where there is a node field, m³/s.
    pub(crate) outflow: Vec<f64>,
    pub(crate) scratch: Vec<f64>,
    /// No line terms and no flow to read: heads of interior nodes are not stored but read from the waves.
    pub(crate) elastic: bool,
    /// Half of the steady flow's loss over one reach, `½R0`, of each segment, m.
    pub(crate) steady_half_loss: Vec<f64>,
    /// `κ` and `μ` of each segment.
    pub(crate) implicit: Vec<Implicit>,
    /// Friction of each segment's reach for `w = 2u`, divided by its `1 + μ`.
    pub(crate) frictions: Vec<ReachFriction>,
}

impl State {
    /// Steps the nodes of a segment between its ends.
    #[inline]
    pub(crate) fn interior(&mut self, segment: usize, nodes: std::ops::Range<usize>) {
        let friction = &self.frictions[segment];
        let steady_loss = 2.0 * self.steady_half_loss[segment];
        let (fwd, bwd) = (&self.fwd[nodes.clone()], &self.bwd[nodes.clone()]);
        let (new_fwd, new_bwd) = (&mut self.new_fwd[nodes.clone()], &mut self.new_bwd[nodes.clone()]);
        if self.elastic {
            match friction {
                ReachFriction::Quadratic(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_loss),
                ReachFriction::Linear(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_loss),
                ReachFriction::Tabulated(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_loss),
            }
            return;
        }
        let Implicit { kappa, mu } = self.implicit[segment];
        let terms = Terms {
            storage: &self.storage[nodes.clone()],
            kappa,
            momentum: &self.momentum[nodes.clone()],
            mu,
            steady_loss,
        };
        let (h, u) = (&mut self.h[nodes.clone()], &mut self.u[nodes]);
        match friction {
            ReachFriction::Linear(f) => kernel::with_terms(fwd, bwd, new_fwd, new_bwd, h, u, &terms, f),
            ReachFriction::Quadratic(f) => kernel::with_terms(fwd, bwd, new_fwd, new_bwd, h, u, &terms, f),
            ReachFriction::Tabulated(f) => kernel::with_terms(fwd, bwd, new_fwd, new_bwd, h, u, &terms, f),
        }
    }

    /// The same with water taken out of every node. The head equation sees half of the outflow as `½ (1 + μ) B q`.
    pub(crate) fn interior_with(&mut self, field: &mut dyn NodeField, s: usize, segment: &Segment) {
        let nodes = segment.nodes();
        let inner = nodes.start + 1..nodes.end - 1;
        let Implicit { kappa, mu } = self.implicit[s];
        let half_b = 0.5 * segment.impedance;
        let (fwd, bwd) = (&self.fwd[nodes.clone()], &self.bwd[nodes.clone()]);
        let mean = &mut self.scratch[inner.clone()];
        kernel::mean_arriving(fwd, bwd, &self.storage[nodes.clone()], mean);
        let (h, outflow) = (&mut self.h[inner.clone()], &mut self.outflow[inner]);
        field.inner(s, 1.0 + kappa, (1.0 + mu) * half_b, mean, h, outflow);
        let terms = Terms {
            storage: &self.storage[nodes.clone()],
            kappa,
            momentum: &self.momentum[nodes.clone()],
            mu,
            steady_loss: 2.0 * self.steady_half_loss[s],
        };
        let (h, q, u) = (&self.h[nodes.clone()], &self.outflow[nodes.clone()], &mut self.u[nodes.clone()]);
        let (new_fwd, new_bwd) = (&mut self.new_fwd[nodes.clone()], &mut self.new_bwd[nodes]);
        match &self.frictions[s] {
            ReachFriction::Linear(f) => kernel::with_outflow(fwd, bwd, new_fwd, new_bwd, h, q, u, half_b, &terms, f),
            ReachFriction::Quadratic(f) => kernel::with_outflow(fwd, bwd, new_fwd, new_bwd, h, q, u, half_b, &terms, f),
            ReachFriction::Tabulated(f) => kernel::with_outflow(fwd, bwd, new_fwd, new_bwd, h, q, u, half_b, &terms, f),
        }
    }

    /// Appends what each probe reads now.
    #[inline]
    pub(crate) fn read(&self, traces: &mut [Trace], readings: &[Reading]) {
        for (trace, reading) in traces.iter_mut().zip(readings) {
            trace.values.push(match reading.flow_by_u {
                None if self.elastic => reading.weigh(|node| 0.5 * (self.fwd[node] + self.bwd[node])),
                None => reading.weigh(|node| self.h[node]),
                Some(by_u) => by_u * reading.weigh(|node| self.u[node]),
            });
        }
    }
}

/// A node that a probe reads.
#[derive(Clone, Copy)]
struct Read {
    node: usize,
    weight: f64,
    /// What the state's value there is counted from: the steady head, or no flow.
    base: f64,
}

/// A probe on the grid.
pub(crate) struct Reading {
    stencil: Vec<Read>,
    /// The two of them between which the probe lies.
    around: [Read; 2],
    /// `1/B` where the flow is read.
    flow_by_u: Option<f64>,
}

impl Reading {
    pub(crate) fn new(probe: Probe, steady: &Steady) -> Reading {
        let Stencil { segment, weights, around } = steady.grid.stencil(probe.position_m());
        let flow_by_u = matches!(probe, Probe::Flow(_)).then(|| 1.0 / steady.grid.segments[segment].impedance);
        let base = |node: usize| if flow_by_u.is_some() { 0.0 } else { steady.head_m[node] };
        let read = |node: usize, weight: f64| Read { node, weight, base: base(node) };
        Reading {
            stencil: weights.into_iter().map(|(node, weight)| read(node, weight)).collect(),
            around: around.map(|node| read(node, 1.0)),
            flow_by_u,
        }
    }

    /// What the stencil makes of the values at its nodes, within the range of the two around the probe: a front that passes does not overshoot.
    #[inline]
    fn weigh(&self, of: impl Fn(usize) -> f64) -> f64 {
        let value = |read: &Read| read.base + of(read.node);
        if let [one] = &self.stencil[..] {
            return value(one);
        }
        let sum = self.stencil.iter().map(|read| read.weight * value(read)).sum();
        between(sum, value(&self.around[0]), value(&self.around[1]))
    }
}
