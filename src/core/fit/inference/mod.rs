//! How well a fit knows its values: errors, intervals, noise that is not white, combinations nobody sees.

pub mod errors;
pub mod identify;
pub mod interval;
pub mod noise_autocorrelation;
pub(crate) mod optimum;
