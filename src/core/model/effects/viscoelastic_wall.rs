//! Creep of the pipe wall: generalised Kelvin-Voigt elements whose retarded hoop strain stores water.

use std::ops::Range;

use crate::model::contribution::{Implicit, LineTerm};
use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;
use crate::model::steady::Steady;
use crate::rig::Rig;
use crate::units::GRAVITY_M_S2;
use crate::wide::widened;

/// See the module.
pub struct ViscoelasticWall;

impl Effect for ViscoelasticWall {
    fn name(&self) -> &'static str {
        "viscoelastic-wall"
    }
    fn summary(&self) -> &'static str {
        "Kelvin-Voigt creep of the wall, one or several elements"
    }
    fn equation(&self) -> &'static str {
        "dH/dt + (a²/g) dV/dx + (2a²/g) Σ dε_k/dt = 0,  dε_k/dt = (c₁ D ρ g/(2e) J_k (H - H_steady) - ε_k)/τ_k"
    }
    fn source(&self) -> &'static str {
        "Covas et al. (2005), J. Hydraul. Res. 43(1):56-70; the strain rate is averaged over both ends of the characteristic"
    }
    fn trace(&self) -> &'static str {
        "droop on the first plateau, decay, a longer period and smooth fronts, the same at all flows"
    }
    fn elements(&self) -> Option<std::ops::RangeInclusive<usize>> {
        Some(1..=5)
    }

    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        // A wrong material in the rig file is the file's fault.
        let creeps = rig.pipes.iter().any(|p| p.material().viscoelastic);
        (!creeps).then_some("no pipe of the rig is made of a material that creeps at room temperature")
    }
    /// `J1_per_GPa, tau1_s, J2_per_GPa, tau2_s, …`, spread evenly (in ratio) around the period.
    fn parameters(&self, site: &Site, elements: usize) -> Vec<Parameter> {
        // The creep compliance in units of the wall's whole effect on the wave speed, e/(a² c₁ ρ D).
        let pipe = site.rig.pipes.iter().find(|p| p.material().viscoelastic).unwrap_or(&site.rig.pipes[0]);
        let (wave_speed, ..) = pipe.wave_speed_start(site.water);
        let unit_compliance = pipe.wall_thickness_m
            / (wave_speed.powi(2) * pipe.constraint_coefficient() * site.water.density_kg_m3 * pipe.inner_diameter_m);
        let per_gpa = unit_compliance * 1e9;
        (1..=elements)
            .flat_map(|k| {
                let place = (k as f64 - 0.5) / elements as f64;
                let tau = site.period_s * 0.03 * 60f64.powf(place);
                [
                    Parameter::log(
                        format!("J{k}_per_GPa"),
                        "1/GPa",
                        "creep compliance of the element",
                        per_gpa * 0.15 / elements as f64,
                        per_gpa * 1e-5,
                        per_gpa * 10.0,
                    )
                    .vanishing_at(0.0),
                    Parameter::log(
                        format!("tau{k}_s"),
                        "s",
                        "retardation time of the element",
                        tau,
                        site.period_s * 1e-3,
                        site.period_s * 100.0,
                    ),
                ]
            })
            .collect()
    }

    /// The same spread of retardation times, five times shorter and five times longer.
    fn other_starts(&self, elements: usize) -> Vec<Vec<f64>> {
        [0.2, 5.0].iter().map(|&by| [1.0, by].repeat(elements)).collect()
    }

    /// By retardation time.
    fn put_in_order(&self, values: &mut [f64]) {
        let mut pairs: Vec<[f64; 2]> = values.chunks_exact(2).map(|p| [p[0], p[1]]).collect();
        pairs.sort_by(|a, b| a[1].total_cmp(&b[1]));
        values.copy_from_slice(pairs.as_flattened());
    }

    fn kept_per_node(&self, elements: usize) -> usize {
        elements
    }

    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        for (k, pair) in values.chunks_exact(2).enumerate() {
            check(&format!("J{}_per_GPa", k + 1), pair[0], pair[0] >= 0.0, "zero or more")?;
            check(&format!("tau{}_s", k + 1), pair[1], pair[1] > 0.0, "more than zero")?;
        }
        let dt = steady.grid.dt_s;
        let mut kappas = Vec::new();
        let mut elements: Vec<Element> = values.chunks_exact(2).map(|p| Element::new(p[1], dt)).collect();
        for segment in &steady.grid.segments {
            // ½ B (2 A dx) ε': half of the storage flow of a reach, as a head; ε = C J h with C = c₁ D ρ g/(2e).
            let strain = segment.mean(|s| {
                f64::from(u8::from(s.creeps))
                    * s.area_m2()
                    * s.constraint
                    * s.diameter_m
                    * steady.density_kg_m3
                    * GRAVITY_M_S2
                    / (2.0 * s.wall_m)
            });
            let weight = segment.impedance * segment.reach_m * strain;
            let mut kappa = 0.0;
            for (element, pair) in elements.iter_mut().zip(values.chunks_exact(2)) {
                let per_s = weight * pair[0] * 1e-9 / pair[1];
                kappa += per_s * (1.0 - element.p1);
                element.gain.push(per_s * (element.decay * element.p1 + element.p0));
            }
            kappas.push(kappa);
        }
        for element in &mut elements {
            element.strain = vec![0.0; steady.head_m.len()];
        }
        let together = steady.grid.together(|a, b| elements.iter().all(|e| e.gain[a] == e.gain[b]));
        Ok(vec![Box::new(Creep { kappas, elements, together })])
    }
}

/// One Kelvin-Voigt element on the grid.
///
/// The exact update for `h` linear over the step is `ε⁺ = E ε + C J (p1 h⁺ + p0 h)` with `r = dt/τ`, `E = exp(-r)`, `p1
/// = 1 - (1-E)/r`, `p0 = (1-E)/r - E`. The part that is known before the next step, `w = E ε + C J p0 h`, follows `w⁺ =
/// E w + C J (E p1 + p0) h⁺`; `strain` holds `w/τ` as a head.
struct Element {
    decay: f64,
    p1: f64,
    p0: f64,
    /// `(E p1 + p0) C J/τ` of each segment, as a head per head.
    gain: Vec<f64>,
    strain: Vec<f64>,
}

impl Element {
    fn new(tau_s: f64, dt_s: f64) -> Self {
        let r = dt_s / tau_s;
        let decay = (-r).exp();
        // (1 - E)/r, by its series if the difference would lose digits.
        let mean = if r < 1e-4 { 1.0 - r / 2.0 + r * r / 6.0 } else { -(-r).exp_m1() / r };
        Element { decay, p1: 1.0 - mean, p0: mean - decay, gain: Vec::new(), strain: Vec::new() }
    }
}

struct Creep {
    kappas: Vec<f64>,
    elements: Vec<Element>,
    /// Nodes with equal gains, and a segment that they are of.
    together: Vec<(usize, Range<usize>)>,
}

impl LineTerm for Creep {
    fn is_storage_alone(&self) -> bool {
        true
    }

    fn implicit(&self, segment: usize) -> Implicit {
        Implicit { kappa: self.kappas[segment], mu: 0.0 }
    }

    fn advance(&mut self, h: &[f64], _u: &[f64], storage: &mut [f64], _momentum: &mut [f64]) {
        self.advance_storage(h, storage, false);
    }

    fn advance_storage(&mut self, h: &[f64], storage: &mut [f64], first: bool) {
        for (segment, nodes) in &self.together {
            let (h, storage) = (&h[nodes.clone()], &mut storage[nodes.clone()]);
            let mut first = first;
            // Elements two by two: half the passes over the heads.
            let mut pairs = self.elements.chunks_exact_mut(2);
            for pair in &mut pairs {
                let [one, other] = pair else { continue };
                creep_of_two(one.of(*segment, nodes), other.of(*segment, nodes), h, storage, first);
                first = false;
            }
            if let [last] = pairs.into_remainder() {
                creep_of_one(last.of(*segment, nodes), h, storage, first);
            }
        }
    }
}

// By index, as in the convolution of unsteady friction. The first of them sets the storage, which saves a pass over it.
widened! {
    over h.len();
    fn creep_of_two(a: Share, b: Share, h: &[f64], storage: &mut [f64], first: bool) {
        let m = h.len();
        let (x, y, out) = (&mut a.strain[..m], &mut b.strain[..m], &mut storage[..m]);
        for i in 0..m {
            x[i] = a.decay * x[i] + a.gain * h[i];
            y[i] = b.decay * y[i] + b.gain * h[i];
            out[i] = if first { x[i] + y[i] } else { out[i] + (x[i] + y[i]) };
        }
    }
}

widened! {
    over h.len();
    fn creep_of_one(a: Share, h: &[f64], storage: &mut [f64], first: bool) {
        let m = h.len();
        let (x, out) = (&mut a.strain[..m], &mut storage[..m]);
        for i in 0..m {
            x[i] = a.decay * x[i] + a.gain * h[i];
            out[i] = if first { x[i] } else { out[i] + x[i] };
        }
    }
}

/// One element's share of nodes with equal gains.
struct Share<'a> {
    decay: f64,
    gain: f64,
    strain: &'a mut [f64],
}

impl Element {
    fn of(&mut self, segment: usize, nodes: &Range<usize>) -> Share<'_> {
        Share { decay: self.decay, gain: self.gain[segment], strain: &mut self.strain[nodes.clone()] }
    }
}
