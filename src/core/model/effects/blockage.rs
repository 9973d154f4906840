//! A partial blockage: a local head loss that grows with the square of the flow.

use crate::model::effect::{Attachment, Effect, Element, Place, check};
use crate::model::error::ModelError;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site};
use crate::units::GRAVITY_M_S2;

/// See the module.
pub struct Blockage;

impl Effect for Blockage {
    fn name(&self) -> &'static str {
        "blockage"
    }
    fn summary(&self) -> &'static str {
        "a local loss at an unknown place"
    }
    fn equation(&self) -> &'static str {
        "ΔH = K V|V|/(2g) across one place, V the velocity in the pipe there"
    }
    fn source(&self) -> &'static str {
        "Wylie & Streeter (1993), Fluid Transients in Systems; Mohapatra et al. (2006), J. Hydraul. Eng. 132(10):1025-1030"
    }
    fn trace(&self) -> &'static str {
        "a rising step when its reflection arrives, that grows with the square of the flow; the steady head falls across it"
    }

    fn remedy(&self, place: Option<&str>, _sensor: Option<&str>) -> Option<String> {
        place.map(|at| format!("look for what narrows the pipe at {at}, take it out and repeat the test"))
    }
    fn on_pipe(&self) -> bool {
        true
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let length_m = site.length_m();
        vec![
            Parameter::linear(
                "blockage_position_m",
                "m",
                "where the blockage is, from the supply (in a network, from where its pipe begins)",
                0.5 * length_m,
                0.02 * length_m,
                0.98 * length_m,
            ),
            Parameter::log(
                "blockage_K",
                "1",
                "head loss across the blockage in velocity heads of the pipe",
                30.0,
                0.03,
                1e6,
            )
            .vanishing_at(0.0),
        ]
    }

    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        crate::model::effect::other_places().map(|by| vec![by, 1.0]).collect()
    }

    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let [position_m, loss] = *values else { return Ok(Vec::new()) };
        let inside = scene.is_inside(position_m);
        check("blockage_position_m", position_m, inside, "inside the pipe, between supply and valve")?;
        check("blockage_K", loss, loss >= 0.0, "zero or more")?;
        if loss == 0.0 {
            return Ok(Vec::new());
        }
        Ok(vec![Attachment {
            place: Place::At(position_m),
            make: Box::new(move |spot| {
                Element::Loss(spot.share * loss / (2.0 * GRAVITY_M_S2 * spot.area_m2 * spot.area_m2))
            }),
        }])
    }
}
