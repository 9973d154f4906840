//! A valve that does not close fully: worn seat, grit, a stop set too early.

use super::{Effect, Site, check};
use crate::model::ModelError;
use crate::model::boundary::ValveEnd;
use crate::model::parameter::Parameter;

/// See the module.
pub struct ValveSeatLeak;

impl Effect for ValveSeatLeak {
    fn name(&self) -> &'static str {
        "valve-seat-leak"
    }
    fn summary(&self) -> &'static str {
        "a valve that does not close fully"
    }
    fn equation(&self) -> &'static str {
        "Q = τ Q₀ √(ΔH/ΔH₀);  τ = r + (1 - r) τ_moving(t), r the opening that stays"
    }
    fn source(&self) -> &'static str {
        "Wylie & Streeter (1993), Fluid Transients in Systems, ch. 3: the valve as an orifice"
    }
    fn trace(&self) -> &'static str {
        "faster decay at all sensors, a lower first plateau, a mean that sags by friction; no reflection from along the pipe"
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        let about = "relative opening that stays when the valve is closed";
        vec![Parameter::log("residual_opening", "1", about, 0.01, 1e-5, 0.3).vanishing_at(0.0)]
    }
    fn valve(&self, values: &[f64], valve: &mut ValveEnd) -> Result<(), ModelError> {
        check("residual_opening", values[0], (0.0..1.0).contains(&values[0]), "0 to below 1")?;
        valve.residual_opening = values[0];
        Ok(())
    }
}
