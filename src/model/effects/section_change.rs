//! A stretch of pipe with another wave speed: another wall, material or support, but the same bore.
//!
//! Only the elastic wave speed differs; creep of the wall, where the model has it, is the pipe's. A stretch that no reach
//! resolves is lumped by the grid with all its inertance and capacitance, so a fit may move it anywhere.
//!
//! A stretch of its own parts the pipe in two, which need not be one piece of pipe: a wall 5% thicker makes the wave speed of a
//! metal pipe half a percent higher. Over some tens of periods that is more than the noise, so the pipe beyond the stretch has
//! a ratio of its own, held near 1 by a prior of that size.

use super::{Effect, Site, check};
use crate::model::ModelError;
use crate::model::grid::Stretch;
use crate::model::parameter::Parameter;

/// See the module.
pub struct SectionChange;

impl Effect for SectionChange {
    fn name(&self) -> &'static str {
        "section-change"
    }
    fn summary(&self) -> &'static str {
        "a stretch of pipe with another wave speed"
    }
    fn equation(&self) -> &'static str {
        "a → ratio · a from start to start + length; waves reflect by (B₂ - B₁)/(B₂ + B₁), B = a/(gA)"
    }
    fn source(&self) -> &'static str {
        "series connection: Wylie & Streeter (1993), Fluid Transients in Systems; Gong et al. (2013), J. Hydraul. Eng. 139(9):935-944"
    }
    fn trace(&self) -> &'static str {
        "a pair of steps from its two ends, in proportion to the pressure; modes shift unevenly"
    }

    /// Start and length rather than two ends: no fit can cross them.
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let length_m = site.rig.length_m();
        vec![
            Parameter::linear(
                "section_start_m",
                "m",
                "where the stretch begins, from the supply",
                0.4 * length_m,
                0.0,
                0.99 * length_m,
            ),
            Parameter::log(
                "section_length_m",
                "m",
                "length of the stretch; it ends at the valve at the latest",
                0.2 * length_m,
                0.01 * length_m,
                length_m,
            ),
            Parameter::log("section_wave_speed_ratio", "1", "its wave speed over that of the pipe", 1.15, 0.25, 4.0)
                .vanishing_at(1.0),
            Parameter::log(
                "section_beyond_ratio",
                "1",
                "wave speed of the pipe from the stretch to the valve over that before the stretch",
                1.0,
                0.95,
                1.05,
            )
            .with_prior(1.0, 0.005),
        ]
    }

    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        let slower = 1.0 / (1.15 * 1.15);
        let places = [(0.1, 1.0), (0.25, 1.0), (0.55, 1.0), (0.7, 1.0), (0.05, 2.0), (0.3, 2.0), (0.55, 2.0)];
        std::iter::once(vec![1.0, 1.0, slower, 1.0])
            .chain(
                places
                    .iter()
                    .flat_map(|&(place, length)| [1.0, slower].map(|ratio| vec![place / 0.4, length, ratio, 1.0])),
            )
            .collect()
    }

    fn reshape(&self, values: &[f64], stretches: &mut Vec<Stretch>) -> Result<(), ModelError> {
        let [start_m, section_m, ratio, beyond] = *values else { return Ok(()) };
        let total_m: f64 = stretches.iter().map(|s| s.length_m).sum();
        check("section_start_m", start_m, (0.0..total_m).contains(&start_m), "inside the pipe")?;
        check("section_length_m", section_m, section_m > 0.0, "more than zero")?;
        check("section_wave_speed_ratio", ratio, ratio > 0.0, "more than zero")?;
        check("section_beyond_ratio", beyond, beyond > 0.0, "more than zero")?;
        if ratio == 1.0 && beyond == 1.0 {
            return Ok(());
        }
        let end_m = start_m + section_m;
        let mut before_m = 0.0;
        let mut reshaped = Vec::with_capacity(stretches.len() + 2);
        for stretch in stretches.drain(..) {
            let after_m = before_m + stretch.length_m;
            let (from_m, to_m) = (start_m.clamp(before_m, after_m), end_m.clamp(before_m, after_m));
            for (length_m, by) in [(from_m - before_m, 1.0), (to_m - from_m, ratio), (after_m - to_m, beyond)] {
                if length_m > 1e-12 * total_m {
                    let wave_speed_m_s = by * stretch.wave_speed_m_s;
                    reshaped.push(Stretch { length_m, wave_speed_m_s, ..stretch.clone() });
                }
            }
            before_m = after_m;
        }
        *stretches = reshaped;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::friction::WallFriction;

    fn stretch(length_m: f64, wave_speed_m_s: f64) -> Stretch {
        let friction = WallFriction::constant(0.02);
        Stretch { length_m, diameter_m: 0.05, wall_m: 0.005, wave_speed_m_s, constraint: 1.0, friction, creeps: true }
    }

    fn reshaped(values: [f64; 4]) -> Vec<(f64, f64)> {
        let mut stretches = vec![stretch(40.0, 1000.0), stretch(60.0, 500.0)];
        SectionChange.reshape(&values, &mut stretches).unwrap();
        stretches.iter().map(|s| (s.length_m, s.wave_speed_m_s)).collect()
    }

    #[test]
    fn it_cuts_the_pipes_where_it_lies() {
        assert_eq!(reshaped([10.0, 20.0, 1.5, 1.0]), [(10.0, 1000.0), (20.0, 1500.0), (10.0, 1000.0), (60.0, 500.0)]);
        assert_eq!(reshaped([30.0, 20.0, 0.5, 1.0]), [(30.0, 1000.0), (10.0, 500.0), (10.0, 250.0), (50.0, 500.0)]);
        assert_eq!(reshaped([0.0, 40.0, 2.0, 1.0]), [(40.0, 2000.0), (60.0, 500.0)]);
        assert_eq!(reshaped([90.0, 50.0, 2.0, 1.0]), [(40.0, 1000.0), (50.0, 500.0), (10.0, 1000.0)]);
        assert_eq!(reshaped([30.0, 20.0, 1.0, 1.0]), [(40.0, 1000.0), (60.0, 500.0)]);
        assert_eq!(reshaped([10.0, 20.0, 1.5, 2.0])[2..], [(10.0, 2000.0), (60.0, 1000.0)]);
    }
}
