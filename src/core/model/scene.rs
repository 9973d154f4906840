//! What effects know of the rig, of a run and of a node.

use crate::rig::{Pipe, Rig, WaterProperties};
use crate::units::GRAVITY_M_S2;

/// The data from which an effect derives starts and bounds of its parameters.
pub struct Site<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Its water.
    pub water: &'a WaterProperties,
    /// Theoretical period `4L/a`, s.
    pub period_s: f64,
    /// The line on which the effect is, if it has a place.
    pub line: usize,
}

impl Site<'_> {
    /// Length of the effect's line, m.
    pub fn length_m(&self) -> f64 {
        self.rig.line_length_m(self.line)
    }

    /// The first pipe of the effect's line.
    pub fn pipe(&self) -> &Pipe {
        &self.rig.pipes_of(self.line)[0]
    }
}

/// The data of a run that an effect needs.
pub struct Scene<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// The water at the run's temperature.
    pub water: &'a WaterProperties,
    /// Time step, s.
    pub dt_s: f64,
    /// Flow through the valve before the closure, m³/s.
    pub flow_m3_s: f64,
    /// Head upstream of the valve before the closure, m.
    pub valve_head_m: f64,
    /// The line on which the effect is, if it has a place.
    pub line: usize,
}

/// Gauge pressure head of vapour, m: below this head above the pipe's axis, the water boils.
pub fn vapour_head_m(water: &WaterProperties) -> f64 {
    (water.vapour_pressure_pa - ATMOSPHERE_PA) / (water.density_kg_m3 * GRAVITY_M_S2)
}

impl Scene<'_> {
    /// Whether a position is inside the effect's line, between its ends.
    pub fn is_inside(&self, position_m: f64) -> bool {
        position_m > 0.0 && position_m < self.rig.line_length_m(self.line)
    }

    /// [`vapour_head_m`] of its water.
    pub fn vapour_head_m(&self) -> f64 {
        vapour_head_m(self.water)
    }

    /// Head of the atmosphere, m.
    pub fn atmosphere_head_m(&self) -> f64 {
        ATMOSPHERE_PA / (self.water.density_kg_m3 * GRAVITY_M_S2)
    }
}

/// Standard atmosphere, Pa: the zero of gauge pressure.
pub const ATMOSPHERE_PA: f64 = 101_325.0;

/// One node of the grid, as an element at it sees it.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// Share of a head loss at this node, 0 to 1: one between nodes is shared among them. A shunt is whole.
    pub share: f64,
    /// Elevation of the pipe's axis, m.
    pub elevation_m: f64,
    /// Cross-section of the pipe, m².
    pub area_m2: f64,
    /// Wave speed, m/s.
    pub wave_speed_m_s: f64,
    /// Volume of pipe that belongs to the node, m³.
    pub volume_m3: f64,
}
