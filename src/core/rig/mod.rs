//! The rig: what stands in the lab, as the rig file describes it. All values are SI.
//!
//! A rig file is TOML; [`Rig::load`] reads it and reports all its errors at once, each with its line.
//!
//! A file may also hold steady states that a paper or a log book reports of the rig. Only `surgescope rig check` uses
//! them, and reports which are impossible:
//!
//! ```toml
//! [[steady]]
//! name = "Case 1"
//! flow_m3_h = 2.59
//! # optional:
//! supply_head_m = 62.6         # above the datum of the elevations
//! temperature_degC = 24.0      # else that of [fluid]
//! reynolds_number = 71937.0    # as reported, in the first pipe
//! wave_speed_m_s = 470.0       # as reported, in the first pipe
//! ```

pub mod check;
pub mod compare;
pub(crate) mod device;
pub mod draft;
pub(crate) mod error;
pub mod friction;
pub(crate) mod graph;
pub mod limits;
pub(crate) mod live;
pub mod material;
pub(crate) mod network;
pub mod own_effects;
pub(crate) mod parse;
pub(crate) mod sensors;
pub mod sizes;
pub(crate) mod table;
pub(crate) mod types;
pub(crate) mod unique;
pub(crate) mod wall;
pub mod water;
pub(crate) mod way;

pub use crate::rig::device::{
    Command, Device, Encoding, Framing, Parity, Port, Protocol, Register, Serial, TimeUnit, Wiring,
};
pub use crate::rig::error::{Problem, RigError};
pub use crate::rig::friction::{
    CERTAINLY_LAMINAR_REYNOLDS, LAMINAR_REYNOLDS, Regime, darcy_friction_factor, turbulent_friction_factor,
};
pub use crate::rig::graph::{Closing, Drive, Graph, Line, Node, NodeKind, Opening, Place, Pump, PumpCurve, at_time};
pub use crate::rig::sensors::{quantity_of, spelled_unit};
pub use crate::rig::types::{
    Constraint, Coupling, Fluid, Pipe, Rig, Sensor, SensorKind, SteadyState, Tolerance, Upstream, Valve,
};
pub use crate::rig::water::WaterProperties;
