//! Calibration: from a recording to the fitted model of the run.

pub mod data;
pub mod inference;
pub mod numeric;
pub mod outcome;
pub mod problem;
pub mod search;
pub mod validate;
