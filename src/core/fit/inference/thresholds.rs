//! Thresholds of errors and intervals: what each means, and where it comes from.

/// A fit that leaves less than this share of the mean square of the noise before the closure shows that the noise has
/// died away. Tuned; data unknown.
pub(crate) const DECAYED_NOISE_SHARE: f64 = 0.6;

/// Share of a variable in the unidentifiable space from which on it is named, and of two from which on they go
/// together. Chosen.
pub(crate) const UNIDENTIFIED_SHARE: f64 = 0.2;
/// An exponent this close to one is rounded to one. Chosen.
pub(crate) const UNIT_EXPONENT_WITHIN: f64 = 0.15;

/// Independent frequencies on either side over which a spectrum is averaged, at least. Tuned; data unknown.
pub(crate) const MIN_SMOOTHING_NEIGHBOURS: f64 = 16.0;
/// The same as a share of the frequency, where that is more. Tuned; data unknown.
pub(crate) const SMOOTHING_SHARE: f64 = 0.25;
/// Slowest autoregression that is tried: the decade of `1 - φ`. Chosen.
pub(crate) const SLOWEST_DECADE: i32 = -4;
/// White noise that is tried beside an autoregression: decades of its share in the top of the spectrum, over `1 - φ`.
/// Chosen.
pub(crate) const WHITE_DECADES: (i32, i32) = (-4, 2);
/// Shapes of a spectrum that are tried for each decade. Chosen.
pub(crate) const SHAPES_PER_DECADE: i32 = 4;
/// Width of the bands over which a periodogram is summed before a shape is fitted, as a share of their frequency.
/// Chosen.
pub(crate) const BAND_SHARE: f64 = 0.15;

/// Predicted reduction of the sum of squares, in units of what one sample leaves, up to which a search has ended at an
/// optimum. Derived: it is the square of the distance in standard errors, here one half.
pub(crate) const OPTIMUM_REDUCTION: f64 = 0.25;
