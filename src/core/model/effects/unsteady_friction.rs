//! Wall friction that depends on the history of the flow: as a convolution with its past acceleration, or, as a
//! variant, from its momentary acceleration alone.

use std::ops::Range;

use crate::model::contribution::{Implicit, LineTerm};
use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::grid::Segment;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;
use crate::model::steady::Steady;
use crate::model::unsteady_kernels::Kernel;
use crate::rig::Regime;
use crate::units::GRAVITY_M_S2;
use crate::wide::widened;

/// Convolution with the history of the flow; see the module.
pub struct UnsteadyFriction;

/// Friction from the momentary acceleration; see the module.
pub struct Brunone;

const CONVOLUTION: &str = "unsteady-friction";
const BRUNONE: &str = "unsteady-friction/brunone";
const ONE_LAW: &str = "both describe the same friction, which would count twice";

/// Uncertainty of the textbook's strength: the scatter of published tests.
const SCALE_DEVIATION: f64 = 0.3;

/// A factor on the textbook's friction.
fn scale(name: &str, about: &'static str) -> Parameter {
    Parameter::linear(name, "1", about, 1.0, 0.0, 4.0).with_prior(1.0, SCALE_DEVIATION).vanishing_at(0.0)
}

/// Reynolds number of the flow before the closure.
fn reynolds(segment: &Segment, flow_m3_s: f64, viscosity_m2_s: f64) -> f64 {
    segment.mean(|s| s.diameter_m / s.area_m2()) * flow_m3_s.abs() / viscosity_m2_s
}

impl Effect for UnsteadyFriction {
    fn name(&self) -> &'static str {
        CONVOLUTION
    }
    fn summary(&self) -> &'static str {
        "wall shear that depends on the flow's history"
    }
    fn equation(&self) -> &'static str {
        "dV/dt + g dH/dx + f V|V|/(2D) + (16ν/D²) ∫ W(t-s) V'(s) ds = 0;  Re < 2320: W = Σ exp(-j²θ) over the zeros of J₂, θ = 4νt/D²; \
         above: W = exp(-B*θ)/(2√(πθ)), B* = Re^κ/12.86, κ = log10(15.29/Re^0.0567)"
    }
    fn source(&self) -> &'static str {
        "Zielke (1968), J. Basic Eng. 90:109-115; Vardy & Brown (2003), J. Sound Vib. 259:1011-1036; sums of exponentials by Kagawa et al. \
         (1983) and Vitkovsky et al. (2004), carried on to short times"
    }
    fn trace(&self) -> &'static str {
        "decay faster than steady friction's, fronts rounded as √t and slightly late; weaker at high Reynolds numbers"
    }
    fn variants(&self) -> &'static [&'static dyn Effect] {
        &[&Brunone]
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[(BRUNONE, ONE_LAW)]
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        vec![scale("unsteady_friction_scale", "multiplies the unsteady friction; 1 is the textbook value")]
    }

    fn kept_per_node(&self, _elements: usize) -> usize {
        MOST_TERMS
    }

    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        let [scale] = *values else { return Ok(Vec::new()) };
        check("unsteady_friction_scale", scale, scale >= 0.0, "zero or more")?;
        let segments = steady.grid.segments.iter().zip(&steady.flow_m3_s);
        let segments: Vec<Decays> =
            segments.map(|(segment, &flow)| Decays::new(segment, flow, scale, steady)).collect();
        let together = steady.grid.together(|a, b| segments[a] == segments[b]);
        let memories = together.into_iter().map(|(segment, nodes)| Memory::of(&segments, segment, nodes)).collect();
        Ok(vec![Box::new(Convolution { segments, memories })])
    }
}

/// Number of terms that reaches down to the steps of the finest grids, about a microsecond in pipes of centimetres.
const MOST_TERMS: usize = 20;
/// Nodes per block: one pass over a block keeps its sums and flows in registers.
const BLOCK: usize = 8;

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
    fn new(segment: &Segment, flow_m3_s: f64, scale: f64, steady: &Steady) -> Self {
        let viscosity = steady.viscosity_m2_s;
        let by_diffusion_s = 4.0 * viscosity / segment.mean(|s| s.diameter_m).powi(2);
        let kernel = Kernel::of(reynolds(segment, flow_m3_s, viscosity), segment.regime());
        let steps = kernel.steps(by_diffusion_s * steady.grid.dt_s);
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

struct Convolution {
    segments: Vec<Decays>,
    memories: Vec<Memory>,
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

impl Effect for Brunone {
    fn name(&self) -> &'static str {
        BRUNONE
    }
    fn summary(&self) -> &'static str {
        "wall shear by the momentary acceleration: cheaper than the history, right for one closure at the end of one pipe"
    }
    fn equation(&self) -> &'static str {
        "dV/dt + g dH/dx + f V|V|/(2D) + k (dV/dt + a sign(V) |dV/dx|) = 0;  k = √C*/2, C* = 0.00476 for Re < 2320, \
         7.41/Re^log10(14.3/Re^0.05) above"
    }
    fn source(&self) -> &'static str {
        "Brunone et al. (1991, 1995); sign by Vitkovsky (1998), Bergant et al. (2001), J. Hydraul. Res. 39:249-257; C* by Vardy & Brown (1996)"
    }
    fn trace(&self) -> &'static str {
        "decay and a slightly longer period; the first rise stays Joukowsky's, fronts keep their shape"
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[(CONVOLUTION, ONE_LAW)]
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        vec![scale("brunone_scale", "multiplies Brunone's coefficient k; 1 is that of Vardy's shear decay")]
    }

    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        let [scale] = *values else { return Ok(Vec::new()) };
        check("brunone_scale", scale, (0.0..=MOST_BRUNONE_SCALE).contains(&scale), "from 0 to 20")?;
        let half = |(segment, flow): (&Segment, &f64)| {
            let k = brunone_coefficient(reynolds(segment, *flow, steady.viscosity_m2_s), segment.regime());
            Inertia { mu: 0.5 * scale * k, steady_u: segment.impedance * flow, nodes: segment.nodes() }
        };
        let segments = steady.grid.segments.iter().zip(&steady.flow_m3_s).map(half).collect();
        Ok(vec![Box::new(Acceleration { segments })])
    }
}

/// Beyond this, `k` is no longer a small share of the inertia and the equation is meaningless.
const MOST_BRUNONE_SCALE: f64 = 20.0;

/// Brunone's `k` from Vardy's shear decay coefficient.
fn brunone_coefficient(reynolds: f64, regime: Regime) -> f64 {
    let shear_decay = match regime {
        Regime::Laminar => 0.00476,
        Regime::Turbulent => 7.41 / reynolds.powf((14.3 / reynolds.powf(0.05)).log10()),
    };
    0.5 * shear_decay.sqrt()
}

/// Brunone's term with Vítkovský's sign.
///
/// `dt (dV/dt + a s |dV/dx|)`, `s = sign V`, is the change of `V` along one of the two arriving characteristics: `V_P -
/// min(V_A, V_B)` for `s > 0`, `V_P - max(V_A, V_B)` for `s < 0`. In this form it vanishes to rounding for a wave that
/// slows the flow, however steep, and a front keeps its height over any number of reaches; differences taken at other
/// places cancel only in theory. At rest it is any value in between, like dry friction, so no sign chatters there.
struct Acceleration {
    segments: Vec<Inertia>,
}

/// Its coefficient in a segment.
struct Inertia {
    /// `½k`.
    mu: f64,
    /// `u` before the closure.
    steady_u: f64,
    nodes: Range<usize>,
}

impl Acceleration {
    /// `d` from the neighbours' `u` and the `u` that the node will have without the term.
    #[inline(always)]
    fn known(mu: f64, before: f64, after: f64, next_u: f64) -> f64 {
        (-next_u).max(mu * before.min(after)).min(mu * before.max(after))
    }
}

impl LineTerm for Acceleration {
    fn implicit(&self, segment: usize) -> Implicit {
        Implicit { kappa: 0.0, mu: self.segments[segment].mu }
    }

    fn known(&self, segment: usize, _storage: &mut [f64], momentum: &mut [f64]) {
        let Inertia { mu, steady_u, .. } = self.segments[segment];
        momentum.iter_mut().for_each(|d| *d += mu * steady_u);
    }

    fn advance(&mut self, h: &[f64], u: &[f64], _storage: &mut [f64], momentum: &mut [f64]) {
        for Inertia { mu, nodes, .. } in &self.segments {
            let (h, u, momentum) = (&h[nodes.clone()], &u[nodes.clone()], &mut momentum[nodes.clone()]);
            let (Some(inner), [first, .., last]) = (u.len().checked_sub(2), &mut *momentum) else { continue };
            // Beyond a segment's ends the flow is that at the ends.
            *first += Self::known(*mu, u[0], u[1], u[0]);
            *last += Self::known(*mu, u[inner], u[inner + 1], u[inner + 1]);
            let (u_before, u_after) = (&u[..inner], &u[2..][..inner]);
            let (h_before, h_after) = (&h[..inner], &h[2..][..inner]);
            let out = &mut momentum[1..][..inner];
            for i in 0..inner {
                let next_u = 0.5 * (u_before[i] + u_after[i] + h_before[i] - h_after[i]);
                out[i] += Self::known(*mu, u_before[i], u_after[i], next_u);
            }
        }
    }
}
