//! A leak: an orifice in the wall that lets water out to the atmosphere.
//!
//! `Q = Cd A √(2g (H - z))` above atmospheric pressure. Below it the orifice would draw air, which this model does not
//! follow: nothing flows. The strength `Cd A` is a property of the hole and the same in every run. The flow before the
//! closure follows from the steady head at the leak, `Q = leak_cda_mm2·1e-6 √(2g (H(x) - z(x)))`: 1 mm² at 20 m of
//! pressure loses 0.0198 L/s.

use crate::model::effect::{Attachment, Effect, Element, Place, check};
use crate::model::error::ModelError;
use crate::model::node::Shunt;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site};
use crate::units::GRAVITY_M_S2;

/// See the module.
pub struct Leak;

impl Effect for Leak {
    fn name(&self) -> &'static str {
        "leak"
    }
    fn summary(&self) -> &'static str {
        "an orifice in the wall at an unknown place"
    }
    fn equation(&self) -> &'static str {
        "Q_leak = Cd A √(2g (H - z)) for H > z, else 0, taken out at one place"
    }
    fn source(&self) -> &'static str {
        "Torricelli's orifice; Wylie & Streeter (1993), Fluid Transients in Systems; Liggett & Chen (1994), J. Hydraul. Eng. 120(8):934-955"
    }
    fn trace(&self) -> &'static str {
        "a falling step when its reflection arrives, all modes damped, the mean sags"
    }

    fn remedy(&self, place: Option<&str>, _sensor: Option<&str>) -> Option<String> {
        place.map(|at| format!("look for the leak at {at}, close it and repeat the test"))
    }
    fn on_pipe(&self) -> bool {
        true
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let length_m = site.length_m();
        let area_mm2 = 1e6 * site.pipe().area_m2();
        vec![
            Parameter::linear(
                "leak_position_m",
                "m",
                "where the leak is, from the supply (in a network, from where its pipe begins)",
                0.5 * length_m,
                0.02 * length_m,
                0.98 * length_m,
            ),
            Parameter::log(
                "leak_cda_mm2",
                "mm²",
                "area of the orifice times its discharge coefficient",
                3e-4 * area_mm2,
                1e-7 * area_mm2,
                0.1 * area_mm2,
            )
            .vanishing_at(0.0),
        ]
    }

    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        crate::model::effect::other_places().map(|by| vec![by, 1.0]).collect()
    }

    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let [position_m, cda_mm2] = *values else { return Ok(Vec::new()) };
        let inside = scene.is_inside(position_m);
        check("leak_position_m", position_m, inside, "inside the pipe, between supply and valve")?;
        check("leak_cda_mm2", cda_mm2, cda_mm2 >= 0.0, "zero or more")?;
        if cda_mm2 == 0.0 {
            return Ok(Vec::new());
        }
        let root_c = cda_mm2 * 1e-6 * (2.0 * GRAVITY_M_S2).sqrt();
        Ok(vec![Attachment {
            place: Place::At(position_m),
            make: Box::new(move |spot| Element::Shunt(Box::new(Orifice { root_c, elevation_m: spot.elevation_m }))),
        }])
    }
}

/// Below this pressure head, m, the flow is linear: a square root has no finite slope at zero.
const SMALL_HEAD_M: f64 = 1e-9;

/// `Q = root_c √(H - z)`.
struct Orifice {
    root_c: f64,
    elevation_m: f64,
}

impl Shunt for Orifice {
    fn settle(&mut self, head_m: f64) -> f64 {
        self.outflow(head_m).0
    }

    fn outflow(&self, head_m: f64) -> (f64, f64) {
        let pressure_m = head_m - self.elevation_m;
        if pressure_m <= 0.0 {
            return (0.0, 0.0);
        }
        if pressure_m < SMALL_HEAD_M {
            let slope = self.root_c / SMALL_HEAD_M.sqrt();
            return (slope * pressure_m, slope);
        }
        let flow = self.root_c * pressure_m.sqrt();
        (flow, 0.5 * flow / pressure_m)
    }

    fn advance(&mut self, _head_m: f64) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_square_millimetre_at_twenty_metres_and_none_below_the_atmosphere() {
        let mut orifice = Orifice { root_c: 1e-6 * (2.0 * GRAVITY_M_S2).sqrt(), elevation_m: 3.0 };
        assert!((orifice.settle(23.0) - 1e-6 * 19.809).abs() < 1e-9);
        assert_eq!(orifice.outflow(2.9), (0.0, 0.0));
        orifice.elevation_m = 0.0;
        for head in [3e-10, 0.5, 40.0] {
            let (flow, slope) = orifice.outflow(head);
            let step = (1e-4 * head).min(1e-6);
            let numeric = (orifice.outflow(head + step).0 - flow) / step;
            assert!((numeric / slope - 1.0).abs() < 1e-3, "{head}: {numeric} {slope}");
        }
    }
}
