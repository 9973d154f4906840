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
//! | [`align`] | several recordings of one closure, each on its own clock, become one |
//! | [`model`] | the method of characteristics, its boundaries and effects |
//! | [`sensitivity`] | which parameter moves what: analysis of variance, maps, Morris, Sobol, the source paper's rules |
//! | [`fit`] | calibration: bounded least squares, comparison, uncertainty |
//! | [`diagnose`] | where a model fails, and which effect it lacks |
//! | [`history`] | every run of a folder in an index, and the drift of a rig's parameters |
//! | [`report`] | tables, JSON and HTML |
//! | [`replay`] | results kept beside recordings, and whether they still hold |
//! | [`watch`] | from a finished recording to its verdict: which files are finished, the model to start from, what to say |
//! | [`cli`] | one thin file a command |
//!
//! # Example
//!
//! Joukowsky's head on a rig of the project, by simulation:
//!
//! ```
//! use surgescope::model::{Conditions, Model, Resolution, RunValues, trace::Probe};
//! use surgescope::rig::Rig;
//!
//! let rig = Rig::from_toml(include_str!("../rigs/imperial-pe.toml"), "imperial-pe.toml")?;
//! let water = rig.fluid.properties(20.0);
//! let model = Model::new(&rig, &water, &[]);
//! let run = RunValues { initial_velocity_m_s: 0.5, valve_head_m: 45.0, closing_time_s: 0.1, friction_scale: 0.0 };
//! let conditions = Conditions { water, supply_deviation: None };
//! let resolution = Resolution { reaches: 100, duration_s: 1.0 };
//! let traces = model.simulate(&conditions, &[395.0], &run, resolution, &[Probe::Head(rig.length_m())])?.traces;
//! let rise_m = traces[0].at(0.5) - traces[0].at(0.0);
//! assert!((rise_m - 395.0 * 0.5 / 9.81).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![warn(missing_docs)]

pub mod cli;
pub mod record;
pub mod replay;
pub mod report;
pub mod results;
pub mod simulate;
pub mod storage;
pub mod study;
pub mod watch;

pub use crate::diagnose::Diagnosis;
pub use crate::fit::outcome::fit::Fit;
pub use crate::recording::Recording;
pub use crate::rig::Rig;
pub use crate::study::Study;
pub use crate::study::error::Error;

use surgescope_core::robust;
pub use surgescope_core::{
    align, creep, diagnose, fit, model, recording, rig, sensitivity, signal, temperature, units, valve,
};
