//! A valve that does not close linearly in time: in two stages, or as a power of the time left.

use crate::model::boundary::ValveEnd;
use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;

/// Why the forms of the law exclude each other.
const ONE_LAW: &str = "a valve closes by one law";

/// Two stages. See the module.
///
/// The opening is linear in time between `(0, 1)`, the inflection `(t_i/T_c, τ_i)` and `(1, 0)`. The closing time stays
/// the run's own parameter. The corners of the law may lie anywhere between time steps: the solver evaluates the
/// opening only at its steps, so it sees a corner inside a step a fraction of the step late, as it does the end of the
/// linear law.
pub struct ValveLaw;

impl Effect for ValveLaw {
    fn name(&self) -> &'static str {
        "valve-law"
    }
    fn summary(&self) -> &'static str {
        "a valve that closes in two stages (or /power: by a power of the time left)"
    }
    fn equation(&self) -> &'static str {
        "Q = τ Q₀ √(ΔH/ΔH₀);  τ linear in t between (0, 1), (t_i, τ_i) and (T_c, 0)"
    }
    fn source(&self) -> &'static str {
        "Wylie & Streeter (1993), Fluid Transients in Systems, ch. 3 (orifice); two-stage closure: Azoury, Baasiri & Najm \
         (1986), J. Hydraul. Eng. 112(10)"
    }
    fn trace(&self) -> &'static str {
        "another shape of the first rise and of every front after it; plateaus and period stay"
    }
    fn variants(&self) -> &'static [&'static dyn Effect] {
        &[&Power]
    }
    fn at_valve(&self) -> bool {
        true
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[("valve-law/power", ONE_LAW)]
    }

    /// The law is linear wherever `τ_i = 1 - t_i/T_c`: at half the time, at half the opening.
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        vec![
            Parameter::linear(
                "inflection_time_fraction",
                "1",
                "share of the closing time after which the valve changes its speed",
                0.5,
                0.01,
                0.99,
            ),
            Parameter::linear(
                "inflection_opening",
                "1",
                "relative opening at that time; the closure is linear if it is 1 minus that share",
                0.35,
                0.0,
                1.0,
            )
            .vanishing_at(0.5),
        ]
    }

    /// Slow then fast and fast then slow, each with an early and a late turn.
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![1.0, 1.9], vec![0.4, 1.4], vec![1.6, 0.3]]
    }

    fn valve(&self, values: &[f64], valve: &mut ValveEnd) -> Result<(), ModelError> {
        let (at, opening) = (values[0], values[1]);
        check("inflection_time_fraction", at, at > 0.0 && at < 1.0, "between 0 and 1")?;
        check("inflection_opening", opening, (0.0..=1.0).contains(&opening), "0 to 1")?;
        valve.law = Some(Box::new(move |s| two_stage(at, opening, s)));
        Ok(())
    }
}

/// The opening after a share `s` of the closing time.
fn two_stage(at: f64, opening: f64, s: f64) -> f64 {
    if s < at { 1.0 - (1.0 - opening) * s / at } else { opening * (1.0 - s) / (1.0 - at) }
}

/// `τ = (1 - t/T_c)^m`: a ball or butterfly valve turned at constant speed has `m` above 1, a gate worn around its seat
/// below.
struct Power;

impl Effect for Power {
    fn name(&self) -> &'static str {
        "valve-law/power"
    }
    fn summary(&self) -> &'static str {
        "a valve whose opening falls as a power of the time left"
    }
    fn equation(&self) -> &'static str {
        "Q = τ Q₀ √(ΔH/ΔH₀);  τ = (1 - t/T_c)^m"
    }
    fn source(&self) -> &'static str {
        "Wylie & Streeter (1993), Fluid Transients in Systems, ch. 3"
    }
    fn trace(&self) -> &'static str {
        ValveLaw.trace()
    }
    fn at_valve(&self) -> bool {
        true
    }
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[("valve-law", ONE_LAW)]
    }
    fn parameters(&self, _site: &Site, _elements: usize) -> Vec<Parameter> {
        let about = "power by which the opening falls with the time left; 1 is linear";
        vec![Parameter::log("valve_exponent", "1", about, 1.5, 0.1, 10.0).vanishing_at(1.0)]
    }
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![0.45], vec![2.5]]
    }
    fn valve(&self, values: &[f64], valve: &mut ValveEnd) -> Result<(), ModelError> {
        let exponent = values[0];
        check("valve_exponent", exponent, exponent > 0.0, "more than zero")?;
        valve.law = Some(Box::new(move |s| (1.0 - s).powf(exponent)));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_stages_go_through_their_corners_and_fall_throughout() {
        for (at, opening) in [(0.2, 0.4), (0.7, 0.9), (0.5, 0.5), (0.3, 0.0)] {
            let law = |s: f64| two_stage(at, opening, s);
            assert_eq!((law(0.0), law(1.0)), (1.0, 0.0));
            assert!((law(at) - opening).abs() < 1e-12);
            let all: Vec<f64> = (0..=100).map(|i| law(f64::from(i) / 100.0)).collect();
            assert!(all.windows(2).all(|w| w[1] <= w[0] + 1e-15));
        }
        assert!((0..100).map(|i| f64::from(i) / 100.0).all(|s| (two_stage(0.3, 0.7, s) - (1.0 - s)).abs() < 1e-15));
    }
}
