//! Small problems with known answers, for the tests of descents and searches.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::fit::numeric::least_squares::{Problem, Way};

/// Residuals `f` of variables in a box.
pub(crate) struct Test<F> {
    pub f: F,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// Of every variable.
    pub way: Way,
}

impl<F: Fn(&[f64]) -> Vec<f64> + Sync> Problem for Test<F> {
    type Error = String;
    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, String> {
        Ok((self.f)(x))
    }
    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }
    fn difference_step(&self, _j: usize) -> f64 {
        1e-7
    }
    fn way(&self, _j: usize) -> Way {
        self.way
    }
}

/// Asserts that `search`, given a cost, a start and a budget, asks for the cost no more often than that.
pub(crate) fn keeps_to_its_budget(search: impl Fn(&(dyn Fn(&[f64]) -> f64 + Sync), &[f64], usize)) {
    for budget in [1, 3, 7, 40, 333] {
        let spent = AtomicUsize::new(0);
        let bowl = |x: &[f64]| {
            spent.fetch_add(1, Ordering::Relaxed);
            x.iter().map(|v| v * v).sum::<f64>()
        };
        search(&bowl, &[0.5, 0.5], budget);
        assert!(spent.into_inner() <= budget);
    }
}
