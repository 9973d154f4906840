//! Thresholds of the search: what each means, and where it comes from.
//!
//! Costs are half sums of squares of residuals in units of the noise: a model that leaves nothing but noise costs half
//! the number of samples.

use crate::fit::numeric::least_squares::Limits;

/// Reaches of the grid while the phase locks. Cost: with 48 the open sets have the same answers.
pub(crate) const LOCKING_REACHES: usize = 32;
/// Samples of the slowest sensor in a step of that grid. Derived: what two samples a step cannot show, the grid does
/// not have.
pub(crate) const LOCKING_PER_STEP: f64 = 2.0;
/// Reaches of the grid while models are chosen. Tuned; data unknown.
pub(crate) const COARSE_REACHES: usize = 48;
/// Reaches from which the grid is refined. Tuned; data unknown.
pub(crate) const FINAL_REACHES: usize = 64;
/// Samples of each sensor that coarse fits look at, and averages that a diagnosis screens effects on. Tuned; data
/// unknown.
pub(crate) const COARSE_SAMPLES: usize = 2500;
/// First cycles, in periods, that a fit looks at one after the other so that the phase locks: each time almost twice as
/// many, for from 1.5 periods to 5 a fit with gas loses its way. Tuned; the measured trace of Adelaide, with its head
/// off by up to 0.13 m.
pub(crate) const LOCKING_PERIODS: [f64; 3] = [1.5, 2.7, 5.0];

/// How many rivals of one kind (starts, places, retardation times, models) are followed further. Cost: the open sets
/// have the same answers with three starts and with four.
pub(crate) const LEADING: usize = 3;
/// Cost, as a share of what there was, below which several effects that may be anywhere are looked for once more. Cost,
/// and chosen.
pub(crate) const LOOKED_AGAIN: f64 = 0.7;
/// A start that costs this many times the best fit so far is not descended from. Cost: where all are
/// descended from, the open sets have the same answers.
pub(crate) const HOPELESS_START_RATIO: f64 = 30.0;
/// A few iterations, to see which start is worth more; also the rounds of a stepwise search over the features and over
/// the first cycles. Tuned; data unknown.
pub(crate) const SCREENING: Limits =
    Limits { iterations: 6, cost_tolerance: 1e-2, step_tolerance: 1e-7, thorough: false };
/// Of the others while one parameter is dragged. Cost: each answer is to be on the screen before the next is asked for.
pub(crate) const FOLLOWING: Limits = Limits { iterations: 3, ..SCREENING };
/// The cost of a start, without any iteration.
pub(crate) const EVALUATE_ONLY: Limits = Limits { iterations: 0, ..SCREENING };
/// Of a coarse fit: what it leaves undone the finer grids do. Tuned; data unknown.
pub(crate) const COARSE: Limits =
    Limits { iterations: 30, cost_tolerance: 3e-4, step_tolerance: 1e-7, thorough: false };
/// Of a fit of the first cycles, and of the rounds of a stepwise search over the whole record: what they leave undone the
/// next window, or the next grid, does. Cost.
pub(crate) const LOCKING: Limits = Limits { cost_tolerance: 3e-3, ..COARSE };

/// A smaller model that leaves this many times the bigger one's sum of squares after a few steps from its end is not
/// fitted further. Cost, and chosen: a few steps more gain less.
pub(crate) const AS_GOOD_WITHOUT: f64 = 1.02;
/// A smaller model that leaves this many times the bigger one's mean square on the coarse grid is not fitted further.
/// Cost, and chosen: the coarse grid may err by as much.
pub(crate) const HOPELESS_SMALLER: f64 = 1.5;

/// Error over noise up to which what a fit leaves may be noise. Beyond it smaller models are fitted, too; up to it
/// forecasts are accurate: an effect that they do not promise will not appear. Tuned; data unknown.
pub(crate) const NOISE_LIKE: f64 = 1.3;
/// Error over noise of a model above which its parameters may be wrong. Tuned; data unknown.
pub(crate) const DOUBTFUL_ABOVE: f64 = 3.0;
/// Finest grid of a fit with cavities among others, in reaches, except near the noise: the spikes of their collapse
/// belong to the grid. Literature: Bergant, Simpson & Tijsseling (2006) for the fact; the number is tuned; data unknown.
pub(crate) const MOST_REACHES_WITH_CAVITIES: usize = 128;

/// Of the fits while the grid is refined. Tuned; data unknown.
pub(crate) const GRID_REFINEMENT: Limits =
    Limits { iterations: 20, cost_tolerance: 1e-4, step_tolerance: 1e-8, thorough: true };
/// Of the last fit; its tolerance of the cost is no larger than [`POLISH_REDUCTION`] says. Tuned; data unknown.
pub(crate) const FINAL: Limits = Limits { iterations: 40, step_tolerance: 1e-9, ..GRID_REFINEMENT };
/// Pull of the grid on a parameter, in its standard errors, that asks for a finer grid. Chosen.
pub(crate) const MAX_GRID_PULL: f64 = 2.0;
/// Fall of the sum of squares, in units of what one independent sample leaves, that is not worth another iteration.
/// Derived: a seventh of a standard error.
pub(crate) const POLISH_REDUCTION: f64 = 0.02;
/// How often a descent that has given up starts anew at most. Cost: with 20 the open sets have the same answers.
pub(crate) const MAX_RESTARTS: usize = 3;
/// Shares of a step in the values that are tried. Chosen.
pub(crate) const STEP_SHARES: [f64; 4] = [1.0, 0.5, 0.2, 0.05];

/// Retardation times at which an element is tried, evenly in ratio between their bounds. Chosen.
pub(crate) const PROBED_TIMES: usize = 32;
/// Fall of the sum of squares that an element's two parameters bring of noise alone, in units of what one sample
/// leaves. Derived: the mean of χ² with two degrees of freedom.
pub(crate) const ELEMENT_NOISE_REDUCTION: f64 = 2.0;
/// Compliance that stands for none, in units of the least. Chosen.
pub(crate) const NO_COMPLIANCE: f64 = 1e-12;

/// How far a global search goes from what is known beforehand, in standard deviations. Chosen.
pub(crate) const PRIOR_HALF_WIDTH: f64 = 4.0;
/// How far it goes at least from a measured velocity, as a share of it, and from the start of the closure that the
/// signals show, as a share of the period. Tuned; data unknown.
pub(crate) const MIN_WINDOW_SHARE: f64 = 0.05;
/// Cost of what cannot be simulated: more than of anything that can. Chosen.
pub(crate) const IMPOSSIBLE_COST: f64 = 1e300;
