//! The way to an optimum: coarse fits, descents, global searches, elements that come and go.

pub(crate) mod assemble;
pub mod calibrate;
pub(crate) mod calibrator;
pub(crate) mod coarse_fit;
pub(crate) mod descent;
pub(crate) mod finish;
pub mod from_signals;
pub(crate) mod global;
pub mod options;
pub(crate) mod polish;
pub(crate) mod prune_elements;
pub mod sensor_choice;
pub(crate) mod starts;
pub(crate) mod stepwise;
pub(crate) mod thresholds;
