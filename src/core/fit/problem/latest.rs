//! The latest simulation of a run. Moving the closure's start, a sensor or what a sensor does to its reading changes no
//! wave, so finite differences by these are read from the kept simulation. Descents in parallel may lose it to each
//! other; they simulate again then.

use std::sync::{Arc, Mutex, PoisonError};

use crate::model::run::Simulated;
use crate::rig::Place;

/// A simulation, and what it follows from.
pub(crate) struct Kept {
    /// Everything that a wave depends on.
    pub(crate) causes: Vec<f64>,
    /// For how long it was needed, s.
    pub(crate) needed_s: f64,
    /// Where its traces were read.
    pub(crate) places: Vec<Place>,
    pub(crate) simulated: Simulated,
}

/// Keeps one simulation.
#[derive(Default)]
pub(crate) struct Latest(Mutex<Option<Arc<Kept>>>);

impl Latest {
    /// Keeps a simulation in place of the one before.
    pub(crate) fn keep(&self, kept: Kept) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(kept));
    }

    /// The kept simulation, read at these places. None if it was computed from other values, is too short, or has no
    /// trace at one of the places.
    pub(crate) fn read(&self, causes: &[f64], needed_s: f64, places: &[Place]) -> Option<Simulated> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()?;
        let long_enough = needed_s <= kept.needed_s; // not so for NaN
        if kept.causes != causes || !long_enough {
            return None;
        }
        let trace = |place| kept.places.iter().position(|p| p == place).map(|i| kept.simulated.traces[i].clone());
        let traces = places.iter().map(trace).collect::<Option<_>>()?;
        let (starts, flows_m3_s) = (kept.simulated.starts.clone(), kept.simulated.flows_m3_s.clone());
        Some(Simulated { traces, energy: None, starts, flows_m3_s })
    }
}
