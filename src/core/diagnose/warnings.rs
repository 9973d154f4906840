//! Reasons to doubt a diagnosis: what was asked cannot be, or the model on which the verdict rests contradicts what is
//! known.
//!
//! A model that lacks an effect bends what it has to make up for it. Where that effect was found, the bends of the
//! model without it speak for the answer, not against it: only what is left of them with the effect is a doubt.

use crate::diagnose::limits::NOT_FITTED;
use crate::diagnose::outcome::Diagnosis;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::validate::conflict::{at_bounds, faded_noise, of_fit, of_records};
use crate::model::effects::Chosen;
use crate::number::error_m;
use crate::rig::Rig;

/// One sentence for each reason; `effects` are those that the start model was asked to have.
pub(crate) fn warnings(rig: &Rig, runs: &[RunData], diagnosis: &Diagnosis, effects: &[Chosen]) -> Vec<String> {
    let mut warnings = Vec::new();
    let held = diagnosis.start.parameters.iter().filter(|p| p.held);
    let held: Vec<&str> = held.map(|p| p.name.as_str()).collect();
    if !held.is_empty() {
        warnings.push(format!(
            "held: {}; an effect may be found only because it makes up for a wrong value",
            held.join(", ")
        ));
    }
    for chosen in effects {
        if let Some(why) = chosen.effect.impossible(rig) {
            warnings.push(format!(
                "{} is in the start model, but {why}: whatever it absorbs belongs to another effect; leave it out of option `effects`",
                chosen.effect.name()
            ));
        }
    }
    warnings.extend(of_records(runs));
    let of_model = match diagnosis.answer() {
        Some(answer) => {
            let with = diagnosis.answer_label();
            of_answer(answer, runs).into_iter().map(|doubt| format!("with {with}: {doubt}")).collect()
        }
        None => of_start(&diagnosis.start, runs),
    };
    warnings.extend(of_model);
    warnings.extend(faded_noise(diagnosis.answer().unwrap_or(&diagnosis.start)));
    warnings
}

/// The noise may be reached with a velocity that contradicts the meter, or with a level that no gauge has: it is then
/// the wrong scale that fits.
fn of_answer(answer: &Fit, runs: &[RunData]) -> Vec<String> {
    of_fit(answer, runs).into_iter().chain(at_bounds(answer)).collect()
}

/// Where nothing explains the records, or nothing is missing.
fn of_start(start: &Fit, runs: &[RunData]) -> Vec<String> {
    let mut doubts = Vec::new();
    let at_bound: Vec<&str> = start.parameters.iter().filter(|p| p.at_bound).map(|p| p.name.as_str()).collect();
    if !at_bound.is_empty() {
        doubts.push(format!(
            "the start model has {} at a bound: check material, length and wall of the pipe, and its effects, before \
             believing what follows",
            at_bound.join(", ")
        ));
    }
    let (rmse_m, signal_m) = (start.pooled().0, start.signal_m());
    if rmse_m > NOT_FITTED * signal_m {
        doubts.push(format!(
            "the start model leaves {} m of a signal that moves by {} m, rms: it does not follow the signal, so its residual \
             says little; start with the effects that are known to be present",
            error_m(rmse_m),
            error_m(signal_m)
        ));
    }
    doubts.extend(of_fit(start, runs));
    doubts
}
