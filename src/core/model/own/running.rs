//! A law at work in one simulation: its values given, its states moved from step to step.

use std::cell::RefCell;

use crate::model::own::file::{Definition, INPUTS, T};
use crate::model::own::number::Dual;
use crate::model::own::program::Program;

/// See the module.
pub struct Running {
    law: Program,
    starts: Vec<Program>,
    rates: Vec<Program>,
    /// See [`Gives::moving`](crate::model::own::file::Gives::moving).
    moving: usize,
    before: usize,
    other: usize,
    other_before: usize,
    first_state: usize,
    work: RefCell<Work>,
}

/// Inputs, and room for the steps of a program.
struct Work {
    inputs: Vec<f64>,
    scratch: Vec<Dual>,
}

impl Work {
    fn run(&mut self, program: &Program, by: usize) -> Dual {
        let inputs = &self.inputs;
        program.run(|i| Dual(inputs[i], if i == by { 1.0 } else { 0.0 }), &mut self.scratch)
    }
}

impl Running {
    /// With values of the parameters, in the order of the file.
    pub fn new(d: &Definition, values: &[f64]) -> Running {
        let given = |i: usize| i.checked_sub(INPUTS.len()).and_then(|i| values.get(i)).copied();
        let first_state = INPUTS.len() + values.len();
        let inputs = vec![0.0; first_state + d.states.len()];
        let [moving, before, other, other_before] = d.gives.moving();
        Running {
            law: d.law.bound(given),
            starts: d.states.iter().map(|s| s.start.bound(given)).collect(),
            rates: d.states.iter().map(|s| s.rate.bound(given)).collect(),
            moving,
            before,
            other,
            other_before,
            first_state,
            work: RefCell::new(Work { inputs, scratch: Vec::new() }),
        }
    }

    /// The same at an elevation, m.
    pub fn at_elevation(self, elevation_m: f64) -> Running {
        self.work.borrow_mut().inputs[crate::model::own::file::Z] = elevation_m;
        self
    }

    /// Learns the flow where the law is solved with the head, or the head where it is solved with the flow.
    #[inline]
    pub fn learn(&mut self, other: f64) {
        self.work.get_mut().inputs[self.other] = other;
    }

    /// Starts from the steady state at a head or flow; returns the law's value there.
    pub fn settle(&mut self, steady: f64) -> f64 {
        let work = self.work.get_mut();
        (work.inputs[T], work.inputs[self.moving], work.inputs[self.before]) = (0.0, steady, steady);
        work.inputs[self.other_before] = work.inputs[self.other];
        for (k, start) in self.starts.iter().enumerate() {
            work.inputs[self.first_state + k] = work.run(start, usize::MAX).0;
        }
        work.run(&self.law, usize::MAX).0
    }

    /// The law's value at a time and a head or flow, and its derivative by that.
    #[inline]
    pub fn value(&self, time_s: f64, moving: f64) -> (f64, f64) {
        let mut work = self.work.borrow_mut();
        let was = std::mem::replace(&mut work.inputs[self.moving], moving);
        work.inputs[T] = time_s;
        let Dual(value, slope) = work.run(&self.law, self.moving);
        work.inputs[self.moving] = was;
        (value, slope)
    }

    /// Moves the states over a step that ends at a time with a head or flow. Each moves as a linear equation would,
    /// with the head in the middle of the step (the exponential Rosenbrock-Euler method: Hochbruck & Ostermann 2010,
    /// Acta Numerica 19, 209), so a fast state stays stable.
    pub fn advance(&mut self, time_s: f64, dt_s: f64, moving: f64) {
        const MOST_STATES: usize = 20;
        let work = self.work.get_mut();
        if !self.rates.is_empty() {
            work.inputs[T] = time_s - 0.5 * dt_s;
            work.inputs[self.moving] = 0.5 * (work.inputs[self.moving] + moving);
            let mut moved = [0.0; MOST_STATES];
            for (k, (rate, moved)) in self.rates.iter().zip(&mut moved).enumerate() {
                let Dual(rate, by_itself) = work.run(rate, self.first_state + k);
                let x = by_itself * dt_s;
                *moved = rate * dt_s * if x.abs() < 1e-9 { 1.0 } else { x.exp_m1() / x };
            }
            work.inputs[self.first_state..].iter_mut().zip(moved).for_each(|(state, moved)| *state += moved);
        }
        work.inputs[self.moving] = moving;
    }
}
