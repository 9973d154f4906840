//! The mouth of the pipe at the supply: what is lost where water enters or leaves as a jet, and the inertia of the
//! water that moves outside the pipe.

use crate::model::effect::{Attachment, Effect, Element, Place, check};
use crate::model::error::ModelError;
use crate::model::fitted::theta;
use crate::model::node::HeadLoss;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site};
use crate::rig::{Rig, Upstream};
use crate::units::GRAVITY_M_S2;

/// See the module.
///
/// Heads are piezometric, so a flow that enters loses its own velocity head and what the inlet takes, `K = 1 + K_inlet`
/// (1.5 for a sharp edge flush with the wall). A flow that leaves gives its velocity head to the jet: all of it is
/// lost, and `jet_ratio` counts only what a fitting takes beyond that, 0 for an open end.
///
/// In a network the rig's head of the reservoir is taken for that in the mouth before the closure.
pub struct InletJet;

impl Effect for InletJet {
    fn name(&self) -> &'static str {
        "inlet-jet"
    }
    fn summary(&self) -> &'static str {
        "losses and inertia of the water that enters the pipe at the supply, or leaves it as a jet"
    }
    fn equation(&self) -> &'static str {
        "H_supply - H(0,t) = K V|V|/(2g) + (l/g) dV/dt where V > 0 (into the pipe), r K V|V|/(2g) + (l/g) dV/dt where V < 0"
    }
    fn source(&self) -> &'static str {
        "a jet in the reservoir: Cao, Nistor & Mohareb (2020), J. Hydraul. Eng. 146; here the momentum balance of the water \
         outside with the losses of Contractor (1965), J. Basic Eng. 87(2):445-451; Idelchik (1994), Handbook of Hydraulic Resistance, \
         ch. 3 and 11"
    }
    fn trace(&self) -> &'static str {
        "every reflection at the supply weakens with the square of the flow and comes back rounded and slightly late; the mean head ends \
         higher by what the steady flow lost"
    }

    fn remedy(&self, _place: Option<&str>, _sensor: Option<&str>) -> Option<String> {
        Some("look for what narrows the pipe's inlet: a strainer, a half-open valve, a fitting; open it and repeat the test".to_owned())
    }
    fn at_supply(&self) -> bool {
        true
    }
    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        let supply = &rig.graph.nodes[rig.graph.supply()];
        if !supply.kind.holds_given_head() {
            return Some("no reservoir feeds the rig: the head of its tank or pump follows from its own law");
        }
        (rig.upstream == Upstream::Measured)
            .then_some("the head that drives the model is measured in the pipe, behind its inlet")
    }

    /// A half-open fitting, and a jet of one diameter.
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let pipe = &site.rig.pipes[site.rig.way().next().unwrap_or(0)];
        let (diameter_m, length_m) = (pipe.inner_diameter_m, site.rig.length_m());
        vec![
            Parameter::log(
                "inlet_K",
                "1",
                "head that entering water loses, in velocity heads of the pipe",
                30.0,
                0.03,
                1e6,
            )
            .vanishing_at(0.0),
            Parameter::linear(
                "jet_ratio",
                "1",
                "head that leaving water loses beyond its velocity head, over that of the same flow entering",
                0.5,
                0.0,
                2.0,
            ),
            Parameter::log(
                "jet_length_m",
                "m",
                "length of pipe that holds as much water as moves outside",
                diameter_m,
                0.01 * diameter_m,
                (0.1 * length_m).max(diameter_m),
            )
            .vanishing_at(0.0),
        ]
    }

    /// More than the inlet's loss, so that it shows where flows are slow.
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![10.0, 1.0, 1.0], vec![1.0, 1.0, 10.0]]
    }

    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let [loss, ratio, length_m] = *values else { return Ok(Vec::new()) };
        check("inlet_K", loss, loss >= 0.0, "zero or more")?;
        check("jet_ratio", ratio, ratio >= 0.0, "zero or more")?;
        check("jet_length_m", length_m, length_m >= 0.0, "zero or more")?;
        if loss == 0.0 && length_m == 0.0 {
            return Ok(Vec::new());
        }
        Ok(vec![Attachment {
            place: Place::Supply,
            make: Box::new(move |spot| {
                let enters = loss / (2.0 * GRAVITY_M_S2 * spot.area_m2 * spot.area_m2);
                Element::Drop(Box::new(Mouth {
                    enters,
                    leaves: ratio * enters,
                    inertance: Inertance::new(length_m, spot.wave_speed_m_s, spot.area_m2, scene.dt_s),
                }))
            }),
        }])
    }
}

/// `φ = I dQ/dt` from step to step: `θ φ⁺ + (1 - θ) φ = I (Q⁺ - Q)/dt`, `θ` fitted ([`theta`]) to `dt z/I`.
///
/// The step is exact for a flow that a wave drives through the inertance and the pipe's own impedance `z` while the
/// wave is linear over the step. An inertance that is short beside the step does not ring, as it would by the
/// trapezoidal rule; `θ ≥ 1/2` adds no energy, and the order is 2.
#[derive(Debug, Clone, Copy)]
struct Inertance {
    /// `I/(θ dt)`, s/m².
    by_flow: f64,
    /// `(1 - θ)/θ`.
    by_last: f64,
    flow_m3_s: f64,
    drop_m: f64,
}

impl Inertance {
    /// Of water in a length of pipe.
    fn new(length_m: f64, wave_speed_m_s: f64, area_m2: f64, dt_s: f64) -> Inertance {
        let r = dt_s * wave_speed_m_s / length_m;
        let theta = theta(r);
        Inertance {
            by_flow: length_m / (GRAVITY_M_S2 * area_m2 * theta * dt_s),
            by_last: (1.0 - theta) / theta,
            flow_m3_s: 0.0,
            drop_m: 0.0,
        }
    }

    fn drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        (self.by_flow * (flow_m3_s - self.flow_m3_s) - self.by_last * self.drop_m, self.by_flow)
    }
}

/// From the pipe into the supply: a flow that leaves counts as positive.
struct Mouth {
    /// Loss over the square of a flow that enters the pipe, s²/m⁵.
    enters: f64,
    /// The same of one that leaves.
    leaves: f64,
    inertance: Inertance,
}

impl HeadLoss for Mouth {
    fn settle(&mut self, flow_m3_s: f64) -> f64 {
        (self.inertance.flow_m3_s, self.inertance.drop_m) = (flow_m3_s, 0.0);
        self.steady_drop_m(flow_m3_s).0
    }
    fn drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        let (lost_m, slope) = self.steady_drop_m(flow_m3_s);
        let (inertial_m, by_flow) = self.inertance.drop_m(flow_m3_s);
        (lost_m + inertial_m, slope + by_flow)
    }
    fn steady_drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        let k = if flow_m3_s < 0.0 { self.enters } else { self.leaves };
        (k * flow_m3_s * flow_m3_s.abs(), 2.0 * k * flow_m3_s.abs())
    }
    fn advance(&mut self, flow_m3_s: f64) {
        let drop_m = self.inertance.drop_m(flow_m3_s).0;
        (self.inertance.flow_m3_s, self.inertance.drop_m) = (flow_m3_s, drop_m);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A front `e` behind the impedance `z`: `z Q + I dQ/dt = e` has `Q = e/z (1 - exp(-z t/I))`, whatever the step.
    #[test]
    fn a_front_passes_the_inertance_as_an_exponential() {
        let (wave_speed_m_s, area_m2, e) = (1200.0, 3e-4, 7.0);
        let z = wave_speed_m_s / (GRAVITY_M_S2 * area_m2);
        for (length_m, dt_s) in [(0.5, 1e-5), (0.5, 1e-4), (0.5, 1e-3), (1e-3, 1e-3)] {
            let mut water = Inertance::new(length_m, wave_speed_m_s, area_m2, dt_s);
            // At the front itself all of the head is taken by the inertance.
            water.drop_m = e;
            let mut last = 0.0;
            for i in 1..200 {
                // z Q + φ(Q) = e, linear in Q.
                let (at_rest, slope) = water.drop_m(0.0);
                let flow = (e - at_rest) / (z + slope);
                let exact = -e / z * (-wave_speed_m_s / length_m * f64::from(i) * dt_s).exp_m1();
                assert!((flow - exact).abs() < 1e-12 * e / z, "{length_m} {dt_s} {i}: {flow} {exact}");
                assert!(flow >= last - 1e-12 * e / z, "it rings");
                (water.flow_m3_s, water.drop_m, last) = (flow, water.drop_m(flow).0, flow);
            }
        }
    }

    #[test]
    fn its_slope_is_that_of_its_drop() {
        let mut mouth = Mouth { enters: 3e6, leaves: 1e6, inertance: Inertance::new(0.2, 400.0, 3e-4, 1e-3) };
        assert_eq!(mouth.settle(-2e-3), -12.0);
        for flow in [-2e-3, -1e-4, 1e-4, 3e-3] {
            let (at, slope) = mouth.drop_m(flow);
            let numeric = (mouth.drop_m(flow + 1e-9).0 - at) / 1e-9;
            assert!((numeric / slope - 1.0).abs() < 1e-4, "{flow}: {numeric} {slope}");
        }
    }
}
