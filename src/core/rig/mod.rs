//! The rig: what stands in the lab, as the rig file describes it; SI inside.
//!
//! A rig file is TOML; [`Rig::load`] reads it and reports everything that is wrong in it at once, each with its line.
//!
//! Beside the tables that describe the rig, a file may hold steady states that a paper or a log book reports of it. Only
//! `surgescope rig check` looks at them, and says which cannot be:
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
pub(crate) mod error;
pub mod friction;
pub mod limits;
pub(crate) mod live;
pub mod material;
pub(crate) mod parse;
pub(crate) mod sensors;
pub(crate) mod table;
pub(crate) mod unique;
pub(crate) mod wall;
pub mod water;

use crate::units::Unit;

pub use crate::rig::error::{Problem, RigError};
pub use crate::rig::friction::{LAMINAR_REYNOLDS, darcy_friction_factor};
pub use crate::rig::sensors::{quantity_of, spelled_unit};
pub use crate::rig::water::WaterProperties;

/// A test rig: fluid, pipes in series from the supply to the valve, sensors and their wiring.
#[derive(Debug, Clone)]
pub struct Rig {
    /// The rig's name.
    pub name: String,
    /// The liquid.
    pub fluid: Fluid,
    /// One or more pipes in series, from the supply to the valve.
    pub pipes: Vec<Pipe>,
    /// What feeds the pipe.
    pub upstream: Upstream,
    /// The valve.
    pub valve: Valve,
    /// Every sensor, in the order of the file.
    pub sensors: Vec<Sensor>,
    /// Acquisition devices for live recording.
    pub devices: Vec<Device>,
    /// Steady states known of the rig, from a paper or a log book; only `rig check` looks at them.
    pub steady: Vec<SteadyState>,
    /// The file's text, kept to be attached to recordings unchanged.
    pub source: String,
}

/// The liquid in the pipe.
#[derive(Debug, Clone, PartialEq)]
pub struct Fluid {
    /// Its name (`water`).
    pub name: String,
    /// Temperature where a recording has no sensor for it, °C.
    pub temperature_degc: f64,
}

/// One pipe of constant section, material and nominal wave speed.
#[derive(Debug, Clone, PartialEq)]
pub struct Pipe {
    /// Its name.
    pub name: String,
    /// Length, m.
    pub length_m: f64,
    /// Inner diameter, m.
    pub inner_diameter_m: f64,
    /// Wall thickness, m.
    pub wall_thickness_m: f64,
    /// Name of its material in [`material`]'s library.
    pub material: String,
    /// Nominal wave speed, m/s, where the file gives one.
    pub wave_speed_m_s: Option<f64>,
    /// Constant Darcy friction factor, where the file gives one.
    pub friction_factor: Option<f64>,
    /// Wall roughness, m, where the file gives one.
    pub roughness_m: Option<f64>,
    /// Poisson's ratio of the wall, where the file gives one.
    pub poisson_ratio: Option<f64>,
    /// How the pipe is held.
    pub constraint: Constraint,
    /// Elevation at the supply side, m.
    pub elevation_start_m: f64,
    /// Elevation at the valve side, m.
    pub elevation_end_m: f64,
}

/// How a pipe is held along its axis; decides the constraint coefficient c₁ of the hoop strain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constraint {
    /// Expansion joints throughout.
    Free,
    /// Held at the upstream end only.
    AnchoredUpstream,
    /// Held along its whole length.
    Anchored,
    /// c₁ itself.
    Coefficient(f64),
}

/// What feeds the pipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Upstream {
    /// A tank of constant head.
    Reservoir,
    /// A pump; the base model keeps its head constant.
    Pump,
    /// A pressure sensor at position 0 drives the model.
    Measured,
}

/// The valve at the downstream end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Valve {
    /// Nominal closing time, s.
    pub closing_time_s: f64,
    /// Head behind the valve, m.
    pub discharge_head_m: f64,
}

/// What a sensor measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorKind {
    /// Gauge pressure.
    Pressure,
    /// Volume flow.
    Flow,
    /// Water temperature.
    Temperature,
    /// Relative valve opening.
    ValvePosition,
    /// The valve's command, 0 or 1.
    Trigger,
}

/// How a pressure sensor couples to the steady pressure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coupling {
    /// It sees the steady pressure.
    Dc,
    /// Piezoelectric: high-pass with the sensor's time constant.
    Ac,
}

/// One sensor.
#[derive(Debug, Clone)]
pub struct Sensor {
    /// Its name, also its column in time series.
    pub name: String,
    /// What it measures.
    pub kind: SensorKind,
    /// Distance from the supply along the pipes, m.
    pub position_m: f64,
    /// Unit of its samples.
    pub unit: Unit,
    /// Measuring range in `unit`, where given.
    pub range: Option<[f64; 2]>,
    /// Accuracy in percent of full scale, where given.
    pub accuracy_percent_fs: Option<f64>,
    /// Time constant, s: of a first-order lag (DC) or of the high-pass (AC).
    pub time_constant_s: Option<f64>,
    /// Elevation of the sensor, m; that of the pipe at its place if absent.
    pub elevation_m: Option<f64>,
    /// Coupling of a pressure sensor.
    pub coupling: Coupling,
    /// Live wiring, where the sensor is recorded live.
    pub wiring: Option<Wiring>,
}

/// Which channel of which device carries a sensor, and its calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Wiring {
    /// Device name.
    pub device: String,
    /// Column from 0 (`frames`, `lines`) or register address (`modbus-rtu`).
    pub channel: u16,
    /// Sensor units per count.
    pub scale: f64,
    /// Sensor units at count 0.
    pub offset: f64,
    /// Register layout, for `modbus-rtu`.
    pub register: Option<Register>,
}

/// Layout of a Modbus value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Register {
    /// Input registers (function 4) rather than holding registers (function 3).
    pub input: bool,
    /// Number format.
    pub encoding: Encoding,
    /// Most significant word first.
    pub big_word_order: bool,
}

/// Number format of a Modbus value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Encoding {
    U16,
    I16,
    U32,
    I32,
    F32,
}

impl Encoding {
    /// Number of 16-bit registers that a value takes.
    pub fn words(self) -> u64 {
        match self {
            Encoding::U16 | Encoding::I16 => 1,
            Encoding::U32 | Encoding::I32 | Encoding::F32 => 2,
        }
    }
}

/// An acquisition device on a serial port.
#[derive(Debug, Clone, PartialEq)]
pub struct Device {
    /// Its name.
    pub name: String,
    /// Port path.
    pub port: String,
    /// Baud rate.
    pub baud: u32,
    /// What a character on the line looks like.
    pub framing: Framing,
    /// What it speaks.
    pub protocol: Protocol,
}

impl Device {
    /// Baud rate and format of its line, as in `115200 baud 8N1`.
    pub fn speed(&self) -> String {
        format!("{} baud {}", self.baud, self.framing)
    }
}

/// What a character on a serial line looks like; 8N1 unless the file says otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Framing {
    /// 7 or 8.
    pub data_bits: u8,
    /// Whether a bit more makes the number of ones even or odd.
    pub parity: Parity,
    /// 1 or 2.
    pub stop_bits: u8,
}

impl Default for Framing {
    fn default() -> Framing {
        Framing { data_bits: 8, parity: Parity::None, stop_bits: 1 }
    }
}

impl std::fmt::Display for Framing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parity = match self.parity {
            Parity::None => 'N',
            Parity::Even => 'E',
            Parity::Odd => 'O',
        };
        write!(f, "{}{parity}{}", self.data_bits, self.stop_bits)
    }
}

/// Parity of a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Parity {
    None,
    Even,
    Odd,
}

/// Wire protocol of a device.
#[derive(Debug, Clone, PartialEq)]
pub enum Protocol {
    /// COBS frames of samples.
    Frames,
    /// Text lines.
    Lines,
    /// Polled Modbus RTU.
    ModbusRtu {
        /// Slave address.
        unit_id: u8,
        /// Time between polls, s.
        poll_interval_s: f64,
        /// Time to wait for an answer, s.
        timeout_s: f64,
    },
}

/// A steady state that somebody reported of the rig (`[[steady]]`): what `rig check` holds against the rest.
#[derive(Debug, Clone, PartialEq)]
pub struct SteadyState {
    /// Its name, e.g. that of a case in a paper.
    pub name: String,
    /// Volume flow, m³/s.
    pub flow_m3_s: f64,
    /// Head of the supply above the valve's discharge, m, where reported.
    pub supply_head_m: Option<f64>,
    /// Water temperature, °C; that of the fluid where not reported.
    pub temperature_degc: Option<f64>,
    /// Reynolds number as reported.
    pub reynolds_number: Option<f64>,
    /// Wave speed as reported, m/s.
    pub wave_speed_m_s: Option<f64>,
}

impl Rig {
    /// Length of all pipes together, m.
    pub fn length_m(&self) -> f64 {
        self.pipes.iter().map(|p| p.length_m).sum()
    }

    /// The pressure sensors with their index in [`Rig::sensors`].
    pub fn pressure_sensors(&self) -> impl Iterator<Item = (usize, &Sensor)> {
        self.sensors.iter().enumerate().filter(|(_, s)| s.kind == SensorKind::Pressure)
    }

    /// Elevation of a sensor, m: its own, or that of the pipe's axis at its place.
    pub fn sensor_elevation_m(&self, sensor: &Sensor) -> f64 {
        sensor.elevation_m.unwrap_or_else(|| self.elevation_m(sensor.position_m))
    }

    /// Elevation of the pipe axis at a position, m (linear along each pipe).
    pub fn elevation_m(&self, position_m: f64) -> f64 {
        let mut start = 0.0;
        for (i, pipe) in self.pipes.iter().enumerate() {
            if position_m <= start + pipe.length_m || i + 1 == self.pipes.len() {
                let part = ((position_m - start) / pipe.length_m).clamp(0.0, 1.0);
                return pipe.elevation_start_m + part * (pipe.elevation_end_m - pipe.elevation_start_m);
            }
            start += pipe.length_m;
        }
        0.0
    }
}
