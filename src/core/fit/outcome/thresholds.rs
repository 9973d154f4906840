//! Thresholds of what is made of a fit: what each means, and where it comes from.

/// Evidence, as a natural logarithm of odds, that is strong: odds of twenty. Literature: Kass & Raftery (1995).
pub const STRONG_EVIDENCE: f64 = 3.0;
/// Share of the interval on one side by which profile and linear interval may differ before a reader is warned. Chosen.
pub(crate) const PROFILE_DIFFERS: f64 = 0.3;
