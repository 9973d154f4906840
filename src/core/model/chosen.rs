//! Effects chosen for a model, with their text form: `viscoelastic-wall:2,leak`.

use crate::model::effect::Effect;
use crate::model::error::ModelError;
use crate::rig::Rig;

/// An effect chosen for a model.
#[derive(Clone)]
pub struct Chosen {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Number of elements, if the user fixed it.
    pub elements: Option<usize>,
    /// The sensor it concerns, if the user named one.
    pub sensor: Option<String>,
    /// The pipe of a network on which it is, if the user named one.
    pub pipe: Option<String>,
    /// The valve it concerns, if the user named one.
    pub valve: Option<String>,
}

impl Chosen {
    /// An effect, with nothing more said of it.
    pub fn of(effect: &'static dyn Effect) -> Self {
        Chosen { effect, elements: None, sensor: None, pipe: None, valve: None }
    }

    /// As the user writes it: `viscoelastic-wall:2`, `sensor-lag@P2`, `leak@branch`.
    pub fn label(&self) -> String {
        let mut label = self.effect.name().to_owned();
        if let Some(n) = self.elements.filter(|_| self.effect.elements().is_some()) {
            label += &format!(":{n}");
        }
        if let Some(at) = self.sensor.as_ref().or(self.pipe.as_ref()).or(self.valve.as_ref()) {
            label += &format!("@{at}");
        }
        label
    }

    /// The line on which it is: that of the pipe it names, else that which ends at the valve.
    pub fn line(&self, rig: &Rig) -> usize {
        let own = self.pipe.as_ref().and_then(|pipe| rig.pipes.iter().position(|p| p.name == *pipe));
        own.and_then(|i| rig.graph.lines.iter().position(|line| line.pipes.contains(&i)))
            .unwrap_or_else(|| rig.graph.line_to_valve())
    }

    /// The node of the valve that it names, else of the one that closes first.
    pub fn valve(&self, rig: &Rig) -> usize {
        let own = |name: &String| rig.graph.nodes.iter().position(|node| node.name == *name);
        self.valve.as_ref().and_then(own).unwrap_or(rig.graph.valve)
    }

    /// The same at a valve.
    pub fn at_valve(&self, valve: &str) -> Self {
        Chosen { valve: Some(valve.to_owned()), ..self.clone() }
    }

    /// The same on a pipe.
    pub fn on_pipe(&self, pipe: &str) -> Self {
        Chosen { pipe: Some(pipe.to_owned()), ..self.clone() }
    }

    /// Greatest number of elements that it may have; `None` if it has none.
    pub fn most_elements(&self) -> Option<usize> {
        self.elements.or_else(|| self.effect.elements().map(|range| *range.end()))
    }

    /// The same with a number of elements.
    pub fn with_elements(&self, elements: usize) -> Self {
        Chosen { elements: Some(elements), ..self.clone() }
    }

    /// The same at a sensor.
    pub fn with_sensor(&self, sensor: &str) -> Self {
        Chosen { sensor: Some(sensor.to_owned()), ..self.clone() }
    }
}

impl std::fmt::Debug for Chosen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.label())
    }
}

impl PartialEq for Chosen {
    fn eq(&self, other: &Self) -> bool {
        self.label() == other.label()
    }
}

/// Whether water may boil in a model with these effects.
pub fn boils(effects: &[Chosen]) -> bool {
    effects.iter().any(|chosen| chosen.effect.lets_boil())
}

/// Name of a model with `effects`, for users.
pub fn name_of(effects: &[Chosen]) -> String {
    std::iter::once("base model".to_owned()).chain(effects.iter().map(Chosen::label)).collect::<Vec<_>>().join(" + ")
}

/// Labels of the `effects` that a model has beside the base model, for the progress of its fit.
pub(crate) fn labels_of(effects: &[Chosen]) -> String {
    let labels = effects.iter().map(Chosen::label).collect::<Vec<_>>().join(" + ");
    if labels.is_empty() { "base model".to_owned() } else { labels }
}

/// Whether two effects can be combined.
///
/// # Errors
/// If one excludes the other, with the reason.
pub fn excluded(one: &dyn Effect, other: &dyn Effect) -> Result<(), ModelError> {
    for (a, b) in [(one, other), (other, one)] {
        if let Some((name, why)) = a.excludes().iter().find(|(name, _)| *name == b.name()) {
            return Err(ModelError::Excluded { one: a.name().to_owned(), other: (*name).to_owned(), why });
        }
    }
    Ok(())
}
