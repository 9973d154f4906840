//! A supply head that changes after the closure: a pump running up its curve, a small tank, an air vessel.

use crate::model::boundary::Supply;
use crate::model::effect::{Effect, check};
use crate::model::error::ModelError;
use crate::model::parameter::Parameter;
use crate::model::scene::Site;
use crate::rig::Rig;

/// See the module.
pub struct SupplyDrift;

impl Effect for SupplyDrift {
    fn name(&self) -> &'static str {
        "supply-drift"
    }
    fn summary(&self) -> &'static str {
        "a supply head that changes after the closure"
    }
    fn equation(&self) -> &'static str {
        "H_R(t) = H_R(0) + ΔH (1 - exp(-t/T))"
    }
    fn source(&self) -> &'static str {
        "relaxation of a supply to its head at rest; Chaudhry (2014), Applied Hydraulic Transients, ch. 3: boundary conditions"
    }
    fn trace(&self) -> &'static str {
        "a slow shift of the mean, the same at all sensors; amplitude and period stay"
    }
    fn at_supply(&self) -> bool {
        true
    }
    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        let supply = &rig.graph.nodes[rig.graph.supply()];
        (!supply.kind.holds_given_head())
            .then_some("no reservoir feeds the rig: the head of its tank or pump follows from its own law")
    }
    fn parameters(&self, site: &Site, _elements: usize) -> Vec<Parameter> {
        vec![
            Parameter::linear(
                "supply_head_change_m",
                "m",
                "head by which the supply ends up higher than before the closure",
                1.0,
                -50.0,
                50.0,
            )
            .vanishing_at(0.0),
            Parameter::log(
                "supply_time_constant_s",
                "s",
                "time in which the supply goes 63 % of that way",
                5.0 * site.period_s,
                0.1 * site.period_s,
                1e4 * site.period_s,
            ),
        ]
    }
    fn other_starts(&self, _elements: usize) -> Vec<Vec<f64>> {
        vec![vec![1.0, 6.0], vec![1.0, 0.3]]
    }
    fn supply(&self, values: &[f64], supply: Box<dyn Supply>) -> Result<Box<dyn Supply>, ModelError> {
        let (change_m, time_constant_s) = (values[0], values[1]);
        check("supply_head_change_m", change_m, true, "a number")?;
        check("supply_time_constant_s", time_constant_s, time_constant_s > 0.0, "more than zero")?;
        Ok(Box::new(Drifting { supply, change_m, time_constant_s }))
    }
}

/// Adds a drift to another supply.
struct Drifting {
    supply: Box<dyn Supply>,
    change_m: f64,
    time_constant_s: f64,
}

impl Supply for Drifting {
    fn head_m(&mut self, time_s: f64) -> f64 {
        self.supply.head_m(time_s) - self.change_m * (-time_s.max(0.0) / self.time_constant_s).exp_m1()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::boundary::ConstantHead;

    #[test]
    fn it_relaxes_by_its_time_constant_and_only_after_the_closure() {
        let mut supply = SupplyDrift.supply(&[-3.0, 2.0], Box::new(ConstantHead(10.0))).unwrap();
        assert_eq!(supply.head_m(-1.0), 10.0);
        assert!((supply.head_m(2.0) - (10.0 - 3.0 * (1.0 - (-1f64).exp()))).abs() < 1e-12);
        assert!((supply.head_m(1e3) - 7.0).abs() < 1e-12);
    }
}
