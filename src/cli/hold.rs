//! `--hold NAME=VALUE`: parameters that a fit does not touch.

use crate::fit::data::RunData;
use crate::model::Model;
use crate::model::constraint::Constraint;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// Refuses two values for one parameter.
///
/// # Errors
/// The first parameter that is held twice.
pub fn check(hold: &[(String, f64)]) -> Result<(), String> {
    let twice = hold.iter().enumerate().find(|(i, (name, _))| hold[..*i].iter().any(|(n, _)| n == name));
    twice.map_or(Ok(()), |(_, (name, _))| Err(format!("--hold names {name} twice: give it one value")))
}

/// What holds mean for each of several models. A value that one of them shares among runs concerns only those that have it; any
/// other is held in every run, and the fit says so where there is no such parameter.
pub fn constraints(
    rig: &Rig,
    runs: &[RunData],
    models: &[Vec<Chosen>],
    hold: &[(String, f64)],
) -> Vec<Vec<Constraint>> {
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
