//! Column separation: where the pressure falls to vapour pressure, a cavity opens and holds it there until water fills
//! the cavity again.

use crate::model::contribution::NodeField;
use crate::model::effect::{Circumstances, Effect, SHOWN, check};
use crate::model::error::ModelError;
use crate::model::gas::{self, Gas};
use crate::model::node::Shunt;
use crate::model::parameter::Parameter;
use crate::model::scene::{ATMOSPHERE_PA, Scene, Site, Spot};
use crate::model::steady::Steady;

/// See the module.
pub struct VapourCavity;

/// A record lies on the floor if it comes this near to vapour pressure, m: zero errors of sensors and weather are of
/// this size. Higher up, the gas that starts the cavities is dissolved. Thus the effect changes nothing where no cavity
/// opens, whereas gas that never dissolves would add 2% to what the water yields at 3 m.
const FLOOR_M: f64 = 1.0;

impl Effect for VapourCavity {
    fn name(&self) -> &'static str {
        "vapour-cavity"
    }
    fn summary(&self) -> &'static str {
        "column separation at vapour pressure"
    }
    fn equation(&self) -> &'static str {
        "at every node V_eq = α A dx H_atm [1/(H - z - H_vapour) - 1/(1 m)] where positive,  V + θ dV/dt = V_eq,  \
         dV/dt = Q_out - Q_in: H - z stays at H_vapour until the cavity is filled"
    }
    fn source(&self) -> &'static str {
        "Wylie (1984), J. Fluids Eng. 106(3):307-311; Bergant, Simpson & Tijsseling (2006), J. Fluids Struct. 22:135-171: the \
         discrete gas cavity model with hardly any gas"
    }
    fn trace(&self) -> &'static str {
        "a flat floor at vapour pressure, then spikes above the first rise, and delays in multiples of 2L/a"
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[("entrained-gas", "gas opens cavities at the vapour head by itself")]
    }

    fn lets_boil(&self) -> bool {
        true
    }
    /// If the record lies on the floor of vapour pressure, the water boils: nothing else stops a fall there. But a
    /// trough may end near the floor by chance.
    fn odds(&self, known: &Circumstances) -> f64 {
        if known.above_vapour_m < FLOOR_M { SHOWN } else { 1.0 }
    }
    /// Neither the gas nor the pressure of the air is known beforehand, and each changes a boiling record by more than
    /// its noise. The gas cushions the many small cavities of a region near vapour pressure and rounds what follows
    /// their collapse; Bergant, Simpson & Tijsseling (2006) recommend 1e-7 or less. The pressure of the air sets the
    /// gauge pressure at which water boils.
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        vec![
            Parameter::log(
                "cavity_lag_s",
                "s",
                "time that a cavity takes to follow the pressure: evaporation and condensation",
                2e-4,
                1e-7,
                0.1,
            )
            .with_prior(2e-4, 2.0),
            Parameter::log(
                "cavity_gas_fraction",
                "1",
                "volume per volume of pipe, at a pressure of one atmosphere, of the gas that starts the cavities",
                1e-7,
                1e-12,
                gas::CAVITIES_ONLY,
            )
            .with_prior(1e-8, 3.0),
            // The weather moves it by 1 kPa, and so do ninety metres of height.
            Parameter::linear(
                "air_pressure_kPa",
                "kPa",
                "pressure of the air outside, which gauge pressure counts from; the start is a standard atmosphere",
                1e-3 * ATMOSPHERE_PA,
                60.0,
                110.0,
            )
            .with_prior(1e-3 * ATMOSPHERE_PA, 1.5),
        ]
    }
    /// Cavities that condense slowly, with less gas: their collapse makes fewer spikes, among which no descent finds its
    /// way.
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![10.0, 0.1, 1.0]]
    }
    /// Steady head above vapour pressure, and `K` of each node.
    fn kept_per_node(&self, _elements: usize) -> usize {
        2
    }
    fn field(&self, values: &[f64], scene: &Scene, steady: &Steady) -> Result<Option<Box<dyn NodeField>>, ModelError> {
        check("cavity_lag_s", values[0], values[0] >= 0.0, "zero or more")?;
        check("cavity_gas_fraction", values[1], (0.0..1.0).contains(&values[1]), "zero or more, less than 1")?;
        check("air_pressure_kPa", values[2], values[2] > 0.0, "more than zero")?;
        gas::field(scene, steady, gas(scene, values)).map(Some)
    }
    fn node_shunt(&self, values: &[f64], scene: &Scene, spot: &Spot) -> Option<Box<dyn Shunt>> {
        Some(gas::at_node(scene, spot, gas(scene, values)))
    }
}

fn gas(scene: &Scene, values: &[f64]) -> Gas {
    let (lag_s, content_m) = (values[0], values[1] * scene.atmosphere_head_m());
    let weather_m = scene.atmosphere_head_m() * (1e3 * values[2] / ATMOSPHERE_PA - 1.0);
    Gas { content_m, below_m: FLOOR_M, lag_s, vapour_head_m: scene.vapour_head_m() - weather_m }
}
