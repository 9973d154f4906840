//! Air trapped at the pipe's end, before the valve: a spring.

use crate::model::effect::{Attachment, Effect, Element, Place, check};
use crate::model::error::ModelError;
use crate::model::gas::{Law, Stepping, Volume};
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site, Spot};
use crate::units::GRAVITY_M_S2;

/// See the module.
pub struct AirPocket;

impl Effect for AirPocket {
    fn name(&self) -> &'static str {
        "air-pocket"
    }
    fn summary(&self) -> &'static str {
        "trapped air at the valve"
    }
    fn equation(&self) -> &'static str {
        "at the pipe's end (H - z + H_atm) Vⁿ = const,  dV/dt = Q_valve - Q_pipe;  V before the closure = air_volume_mL"
    }
    fn source(&self) -> &'static str {
        "Martin (1976), 2nd Int. Conf. Pressure Surges; Wylie & Streeter (1993), Fluid Transients in Systems, ch. 6: air chamber"
    }
    fn trace(&self) -> &'static str {
        "a spring at the end: a rounded first rise, a slow mode, sharp peaks and wide troughs"
    }

    fn remedy(&self, _place: Option<&str>, _sensor: Option<&str>) -> Option<String> {
        Some("vent the pipe at its high points and repeat the test".to_owned())
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        // A pocket as soft as a tenth of the water in the pipe, at 30 m of absolute head.
        let line_m2: f64 = site
            .rig
            .way_pipes()
            .map(|p| GRAVITY_M_S2 * p.area_m2() * p.length_m / p.wave_speed_start(site.water).0.powi(2))
            .sum();
        let start_ml = (0.1 * line_m2 * 30.0 * 1e6).clamp(0.1, 1e3);
        vec![
            // At the pressure before the closure.
            Parameter::log("air_volume_mL", "mL", "volume of the trapped air before the closure", start_ml, 1e-6, 1e4)
                .vanishing_at(0.0),
            Parameter::linear(
                "polytropic_exponent",
                "1",
                "1: the air stays as warm as the water, 1.4: it keeps its heat",
                1.2,
                1.0,
                1.4,
            )
            .with_prior(1.2, 0.1),
        ]
    }

    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![0.05, 1.0], vec![10.0, 1.0]]
    }

    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let (volume_ml, exponent) = (values[0], values[1]);
        check("air_volume_mL", volume_ml, volume_ml >= 0.0, "zero or more")?;
        check("polytropic_exponent", exponent, (1.0..=1.4).contains(&exponent), "from 1 to 1.4")?;
        if volume_ml == 0.0 {
            return Ok(Vec::new());
        }
        // Below vapour pressure the air continues to expand linearly.
        let low_m = scene.vapour_head_m() + scene.atmosphere_head_m();
        let floor_m = scene.rig.elevation_m(scene.rig.valve_place()) - scene.atmosphere_head_m();
        let reference_m = scene.valve_head_m - floor_m;
        let boils_not = reference_m > low_m;
        check(
            "valve_head_m",
            scene.valve_head_m,
            boils_not,
            "so high that the water does not boil before the closure",
        )?;
        let make = move |spot: &Spot| {
            let law = Law::polytropic(floor_m, exponent, reference_m, volume_ml * 1e-6, low_m);
            Element::Shunt(Box::new(Volume::new(law, Stepping::at(scene, spot, 0.0))))
        };
        Ok(vec![Attachment { place: Place::Valve, make: Box::new(make) }])
    }
}
