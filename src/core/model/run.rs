//! Input and output of the simulation of one run.

use crate::model::energy::Energy;
use crate::model::trace::Trace;
use crate::rig::{Place, Regime, WaterProperties};

/// The per-run parameters, in their order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunValues {
    /// Velocity in the last pipe before the closure, m/s.
    pub initial_velocity_m_s: f64,
    /// Head upstream of the valve before the closure, m.
    pub valve_head_m: f64,
    /// Closing time, s.
    pub closing_time_s: f64,
    /// Multiplies the steady friction factor.
    pub friction_scale: f64,
}

/// Conditions of a run besides its parameters.
#[derive(Debug, Clone)]
pub struct Conditions {
    /// The water at the run's temperature.
    pub water: WaterProperties,
    /// Head measured at position 0 minus its mean before the closure, and its times after the start of the closure. It
    /// drives an upstream end of kind `measured`.
    pub supply_deviation: Option<(Vec<f64>, Vec<f64>)>,
    /// Regime of the flow before the closure in each pipe. Where none is given, the run's own velocity decides. A fit
    /// keeps the one that its instruments show: the law of friction must not change while a velocity is fitted.
    pub regimes: Option<Vec<Regime>>,
}

impl Conditions {
    /// Water, and nothing else that is known.
    pub fn of(water: WaterProperties) -> Conditions {
        Conditions { water, supply_deviation: None, regimes: None }
    }
}

/// Resolution in space, and duration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// Number of reaches on the way from the supply to the valve.
    pub reaches: usize,
    /// Simulated time after the start of the closure, s.
    pub duration_s: f64,
}

/// Result of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// Reading of each probe.
    pub traces: Vec<Trace>,
    /// The energy balance, if requested.
    pub energy: Option<Energy>,
    /// Where each segment starts.
    pub(crate) starts: Vec<Place>,
    /// Flow in each segment before the closure, m³/s.
    pub(crate) flows_m3_s: Vec<f64>,
}

impl Simulated {
    /// Flow before the closure at a place, m³/s: it changes along the pipe at a leak.
    pub fn steady_flow_m3_s(&self, place: impl Into<Place>) -> f64 {
        let Place { line, position_m } = place.into();
        let segment = self.starts.iter().rposition(|s| s.line == line && position_m >= s.position_m).unwrap_or(0);
        self.flows_m3_s[segment]
    }
}

/// Least head over the open valve, m: without it nothing would flow.
pub const LEAST_DROP_M: f64 = 1e-3;

impl RunValues {
    /// Number of per-run parameters.
    pub const COUNT: usize = 4;

    /// From values in the parameters' order.
    pub fn from_slice(values: &[f64; RunValues::COUNT]) -> RunValues {
        let [initial_velocity_m_s, valve_head_m, closing_time_s, friction_scale] = *values;
        RunValues { initial_velocity_m_s, valve_head_m, closing_time_s, friction_scale }
    }
}
