//! Thresholds of what a fit sees of a run: what each means, and where it comes from.

/// Relative uncertainty of a flow meter that states none. Chosen.
pub(crate) const DEFAULT_FLOW_UNCERTAINTY: f64 = 0.01;
/// Relative uncertainty of a velocity taken from the pressure rise where there is no flow meter. Chosen.
pub(crate) const JOUKOWSKY_UNCERTAINTY: f64 = 0.2;
/// Factor by which the rig file's closing time may differ from the one that the pressures show before these are
/// believed. Derived: 1.4 standard deviations of what is known of it beforehand.
pub(crate) const CLOSING_TIME_FACTOR: f64 = 2.0;
/// Standard error of the time at which a closure is seen to end, in periods of the oscillation after it. Derived: an
/// eighth is half the stretch over which the head comes to repeat itself.
pub(crate) const CLOSURE_END_PERIODS: f64 = 0.125;
/// A sensor's lower end this close to the vapour pressure, Pa, does not count: the water boils there. Chosen.
pub(crate) const VAPOUR_MARGIN_PA: f64 = 5e3;
/// Zero error of a pressure sensor that states none, as a share of the first rise. Chosen.
pub(crate) const DEFAULT_OFFSET_SHARE: f64 = 0.01;
/// Factor by which the residual of a smoothed series may exceed its noise. Tuned; data
/// unknown.
pub(crate) const SMOOTHING_EXCESS: f64 = 1.03;
/// Accuracy class of a pressure sensor that states none, percent of its span. Common industrial transmitters.
pub(crate) const DEFAULT_ACCURACY_PERCENT: f64 = 0.25;
/// Samples before the front from which a record shows the head before the closure. Chosen.
pub(crate) const FEWEST_BEFORE: f64 = 3.0;
