//! Stress waves on their way from one end of a pipe to the other, and what each end hears and sends of them.
//!
//! The delay is exact where it is a whole number of steps; elsewhere an all-pass filter makes up the rest and loses
//! nothing ([`AllPass`]).

use std::collections::VecDeque;

use crate::model::late::AllPass;

/// The stress waves at one end of a pipe, as heads of water, m.
pub(crate) struct Mouth {
    pub(crate) arriving_m: f64,
    pub(crate) leaving_m: f64,
    /// Both of each step, for the probes.
    pub(crate) arrived_m: Vec<f64>,
    pub(crate) left_m: Vec<f64>,
}

impl Mouth {
    /// Of a pipe in steady flow, in which there are no stress waves.
    pub(crate) fn new() -> Mouth {
        Mouth { arriving_m: 0.0, leaving_m: 0.0, arrived_m: vec![0.0], left_m: vec![0.0] }
    }

    /// Makes room for so many steps, so that no step has to.
    pub(crate) fn reserve(&mut self, steps: usize) {
        self.arrived_m.reserve_exact(steps);
        self.left_m.reserve_exact(steps);
    }

    /// Ends a step; `next_m` arrives in the next one.
    fn turn(&mut self, next_m: f64) {
        self.arrived_m.push(self.arriving_m);
        self.left_m.push(self.leaving_m);
        self.arriving_m = next_m;
    }
}

/// Stress waves on their way, oldest first: whole steps from the valve's side, and all-pass filters for the rest of the
/// way, at the supply's.
pub(crate) struct Ways {
    pub(crate) down: VecDeque<f64>,
    pub(crate) up: VecDeque<f64>,
    rest: [AllPass; 2],
}

impl Ways {
    /// Of a pipe that they pass in so many steps, two or more when rounded.
    pub(crate) fn new(steps: f64) -> Ways {
        // One step more passes until the other end takes it; the filter takes a half to one and a half.
        let late = 1.0 + steps - steps.round();
        let whole = VecDeque::from(vec![0.0; steps.round() as usize - 2]);
        Ways { down: whole.clone(), up: whole, rest: [AllPass::new(late, 0.0); 2] }
    }

    /// What left one end in this step goes on towards the other.
    pub(crate) fn turn(&mut self, supply_side: &mut Mouth, valve_side: &mut Mouth) {
        let [at_supply, at_valve] = self.pass(supply_side.leaving_m, valve_side.leaving_m);
        supply_side.turn(at_supply);
        valve_side.turn(at_valve);
    }

    /// What arrives towards the supply and towards the valve as these waves leave there.
    fn pass(&mut self, from_supply: f64, from_valve: f64) -> [f64; 2] {
        let [down, up] = &mut self.rest;
        let shift = |way: &mut VecDeque<f64>, wave: f64| {
            way.push_back(wave);
            way.pop_front().unwrap_or(wave)
        };
        let at_valve = shift(&mut self.down, down.pass(from_supply));
        [up.pass(shift(&mut self.up, from_valve)), at_valve]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_number_of_steps_is_an_exact_delay() {
        let mut ways = Ways::new(5.0);
        let heard: Vec<[f64; 2]> = (0..12).map(|i| ways.pass(f64::from(i * i), -f64::from(i))).collect();
        // The other end takes it a step later.
        for (i, arrived) in heard.iter().enumerate().skip(4) {
            assert_eq!(*arrived, [-((i - 4) as f64), ((i - 4) * (i - 4)) as f64]);
        }
    }
}
