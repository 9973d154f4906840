//! The candidates: every effect of the catalogue that the start model has not, in each of its forms.

use crate::model::effects::{CATALOGUE, Chosen, Effect};
use crate::rig::Rig;

/// One form of an effect: a variant, at a sensor, with a number of elements.
#[derive(Debug, Clone)]
pub struct Form {
    /// The effect's name in the catalogue, whatever the variant.
    pub effect: &'static str,
    /// What is added to the model.
    pub chosen: Chosen,
}

/// Most elements with which an effect that has some is tried.
const MOST_ELEMENTS: usize = 3;

/// Effects of the catalogue that may be added to `start`, in their order, each with its forms.
pub fn candidates(rig: &Rig, start: &[Chosen]) -> Vec<Vec<Form>> {
    CATALOGUE
        .iter()
        .filter(|effect| {
            !start.iter().any(|c| base_name(c.effect.name()) == effect.name()) && fits_beside(**effect, start)
        })
        .map(|effect| forms(rig, *effect))
        .collect()
}

fn forms(rig: &Rig, effect: &'static dyn Effect) -> Vec<Form> {
    let variants = std::iter::once(effect).chain(effect.variants().iter().copied());
    variants
        .flat_map(|variant| {
            let form = Chosen { effect: variant, elements: None, sensor: None };
            let all: Vec<Chosen> = match variant.elements() {
                Some(range) => range.take_while(|n| *n <= MOST_ELEMENTS).map(|n| form.with_elements(n)).collect(),
                None if variant.at_sensor() => rig.pressure_sensors().map(|(_, s)| form.with_sensor(&s.name)).collect(),
                None => vec![form],
            };
            all.into_iter().map(|chosen| Form { effect: effect.name(), chosen })
        })
        .collect()
}

/// The forms of one effect as it was asked for: where sensor or number of elements are left open, each of them.
pub fn forms_of(rig: &Rig, asked: &Chosen) -> Vec<Form> {
    let own = |form: &Form| {
        form.chosen.effect.name() == asked.effect.name()
            && asked.elements.is_none_or(|n| form.chosen.elements == Some(n))
            && asked.sensor.as_ref().is_none_or(|s| form.chosen.sensor.as_ref() == Some(s))
    };
    let forms: Vec<Form> = CATALOGUE.iter().flat_map(|effect| forms(rig, *effect)).filter(own).collect();
    if forms.is_empty() { vec![Form { effect: base_name(asked.effect.name()), chosen: asked.clone() }] } else { forms }
}

/// The name without its variant.
pub fn base_name(name: &str) -> &str {
    name.split('/').next().unwrap_or(name)
}

fn fits_beside(effect: &dyn Effect, start: &[Chosen]) -> bool {
    let excluded = |a: &dyn Effect, b: &str| a.excludes().iter().any(|(name, _)| *name == b);
    !start.iter().any(|c| excluded(effect, c.effect.name()) || excluded(c.effect, effect.name()))
}
