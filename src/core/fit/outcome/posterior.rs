//! What a sampler shows of a fit's values: their joint distribution, given the recordings and what was known before.

use std::ops::RangeInclusive;

/// Independent draws that may be asked for: so many show both ends of an interval, and no computer needs more.
pub const WANTED: RangeInclusive<usize> = 100..=100_000;

/// The posterior of one parameter.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Marginal {
    /// Half the draws lie below it, in the parameter's unit.
    pub median: f64,
    /// The 95% interval, in the same: between the quantiles of 2.5% and 97.5%, or from a bound that cuts the density
    /// off where it is high, whose end is open (infinite), to that of 95%.
    pub interval_95: (f64, f64),
    /// Vehtari et al.'s (2021) R̂: 1 where all chains show the same distribution.
    pub r_hat: f64,
    /// Independent draws that say as much as all.
    pub effective_draws: f64,
}

/// How a posterior was sampled, and some of its draws.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Posterior {
    /// R̂ and the effective draws of all parameters are what was asked for; otherwise no interval of the fit comes from
    /// it.
    pub converged: bool,
    /// Largest R̂ of any parameter.
    pub r_hat: f64,
    /// Fewest effective draws of any parameter.
    pub effective_draws: f64,
    /// Effective draws that were asked for.
    pub wanted: usize,
    /// Chains, which know nothing of each other.
    pub chains: usize,
    /// Draws of each chain that count: all but the first quarter.
    pub sweeps: usize,
    /// Share of the steps that were made.
    pub acceptance: f64,
    /// Simulations that it took.
    pub evaluations: usize,
    /// The parameters that were sampled, by their index in the fit.
    pub of: Vec<usize>,
    /// Some of the draws, evenly from all chains: values of these parameters, in their units.
    pub draws: Vec<Vec<f64>>,
}
