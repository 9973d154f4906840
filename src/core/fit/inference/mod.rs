//! How well a fit knows its values: errors, intervals, noise that is not white, combinations that no record shows.

pub mod errors;
pub mod identify;
pub mod interval;
pub mod noise_autocorrelation;
pub(crate) mod thresholds;
