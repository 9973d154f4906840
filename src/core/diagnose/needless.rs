//! Backward elimination: after an effect was added, an earlier one may have nothing left to explain.
//!
//! What was found first may have stood in for what was found later. So each effect that a diagnosis has added is tried without, and goes where the
//! evidence for it is no longer enough.

use rayon::prelude::*;

use crate::diagnose::circumstances::{circumstances, features};
use crate::diagnose::fitter::Fitter;
use crate::diagnose::limits::{LEAST_EVIDENCE, NO_FULL_FIT_ABOVE};
use crate::diagnose::measures::{evidence_scale, least_fall, over_noise, square};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::options::Options;
use crate::model::Model;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// The model without the effect that it needs least, where the evidence for that one is not enough; and that effect. Effects that are `kept` stay.
pub fn without_needless(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    kept: &[Chosen],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Option<(Fit, Chosen)> {
    let stays = |effect: &Chosen| kept.iter().any(|c| c.effect.name() == effect.effect.name());
    let fitter = Fitter { rig, runs, asked: &fit.effects, options, progress };
    let model = Model::new(rig, &runs.first()?.conditions.water, &fit.effects);
    let scale = evidence_scale(fit, features(runs));
    let known = circumstances(rig, runs);
    let tried = (0..fit.effects.len()).into_par_iter().filter(|&i| !stays(&fit.effects[i])).filter_map(|i| {
        let gone = fit.effects[i].clone();
        progress(&Progress::from(format!("without {}", gone.label())));
        let own = model.parameters_of(i);
        let mut smaller = fitter.without(fit, i).ok()?;
        if square(&smaller) < NO_FULL_FIT_ABOVE * square(fit) {
            smaller = fitter.to_its_end(&smaller, None).unwrap_or(smaller);
        }
        let evidence = scale.evidence(square(&smaller), square(fit), own.len());
        let size: Vec<f64> = fit.values()[own].to_vec();
        let worth = over_noise(&smaller, runs).powi(2) - over_noise(fit, runs).powi(2) > least_fall(runs, 0.0);
        let needed = evidence > LEAST_EVIDENCE && worth && gone.effect.noteworthy(&size, &known);
        (!needed).then_some((evidence, smaller, gone))
    });
    let least = tried.collect::<Vec<_>>().into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((least.1, least.2))
}
