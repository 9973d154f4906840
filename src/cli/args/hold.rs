//! `--hold NAME=VALUE`: parameters that a fit does not touch.

use crate::fit::data::run_data::RunData;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::model::Model;
use crate::model::constraint::Constraint;
use crate::model::effects::Chosen;
use crate::model::parameter::Parameter;
use crate::report::text::number::significant;
use crate::results::model_file::Entry;
use crate::rig::Rig;

/// Refuses two values for one parameter.
///
/// # Errors
/// The first parameter that is held twice.
pub fn check(hold: &[(String, f64)]) -> Result<(), String> {
    let twice = hold.iter().enumerate().find(|(i, (name, _))| hold[..*i].iter().any(|(n, _)| n == name));
    twice.map_or(Ok(()), |(_, (name, _))| Err(format!("--hold names {name} twice: give it one value")))
}

/// Says which values of an `option` lie beyond what a fit may take.
pub fn warn_beyond(option: &str, rig: &Rig, runs: &[RunData], effects: &[Chosen], values: &[(String, f64)]) {
    let Some(run) = runs.first().filter(|_| !values.is_empty()) else { return };
    // With as many elements as there may be, so that each parameter is known.
    let most = |c: &Chosen| c.most_elements().map_or_else(|| c.clone(), |n| c.with_elements(n));
    let effects: Vec<Chosen> = effects.iter().map(most).collect();
    let model = Model::new(rig, &run.conditions.water, &effects);
    let window = Window { reaches: 1, horizon_s: f64::INFINITY, stride: 1 };
    let parameters = FitProblem::new(&model, runs, window).parameters;
    for (name, value) in values {
        let beyond = |p: &&Parameter| p.name == *name && !(p.lower..=p.upper).contains(value);
        if let Some(p) = parameters.iter().find(beyond) {
            let [lower, upper] = [p.lower, p.upper].map(|bound| significant(bound, 3));
            let value = if (1e-4..1e9).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") };
            crate::cli::tell!(
                "warning: {option} {name}={value} lies beyond what a fit may take, {lower} to {upper}: check its unit"
            );
        }
    }
}

/// With what a model of a file settles, where `held` says nothing else: values held and bounds of parameters that a model with these `effects` has.
/// Says which of the held ones it does not have, where that is asked for.
pub fn and_settled(
    held: &mut Vec<Constraint>,
    from: &Entry,
    rig: &Rig,
    runs: &[RunData],
    (effects, said_aloud): (&[Chosen], bool),
) {
    let Some(run) = runs.first() else { return };
    let model = Model::new(rig, &run.conditions.water, effects);
    let has = |c: &Constraint| match &c.run {
        Some(file) => runs.iter().any(|run| run.file == *file),
        None => model.shared.iter().any(|p| p.name == c.name),
    };
    let said = held.len();
    for settled in from.constraints() {
        if held[..said].iter().any(|c| c.concerns(&settled.name, settled.run.as_deref())) {
            continue;
        }
        if has(&settled) {
            held.push(settled);
        } else if said_aloud && settled.holds() {
            crate::cli::tell!(
                "warning: {} is held in the file that is gone on from, and this model has no such parameter",
                settled.name
            );
        }
    }
}

/// What holds mean for each of several models. A value that one of them shares among runs concerns only those that have it; any
/// other is held in every run, and the fit says so where there is no such parameter. Values beyond what a fit of the last model may take are warned of.
pub fn constraints(
    rig: &Rig,
    runs: &[RunData],
    models: &[Vec<Chosen>],
    hold: &[(String, f64)],
) -> Vec<Vec<Constraint>> {
    if let Some(last) = models.last() {
        warn_beyond("--hold", rig, runs, last, hold);
    }
    let shared = |effects: &Vec<Chosen>| -> Vec<String> {
        let Some(run) = runs.first() else { return Vec::new() };
        Model::new(rig, &run.conditions.water, effects).shared.into_iter().map(|p| p.name).collect()
    };
    let own: Vec<Vec<String>> = models.iter().map(shared).collect();
    let of = |known: &Vec<String>| {
        let mut all = Vec::new();
        for (name, value) in hold {
            let held = |run: Option<String>| Constraint { name: name.clone(), run, lower: *value, upper: *value };
            if known.contains(name) {
                all.push(held(None));
            } else if !own.iter().flatten().any(|n| n == name) {
                all.extend(runs.iter().map(|run| held(Some(run.file.clone()))));
            }
        }
        all
    };
    own.iter().map(of).collect()
}
