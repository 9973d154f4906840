//! Thresholds of runs at several temperatures: what each means, and where it comes from.

use crate::fit::numeric::least_squares::Limits;

/// Least distance between the coldest and the warmest run, K, that shows a law of the temperature. Chosen.
pub(crate) const LEAST_SPREAD_K: f64 = 2.0;
/// Relative standard error from which on a value is open. Chosen.
pub(crate) const OPEN_RELATIVE_ERROR: f64 = 1.0;
/// Chance below which values scatter about a line by more than their errors. Convention: 5%.
pub(crate) const SCATTER_SIGNIFICANCE: f64 = 0.05;
/// Chance below which the laws leave more than noise. Convention: 1%.
pub(crate) const LAWS_SIGNIFICANCE: f64 = 0.01;

/// Largest relative change of a modulus or a compliance for each kelvin. Chosen.
pub(crate) const MAX_RATE_PER_K: f64 = 0.3;
/// Of the laws' values from those of the runs: to rounding, for it is cheap.
pub(crate) const START_LIMITS: Limits =
    Limits { iterations: 300, cost_tolerance: 1e-10, step_tolerance: 1e-10, thorough: false };
/// Least standard error of a variable: a run without noise must not weigh infinitely. Chosen.
pub(crate) const LEAST_ERROR: f64 = 1e-6;
/// Factor on correlations, so that two parameters that stand in for each other entirely leave their matrix regular.
/// Chosen.
pub(crate) const KEPT_CORRELATION: f64 = 0.9999;
/// Of the fit of all runs together. Tuned; data unknown.
pub(crate) const JOINT_LIMITS: Limits =
    Limits { iterations: 60, cost_tolerance: 1e-6, step_tolerance: 1e-9, thorough: true };
/// Largest error of a thermometer, in its standard deviations. Chosen.
pub(crate) const MAX_THERMOMETER_ERROR: f64 = 20.0;
/// Points of a law's line. Chosen.
pub(crate) const LINE_POINTS: usize = 41;
