//! What an effect is: its description and its contributions to the scheme. The effects themselves are in
//! [`effects`](crate::model::effects), one file each.

use crate::model::boundary::{Supply, ValveEnd};
use crate::model::contribution::{LineTerm, NodeField};
use crate::model::error::ModelError;
use crate::model::grid::Stretch;
use crate::model::node::{HeadLoss, Shunt};
use crate::model::parameter::Parameter;
use crate::model::scene::{Scene, Site, Spot};
use crate::model::steady::Steady;
use crate::model::trace::Trace;
use crate::model::wall::waves::WallWaves;
use crate::rig::{Pipe, Rig};

/// Prior odds of an effect that a record shows by itself: the chance that something else looks like it is one in so
/// many.
pub const SHOWN: f64 = 1e4;

/// Evidence for or against an effect that is known before any fit.
#[derive(Debug, Clone, Copy)]
pub struct Circumstances<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// How far the lowest pressure in any record stays above vapour pressure, m.
    pub above_vapour_m: f64,
    /// Time between samples of the pressure sensors, the longest of all runs, s.
    pub sample_s: f64,
}

/// Place of an attachment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// At a distance from the supply, m.
    At(f64),
    /// At the pipe's end, before the valve.
    Valve,
    /// Between the supply and the pipes that leave it.
    Supply,
}

/// An element at a node.
pub enum Element {
    /// A head loss `k Q|Q|` with `k = K/(2gA²)`, s²/m⁵.
    Loss(f64),
    /// A head loss of any other law.
    Drop(Box<dyn HeadLoss>),
    /// Takes water out.
    Shunt(Box<dyn Shunt>),
}

/// An element at one place; it is made once for each node that shares it.
pub struct Attachment<'a> {
    /// Where.
    pub place: Place,
    /// Makes a node's share of it.
    pub make: Box<dyn Fn(&Spot) -> Element + 'a>,
}

/// A physical effect that can be added to the base model.
pub trait Effect: Sync {
    /// Its name, as on the command line.
    fn name(&self) -> &'static str;
    /// The physics added, in a few words.
    fn summary(&self) -> &'static str;
    /// The equation, as text.
    fn equation(&self) -> &'static str;
    /// Where the equation comes from.
    fn source(&self) -> &'static str;
    /// The trace it leaves in a pressure record.
    fn trace(&self) -> &'static str;
    /// Range of the number of elements (`name:2`), if it has elements.
    fn elements(&self) -> Option<std::ops::RangeInclusive<usize>> {
        None
    }
    /// Other forms of the same effect, chosen as `name/variant`; each is an effect of that name.
    fn variants(&self) -> &'static [&'static dyn Effect] {
        &[]
    }
    /// Whether it concerns one pressure sensor, which may be named (`name@P2`).
    fn at_sensor(&self) -> bool {
        false
    }
    /// Whether it may be anywhere along a pipe, which may be named in a network (`name@branch`): it proposes starts
    /// over the whole of it.
    fn on_pipe(&self) -> bool {
        false
    }
    /// Whether it concerns one valve that closes, which must be named where several do (`name@V2`).
    fn at_valve(&self) -> bool {
        false
    }
    /// Whether it is no effect of the catalogue but a rig's own.
    fn is_own(&self) -> bool {
        false
    }
    /// Whether it changes the head of the supply.
    fn at_supply(&self) -> bool {
        false
    }
    /// Effects with which it cannot be combined, and why.
    fn excludes(&self) -> &'static [(&'static str, &'static str)] {
        &[]
    }
    /// Why it is impossible on a rig, if it is. A diagnosis then leaves it out; a user may still add it.
    fn impossible(&self, rig: &Rig) -> Option<&'static str> {
        let _ = rig;
        None
    }
    /// Number of runs needed to tell it from the effect of which it is a variant.
    fn least_runs(&self) -> usize {
        1
    }
    /// Whether a diagnosis tries it. Another way to compute what a cheaper form of the same effect stands for is left to
    /// those who ask for it.
    fn searched(&self) -> bool {
        true
    }
    /// The effect all of which it has, with something more.
    fn extends(&self) -> Option<&'static dyn Effect> {
        None
    }
    /// Prior odds that it is at work, relative to other effects.
    fn odds(&self, known: &Circumstances) -> f64 {
        let _ = known;
        1.0
    }
    /// Whether these values exceed what every rig has of it: instruments within their class are not faulty.
    fn noteworthy(&self, values: &[f64], known: &Circumstances) -> bool {
        let _ = (values, known);
        true
    }
    /// The effect that it stands in for with these values, where it is a way to compute that one rather than physics of
    /// its own.
    fn stands_for(&self, values: &[f64]) -> Option<&'static str> {
        let _ = values;
        None
    }
    /// What a lab can do to be rid of it, in words, where it can be put right: it stands at a `place`, or concerns a
    /// `sensor`.
    fn remedy(&self, place: Option<&str>, sensor: Option<&str>) -> Option<String> {
        let _ = (place, sensor);
        None
    }
    /// Its parameters, for a number of elements (1 if it has none).
    fn parameters(&self, site: &Site, elements: usize) -> Vec<Parameter>;
    /// Further starts for a fit of this effect, as factors on the start values.
    fn other_starts(&self, elements: usize) -> Vec<Vec<f64>> {
        let _ = elements;
        Vec::new()
    }
    /// Puts values whose order is arbitrary (elements) in their conventional order.
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
    /// How many numbers it keeps per node.
    fn kept_per_node(&self, elements: usize) -> usize {
        let _ = elements;
        0
    }
    /// Its elements at places of the line.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn attachments<'a>(&self, values: &'a [f64], scene: &'a Scene) -> Result<Vec<Attachment<'a>>, ModelError> {
        let _ = (values, scene);
        Ok(Vec::new())
    }
    /// The outflow from all inner nodes of segments.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn field(&self, values: &[f64], scene: &Scene, steady: &Steady) -> Result<Option<Box<dyn NodeField>>, ModelError> {
        let _ = (values, scene, steady);
        Ok(None)
    }
    /// The same outflow at a joint of segments or at the pipe's end, for effects that have a field.
    fn node_shunt(&self, values: &[f64], scene: &Scene, spot: &Spot) -> Option<Box<dyn Shunt>> {
        let _ = (values, scene, spot);
        None
    }
    /// Fewest steps that a pressure wave must take through a pipe of the rig: more than one where it has faster waves,
    /// which may not pass the pipe within a step. Each joint of two pipes then has a node, where the grid else may have a
    /// reach over it.
    fn least_steps(&self, values: &[f64], rig: &Rig, pipe: &Pipe, wave_speed_m_s: f64) -> f64 {
        let _ = (values, rig, pipe, wave_speed_m_s);
        1.0
    }
    /// Stress waves in the walls of pipes that may move.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn wall_waves(&self, values: &[f64], scene: &Scene, steady: &Steady) -> Result<Option<WallWaves>, ModelError> {
        let _ = (values, scene, steady);
        Ok(None)
    }
    /// The supply, given the one without this effect.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn supply(&self, values: &[f64], supply: Box<dyn Supply>) -> Result<Box<dyn Supply>, ModelError> {
        let _ = values;
        Ok(supply)
    }
    /// Whether it lets water boil or gas grow where the pressure falls. Without such an effect, a head below vapour
    /// pressure is unphysical.
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
    /// Additional time to simulate, s: a sensor's clock may show later events.
    fn beyond_s(&self, values: &[f64]) -> f64 {
        let _ = values;
        0.0
    }
    /// The reading of the sensor that it concerns; `elevation_m` is the sensor's elevation.
    ///
    /// # Errors
    /// See [`Effect::reshape`].
    fn sense(&self, values: &[f64], elevation_m: f64, trace: Trace) -> Result<Trace, ModelError> {
        let _ = (values, elevation_m);
        Ok(trace)
    }
}

/// Factors on a start in the middle of the pipe, which give starts over its whole length for a fit of something local.
pub(crate) fn other_places() -> impl Iterator<Item = f64> {
    [0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9].into_iter().map(|place| place / 0.5)
}

/// Refuses a value outside its physical range.
///
/// # Errors
/// [`ModelError::Value`] with the name, the value and what is allowed.
pub fn check(name: &str, value: f64, holds: bool, allowed: &'static str) -> Result<(), ModelError> {
    if holds && value.is_finite() {
        return Ok(());
    }
    Err(ModelError::Value { name: name.to_owned(), value, allowed })
}
