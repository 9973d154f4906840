//! surgescope records valve-closure (water-hammer) tests, models them, calibrates the model and shows which physics it
//! lacks.
//!
//! The front door is [`Study`]: it opens recordings, calibrates models, diagnoses what they lack and grows them;
//! [`UntilDone`](study::until_done::UntilDone) goes on until nothing is missing.
//!
//! ```no_run
//! use surgescope::Study;
//!
//! // recordings of one rig: read, inspected, prepared
//! let study = Study::open(["recordings/hdpe-creep.mcap"])?;
//! for warning in study.warnings() {
//!     eprintln!("{warning}");
//! }
//! // the base model, with a value that is known
//! let base = study.calibrate("none").hold("closing_time_s", 0.1).run()?;
//! // what it lacks, and the model that has it: one effect, or two
//! let diagnosis = study.diagnose(&base)?;
//! if let Some(grown) = diagnosis.answer() {
//!     println!("{}: evidence {:.0}", diagnosis.answer_label(), diagnosis.answer_evidence());
//!     println!("wave speed {:.1} m/s", grown.parameter("wave_speed_m_s")?.value);
//! }
//! # Ok::<(), surgescope::Error>(())
//! ```
//!
//! Test data walks through the rooms in one direction, and each room uses only those above it:
//!
//! | module | what happens there |
//! | --- | --- |
//! | [`units`] | display units at the edges, SI inside |
//! | [`number`] | how many digits a value deserves |
//! | [`rig`] | the rig file: pipes, water, materials, sensors, wiring |
//! | [`recording`] | a test in memory: samples of each sensor, gaps, metadata |
//! | [`signal`] | noise, steady pressures, extrema, period, wave speed |
//! | [`align`] | several recordings of one closure, each on its own clock, become one |
//! | [`model`] | the method of characteristics, its boundaries and effects |
//! | [`sensitivity`] | which parameter affects what: analysis of variance, maps, Morris, Sobol, the source paper's rules |
//! | [`fit`] | calibration: bounded least squares, comparison, uncertainty |
//! | [`valve`] | how the valve closed, from the head upstream of it |
//! | [`creep`], [`temperature`] | creep tests of the wall's material; runs at several temperatures |
//! | [`diagnose`] | where a model fails, and which effect it lacks |
//! | [`storage`] | recordings on disk: MCAP writer, reader, recovery; import and export |
//! | [`draft`] | what a file of a test tells of its rig |
//! | [`record`] | live streams: wire protocols, ports, sessions |
//! | [`live`] | what is recorded, over a WebSocket while it is |
//! | [`simulate`] | simulated runs and devices |
//! | [`results`] | fits and models as files, and every run of a folder in an index |
//! | [`study`] | the front door |
//! | [`report`] | tables, JSON and HTML |
//! | [`replay`] | results kept beside recordings, and whether they still hold |
//! | [`campaign`] | thousands of fits, planned once and run in shards |
//! | [`watch`] | from a finished recording to its verdict, without a person |
//! | [`web`] | the workbench in the browser |
//! | [`cli`] | the program: one thin file per command |
//!
//! # The model alone
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
//! let conditions = Conditions::of(water);
//! let resolution = Resolution { reaches: 100, duration_s: 1.0 };
//! let traces = model.simulate(&conditions, &[395.0], &run, resolution, &[Probe::head(rig.length_m())])?.traces;
//! let rise_m = traces[0].at(0.5) - traces[0].at(0.0);
//! assert!((rise_m - 395.0 * 0.5 / 9.81).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![warn(missing_docs)]

pub mod campaign;
pub mod cli;
pub mod draft;
pub mod live;
mod own_host;
pub mod record;
pub mod replay;
pub mod report;
pub mod results;
pub mod simulate;
pub mod storage;
pub mod study;
pub mod watch;
pub mod web;

pub use crate::diagnose::Diagnosis;
pub use crate::fit::outcome::fit::Fit;
pub use crate::recording::Recording;
pub use crate::rig::Rig;
pub use crate::study::Study;
pub use crate::study::error::Error;

pub use surgescope_core::{
    align, creep, diagnose, fit, model, number, recording, rig, sensitivity, signal, temperature, units, valve,
};
use surgescope_core::{extent, robust, shown, text_file};
