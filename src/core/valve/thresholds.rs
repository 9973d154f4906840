//! Thresholds of the valve's law: what each means, and where it comes from.

/// Share of the square beyond the noise that a law of the valve has to take off to be the valve's: else any law mends a
/// pipe that lacks something a little. Chosen.
pub(crate) const LAW_SHARE: f64 = 0.5;
/// Share by which wave speeds are changed to show how the curve depends on them. Chosen.
pub(crate) const WAVE_SPEED_CHANGE: f64 = 0.02;
/// The same for compliances. Chosen.
pub(crate) const CREEP_CHANGE: f64 = 0.2;
