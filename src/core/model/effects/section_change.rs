//! A stretch of pipe with another wave speed: another wall, material or support, but the same bore.
//!
//! Only the elastic wave speed differs; the creep of the wall, if the model has it, is the pipe's. The grid lumps a
//! stretch that no reach resolves with all its inertance and capacitance, so a fit may move it anywhere.
//!
//! The stretch parts the pipe in two, which need not be one piece of pipe: a wall that is 5 % thicker raises the wave
//! speed of a metal pipe by half a percent. Over some tens of periods that exceeds the noise, so the pipe beyond the
//! stretch has a ratio of its own, held near 1 by a prior of that size.

use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::grid::Stretch;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;

/// Ratio from which a fit starts: so weak that the period, to which the wave speed is locked, hardly changes.
const WEAK: f64 = 1.04;

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
        "a → ratio · a from start to end; waves reflect by (B₂ - B₁)/(B₂ + B₁), B = a/(gA)"
    }
    fn source(&self) -> &'static str {
        "series connection: Wylie & Streeter (1993), Fluid Transients in Systems; Gong et al. (2013), J. Hydraul. Eng. 139(9):935-944"
    }
    fn trace(&self) -> &'static str {
        "a pair of steps from its two ends, in proportion to the pressure; modes shift unevenly"
    }

    /// The two ends, each a front of its own in the record. Either order is allowed, so that they may pass each other
    /// in a fit.
    fn on_pipe(&self) -> bool {
        true
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        let length_m = site.length_m();
        vec![
            Parameter::linear(
                "section_start_m",
                "m",
                "where the stretch begins, from the supply (in a network, from where its pipe begins)",
                0.4 * length_m,
                0.0,
                length_m,
            ),
            Parameter::linear(
                "section_end_m",
                "m",
                "where the stretch ends, from the supply (in a network, from where its pipe begins)",
                0.6 * length_m,
                0.0,
                length_m,
            ),
            Parameter::log("section_wave_speed_ratio", "1", "its wave speed over that of the pipe", WEAK, 0.25, 4.0)
                .vanishing_at(1.0),
            Parameter::log(
                "section_beyond_ratio",
                "1",
                "wave speed of the pipe from the stretch to the valve over that before the stretch",
                1.0,
                0.98,
                1.02,
            )
            .with_prior(1.0, 0.005),
        ]
    }

    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        let ends = [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95];
        let pairs = ends.iter().enumerate().flat_map(|(i, from)| ends[i + 1..].iter().map(move |to| (from, to)));
        pairs.map(|(from, to)| vec![from / 0.4, to / 0.6, 1.0, 1.0]).collect()
    }

    fn put_in_order(&self, values: &mut [f64]) {
        if let [start_m, end_m, ..] = values
            && start_m > end_m
        {
            std::mem::swap(start_m, end_m);
        }
    }

    fn reshape(&self, values: &[f64], stretches: &mut Vec<Stretch>) -> Result<(), ModelError> {
        let [one_m, other_m, ratio, beyond] = *values else { return Ok(()) };
        let total_m: f64 = stretches.iter().map(|s| s.length_m).sum();
        for (name, end_m) in [("section_start_m", one_m), ("section_end_m", other_m)] {
            check(name, end_m, (0.0..=total_m * (1.0 + 1e-9)).contains(&end_m), "between supply and valve")?;
        }
        check("section_wave_speed_ratio", ratio, ratio > 0.0, "more than zero")?;
        check("section_beyond_ratio", beyond, beyond > 0.0, "more than zero")?;
        if ratio == 1.0 && beyond == 1.0 {
            return Ok(());
        }
        let (start_m, end_m) = (one_m.min(other_m), one_m.max(other_m));
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

    fn reshaped(values: [f64; 4]) -> Vec<(f64, f64)> {
        let mut stretches = vec![Stretch::plain(40.0, 1000.0), Stretch::plain(60.0, 500.0)];
        SectionChange.reshape(&values, &mut stretches).unwrap();
        stretches.iter().map(|s| (s.length_m, s.wave_speed_m_s)).collect()
    }

    #[test]
    fn it_cuts_the_pipes_where_it_lies() {
        assert_eq!(reshaped([10.0, 30.0, 1.5, 1.0]), [(10.0, 1000.0), (20.0, 1500.0), (10.0, 1000.0), (60.0, 500.0)]);
        assert_eq!(reshaped([50.0, 30.0, 0.5, 1.0]), [(30.0, 1000.0), (10.0, 500.0), (10.0, 250.0), (50.0, 500.0)]);
        assert_eq!(reshaped([0.0, 40.0, 2.0, 1.0]), [(40.0, 2000.0), (60.0, 500.0)]);
        assert_eq!(reshaped([90.0, 100.0, 2.0, 1.0]), [(40.0, 1000.0), (50.0, 500.0), (10.0, 1000.0)]);
        assert_eq!(reshaped([100.0, 90.0, 2.0, 1.0]), [(40.0, 1000.0), (50.0, 500.0), (10.0, 1000.0)]);
        assert_eq!(reshaped([30.0, 50.0, 1.0, 1.0]), [(40.0, 1000.0), (60.0, 500.0)]);
        let mut reversed = [50.0, 30.0, 1.1, 1.0];
        SectionChange.put_in_order(&mut reversed);
        assert_eq!(reversed, [30.0, 50.0, 1.1, 1.0]);
        assert_eq!(reshaped([10.0, 30.0, 1.5, 2.0])[2..], [(10.0, 2000.0), (60.0, 1000.0)]);
    }
}
