//! Wall friction that depends on the history of the flow: as a convolution with its past acceleration, or, as a
//! variants, from its momentary acceleration alone or from the velocity profile at every node.

use std::ops::Range;

use crate::model::chosen::Chosen;
use crate::model::contribution::{Implicit, LineTerm};
use crate::model::convolution::Convolution;
use crate::model::eddy_viscosity::EddyViscosity;
use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::grid::Segment;
use crate::model::parameter::Parameter;
use crate::model::profile::Profile;
use crate::model::scene::Site;
use crate::model::steady::Steady;
use crate::model::unsteady_kernels::{Kernel, Steps};
use crate::rig::Regime;

/// Convolution with the history of the flow; see the module.
pub struct UnsteadyFriction;

/// Friction from the momentary acceleration; see the module.
pub struct Brunone;

const CONVOLUTION: &str = "unsteady-friction";
const BRUNONE: &str = "unsteady-friction/brunone";
const QUASI_2D: &str = "unsteady-friction/quasi-2d";
/// Name of the factor on the convolution with the history of the flow.
pub const SCALE_1D: &str = "unsteady_friction_scale";
/// Name of the factor on what the velocity profile adds.
pub const SCALE_2D: &str = "quasi_2d_scale";
const ONE_LAW: &str = "both describe the same friction, which would count twice";

/// The velocity profile at every node; see [`profile`](crate::model::profile).
pub struct QuasiTwoD;

/// Number of terms that reaches down to the steps of the finest grids, about a microsecond in pipes of centimetres.
const MOST_TERMS: usize = 20;
/// The same of a profile, whose every ring has one.
const MOST_RINGS: usize = 120;

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
        &[&Brunone, &QuasiTwoD]
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[(BRUNONE, ONE_LAW), (QUASI_2D, ONE_LAW)]
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        vec![scale(SCALE_1D, "multiplies the unsteady friction; 1 is the textbook value")]
    }

    fn kept_per_node(&self, _elements: usize) -> usize {
        MOST_TERMS
    }

    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        let [scale] = *values else { return Ok(Vec::new()) };
        check(SCALE_1D, scale, scale >= 0.0, "zero or more")?;
        let memory = |segment: &Segment, flow_m3_s: f64, step: f64| {
            Kernel::of(reynolds(segment, flow_m3_s, steady.viscosity_m2_s), segment.regime()).steps(step)
        };
        Ok(vec![Box::new(Convolution::new(steady, scale, memory))])
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
        &[(CONVOLUTION, ONE_LAW), (QUASI_2D, ONE_LAW)]
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

impl Effect for QuasiTwoD {
    fn name(&self) -> &'static str {
        QUASI_2D
    }
    fn summary(&self) -> &'static str {
        "wall shear of the velocity profile at every node: the quasi-2D model"
    }
    fn equation(&self) -> &'static str {
        "dv/dt + g dH/dx = 1/r d/dr(r n ν dv/dr) in rings, v their mean V;  n = 1 if laminar, else the five regions of the flow before \
         the closure, with the wall shifted to the rig's friction; the steady profile takes the rig's f V|V|/(2D)"
    }
    fn source(&self) -> &'static str {
        "Vardy & Hwang (1991), J. Hydraul. Res. 29:669-684; Pezzinga (1999), J. Hydraul. Eng. 125:676-685; Zhao & Ghidaoui (2003), \
         J. Hydraul. Eng. 129:1007-1013; viscosity by Kita et al. (1980)"
    }
    fn trace(&self) -> &'static str {
        "that of unsteady friction, for any Reynolds number and a rough wall too"
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[(CONVOLUTION, ONE_LAW), (BRUNONE, ONE_LAW)]
    }
    fn searched(&self) -> bool {
        false
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        vec![scale(SCALE_2D, "multiplies what the profile adds to steady friction; 1 is the profile itself")]
    }

    fn kept_per_node(&self, _elements: usize) -> usize {
        MOST_RINGS
    }

    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        let [scale] = *values else { return Ok(Vec::new()) };
        check(SCALE_2D, scale, scale >= 0.0, "zero or more")?;
        // Segments of one pipe have the same rings.
        let mut last: Option<((EddyViscosity, f64), Steps)> = None;
        let memory = |segment: &Segment, flow_m3_s: f64, step: f64| {
            let own = (viscosity(segment, flow_m3_s, steady.viscosity_m2_s), step);
            if let Some((_, steps)) = last.as_ref().filter(|(known, _)| *known == own) {
                return steps.clone();
            }
            let steps = Steps::of(Profile::new(own.0, step).weights(), step);
            last.insert((own, steps)).1.clone()
        };
        Ok(vec![Box::new(Convolution::new(steady, scale, memory))])
    }
}

/// The same effects with friction from the velocity profile in place of any other unsteady friction.
pub fn in_two_dimensions(effects: &[Chosen]) -> Vec<Chosen> {
    replaced(effects, &QuasiTwoD)
}

/// The same with the convolution in place of it, which is nearly as right in one dimension.
pub fn in_one_dimension(effects: &[Chosen]) -> Vec<Chosen> {
    replaced(effects, &UnsteadyFriction)
}

/// In its place, or at the end.
fn replaced(effects: &[Chosen], friction: &'static dyn Effect) -> Vec<Chosen> {
    let mut effects = effects.to_vec();
    match effects.iter().position(|c| [CONVOLUTION, BRUNONE, QUASI_2D].contains(&c.effect.name())) {
        Some(i) => effects[i] = Chosen::of(friction),
        None => effects.push(Chosen::of(friction)),
    }
    effects
}

/// Viscosity of the flow before the closure, from what friction takes of it.
fn viscosity(segment: &Segment, flow_m3_s: f64, viscosity_m2_s: f64) -> EddyViscosity {
    if segment.regime() == Regime::Laminar {
        return EddyViscosity::LAMINAR;
    }
    let slope = segment.reach_loss_m(flow_m3_s).abs() / segment.reach_m;
    let diameter_m = segment.mean(|s| s.diameter_m);
    EddyViscosity::of_flow(reynolds(segment, flow_m3_s, viscosity_m2_s), slope, diameter_m, viscosity_m2_s)
}
