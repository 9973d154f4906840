//! Every threshold of the diagnosis: what it means and where it comes from.
//!
//! The last words of each comment name the source:
//!
//! - *derived*: it follows from the definition or from numbers named there;
//! - *literature*: a published value;
//! - *cost*: it bounds work and changes no answer where it is large enough;
//! - *tuned*: chosen by trial. The data are named where they are known; "data unknown" means that no record of them is
//!   left.
//!
//! "Error over noise" is the residual of each sensor in units of its own noise, rms over all samples. A "square" is the
//! sum of these over all samples, squared. "Evidence" is a natural logarithm of odds over the start model, before
//! tempering.

use crate::fit::numeric::least_squares::Limits;
use crate::model::effects::CATALOGUE;

// ---- The baseline: binned samples on a coarse grid -----------------------------------------------------------------

/// Norm of a Jacobian column, in units of the noise, below which the data do not see a parameter. Derived: its standard
/// error is above ten, of a logarithm a factor of 20,000, so a step of it leads to a bound.
pub(crate) const UNSEEN_COLUMN: f64 = 0.1;
/// A record lies on the floor of vapour pressure if one sample in this many does: a single sample may be a dead count.
/// Chosen: where the lowest sample counts, the open sets have the same answers.
pub(crate) const FLOOR_SAMPLES: usize = 500;
/// Independent features of a half cycle: front, plateau, return. Derived from the shape of a half cycle.
pub(crate) const FEATURES_PER_HALF_CYCLE: f64 = 3.0;
/// Half cycles of a run in which the error of a model tells something new: later ones repeat it. Chosen after a cavity
/// that was taken for gas, with certainty, where both left 25 times the noise in dozens of cycles.
pub(crate) const TELLING_HALF_CYCLES: usize = 8;

// ---- Candidates and their refits -----------------------------------------------------------------------------------

/// Most elements with which an effect that has elements is tried. Cost.
pub(crate) const MOST_ELEMENTS: usize = 3;
/// Strengths at which an effect's signature is taken, as multiples of its usual start. Chosen: with the first alone
/// the open sets have the same answers.
pub(crate) const STRENGTHS: [f64; 5] = [1.0, 0.1, 0.3, 3.0, 10.0];
/// Most places at which an effect is tried in all strengths; with more places, one strength has to do. Cost.
pub(crate) const FEW_PLACES: usize = 12;
/// Range of strengths, as multiples of the one that was simulated, over which a linear forecast is trusted. Tuned: data
/// unknown.
pub(crate) const FORECAST_RANGE: (f64, f64) = (0.3, 2.0);
/// Effects that are refined; the others are only screened. Cost: where all are refined, or none, the open sets have the
/// same answers.
pub(crate) const REFINED_EFFECTS: usize = 6;

// ---- Full fits -----------------------------------------------------------------------------------------------------

/// A candidate that leaves this many times the best candidate's square gets no full fit. Cost: where all leading
/// ones get one, the open sets have the same answers.
pub(crate) const NO_FULL_FIT_ABOVE: f64 = 4.0;

/// Most effects that one diagnosis finds missing. Cost: a further diagnosis finds more.
pub(crate) const MOST_MISSING: usize = 2;

// ---- Evidence ------------------------------------------------------------------------------------------------------

/// Divides the evidence before it becomes odds, as models err in ways that the noise does not know of. Tuned: data
/// unknown.
pub(crate) const TEMPERATURE: f64 = 4.0;
/// Odds, before any data, that nothing is missing against any one effect. Derived: nothing is as probable as that one
/// of the effects of the catalogue is missing.
pub(crate) const PRIOR_ODDS_OF_NOTHING: f64 = CATALOGUE.len() as f64;
/// Least that an effect must take away of the error over noise, in quadrature: less is not worth a model. Tuned: data
/// unknown.
pub(crate) const LEAST_FALL: f64 = 0.25;
/// Share of the surge's height by which solvers differ that are both right: an effect that takes away less stands in
/// for such a difference. Chosen: models with the true effect leave 0.02 to 0.1% of three in four recordings that the
/// scheme of `tools/hidden` makes.
pub(crate) const MODEL_ERROR: f64 = 7e-4;
/// Share of the error that an effect takes away by which two right models of that effect differ: a further effect that
/// takes less makes up for such a difference. Chosen: a swinging valve of `tools/hidden` and ours differ by nearly as
/// much.
pub(crate) const ERROR_OF_EFFECT: f64 = 0.02;
/// Share of [`LEAST_FALL`]'s square that a refit must forecast for a fit to all samples. Cost: forecasts of the fall
/// were right to a factor of three on all recordings of the open sets.
pub(crate) const LEAST_FORECAST: f64 = 0.2;
/// Share of an effect's odds that is left where one of its own parameters ends at a bound: the records ask for what
/// lies beyond, such as a leak at the valve, and another effect may be just that. Derived: of a pipe, 4% lie beyond the
/// bounds of a place.
pub(crate) const ODDS_AT_BOUND: f64 = 0.04;
/// Evidence that an effect has at most if it is not worth a model. Tuned: data unknown.
pub const NEGLIGIBLE_EVIDENCE: f64 = -16.0;

// ---- Verdict -------------------------------------------------------------------------------------------------------

/// An effect that leaves more than this share of the start model's square beyond the noise, and more than
/// `DOUBTFUL_ABOVE`, does not explain it. Tuned: data unknown.
pub(crate) const UNEXPLAINED_SHARE: f64 = 0.35;
/// How fast the probability of something outside the catalogue rises with the logarithm of the error around
/// `NOISE_LIKE`, if no effect explains any of it. Tuned on recordings of `tools/hidden` of one seed;
/// `tools/reliability.py` counts it on other seeds.
pub(crate) const STEEPNESS_UNEXPLAINED: f64 = 20.0;
/// The same around `DOUBTFUL_ABOVE`, if an effect explains some of it. Tuned on the same recordings.
pub(crate) const STEEPNESS: f64 = 4.0;
/// A model whose error of prediction is this many times the start model's has learned nothing of use. Tuned: data
/// unknown.
pub(crate) const WORSE_PREDICTION: f64 = 1.05;
/// Wave speeds within this factor of the greatest that the rig file allows are as fast. Chosen.
pub(crate) const AS_FAST: f64 = 1.005;
/// Probability that the rig file is wrong where even the answer needs a wave that its pipe cannot have. Chosen.
pub(crate) const RIG_FILE_IS_WRONG: f64 = 0.99;

// ---- Residual patterns and warnings --------------------------------------------------------------------------------

/// Mean error of a sensor's peaks or troughs, over its noise, above which it is described. Tuned: data unknown.
pub(crate) const DESCRIBED_EXTREMA: f64 = 2.0;
/// Standard errors by which the model's lateness stands out from the scatter of the extrema. Chosen.
pub(crate) const LATENESS_ERRORS: f64 = 3.0;
/// Extrema whose phase is known, at least, for lateness to be spoken of. Chosen.
pub(crate) const LEAST_PHASES: usize = 4;
/// A start model that leaves more than this share of the signal's deviation, rms, was not fitted. Tuned: data unknown.
pub(crate) const NOT_FITTED: f64 = 0.5;

// ---- The next test -------------------------------------------------------------------------------------------------

/// Most repeats of a test that are proposed. A choice.
pub(crate) const MOST_REPEATS: f64 = 20.0;
/// Tests that are looked at more closely. Cost.
pub(crate) const BEST_TESTS: usize = 8;
/// Draws of an answer's parameters from what the records leave open, the centre among them. Cost.
pub(crate) const DRAWS: u32 = 3;
/// Stopping rules while an answer is fitted to the record that another expects. Cost.
pub(crate) const DESIGN: Limits = Limits { iterations: 20, cost_tolerance: 3e-3, step_tolerance: 1e-6, thorough: true };
/// Most tests that are named. A choice of presentation.
pub(crate) const NAMED_TESTS: usize = 2;
/// Velocities, closing times and compliances within this share are the same to a test. A choice.
pub(crate) const SAME_SHARE: f64 = 0.2;
/// Heads within this are the same test, m. A choice.
pub(crate) const SAME_HEAD_M: f64 = 5.0;
/// Sensors within this share of the length stand at the same place. A choice.
pub(crate) const SAME_PLACE: f64 = 0.1;
