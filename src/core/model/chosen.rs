//! Effects chosen for a model, as they are written on a command line: `viscoelastic-wall:2,leak`.

use crate::model::ModelError;
use crate::model::effects::{CATALOGUE, Effect};

/// An effect chosen for a model.
#[derive(Clone)]
pub struct Chosen {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Number of elements where the user fixed it.
    pub elements: Option<usize>,
    /// The sensor it concerns where the user named it.
    pub sensor: Option<String>,
}

impl Chosen {
    /// As the user writes it: `viscoelastic-wall:2`, `sensor-lag@P2`.
    pub fn label(&self) -> String {
        let mut label = self.effect.name().to_owned();
        if let Some(n) = self.elements.filter(|_| self.effect.elements().is_some()) {
            label += &format!(":{n}");
        }
        if let Some(sensor) = &self.sensor {
            label += &format!("@{sensor}");
        }
        label
    }

    /// As many elements as it may come to have; `None` where it has none.
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

/// What people call a model with `effects`.
pub fn name_of(effects: &[Chosen]) -> String {
    std::iter::once("base model".to_owned()).chain(effects.iter().map(Chosen::label)).collect::<Vec<_>>().join(" + ")
}

/// Reads a comma-separated list of effects; `none` or nothing is the base model.
///
/// # Errors
/// A name that is not in the catalogue (the nearest is named), a number of elements where there are none or out of
/// range, an effect named twice.
pub fn parse_list(text: &str) -> Result<Vec<Chosen>, ModelError> {
    let mut chosen: Vec<Chosen> = Vec::new();
    for item in text.split(',').map(str::trim).filter(|s| !s.is_empty() && *s != "none") {
        let (item, sensor) = match item.split_once('@') {
            Some((item, sensor)) => (item, Some(sensor.to_owned())),
            None => (item, None),
        };
        let (name, number) = match item.split_once(':') {
            Some((name, number)) => (name, Some(number)),
            None => (item, None),
        };
        let all: Vec<&'static dyn Effect> =
            CATALOGUE.iter().flat_map(|e| std::iter::once(*e).chain(e.variants().iter().copied())).collect();
        let effect = all.iter().copied().find(|e| e.name() == name).ok_or_else(|| {
            let known: Vec<_> = all.iter().map(|e| e.name()).collect();
            let nearest =
                known.iter().max_by(|a, b| strsim::jaro_winkler(name, a).total_cmp(&strsim::jaro_winkler(name, b)));
            ModelError::UnknownEffect {
                name: name.to_owned(),
                nearest: nearest.map_or(String::new(), |n| (*n).to_owned()),
                known: known.join(", "),
            }
        })?;
        let elements = match (number, effect.elements()) {
            (None, _) => None,
            (Some(number), Some(range)) => {
                Some(number.parse().ok().filter(|n| range.contains(n)).ok_or_else(|| ModelError::Elements {
                    item: item.to_owned(),
                    low: *range.start(),
                    high: *range.end(),
                })?)
            }
            (Some(_), None) => return Err(ModelError::NoElements { item: item.to_owned() }),
        };
        if sensor.is_some() && !effect.at_sensor() {
            return Err(ModelError::NoSensor { item: item.to_owned() });
        }
        for other in &chosen {
            if other.effect.name() == name {
                return Err(ModelError::EffectTwice { name: name.to_owned() });
            }
            excluded(effect, other.effect)?;
        }
        chosen.push(Chosen { effect, elements, sensor });
    }
    Ok(chosen)
}

/// Whether two effects can be together.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_read_and_slips_are_explained() {
        assert!(parse_list("none").unwrap().is_empty());
        assert_eq!(parse_list("viscoelastic-wall:3").unwrap()[0].label(), "viscoelastic-wall:3");
        let slip = parse_list("viscoelastic_wall").unwrap_err().to_string();
        assert!(slip.contains("did you mean 'viscoelastic-wall'"), "{slip}");
        assert!(parse_list("viscoelastic-wall:0").unwrap_err().to_string().contains("from 1 to"));
        assert!(parse_list("viscoelastic-wall,viscoelastic-wall:2").unwrap_err().to_string().contains("twice"));
    }
}
