//! Calibration: from a recording to the fitted model of the run.
//!
//! Floors, each using only those above it in this list:
//!
//! | floor | what it holds |
//! | --- | --- |
//! | [`numeric`] | methods that know nothing of pipes |
//! | [`data`] | what a fit sees of a run |
//! | [`problem`] | variables and residuals |
//! | [`outcome`] | what a fit gives back |
//! | [`inference`] | errors, intervals, combinations that no record determines |
//! | [`search`] | the way to an optimum |
//! | [`posterior`] | joint posteriors, and where they are needed |
//! | [`validate`] | whether a fitted model holds |
//!
//! The thresholds of a floor stand in its file `thresholds`, with their origin: *derived*; a reference to the
//! literature; *tuned*, where trials on data led to the value (what data, the history does not tell); *chosen*, a round
//! value set by hand.

pub mod data;
pub mod inference;
pub mod numeric;
pub mod outcome;
pub mod posterior;
pub mod problem;
pub mod progress;
pub mod search;
pub mod validate;
