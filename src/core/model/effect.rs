//! What an effect is: what it says about itself and how it changes the scheme. The effects themselves are in
//! [`effects`](crate::model::effects), one file each.

use crate::model::boundary::{Supply, ValveEnd};
use crate::model::contribution::{LineTerm, NodeField};
use crate::model::error::ModelError;
use crate::model::grid::Stretch;
use crate::model::node::Shunt;
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site, Spot};
use crate::model::steady::Steady;
use crate::model::trace::Trace;
use crate::rig::Rig;

/// Odds of an effect that is at work for certain, whatever a fit says of others.
pub const CERTAIN: f64 = 1e300;

/// What is known, before any fit, that speaks for or against an effect.
#[derive(Debug, Clone, Copy)]
pub struct Circumstances<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// By how much the lowest pressure that any sensor saw stays above that of vapour, m.
    pub above_vapour_m: f64,
}

/// Where something is attached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// At a distance from the supply, m.
    At(f64),
    /// At the pipe's end, before the valve.
    Valve,
}

/// What is attached to a node.
pub enum Element {
    /// A head loss `k Q|Q|` with `k = K/(2gA²)`, s²/m⁵.
    Loss(f64),
    /// What takes water out.
    Shunt(Box<dyn Shunt>),
}

/// Something at one place: made once for each node that shares it.
pub struct Attachment<'a> {
    /// Where.
    pub place: Place,
    /// Makes a node's share of it.
    pub make: Box<dyn Fn(&Spot) -> Element + 'a>,
}

/// A physical effect that can be added to the base model.
pub trait Effect: Sync {
    /// Its name in the contract.
    fn name(&self) -> &'static str;
    /// The physics added, in a few words.
    fn summary(&self) -> &'static str;
    /// The equation, as text.
    fn equation(&self) -> &'static str;
    /// Where the equation comes from.
    fn source(&self) -> &'static str;
    /// The trace it leaves in a pressure record.
    fn trace(&self) -> &'static str;
    /// How many elements it may have (`name:2`), where it has elements at all.
    fn elements(&self) -> Option<std::ops::RangeInclusive<usize>> {
        None
    }
    /// Other forms of the same effect, chosen as `name/variant`: each an effect of its own of that name.
    fn variants(&self) -> &'static [&'static dyn Effect] {
        &[]
    }
    /// It concerns one pressure sensor, which may be named (`name@P2`).
    fn at_sensor(&self) -> bool {
        false
    }
    /// Effects that it cannot be together with, and why.
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[]
    }
    /// Why a rig cannot have it, where it cannot: a diagnosis leaves it out then, a person may still add it.
    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        let _ = rig;
        None
    }
    /// Runs that it takes to tell it from the effect that it is a variant of.
    fn least_runs(&self) -> usize {
        1
    }
    /// Odds that it is at work, against other effects, before any fit.
    fn odds(&self, known: &Circumstances) -> f64 {
        let _ = known;
        1.0
    }
    /// These values of it are more than what every rig has of it: instruments within their class are no fault.
    fn noteworthy(&self, values: &[f64]) -> bool {
        let _ = values;
        true
    }
    /// Its parameters, for a number of elements (1 where it has none).
    fn parameters(&self, site: &Site, elements: usize) -> Vec<Parameter>;
    /// Other places than `start` from which a fit of this effect should be tried, as factors on the start values.
    fn other_starts(&self, elements: usize) -> Vec<Vec<f64>> {
        let _ = elements;
        Vec::new()
    }
    /// Puts values that could stand in another order and mean the same (elements) in their customary one.
    fn put_in_order(&self, values: &mut [f64]) {
        let _ = values;
    }
    /// Changes the pipes before the grid is laid. Values are in the order of [`Effect::parameters`], here and below.
    ///
    /// # Errors
    /// If a value is outside its physical range; likewise below.
    fn reshape(&self, values: &[f64], stretches: &mut Vec<Stretch>) -> Result<(), ModelError> {
        let _ = (values, stretches);
        Ok(())
    }
    /// Terms along the line.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        let _ = (values, steady);
        Ok(Vec::new())
    }
    /// How many numbers it keeps of every node.
    fn kept_per_node(&self, elements: usize) -> usize {
        let _ = elements;
        0
    }
    /// What it puts at places of the line.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let _ = (values, scene);
        Ok(Vec::new())
    }
    /// What takes water out of all inner nodes of segments.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn field(&self, values: &[f64], scene: &Scene, steady: &Steady) -> Result<Option<Box<dyn NodeField>>, ModelError> {
        let _ = (values, scene, steady);
        Ok(None)
    }
    /// The same at a joint of segments or at the pipe's end, for effects that have a field.
    fn node_shunt(&self, values: &[f64], scene: &Scene, spot: &Spot) -> Option<Box<dyn Shunt>> {
        let _ = (values, scene, spot);
        None
    }
    /// The supply, given the one without this effect.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn supply(&self, values: &[f64], supply: Box<dyn Supply>) -> Result<Box<dyn Supply>, ModelError> {
        let _ = values;
        Ok(supply)
    }
    /// It lets the water boil or gas grow where the pressure falls: without such an effect a head below vapour's is no head.
    fn lets_boil(&self) -> bool {
        false
    }
    /// Changes the valve.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn valve(&self, values: &[f64], valve: &mut ValveEnd) -> Result<(), ModelError> {
        let _ = (values, valve);
        Ok(())
    }
    /// How much longer than it is looked at a run must be simulated, s: a sensor's clock may show what is still to come.
    fn beyond_s(&self, values: &[f64]) -> f64 {
        let _ = values;
        0.0
    }
    /// What the sensor that it concerns makes of the head; the sensor's elevation is `elevation_m`.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn sense(&self, values: &[f64], elevation_m: f64, trace: Trace) -> Result<Trace, ModelError> {
        let _ = (values, elevation_m);
        Ok(trace)
    }
}

/// Factors on a start in the middle of the pipe: places over its whole length where a fit of something local should start, too.
pub(crate) fn other_places() -> impl Iterator<Item = f64> {
    [0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9].into_iter().map(|place| place / 0.5)
}

/// Refuses a value outside its physical range.
///
/// # Errors
/// A sentence with name, value and what is allowed.
pub fn check(name: &str, value: f64, holds: bool, allowed: &'static str) -> Result<(), ModelError> {
    if holds && value.is_finite() {
        return Ok(());
    }
    Err(ModelError::Value { name: name.to_owned(), value, allowed })
}
