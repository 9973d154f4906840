//! The state of the line: the step of the nodes between the ends of a segment, and the readings of probes.

use crate::model::contribution::{Implicit, NodeField};
use crate::model::friction::ReachFriction;
use crate::model::grid::Segment;
use crate::model::kernel;
use crate::model::kernel::Terms;
use crate::model::late::Late;
use crate::model::steady::Steady;
use crate::model::stencil::Stencil;
use crate::model::trace::{Probe, Trace};

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
    /// Filters of the reaches that take longer than a step.
    pub(crate) late: Vec<Late>,
    pub(crate) terms: LineTerms,
    /// Half of the steady flow's loss over one reach, `½R0`, of each segment, m.
    pub(crate) steady_half_loss: Vec<f64>,
    /// `κ` and `μ` of each segment.
    pub(crate) implicit: Vec<Implicit>,
    /// Friction of each segment's reach for `w = 2u`, divided by its `1 + μ`.
    pub(crate) frictions: Vec<ReachFriction>,
}

/// What the nodes between the ends of segments keep beside their waves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LineTerms {
    /// No line terms, and no flow to read: nothing. Heads are read from the waves.
    None,
    /// Terms of storage, and no flow to read: heads.
    Storage,
    /// Heads and flows.
    All,
}

impl State {
    /// Delays the waves in late reaches.
    #[inline(always)]
    pub(crate) fn pass_late(&mut self) {
        for late in &mut self.late {
            late.pass(&mut self.fwd, &mut self.bwd);
        }
    }

    /// The new waves become the old ones, without a call.
    #[inline(always)]
    pub(crate) fn turn(&mut self) {
        let (fwd, bwd) = (std::mem::take(&mut self.fwd), std::mem::take(&mut self.bwd));
        self.fwd = std::mem::replace(&mut self.new_fwd, fwd);
        self.bwd = std::mem::replace(&mut self.new_bwd, bwd);
    }

    /// Steps the nodes of a segment between its ends.
    #[inline(always)]
    pub(crate) fn interior(&mut self, segment: usize, nodes: std::ops::Range<usize>) {
        let friction = &self.frictions[segment];
        let steady_loss = 2.0 * self.steady_half_loss[segment];
        let (fwd, bwd) = (&self.fwd[nodes.clone()], &self.bwd[nodes.clone()]);
        let (new_fwd, new_bwd) = (&mut self.new_fwd[nodes.clone()], &mut self.new_bwd[nodes.clone()]);
        let Implicit { kappa, mu } = self.implicit[segment];
        match self.terms {
            LineTerms::None => {
                return match friction {
                    ReachFriction::Quadratic(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_loss),
                    ReachFriction::Linear(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_loss),
                    ReachFriction::Tabulated(f) => kernel::elastic(fwd, bwd, new_fwd, new_bwd, f, steady_loss),
                };
            }
            LineTerms::Storage => {
                let (storage, h) = (&self.storage[nodes.clone()], &mut self.h[nodes]);
                let known = (storage, kappa, steady_loss);
                return match friction {
                    ReachFriction::Quadratic(f) => kernel::with_storage(fwd, bwd, new_fwd, new_bwd, h, known, f),
                    ReachFriction::Linear(f) => kernel::with_storage(fwd, bwd, new_fwd, new_bwd, h, known, f),
                    ReachFriction::Tabulated(f) => kernel::with_storage(fwd, bwd, new_fwd, new_bwd, h, known, f),
                };
            }
            LineTerms::All => {}
        }
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
    #[inline(always)]
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

    /// Appends what each probe reads now; by index, for adapters of iterators would be calls, as `swap` in
    /// [`State::turn`].
    #[inline(always)]
    pub(crate) fn read(&self, traces: &mut [Trace], readings: &[Reading]) {
        for i in 0..traces.len().min(readings.len()) {
            let (trace, Reading { stencil, of }) = (&mut traces[i], &readings[i]);
            trace.values.push(match of {
                Quantity::Head(steady_m) if self.terms == LineTerms::None => {
                    stencil.read(|node| steady_m[node] + 0.5 * (self.fwd[node] + self.bwd[node]))
                }
                Quantity::Head(steady_m) => stencil.read(|node| steady_m[node] + self.h[node]),
                Quantity::Flow { by_u } => by_u * stencil.read(|node| self.u[node]),
            });
        }
    }
}

/// A probe on the grid.
pub(crate) struct Reading<'a> {
    stencil: Stencil,
    of: Quantity<'a>,
}

/// What it reads.
enum Quantity<'a> {
    /// Heads, which the state counts from those of the steady flow.
    Head(&'a [f64]),
    /// Flow, `1/B` times the state's.
    Flow { by_u: f64 },
}

impl<'a> Reading<'a> {
    pub(crate) fn new(probe: Probe, steady: &'a Steady) -> Reading<'a> {
        let stencil = steady.grid.stencil(probe.place());
        let of = match probe {
            Probe::Head(_) => Quantity::Head(&steady.head_m),
            Probe::Flow(_) => Quantity::Flow { by_u: 1.0 / steady.grid.segments[stencil.segment].impedance },
        };
        Reading { stencil, of }
    }
}
