//! Thresholds of calibration as a problem: what each means, and where it comes from.

use crate::fit::numeric::least_squares::Limits;

/// Standard deviations that a sensor may stand off the place in the rig file. Chosen.
pub(crate) const FARTHEST_SD: f64 = 6.0;
/// Uncertainty of the time of a crossing, as a share of the period. Chosen.
pub(crate) const PHASE_SHARE: f64 = 1e-3;
/// Share of a period before the closure from which samples are compared: its start is not known to the sample. Chosen.
pub(crate) const LEAD_OF_PERIOD: f64 = 0.1;
/// How far a step along one direction may go back and on, in lengths of the direction. Chosen.
pub(crate) const DIRECTION_SHARES: (&[f64], &[f64]) = (&[-1.0], &[30.0]);

/// Share of the fundamental on each side of a harmonic whose bins count. Chosen.
pub(crate) const HARMONIC_HALF_WIDTH: f64 = 0.5;
/// A harmonic must exceed the level of the noise by this factor. Derived: white noise
/// reaches it in one bin of ten million, `exp(-4²)`.
pub(crate) const HARMONIC_OVER_NOISE: f64 = 4.0;
/// No harmonic beyond this number is looked for. Chosen.
pub(crate) const MAX_HARMONICS: usize = 40;
/// Harmonics in a row that noise hides, after which no other is looked for. Chosen.
pub(crate) const MAX_MISSING_HARMONICS: usize = 3;

/// Samples that show the autocorrelation of noise. Derived: six times the frequencies that are averaged at least.
pub(crate) const MIN_NOISE_SAMPLES: usize = 200;

/// Retardation times that a surge can show, in its periods: a slower element does not move during the surge, a faster
/// one belongs to the wave speed. Chosen.
pub(crate) const VISIBLE_TIMES_PERIODS: (f64, f64) = (0.01, 10.0);
/// Least compliance that a surge can show, as a share of the largest that its bounds allow. Tuned; data unknown.
pub(crate) const VISIBLE_COMPLIANCE_SHARE: f64 = 1e-3;

/// How far from the valve a sensor may be to show the head before it, as a share of the pipe's length. Chosen.
pub(crate) const VALVE_SENSOR_SHARE: f64 = 0.01;
/// How far the curve of the valve is read back, in fitted closing times: the valve may have taken longer than fitted.
/// Chosen.
pub(crate) const READ_BACK_SPAN: f64 = 2.0;
/// A kink of less than this share of the opening off the straight line is none; nor is one of less than so many times
/// what the law leaves of the curve. Chosen: a fiftieth, and two standard deviations.
pub(crate) const STRAIGHT_WITHIN: (f64, f64) = (0.02, 2.0);
/// Of the fit of two stages to a curve: to rounding, for it is cheap.
pub(crate) const TWO_STAGE_LIMITS: Limits =
    Limits { iterations: 100, cost_tolerance: 1e-10, step_tolerance: 1e-10, thorough: false };
