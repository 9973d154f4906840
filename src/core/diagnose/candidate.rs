//! The candidates: every effect of the catalogue that the start model lacks, in each of its forms.

use crate::diagnose::limits::MOST_ELEMENTS;
use crate::model::effects::{Chosen, Effect, catalogue_of};
use crate::rig::Rig;

/// One form of an effect: a variant, at a sensor, with a number of elements.
#[derive(Debug, Clone)]
pub struct Form {
    /// The effect's name in the catalogue, without the variant.
    pub effect: &'static str,
    /// What is added to the model.
    pub chosen: Chosen,
}

/// All forms of the effects that may be added to `start`, in the order of the catalogue. Forms that need more than
/// `runs` runs to be identified are left out.
pub fn candidates(rig: &Rig, start: &[Chosen], runs: usize) -> Vec<Form> {
    catalogue_of(rig)
        .into_iter()
        .filter(|effect| !is_in(*effect, start) && reason_against(*effect, rig, start).is_none())
        .flat_map(|effect| forms(rig, effect))
        .filter(|form| form.chosen.effect.least_runs() <= runs)
        .collect()
}

/// Effects that `start` lacks but cannot be given, each with the reason.
pub fn left_out(rig: &Rig, start: &[Chosen]) -> Vec<(&'static str, String)> {
    let others = catalogue_of(rig).into_iter().filter(|effect| !is_in(*effect, start));
    others.filter_map(|effect| Some((effect.name(), reason_against(effect, rig, start)?))).collect()
}

fn is_in(effect: &dyn Effect, start: &[Chosen]) -> bool {
    start.iter().any(|c| base_name(c.effect.name()) == effect.name())
}

fn forms(rig: &Rig, effect: &'static dyn Effect) -> Vec<Form> {
    let closing = rig.graph.closing_valves();
    let variants =
        std::iter::once(effect).chain(effect.variants().iter().copied()).filter(|variant| variant.searched());
    variants
        .flat_map(|variant| {
            let form = Chosen::of(variant);
            let all: Vec<Chosen> = match variant.elements() {
                Some(range) => range.take_while(|n| *n <= MOST_ELEMENTS).map(|n| form.with_elements(n)).collect(),
                None if variant.at_sensor() => rig.pressure_sensors().map(|(_, s)| form.with_sensor(&s.name)).collect(),
                None if variant.on_pipe() && rig.graph.lines.len() > 1 => {
                    rig.pipes.iter().map(|p| form.on_pipe(&p.name)).collect()
                }
                None if variant.at_valve() && closing.len() > 1 => {
                    closing.iter().map(|valve| form.at_valve(valve)).collect()
                }
                None => vec![form],
            };
            all.into_iter().map(|chosen| Form { effect: effect.name(), chosen })
        })
        .collect()
}

/// All forms of one effect that match what was asked for: an open sensor or number of elements gives one form each.
pub fn forms_of(rig: &Rig, asked: &Chosen) -> Vec<Form> {
    let own = |form: &Form| {
        form.chosen.effect.name() == asked.effect.name()
            && asked.elements.is_none_or(|n| form.chosen.elements == Some(n))
            && asked.sensor.as_ref().is_none_or(|s| form.chosen.sensor.as_ref() == Some(s))
            && asked.pipe.as_ref().is_none_or(|p| form.chosen.pipe.as_ref() == Some(p))
            && asked.valve.as_ref().is_none_or(|v| form.chosen.valve.as_ref() == Some(v))
    };
    let forms: Vec<Form> = catalogue_of(rig).into_iter().flat_map(|effect| forms(rig, effect)).filter(own).collect();
    if forms.is_empty() { vec![Form { effect: base_name(asked.effect.name()), chosen: asked.clone() }] } else { forms }
}

/// The name without its variant.
pub fn base_name(name: &str) -> &str {
    name.split('/').next().unwrap_or(name)
}

fn reason_against(effect: &dyn Effect, rig: &Rig, start: &[Chosen]) -> Option<String> {
    let beside = start.iter().find_map(|c| {
        let why = reason_apart(effect, c.effect)?;
        Some(format!("cannot be combined with {}: {why}", c.effect.name()))
    });
    effect.impossible(rig).map(str::to_owned).or(beside)
}

/// Why two effects cannot be at work together, if they cannot.
pub(crate) fn reason_apart(a: &dyn Effect, b: &dyn Effect) -> Option<&'static str> {
    let excluded =
        |x: &dyn Effect, name: &str| x.excludes().iter().find(|(other, _)| *other == name).map(|(_, why)| *why);
    excluded(a, b.name()).or_else(|| excluded(b, a.name()))
}
