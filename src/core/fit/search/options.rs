//! How a fit is made, and how far it goes.

use crate::fit::problem::method::Method;
use crate::fit::problem::objective::Objective;
use crate::model::constraint::{Constraint, Given};
use crate::model::prior::Prior;

/// How far a fit goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// To see which model is worth more: few iterations on each of the finer grids, with slopes of a coarser one.
    Brief,
    /// Until it converges; elements of creep that keep it from its optimum stay where they are. To place them again
    /// takes longer than the fit, and changes what is known of the elements, not which model is better.
    Converged,
    /// The same; such elements are placed again or left out. From the signals it ends no worse than the models that it
    /// contains.
    Whole,
}

/// What a caller chooses about a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Most reaches of the grid.
    pub most_reaches: usize,
    /// Share of the noise that the grid's own error may have.
    pub grid_error_over_noise: f64,
    /// How far it goes on each grid.
    pub effort: Effort,
    /// Parameters that are held, or kept within bounds of their own.
    pub constraints: Vec<Constraint>,
    /// How to search.
    pub method: Method,
    /// What is compared of the records once the phase is locked.
    pub objective: Objective,
    /// Random starts of least squares, in addition to those that the signals and the effects propose.
    pub starts: usize,
    /// Simulations that a global search may take.
    pub budget: usize,
    /// Steps after which a stepwise calibration stops.
    pub most_steps: usize,
    /// For a stepwise calibration that goes on from given values: names of the features that are still to be used, each
    /// once.
    pub features_left: Option<Vec<String>>,
    /// Start values that replace those of signals, rig and effects.
    pub starts_at: Vec<Given>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// What is known of shared parameters from elsewhere, such as a creep test; a fit begins with the elements that it
    /// fully describes.
    pub priors: Vec<Prior>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            most_reaches: 512,
            grid_error_over_noise: 0.3,
            effort: Effort::Whole,
            constraints: Vec::new(),
            method: Method::LeastSquares,
            objective: Objective::Time,
            starts: 0,
            budget: 20_000,
            most_steps: usize::MAX,
            features_left: None,
            starts_at: Vec::new(),
            seed: 1,
            priors: Vec::new(),
        }
    }
}
