//! The model of a rig: base model and effects, their parameters, and the simulation of one run by the method of
//! characteristics.
//!
//! The base model has elastic waves, quasi-steady wall friction, a constant supply head and a valve whose opening falls
//! linearly in time. Effects (see [`effects`]) add to it.

pub(crate) mod attach;
pub mod boundary;
pub(crate) mod chosen;
pub mod constraint;
pub mod contribution;
pub(crate) mod convolution;
pub(crate) mod definition;
pub mod eddy_viscosity;
pub(crate) mod effect;
pub mod effects;
pub(crate) mod end;
pub mod energy;
pub mod error;
pub(crate) mod fitted;
pub mod friction;
pub mod gas;
pub mod grid;
pub(crate) mod joint;
pub(crate) mod junction;
pub mod kernel;
pub(crate) mod late;
pub(crate) mod laws;
pub mod line_flows;
pub mod memory;
pub(crate) mod multigrid;
pub(crate) mod network;
pub mod node;
pub mod oscillator;
pub(crate) mod other_valves;
pub mod own;
pub mod parameter;
pub(crate) mod passage;
pub mod prior;
pub mod profile;
pub mod reaches;
pub(crate) mod rings;
pub(crate) mod run;
pub(crate) mod scene;
pub mod sensor;
pub(crate) mod simulate;
pub mod solver;
pub(crate) mod sparse;
pub(crate) mod state;
pub mod steady;
pub mod stencil;
pub mod stop;
pub mod trace;
pub(crate) mod unsteady_kernels;
pub mod valve_from_head;
pub mod wall;

pub use crate::model::definition::{Model, check_places};
pub use crate::model::error::ModelError;
pub use crate::model::run::{Conditions, LEAST_DROP_M, Resolution, RunValues, Simulated};
