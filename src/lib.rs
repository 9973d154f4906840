//! surgescope records valve-closure (water-hammer) tests, models them, calibrates the model and shows which physics it lacks.
//!
//! Test data walks through the rooms in one direction:
//!
//! | module | what happens there |
//! | --- | --- |
//! | [`units`] | display units at the edges, SI inside |
//! | [`rig`] | the rig file: pipes, water, materials, sensors, wiring |
//! | [`recording`] | a test in memory: samples of each sensor, gaps, metadata |
//! | [`log`] | recordings on disk: MCAP writer, reader, recovery; CSV import and export |
//! | [`record`] | live streams: wire protocols, ports, sessions, the simulated rig |
//! | [`signal`] | noise, steady pressures, extrema, period, wave speed |
//! | [`model`] | the method of characteristics, its boundaries and effects |
//! | [`fit`] | calibration: bounded least squares, comparison, uncertainty |
//! | [`report`] | tables, JSON and HTML |
//! | [`replay`] | results kept beside recordings, and whether they still hold |
//! | [`cli`] | one thin file a command |
#![warn(missing_docs)]

pub mod cli;
pub mod fit;
pub mod log;
pub mod model;
pub mod record;
pub mod recording;
pub mod replay;
pub mod report;
pub mod rig;
pub mod signal;
pub mod units;
