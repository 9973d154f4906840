//! The rig as plain data: fluid, pipes, ends, sensors.

use std::collections::BTreeMap;

use crate::rig::device::{Device, Wiring};
use crate::rig::graph::{Graph, Place};
use crate::units::Unit;

/// A test rig: fluid, pipes and how they are joined, sensors and their wiring.
#[derive(Debug, Clone)]
pub struct Rig {
    /// The rig's name.
    pub name: String,
    /// The liquid.
    pub fluid: Fluid,
    /// One or more pipes, line after line.
    pub pipes: Vec<Pipe>,
    /// How they are joined.
    pub graph: Graph,
    /// What feeds the pipes.
    pub upstream: Upstream,
    /// The valve.
    pub valve: Valve,
    /// Every sensor, in the order of the file.
    pub sensors: Vec<Sensor>,
    /// Acquisition devices for live recording.
    pub devices: Vec<Device>,
    /// Steady states reported of the rig, by a paper or a log book; only `rig check` uses them.
    pub steady: Vec<SteadyState>,
    /// The file's text, kept to be attached to recordings unchanged.
    pub source: String,
    /// Effects of its own, as text: the files `effects/NAME.toml` beside it.
    pub own_effects: BTreeMap<String, String>,
}

/// How exactly a pipe's dimensions are known: standard deviations, as shares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Of the length.
    pub length: f64,
    /// Of the inner diameter.
    pub diameter: f64,
    /// Of the wall thickness.
    pub wall: f64,
}

/// The liquid in the pipe.
#[derive(Debug, Clone, PartialEq)]
pub struct Fluid {
    /// Its name (`water`).
    pub name: String,
    /// Temperature if a recording has no sensor for it, °C.
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
    /// Name of its material in [`material`](crate::rig::material)'s library.
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
    /// How exactly its dimensions are known.
    pub tolerance: Tolerance,
}

/// How a pipe is held along its axis. It decides the constraint coefficient c₁ of the hoop strain.
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

/// The valve at the downstream end; of several valves that close, the first.
#[derive(Debug, Clone, PartialEq)]
pub struct Valve {
    /// Nominal closing time, s.
    pub closing_time_s: f64,
    /// Head behind the valve, m.
    pub discharge_head_m: f64,
    /// Standard deviation of the closing time as a share of it, where the file gives one; 0: it is exact.
    pub closing_time_tolerance: Option<f64>,
    /// Relative opening over the share of its stroke that is over, from (0, 1) to (1, 0), linear between; none where
    /// both fall alike.
    pub characteristic: Vec<(f64, f64)>,
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

impl SensorKind {
    /// Every kind.
    pub const ALL: [SensorKind; 5] = [
        SensorKind::Pressure,
        SensorKind::Flow,
        SensorKind::Temperature,
        SensorKind::ValvePosition,
        SensorKind::Trigger,
    ];

    /// Its name, as rig files spell it.
    pub fn name(self) -> &'static str {
        match self {
            SensorKind::Pressure => "pressure",
            SensorKind::Flow => "flow",
            SensorKind::Temperature => "temperature",
            SensorKind::ValvePosition => "valve-position",
            SensorKind::Trigger => "trigger",
        }
    }
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
    /// Index of the line on which it stands.
    pub line: usize,
    /// Distance along the line from where it begins: in a rig in series, from the supply, m.
    pub position_m: f64,
    /// Standard deviation of its position, m.
    pub position_sd_m: f64,
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

impl Sensor {
    /// Where it stands.
    pub fn place(&self) -> Place {
        Place { line: self.line, position_m: self.position_m }
    }
}

/// A steady state that was reported of the rig (`[[steady]]`). `rig check` compares it with the rest of the file.
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
    /// The pressure sensors with their index in [`Rig::sensors`].
    pub fn pressure_sensors(&self) -> impl Iterator<Item = (usize, &Sensor)> {
        self.sensors.iter().enumerate().filter(|(_, s)| s.kind == SensorKind::Pressure)
    }
}
