//! The catalogue: one file an effect, and the list of them.
//!
//! An effect says everything about itself. Whatever needs to know of effects (help, calibration, reports) iterates over
//! [`CATALOGUE`]. It contributes to the scheme in one of a few ways, each a method of [`Effect`] that defaults to nothing;
//! so far a term along the line, computed once a step for all nodes of a segment.

mod viscoelastic_wall;

use super::ModelError;
use super::parameter::Parameter;
use super::solver::{LineTerm, Steady};
use crate::rig::Rig;
use crate::rig::WaterProperties;

/// Every effect that a model can have.
pub static CATALOGUE: &[&dyn Effect] = &[&viscoelastic_wall::ViscoelasticWall];

/// What an effect needs to know of the rig to give its parameters sensible starts and bounds.
pub struct Site<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Its water.
    pub water: &'a WaterProperties,
    /// Theoretical period `4L/a`, s.
    pub period_s: f64,
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
    /// Its parameters, for a number of elements (1 where it has none).
    fn parameters(&self, site: &Site, elements: usize) -> Vec<Parameter>;
    /// Other places than `start` from which a fit of this effect should be tried, as factors on the start values.
    fn other_starts(&self, elements: usize) -> Vec<Vec<f64>> {
        let _ = elements;
        Vec::new()
    }
    /// Terms along the line, for parameter values in the order of [`Effect::parameters`].
    ///
    /// # Errors
    /// If a value is outside its physical range.
    fn line_terms(&self, values: &[f64], steady: &Steady) -> Result<Vec<Box<dyn LineTerm>>, ModelError> {
        let _ = (values, steady);
        Ok(Vec::new())
    }
}

/// An effect chosen for a model.
#[derive(Clone, Copy)]
pub struct Chosen {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Number of elements where the user fixed it.
    pub elements: Option<usize>,
}

impl Chosen {
    /// As the user writes it: `viscoelastic-wall:2`.
    pub fn label(&self) -> String {
        match self.elements {
            Some(n) if self.effect.elements().is_some() => format!("{}:{n}", self.effect.name()),
            _ => self.effect.name().to_owned(),
        }
    }

    /// The same with a number of elements.
    pub fn with_elements(self, elements: usize) -> Self {
        Chosen { elements: Some(elements), ..self }
    }
}

impl std::fmt::Debug for Chosen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.label())
    }
}

/// Reads a comma-separated list of effects; `none` or nothing is the base model.
///
/// # Errors
/// A name that is not in the catalogue (the nearest is named), a number of elements where there are none or out of
/// range, an effect named twice.
pub fn parse_list(text: &str) -> Result<Vec<Chosen>, ModelError> {
    let mut chosen: Vec<Chosen> = Vec::new();
    for item in text.split(',').map(str::trim).filter(|s| !s.is_empty() && *s != "none") {
        let (name, number) = match item.split_once(':') {
            Some((name, number)) => (name, Some(number)),
            None => (item, None),
        };
        let effect = *CATALOGUE.iter().find(|e| e.name() == name).ok_or_else(|| {
            let known: Vec<_> = CATALOGUE.iter().map(|e| e.name()).collect();
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
        if chosen.iter().any(|c| c.effect.name() == name) {
            return Err(ModelError::EffectTwice { name: name.to_owned() });
        }
        chosen.push(Chosen { effect, elements });
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_folder_is_in_the_catalogue() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/model/effects");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|f| f.unwrap().file_name().into_string().unwrap())
            .filter(|f| f != "mod.rs")
            .map(|f| f.trim_end_matches(".rs").replace('_', "-"))
            .collect();
        files.sort();
        let mut names: Vec<String> = CATALOGUE.iter().map(|e| e.name().to_owned()).collect();
        names.sort();
        assert_eq!(files, names);
    }

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
