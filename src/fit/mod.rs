//! Calibration: from a recording to the fitted model of the run.

pub mod outcome;
