//! Thresholds of what is made of a fit: what each means, and where it comes from.

/// Difference of the Bayesian information criterion that is strong evidence (Kass & Raftery 1995).
pub const STRONG_EVIDENCE: f64 = 6.0;
/// Share of the interval on one side by which profile and linear interval may differ before a reader is warned. Chosen.
pub(crate) const PROFILE_DIFFERS: f64 = 0.3;
