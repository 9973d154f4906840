//! Thresholds of the creep test: what each means, and where it comes from.

use crate::fit::numeric::least_squares::Limits;

/// Compliances of solids, 1/Pa: from below diamond's to above a gel's.
pub(crate) const SOLIDS_PER_PA: (f64, f64) = (1e-13, 1e-2);
/// Longest test, s: a thousand years. Chosen.
pub(crate) const LONGEST_TEST_S: f64 = 3.2e10;
/// Fewest samples of a test. Chosen.
pub(crate) const LEAST_SAMPLES: usize = 5;

/// Gradient of a unit column, relative to the length of the right-hand side, below which nothing is gained. Chosen:
/// near rounding.
pub(crate) const NNLS_TOLERANCE: f64 = 1e-10;
/// Retardation times of the spectrum's grid for each decade. Chosen.
pub(crate) const GRID_PER_DECADE: f64 = 8.0;
/// Samples that remain of each decade where a test is thinned. Chosen.
pub(crate) const THINNED_PER_DECADE: f64 = 24.0;
/// Spikes of the spectrum nearer to each other than this ratio are one element. Tuned; data unknown.
pub(crate) const NEIGHBOUR_RATIO: f64 = 1.8;

/// Step of the finite difference of a logarithm. Chosen.
pub(crate) const LOG_DIFFERENCE: f64 = 1e-6;
/// Least compliance that a fit may take, as a share of the largest measured. Chosen.
pub(crate) const LEAST_COMPLIANCE: f64 = 1e-5;
/// Largest compliance that a fit may take, in units of the largest measured: only the slope of an element far slower
/// than the test shows. Chosen.
pub(crate) const LARGEST_COMPLIANCE: f64 = 1e2;
/// Retardation times that a fit may take: from the first sample's time times this, to the last one's times that.
/// Chosen.
pub(crate) const TAU_RANGE: (f64, f64) = (0.2, 20.0);
/// Largest logarithm of a shift factor: seven decades. Chosen.
pub(crate) const LARGEST_LOG_SHIFT: f64 = 16.0;

/// Of the fit that shows which start is best, on thinned samples. Tuned; data unknown.
pub(crate) const START_LIMITS: Limits =
    Limits { iterations: 60, cost_tolerance: 1e-6, step_tolerance: 1e-6, thorough: false };
/// Of the fit from that start: to rounding.
pub(crate) const FIT_LIMITS: Limits =
    Limits { iterations: 200, cost_tolerance: 1e-10, step_tolerance: 1e-9, thorough: false };
/// Elements in a row that bring no evidence, after which no more are tried. Chosen.
pub(crate) const MAX_VAIN_ELEMENTS: usize = 2;
/// Mean square of residuals, in units of the noise's, below which nothing is left to explain: readings are rounded.
/// Chosen.
pub(crate) const LEAST_MEAN_SQUARE: f64 = 0.1;
/// Shifts of time that are tried: up to this many decades either way. Chosen.
pub(crate) const SCAN_DECADES: f64 = 6.0;
/// Step between them, in decades. Chosen.
pub(crate) const SCAN_STEP: f64 = 0.1;

/// Last of the correlations that are tried, in steps: beyond it noise cannot be told from creep. Chosen.
pub(crate) const LAST_CORRELATION: usize = 49;
/// Step between the correlations that are tried. Chosen.
pub(crate) const CORRELATION_STEP: f64 = 0.02;
/// Shares of white noise that are tried. Chosen.
pub(crate) const WHITE_SHARES: [f64; 13] = [0.0, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4, 0.55, 0.7, 0.82, 0.92];
/// By how much twice the logarithm of the likelihood must rise for a share of white noise (Akaike 1974).
pub(crate) const WHITE_NOISE_PENALTY: f64 = 2.0;

/// Most elements that are tried where their number is left open. Chosen.
pub(crate) const MAX_ELEMENTS: usize = 6;
/// Least noise of a strain, relative. Chosen.
pub(crate) const LEAST_NOISE: f64 = 1e-6;
/// Least variance of the residuals, in units of the noise's: readings without noise still have so many digits only.
/// Chosen.
pub(crate) const LEAST_VARIANCE: f64 = 0.25;
/// Fall of the Bayesian information criterion that is worth no more than a bare mention (Kass & Raftery 1995).
pub(crate) const BARE_MENTION: f64 = 2.0;
/// Relative standard error from which a value is open. Chosen.
pub const OPEN_ERROR: f64 = 2.0;

/// Largest `C2`, K: beyond it the law of Williams, Landel and Ferry is as good as linear in the temperature. Chosen.
pub(crate) const MAX_C2_K: f64 = 1e4;
/// Of the fit of that law: to rounding.
pub(crate) const WLF_LIMITS: Limits =
    Limits { iterations: 200, cost_tolerance: 1e-14, step_tolerance: 1e-10, thorough: false };

/// Retarded compliance, as a share of J0, from which on a wall creeps. Chosen.
pub(crate) const CREEPING_SHARE: f64 = 0.05;
/// Factor by which compliances may lie beyond those of the library: other grades, and J0 of a test that begins late.
/// Chosen.
pub(crate) const MATERIAL_MARGIN: f64 = 1.5;
/// A test that the fit leaves at this many times its noise contradicts the others. Chosen.
pub(crate) const CONTRADICTING_NOISE: f64 = 2.0;
/// Variance of correlated residuals over that of independent ones from which on a reader is warned. Chosen.
pub(crate) const ALIKE_INFLATION: f64 = 3.0;

/// Widest prior that is used, relative: one decade; also where the test has no standard error. Chosen.
pub(crate) const WIDEST_PRIOR: f64 = 2.3;
/// Temperatures further apart than this are different ones, K. Chosen.
pub(crate) const SAME_TEMPERATURE_K: f64 = 1.0;
