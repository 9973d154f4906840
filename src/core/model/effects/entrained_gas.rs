//! Free gas spread along the pipe: the discrete gas cavity model, a small isothermal gas volume at every node.
//!
//! The volume of gas follows its pressure with a lag `θ`: gas exchanges heat with the water, dissolves and comes out of
//! solution. This is the bulk viscosity of gassy water, which rounds its sharp fronts.

use crate::model::contribution::NodeField;
use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::gas::{self, Gas};
use crate::model::node::Shunt;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site, Spot};
use crate::model::steady::Steady;

/// See the module.
pub struct EntrainedGas;

impl Effect for EntrainedGas {
    fn name(&self) -> &'static str {
        "entrained-gas"
    }
    fn summary(&self) -> &'static str {
        "free gas spread along the pipe"
    }
    fn equation(&self) -> &'static str {
        "at every node V_eq (H - z - H_vapour) = α A dx H_atm,  V + θ dV/dt = V_eq,  dV/dt = -q = Q_out - Q_in; \
         V⁺ = V - dt [ψ q⁺ + (1-ψ) q]"
    }
    fn source(&self) -> &'static str {
        "Wylie (1984), J. Fluids Eng. 106(3):307-311; Wylie & Streeter (1993), Fluid Transients in Systems, ch. 8: discrete gas cavity \
         model; lag: Cannizzaro & Pezzinga (2005), J. Hydraul. Eng. 131(8):724-732"
    }
    fn trace(&self) -> &'static str {
        "troughs wider than peaks, a period that grows with the amplitude, rising fronts that steepen and falling ones that spread"
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[("vapour-cavity", "gas opens cavities at the vapour head by itself")]
    }

    fn lets_boil(&self) -> bool {
        true
    }
    /// Gas of a fraction of 10⁻⁷ or less moves no wave and only keeps cavities apart: it computes vapour cavities
    /// (Wylie 1984; Simpson & Bergant 1994, J. Hydraul. Eng. 120(3):361-377).
    fn stands_for(&self, values: &[f64]) -> Option<&'static str> {
        values.first().filter(|fraction| **fraction <= gas::CAVITIES_ONLY).map(|_| "vapour-cavity")
    }
    fn remedy(&self, _place: Option<&str>, _sensor: Option<&str>) -> Option<String> {
        Some("flush the pipe, let the water stand until its gas has left it, and repeat the test".to_owned())
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        vec![
            Parameter::log(
                "gas_fraction",
                "1",
                "volume of free gas per volume of pipe, at a pressure of one atmosphere",
                1e-5,
                1e-9,
                1e-2,
            )
            .vanishing_at(0.0),
            // Bubbles of 0.1 to 1 mm exchange their heat in 0.1 to 10 ms. A fit begins below: gas that follows too late
            // is as good as absent.
            Parameter::log(
                "gas_lag_s",
                "s",
                "time that the gas takes to follow the pressure: exchange of heat, release and solution",
                2e-5,
                1e-7,
                0.1,
            )
            .with_prior(2e-4, 2.0),
        ]
    }

    /// Hardly any gas, enough to halve the wave speed, and gas that follows as late as bubbles of 0.2 mm.
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![0.03, 1.0], vec![30.0, 1.0], vec![1.0, 20.0]]
    }

    /// Steady head above vapour pressure, and `K` of each node.
    fn kept_per_node(&self, _elements: usize) -> usize {
        2
    }
    fn field(&self, values: &[f64], scene: &Scene, steady: &Steady) -> Result<Option<Box<dyn NodeField>>, ModelError> {
        let (gas_fraction, lag_s) = (values[0], values[1]);
        check("gas_fraction", gas_fraction, (0.0..1.0).contains(&gas_fraction), "zero or more, less than 1")?;
        check("gas_lag_s", lag_s, lag_s >= 0.0, "zero or more")?;
        if gas_fraction == 0.0 {
            return Ok(None);
        }
        gas::field(scene, steady, gas(scene, values)).map(Some)
    }

    fn node_shunt(&self, values: &[f64], scene: &Scene, spot: &Spot) -> Option<Box<dyn Shunt>> {
        (values[0] > 0.0).then(|| gas::at_node(scene, spot, gas(scene, values)))
    }
}

fn gas(scene: &Scene, values: &[f64]) -> Gas {
    let content_m = values[0] * scene.atmosphere_head_m();
    Gas { content_m, below_m: f64::INFINITY, lag_s: values[1], vapour_head_m: scene.vapour_head_m() }
}
