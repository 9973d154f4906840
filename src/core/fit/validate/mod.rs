//! Whether a fitted model holds: predictions, cross-validation, profiles, contradictions with what was known.

pub mod conflict;
pub mod cross_validate;
pub mod energy;
pub mod frequency;
pub mod held_out;
pub mod predict;
pub mod profile;
pub(crate) mod thresholds;
