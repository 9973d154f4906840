//! Friction with a memory: the convolution of a weighting function, a sum of exponentials, with the past acceleration
//! of the flow at every node.

use std::ops::Range;

use crate::model::contribution::{Implicit, LineTerm};
use crate::model::grid::Segment;
use crate::model::steady::Steady;
use crate::model::unsteady_kernels::Steps;
use crate::units::GRAVITY_M_S2;
use crate::wide::widened;

/// Nodes per block: one pass over a block keeps its sums and flows in registers.
const BLOCK: usize = 16;

/// How the nodes of a segment remember.
///
/// With `u` linear over a step, `y⁺ = E y + M (u⁺ - u)` is exact for each exponential; `E` and `M` are its decay and
/// mean. The state is `x = M u - E y`, the part that is known before the next step: `y⁺ = M u⁺ - x`, `x⁺ = E x + M (1 -
/// E) u⁺`. The new flow enters implicitly; explicitly, the error would fall only as the root of the step.
#[derive(PartialEq)]
struct Decays {
    /// `c Σ M`, where `c Σ y` is the head that the term takes over half a reach.
    mu: f64,
    /// The part of `mu` from exponentials that do not outlast a step.
    forgotten: f64,
    /// `E` and `c M (1 - E)` of each exponential.
    terms: Vec<(f64, f64)>,
    /// `c x` before the closure.
    steady: Vec<f64>,
    /// `u` before the closure.
    steady_u: f64,
}

/// The memory of nodes that remember alike.
struct Memory {
    /// A segment that they are of.
    segment: usize,
    nodes: Range<usize>,
    /// `c x`: blocks of nodes, in each block one exponential after the other.
    states: Vec<[f64; BLOCK]>,
}

impl Decays {
    fn new(segment: &Segment, flow_m3_s: f64, scale: f64, viscosity: f64, steps: &Steps) -> Self {
        // ½ dx (16ν/D²)/g of velocity, for u = B Q.
        let by_area = segment.mean(|s| 1.0 / (s.area_m2() * s.diameter_m * s.diameter_m));
        let c = scale * 8.0 * viscosity * by_area * segment.reach_m / (GRAVITY_M_S2 * segment.impedance);
        let steady_u = segment.impedance * flow_m3_s;
        Decays {
            mu: c * steps.first_mean(),
            forgotten: c * steps.forgotten,
            terms: steps.remembered.iter().map(|term| (term.decay, c * term.mean * (1.0 - term.decay))).collect(),
            steady: steps.remembered.iter().map(|term| c * term.mean * steady_u).collect(),
            steady_u,
        }
    }
}

impl Memory {
    fn of(segments: &[Decays], segment: usize, nodes: Range<usize>) -> Self {
        let rest: Vec<[f64; BLOCK]> = segments[segment].steady.iter().map(|&x| [x; BLOCK]).collect();
        let states = rest.repeat(nodes.len().div_ceil(BLOCK));
        Memory { segment, nodes, states }
    }

    /// One block: takes its new flows and adds the known part of the next step. Loops by index: adapters of iterators
    /// are functions of their own, which a build in many units leaves as calls, ten times slower.
    #[inline(always)]
    fn advance(
        terms: &[(f64, f64)],
        forgotten: f64,
        states: &mut [[f64; BLOCK]],
        u: &[f64; BLOCK],
        momentum: &mut [f64; BLOCK],
    ) {
        let mut known = [0.0; BLOCK];
        for i in 0..BLOCK {
            known[i] = forgotten * u[i];
        }
        for k in 0..terms.len().min(states.len()) {
            let ((decay, gain), state) = (terms[k], &mut states[k]);
            for i in 0..BLOCK {
                state[i] = decay * state[i] + gain * u[i];
                known[i] += state[i];
            }
        }
        for i in 0..BLOCK {
            momentum[i] += known[i];
        }
    }
}

widened! {
    over u.len();
    fn advance_blocks(terms: &[(f64, f64)], forgotten: f64, states: &mut [[f64; BLOCK]], u: &[f64], momentum: &mut [f64]) {
        let (whole_u, last_u) = u.as_chunks::<BLOCK>();
        let (whole_d, last_d) = momentum.as_chunks_mut::<BLOCK>();
        let count = terms.len();
        for i in 0..whole_u.len().min(whole_d.len()) {
            Memory::advance(terms, forgotten, &mut states[i * count..][..count], &whole_u[i], &mut whole_d[i]);
        }
        if !last_u.is_empty() {
            let (mut padded_u, mut padded_d) = ([0.0; BLOCK], [0.0; BLOCK]);
            padded_u[..last_u.len()].copy_from_slice(last_u);
            padded_d[..last_d.len()].copy_from_slice(last_d);
            Memory::advance(terms, forgotten, &mut states[whole_u.len() * count..], &padded_u, &mut padded_d);
            last_d.copy_from_slice(&padded_d[..last_d.len()]);
        }
    }
}

/// The term `(16ν/D²) ∫ W(t-s) V'(s) ds`, times a scale.
pub(crate) struct Convolution {
    segments: Vec<Decays>,
    memories: Vec<Memory>,
}

impl Convolution {
    /// `memory` gives the weighting function of a segment that carries so much flow (m³/s), over a step in units of its
    /// diffusion time `D²/(4ν)`.
    pub(crate) fn new(steady: &Steady, scale: f64, mut memory: impl FnMut(&Segment, f64, f64) -> Steps) -> Self {
        let viscosity = steady.viscosity_m2_s;
        let decays = |(segment, &flow_m3_s): (&Segment, &f64)| {
            let step = steady.grid.dt_s * 4.0 * viscosity / segment.mean(|s| s.diameter_m).powi(2);
            Decays::new(segment, flow_m3_s, scale, viscosity, &memory(segment, flow_m3_s, step))
        };
        let segments: Vec<Decays> = steady.grid.segments.iter().zip(&steady.flow_m3_s).map(decays).collect();
        let together = steady.grid.together(|a, b| segments[a] == segments[b]);
        let memories = together.into_iter().map(|(segment, nodes)| Memory::of(&segments, segment, nodes)).collect();
        Convolution { segments, memories }
    }
}

impl LineTerm for Convolution {
    fn implicit(&self, segment: usize) -> Implicit {
        Implicit { kappa: 0.0, mu: self.segments[segment].mu }
    }

    fn known(&self, segment: usize, _storage: &mut [f64], momentum: &mut [f64]) {
        let decays = &self.segments[segment];
        momentum.iter_mut().for_each(|d| *d += decays.mu * decays.steady_u);
    }

    fn advance(&mut self, _h: &[f64], u: &[f64], _storage: &mut [f64], momentum: &mut [f64]) {
        for Memory { segment, nodes, states } in &mut self.memories {
            let Decays { terms, forgotten, .. } = &self.segments[*segment];
            advance_blocks(terms, *forgotten, states, &u[nodes.clone()], &mut momentum[nodes.clone()]);
        }
    }
}
