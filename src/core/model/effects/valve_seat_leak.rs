//! A valve that does not close fully: worn seat, grit, a stop set too early.
//!
//! It has two forms. The first is the seat's: a gap that is the same in every run, however far the valve was open
//! before. Its strength is `Cd A`, as a leak's; relative to the opening that passes `Q0` at `ΔH0` it is `r = CdA √(2g
//! ΔH0)/Q0`. The second, `/stroke`, is the drive's: the closure stops short of the seat by the same share of the
//! opening in every run. In a single run the two are the same.

use crate::model::boundary::ValveEnd;
use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;
use crate::units::GRAVITY_M_S2;

/// Why the two forms exclude each other.
const ONE_REST: &str = "one opening stays";

/// A gap of the seat. See the module.
pub struct ValveSeatLeak;

impl Effect for ValveSeatLeak {
    fn name(&self) -> &'static str {
        "valve-seat-leak"
    }
    fn summary(&self) -> &'static str {
        "a valve that does not close fully (or /stroke: that stops short by the same part of its opening in every run)"
    }
    fn equation(&self) -> &'static str {
        "Q = τ Q₀ √(ΔH/ΔH₀);  τ = r + (1 - r) τ_moving(t),  r = CdA √(2g ΔH₀)/Q₀ the opening that stays"
    }
    fn source(&self) -> &'static str {
        "Wylie & Streeter (1993), Fluid Transients in Systems, ch. 3: the valve as an orifice"
    }
    fn trace(&self) -> &'static str {
        "faster decay at all sensors, a lower first plateau, a mean that sags by friction; no reflection from along the pipe"
    }
    fn variants(&self) -> &'static [&'static dyn Effect] {
        &[&Stroke]
    }
    fn at_valve(&self) -> bool {
        true
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[("valve-seat-leak/stroke", ONE_REST)]
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let area_mm2 = 1e6 * site.rig.pipe_at_valve().area_m2();
        let about = "area of the gap that stays when the valve is closed, times its discharge coefficient";
        let (start, lower, upper) = (3e-4 * area_mm2, 1e-7 * area_mm2, 0.1 * area_mm2);
        vec![Parameter::log("seat_cda_mm2", "mm²", about, start, lower, upper).vanishing_at(0.0)]
    }
    fn valve(&self, values: &[f64], valve: &mut ValveEnd) -> Result<(), ModelError> {
        check("seat_cda_mm2", values[0], values[0] >= 0.0, "zero or more")?;
        if values[0] > 0.0 {
            let seat_m3_s = values[0] * 1e-6 * (2.0 * GRAVITY_M_S2 * valve.drop_m.max(0.0)).sqrt();
            // A gap as wide as the former opening would leave nothing to close.
            valve.residual_opening = (seat_m3_s / valve.flow_m3_s).clamp(0.0, 1.0);
        }
        Ok(())
    }
}

/// The end of the stroke. See the module.
struct Stroke;

impl Effect for Stroke {
    fn name(&self) -> &'static str {
        "valve-seat-leak/stroke"
    }
    fn summary(&self) -> &'static str {
        "a valve whose closure ends the same part of its opening short of the seat in every run"
    }
    fn equation(&self) -> &'static str {
        "Q = τ Q₀ √(ΔH/ΔH₀);  τ = r + (1 - r) τ_moving(t), r the opening that stays"
    }
    fn source(&self) -> &'static str {
        ValveSeatLeak.source()
    }
    fn trace(&self) -> &'static str {
        ValveSeatLeak.trace()
    }
    fn at_valve(&self) -> bool {
        true
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[("valve-seat-leak", ONE_REST)]
    }
    fn least_runs(&self) -> usize {
        2
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
