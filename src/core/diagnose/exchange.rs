//! Exchange: an effect that was found first was chosen without those that were found later, and may have stood in for another.
//!
//! With backward elimination ([`crate::diagnose::needless`]), this makes the end of a stepwise search independent of the order in which it found the effects.

use crate::diagnose::circumstances::features;
use crate::diagnose::diagnose_fit;
use crate::diagnose::limits::LEAST_EVIDENCE;
use crate::diagnose::measures::{evidence_scale, square};
use crate::diagnose::outcome::Diagnosis;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::without;
use crate::fit::search::options::Options;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// The diagnosis of the model without one of its effects, where another one explains the records better beside the rest; and the effect that is exchanged.
/// Effects that are `settled` stay. The model has `grown` out of a smaller one. Smaller models that cannot be simulated are left out.
pub fn exchanged(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    settled: &[Chosen],
    grown: &Fit,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Option<(Diagnosis, Chosen)> {
    let scale = evidence_scale(fit, features(runs));
    let open = |c: &Chosen| settled.iter().all(|s| s.effect.name() != c.effect.name());
    for (i, gone) in fit.effects.iter().enumerate().filter(|(_, c)| open(c)) {
        progress(&Progress::from(format!("another effect in place of {}", gone.label())));
        let Ok(smaller) = without(rig, runs, fit, i, options, progress) else { continue };
        let effects = smaller.effects.clone();
        let Ok(found) = diagnose_fit(rig, runs, &effects, smaller, Some(grown), options, progress) else { continue };
        let better = |other: &&Fit| {
            let added = other.parameters.len().saturating_sub(fit.parameters.len());
            let is_back = other.effects.iter().any(|c| c.effect.name() == gone.effect.name());
            !is_back && scale.evidence(square(fit), square(other), added) > LEAST_EVIDENCE
        };
        if found.answer().filter(better).is_some() {
            return Some((found, gone.clone()));
        }
    }
    None
}
