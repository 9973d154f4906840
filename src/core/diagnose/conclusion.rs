//! What a search says: the verdict and its probability, every candidate, the pair, and what follows from them.

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::{Form, base_name, left_out};
use crate::diagnose::evidence::tempered;
use crate::diagnose::limits::{AS_FAST, RIG_FILE_IS_WRONG};
use crate::diagnose::models::Search;
use crate::diagnose::next::{Answer, in_words};
use crate::diagnose::outcome::{Candidate, Diagnosis, Pair, RivalPair, Verdict};
use crate::diagnose::residual_patterns::{Pattern, residual_patterns};
use crate::diagnose::rest::explain as explain_rest;
use crate::diagnose::verdict::verdict;
use crate::diagnose::visible::visible;
use crate::diagnose::warnings::warnings;
use crate::diagnose::weigh::{Weighed, WeighedModel, left_of, over_noise_of, weigh};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::progress::Progress;
use crate::fit::search::calibrate::Fitter;
use crate::fit::search::thresholds::DOUBTFUL_ABOVE;
use crate::fit::validate::held_out::held_out_m;
use crate::model::Model;
use crate::rig::Rig;

/// What a search that went on from a `state` says of what that lacks.
pub(crate) fn diagnosis(search: &Search, state: &[&'static str], is_held: bool) -> Result<Diagnosis, FitError> {
    let Fitter { rig, runs, options, progress, .. } = search.fitter;
    let asked = search.asked;
    let start = search.fit_of(state);
    let own = if state.is_empty() { None } else { Some(Baseline::new(rig, runs, start, options)?) };
    let baseline = own.as_ref().unwrap_or(search.baseline);
    let weighed = weigh(search, state);
    let mut candidates = candidates(search, &weighed);
    let shown = weighed.models.first().is_some_and(|m| m.is_shown && m.evidence > 0.0);
    let (mut pair, mut rival_pairs) = if shown { (None, Vec::new()) } else { pairs(search, &weighed) };
    let (mut verdict, mut other) = verdict(start.over_noise(), &candidates, pair.as_ref(), shown);
    // No effect makes a wave faster. Where the record shows one that the pipe of the rig file cannot have, an answer
    // that follows it all the same, or that explains nothing, makes up for a wrong length, wall or material.
    let answered = pair.as_ref().map(|p| &p.fit).or(candidates.first().and_then(|c| c.fit.as_ref()));
    let astray = |fit: &Fit| fit.over_noise() > DOUBTFUL_ABOVE || follows_too_fast(rig, runs, fit);
    let rig_file_is_wrong =
        verdict != Verdict::NothingMissing && shows_too_fast(rig, runs) && answered.is_none_or(astray);
    if rig_file_is_wrong {
        (verdict, other) = (Verdict::UnknownEffect, other.max(RIG_FILE_IS_WRONG));
        pair = None;
        rival_pairs.clear();
    }
    // The effects of the catalogue share the rest of the probability.
    let none = (1.0 - weighed.models.iter().map(|m| m.share).sum::<f64>()).max(0.0) * (1.0 - other);
    candidates.iter_mut().for_each(|c| c.probability *= 1.0 - other);
    pair.iter_mut().for_each(|p| p.probability *= 1.0 - other);
    rival_pairs.iter_mut().for_each(|p| p.probability *= 1.0 - other);
    let single = candidates.first().map_or(0.0, |c| c.probability);
    let probability = match verdict {
        Verdict::MissingEffect => pair.as_ref().map_or(single, |p| p.probability),
        Verdict::NothingMissing => none,
        Verdict::UnknownEffect => other,
    };
    let mut diagnosis = Diagnosis {
        verdict,
        probability,
        warnings: Vec::new(),
        residual_patterns: residual_patterns(start).iter().map(Pattern::sentence).collect(),
        candidates,
        pair,
        rival_pairs,
        left_out: left_out(rig, &baseline.effects),
        held_out_m: None,
        visible: Vec::new(),
        next_test: None,
        rest: Vec::new(),
        is_held,
        start: start.clone(),
    };
    diagnosis.warnings = warnings(rig, runs, &diagnosis, asked);
    if rig_file_is_wrong {
        diagnosis.warnings.push(
            "the wave is faster than the rig file's pipe allows, whichever effect is added, and no effect makes a wave faster: correct the pipe's \
             length, wall or material in the rig file, or the rate of the samples"
                .into(),
        );
    }
    match verdict {
        Verdict::MissingEffect => explain(search, baseline, &weighed, &mut diagnosis),
        Verdict::NothingMissing => {
            let forms: Vec<Form> = search.forms_alone();
            let least_fall = search.least_fall_after(search.taken(start));
            diagnosis.visible = visible(baseline, &forms, weighed.scale, least_fall);
        }
        Verdict::UnknownEffect => match explain_rest(rig, runs, &diagnosis.start, options, progress) {
            Ok(explanations) => diagnosis.rest = explanations,
            Err(error) => {
                diagnosis.warnings.push(format!("what would explain the rest could not be solved for: {error}"))
            }
        },
    }
    Ok(diagnosis)
}

/// Each effect of which a model has been met, the most probable first. It may be missing alone, or with another.
fn candidates(search: &Search, weighed: &Weighed) -> Vec<Candidate> {
    let singles: Vec<&WeighedModel> = weighed.models.iter().filter(|m| m.added.len() == 1).collect();
    let candidate = |model: &&WeighedModel| {
        let effect = model.effect()?;
        let near = singles.iter().filter(|other| {
            other.effect() != model.effect()
                && tempered(other.evidence) > STRONG_EVIDENCE
                && (other.log_odds() - model.log_odds()).abs() < STRONG_EVIDENCE
        });
        let with_others = weighed.models.iter().filter(|m| m.met.key.contains(&effect)).map(|m| m.share);
        Some(Candidate {
            effect,
            label: model.label(),
            probability: with_others.sum(),
            evidence: model.evidence,
            rmse_m: model
                .met
                .fit
                .as_ref()
                .map_or_else(|| search.start.pooled().0 * left_of(model.met, search.start), |f| f.pooled().0),
            over_noise: over_noise_of(model.met, search),
            within_class: !model.is_noteworthy,
            parameters: model.parameters.clone(),
            held_out_m: None,
            indistinguishable_from: near.filter_map(|other| other.effect()).collect(),
            fit: model.met.fit.clone(),
        })
    };
    let mut all: Vec<Candidate> = singles.iter().filter_map(candidate).collect();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// The most probable pair, where the evidence for the second effect is enough, and the others whose share is not
/// negligible beside it.
fn pairs(search: &Search, weighed: &Weighed) -> (Option<Pair>, Vec<RivalPair>) {
    let both = |m: &&WeighedModel| m.added.len() == 2 && tempered(m.evidence) > STRONG_EVIDENCE && m.met.fit.is_some();
    let mut all = weighed.models.iter().filter(both);
    let Some((best, fit)) = all.next().and_then(|best| Some((best, best.met.fit.clone()?))) else {
        return (None, Vec::new());
    };
    let single = weighed.models.iter().filter(|m| m.added.len() == 1).map(|m| m.share).fold(0.0, f64::max);
    if best.share < single {
        return (None, Vec::new());
    }
    let labels = |m: &WeighedModel| [0, 1].map(|i| m.added[i].label());
    let rivals = all.filter(|m| best.log_odds() - m.log_odds() < STRONG_EVIDENCE).map(|m| RivalPair {
        labels: labels(m),
        probability: m.share,
        over_noise: over_noise_of(m.met, search),
    });
    let pair = Pair {
        effects: [0, 1].map(|i| base_name(best.added[i].effect.name())),
        labels: labels(best),
        probability: best.share,
        evidence: best.evidence,
        over_noise: over_noise_of(best.met, search),
        parameters: best.parameters.clone(),
        fit,
    };
    (Some(pair), rivals.collect())
}

/// Whether the records show a wave that is faster than the rig file's pipes allow.
fn shows_too_fast(rig: &Rig, runs: &[RunData]) -> bool {
    let Some(first) = runs.first() else { return false };
    let measured: Vec<f64> = runs.iter().filter_map(|run| run.start.wave_speed_ratio).collect();
    let (nominal, _, greatest) = rig.wave_speed_start(&first.conditions.water);
    !measured.is_empty() && measured.iter().sum::<f64>() / measured.len() as f64 > AS_FAST * greatest / nominal
}

/// Whether a wave gets through the model of the fit in the least time that the rig file's pipes allow, or less.
fn follows_too_fast(rig: &Rig, runs: &[RunData], fit: &Fit) -> bool {
    let Some(first) = runs.first() else { return false };
    let water = &first.conditions.water;
    let model = Model::new(rig, water, &fit.effects);
    let problem = FitProblem::new(&model, runs, Window { reaches: fit.reaches, horizon_s: f64::INFINITY, stride: 1 });
    let values = fit.values();
    let run = problem.run_values(0, &values);
    let travel_s = model.travel_s(&first.conditions, &values[..model.shared.len()], &run);
    let least_s = rig.length_m() / rig.wave_speed_start(water).2;
    travel_s.is_ok_and(|travel_s| travel_s.way_s() < AS_FAST * least_s)
}

/// Adds to the diagnosis of a missing effect: how well the effect predicts the end of the records, and the test that
/// would tell it from the candidate that the data cannot tell it from.
fn explain(search: &Search, baseline: &Baseline, weighed: &Weighed, diagnosis: &mut Diagnosis) {
    let fitter = &search.fitter;
    (fitter.progress)(&Progress::from("predicting the end of the records from their beginning"));
    let predicted = |fit: Option<&Fit>| {
        fit.and_then(|fit| held_out_m(fitter.rig, fitter.runs, fit, fitter.options).ok()).filter(|m| m.is_finite())
    };
    let best = diagnosis.answer();
    let (start, with) = rayon::join(|| predicted(Some(&diagnosis.start)), || predicted(best));
    diagnosis.held_out_m = start;
    diagnosis.candidates.iter_mut().take(1).for_each(|first| first.held_out_m = with);
    let effect = diagnosis.answer_label();
    if diagnosis.predicts_worse() {
        diagnosis.warnings.push(format!(
            "fitted to the beginning of the records, the model with {effect} predicts the rest worse than the start model: it \
             describes these records, but not what happens in the pipe"
        ));
    }
    let Some(first) = diagnosis.candidates.first().filter(|_| diagnosis.pair.is_none()) else { return };
    let answer = |name: &str| {
        let model = weighed.models.iter().find(|m| m.effect() == Some(name))?;
        let (effects, values) = model.met.model()?;
        Some(Answer { name: model.label(), effects: effects.to_vec(), values })
    };
    diagnosis.next_test = first.indistinguishable_from.first().and_then(|name| {
        let (one, other) = (answer(first.effect)?, answer(name)?);
        in_words(baseline, [one, other])
    });
}
