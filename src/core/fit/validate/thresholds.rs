//! Thresholds of how a fitted model is checked: what each means, and where it comes from.

/// Distance of a fitted value from what a meter or the signals show, in standard deviations, that contradicts them.
/// Chosen.
pub(crate) const CONFLICT_SD: f64 = 5.0;
/// The same for what a test of the material shows. Chosen.
pub(crate) const PRIOR_CONFLICT_SD: f64 = 3.0;

/// What a model leaves, in units of the noise and the grid's error, from which its intervals are too narrow. Measured:
/// docs/src/measured/coverage.md.
pub(crate) const LACKING_RATIO: f64 = 1.1;

/// Share of each record that is fitted, the rest being predicted. Chosen.
pub(crate) const FITTED_SHARE: f64 = 0.6;

/// A closure slower than 2L/a is followed for this many of its durations. Chosen.
pub(crate) const CLOSURE_MARGIN: f64 = 1.25;

/// Most points of a profile on one side of the best value. Tuned; data unknown.
pub(crate) const MAX_PROFILE_POINTS: usize = 11;
/// How near to the threshold an end must be, in standard errors. Chosen.
pub(crate) const THRESHOLD_WITHIN: f64 = 0.03;
/// The same where all points are spent. Chosen.
pub(crate) const THRESHOLD_WITHIN_AT_LAST: f64 = 0.25;
/// Share of its distance to which a steep end must be known where all points are spent. Chosen.
pub(crate) const NARROW_BRACKET: f64 = 0.05;
/// Fall of the sum of squares, in units of the threshold's, that is not worth another iteration. Derived: a tenth of a
/// standard error.
pub(crate) const PROFILE_COST_TOLERANCE: f64 = 0.01;
/// Share of a rise that a descent may predict to take back before the point counts as unresolved. Chosen.
pub(crate) const UNRESOLVED_SHARE: f64 = 0.1;
