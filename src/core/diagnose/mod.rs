//! Diagnosis: where a model fails, and which effect of the catalogue is missing from it.
//!
//! The start model is fitted fully; every other effect is then added alone and everything refitted ([`refit`]), from the starts whose
//! signatures, projected off the fitted parameters, promise most ([`ground`]). The evidence of each ([`evidence`]) becomes a
//! probability and a verdict, rivals that the data cannot tell apart are named together, with the test that would ([`next_test`]).

pub mod baseline;
pub mod candidate;
pub(crate) mod candidate_fit;
pub mod evidence;
pub(crate) mod fallback_search;
pub(crate) mod next_test;
pub mod refit;
pub mod residual_patterns;
pub mod verdict;
pub mod visible;
pub mod warnings;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::diagnose::baseline::Ground;
use crate::diagnose::candidate_fit::{Finisher, Rival, best_forms, square, worth};
use crate::diagnose::evidence::{Worth, probabilities};
use crate::diagnose::refit::{Refit, follow, glimpse};
pub use crate::diagnose::verdict::Verdict;
use crate::diagnose::verdict::{LEAST_EVIDENCE, LEAST_FALL};
use crate::diagnose::visible::{Visible, visible};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::search::calibrate::{FitError, Options, Progress, calibrate};
use crate::fit::validate::conflict::faded_noise;
use crate::fit::validate::held_out::held_out_m;
use crate::model::check_sensors;
use crate::model::effects::{CERTAIN, Chosen};
use crate::rig::Rig;

/// Difference of tempered evidence within which two effects cannot be told apart: a Bayes factor of twenty (Kass & Raftery 1995).
const INDISTINGUISHABLE: f64 = 3.0;
/// Effects that are refitted to the end; the others have been looked at.
const FOLLOWED_EFFECTS: usize = 6;
/// Most candidates that are fitted to all samples on the fine grid.
const FINISHED: usize = 3;
/// Error over noise of a start model that is next to the noise.
const QUIET: f64 = 1.3;
/// Evidence of what is not worth a model.
pub const NOT_WORTH: f64 = -10.0;
/// Error over noise of the best candidate from which on it is not down to the noise.
const POOR: f64 = 1.2;
/// Error over noise of the start model from which on its parameters may be astray, and from which on they tell nothing of the effects.
const ASTRAY: f64 = 3.0;
const FAR_ASTRAY: f64 = 10.0;
/// Times the start model's error of prediction: a model that errs by more has learned nothing of use.
const PREDICTS_WORSE: f64 = 1.05;
/// Times the best candidate's square: what leaves more is not worth a full fit.
const HOPELESS: f64 = 4.0;
/// Times the best candidate's square up to which a fit is worth all patience.
const SETTLED: f64 = 1.2;

/// An effect that may be missing.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its name in the catalogue.
    pub effect: &'static str,
    /// The form that fits best, as on the command line.
    pub label: String,
    /// The probability that it is the one that is missing.
    pub probability: f64,
    /// Evidence for it over the start model, natural logarithm of odds before tempering.
    pub evidence: f64,
    /// RMSE over the last two fifths of the records when it is fitted to what comes before, m, of the best one.
    pub held_out_m: Option<f64>,
    /// Error over the noise: each sensor's in units of its own, rms.
    pub over_noise: f64,
    /// Its values are within what every rig has of it (see [`crate::model::effects::Effect::noteworthy`]).
    pub within_class: bool,
    /// RMSE with it, m: of the full fit where there is one, otherwise as forecast from the coarse refit.
    pub rmse_m: f64,
    /// Its own parameters.
    pub parameters: Vec<FittedParameter>,
    /// Other effects that these data cannot tell from it.
    pub indistinguishable_from: Vec<&'static str>,
    /// The full fit, of the best ones.
    pub fit: Option<Fit>,
}

/// The answer.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// The probability that it is right.
    pub probability: f64,
    /// The start model, fitted.
    pub start: Fit,
    /// What makes all that follows doubtful, a sentence each.
    pub doubts: Vec<String>,
    /// Where it fails, a sentence each.
    pub failings: Vec<String>,
    /// Effects that could be missing, best first.
    pub candidates: Vec<Candidate>,
    /// Effects that were not tried, each with the reason.
    pub left_out: Vec<(&'static str, String)>,
    /// RMSE of the start model over the last two fifths of the records when it is fitted to what comes before, m.
    pub held_out_m: Option<f64>,
    /// What could not have been seen, where nothing is missing.
    pub visible: Vec<Visible>,
    /// What would tell the best apart, where these data cannot.
    pub next_test: Option<String>,
}

impl Diagnosis {
    /// The most probable effect makes the model predict the end of the records worse than without it.
    pub fn predicts_worse(&self) -> bool {
        let with = self.candidates.first().and_then(|c| c.held_out_m);
        matches!((with, self.held_out_m), (Some(with), Some(without)) if with > PREDICTS_WORSE * without)
    }
}

/// Diagnoses `runs` of a rig, starting from a model with `effects`; `progress` hears what is going on.
///
/// # Errors
/// As [`calibrate`]; a candidate that cannot be simulated is left out.
pub fn diagnose(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, FitError> {
    progress("the start model");
    let start = calibrate(rig, runs, effects, options, &|p| progress(&format!("the start model, {}", p.stage)))?;
    diagnose_fit(rig, runs, effects, start, options, progress)
}

/// The same from a start model that is fitted already, with `options`; `effects` are its effects, which may leave a number of elements open.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_fit(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    start: Fit,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, FitError> {
    let ground = Ground::new(rig, runs, &start, options)?;
    let refits = refits(&ground, progress);
    let finisher = Finisher { rig, runs, effects, options, progress };
    let mut rivals = rivals(&ground, &start, &refits);
    fit(&finisher, &ground, &start, &mut rivals);
    let worth = weigh(&ground, &start, &mut rivals);
    rank(&ground, &mut rivals);
    let shares = probabilities(&rivals.iter().map(|r| (r.evidence, r.odds(&ground.known))).collect::<Vec<_>>());
    let mut candidates: Vec<Candidate> =
        (0..rivals.len()).map(|i| candidate(&ground, &start, &rivals, i, shares[i])).collect();
    let certain = is_certain(&ground, &rivals);
    let (verdict, other) = Verdict::over(over_noise(&start, runs), &candidates, certain);
    // Whatever is in the catalogue shares what is left for it.
    let none = (1.0 - shares.iter().sum::<f64>()).max(0.0) * (1.0 - other);
    candidates.iter_mut().for_each(|c| c.probability *= 1.0 - other);
    let probability = match verdict {
        Verdict::MissingEffect => candidates.first().map_or(0.0, |c| c.probability),
        Verdict::NothingMissing => none,
        Verdict::UnknownEffect => other,
    };
    let mut diagnosis = Diagnosis {
        verdict,
        probability,
        doubts: crate::diagnose::warnings::doubts(rig, runs, &start, effects, options),
        failings: crate::diagnose::residual_patterns::failings(&start),
        candidates,
        left_out: crate::diagnose::candidate::left_out(rig, &ground.effects),
        held_out_m: None,
        visible: Vec::new(),
        next_test: None,
        start,
    };
    match verdict {
        Verdict::MissingEffect => explain(&finisher, &ground, &rivals, &mut diagnosis),
        Verdict::NothingMissing => {
            let forms: Vec<_> = rivals.iter().map(|r| r.refit.form.clone()).collect();
            diagnosis.visible = visible(&ground, &forms, worth, LEAST_EVIDENCE, LEAST_FALL);
        }
        Verdict::UnknownEffect => {}
    }
    Ok(diagnosis)
}

/// The best form of each effect, as its refit forecasts it, the most promising first.
fn rivals<'a>(ground: &Ground, start: &Fit, refits: &'a [Refit]) -> Vec<Rival<'a>> {
    let Some(closest) = refits.iter().min_by(|a, b| a.square.total_cmp(&b.square)) else { return Vec::new() };
    let coarse = Worth::of(&closest.residuals[..ground.samples], ground.features());
    let mut rivals: Vec<Rival> = best_forms(refits, |r| coarse.evidence(ground.square, r.square, r.added))
        .into_iter()
        .map(|(evidence, refit)| Rival::forecast(ground, start, refit, evidence))
        .collect();
    rank(ground, &mut rivals);
    rivals
}

/// The most probable first.
fn rank(ground: &Ground, rivals: &mut [Rival]) {
    rivals.sort_by(|a, b| b.log_odds(&ground.known).total_cmp(&a.log_odds(&ground.known)));
}

/// Fits the best rivals to all samples, and tries further where none of them is down to the noise.
fn fit(finisher: &Finisher, ground: &Ground, start: &Fit, rivals: &mut [Rival]) {
    let Some(best) = rivals.first().map(|r| r.square) else { return };
    let tried = rivals.len().min(FINISHED);
    rivals[..tried].par_iter_mut().enumerate().for_each(|(i, rival)| {
        let first = i == 0 && rival.evidence > NOT_WORTH;
        if first || (rival.evidence > LEAST_EVIDENCE && rival.square < HOPELESS * best) {
            rival.take(finisher.finished(rival.refit));
        }
    });
    let astray = over_noise(start, finisher.runs);
    if is_certain(ground, rivals) {
        if rivals[0].fit.as_ref().is_none_or(|f| over_noise(f, finisher.runs) > POOR) {
            let fit = finisher.scratch_fit(rivals[0].refit);
            rivals[0].take(fit);
        }
    } else if astray > ASTRAY {
        let most = if astray > FAR_ASTRAY { usize::MAX } else { FOLLOWED_EFFECTS };
        crate::diagnose::fallback_search::rescue(finisher, rivals, square(start), POOR, most);
    }
    let near = SETTLED * rivals.iter().map(|r| r.square).fold(f64::INFINITY, f64::min);
    rivals.par_iter_mut().filter(|r| r.fit.as_ref().is_some_and(|f| !f.converged) && r.square < near).for_each(
        |rival| {
            let settled = finisher.settled(rival);
            rival.take(settled);
        },
    );
}

/// Gives the rivals their evidence by the best fit, and takes it from those that are not worth a model, however sure.
fn weigh(ground: &Ground, start: &Fit, rivals: &mut [Rival]) -> Worth {
    let fine = rivals.iter().filter_map(|r| r.fit.as_ref()).min_by(|a, b| square(a).total_cmp(&square(b)));
    let worth = worth(fine.unwrap_or(start), ground.features());
    let before = over_noise(start, &ground.runs);
    for rival in rivals {
        rival.evidence = worth.evidence(square(start), rival.square, rival.added(ground, start));
        let fall = before.powi(2) * (1.0 - rival.square / square(start));
        if fall < LEAST_FALL.powi(2) || !rival.is_noteworthy(ground) {
            rival.evidence = rival.evidence.min(NOT_WORTH);
        }
    }
    worth
}

/// A record on the floor of vapour pressure has cavities, however well or badly a model of them follows their collapse.
fn is_certain(ground: &Ground, rivals: &[Rival]) -> bool {
    rivals.first().is_some_and(|r| r.odds(&ground.known) >= CERTAIN)
}

/// Adds what a missing effect calls for: whether it predicts what comes later, and the test that would tell it from its rivals.
fn explain(finisher: &Finisher, ground: &Ground, rivals: &[Rival], diagnosis: &mut Diagnosis) {
    (finisher.progress)("predicting the end of the records from their beginning");
    let predicted = |fit: Option<&Fit>| {
        fit.and_then(|fit| held_out_m(finisher.rig, finisher.runs, fit, finisher.options).ok())
            .filter(|m| m.is_finite())
    };
    let best = diagnosis.candidates.first().and_then(|c| c.fit.as_ref());
    let (start, with) = rayon::join(|| predicted(Some(&diagnosis.start)), || predicted(best));
    diagnosis.held_out_m = start;
    let Some(first) = diagnosis.candidates.first_mut() else { return };
    first.held_out_m = with;
    let effect = first.effect;
    if let Some(fit) = first.fit.as_ref().filter(|_| faded_noise(&diagnosis.start).is_empty()) {
        diagnosis.doubts.extend(faded_noise(fit));
    }
    if diagnosis.predicts_worse() {
        diagnosis.doubts.push(format!(
            "fitted to the beginning of the records the model with {effect} predicts the rest worse than the start model does: it follows \
             these records without being what happens in the pipe"
        ));
    }
    let Some(first) = diagnosis.candidates.first() else { return };
    diagnosis.next_test = first.indistinguishable_from.first().and_then(|name| {
        let other = rivals.iter().find(|r| r.refit.form.effect == *name)?;
        crate::diagnose::next_test::next_test(ground, &rivals[0], other)
    });
}

/// The start model, fitted before, with one effect more: fitted to all samples, with the evidence for it.
///
/// # Errors
/// As [`calibrate`]; an effect that no start of it can be simulated with.
pub fn grow(
    rig: &Rig,
    runs: &[RunData],
    start: &Fit,
    added: &Chosen,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<(Fit, f64), FitError> {
    check_sensors(rig, std::slice::from_ref(added))?;
    let ground = Ground::new(rig, runs, start, options)?;
    let shown = |p: &Progress| progress(&format!("{}, {}", added.label(), p.stage));
    let mut fits = Vec::new();
    if added.effect.elements().is_some() {
        // Elements are added one by one.
        let effects: Vec<Chosen> = ground.effects.iter().cloned().chain([added.clone()]).collect();
        fits.push(calibrate(rig, runs, &effects, options, &shown));
    } else {
        let finisher = Finisher { rig, runs, effects: &ground.effects, options, progress };
        for form in crate::diagnose::candidate::forms_of(rig, added) {
            let refit = glimpse(&ground, &form).and_then(|g| follow(&ground, &g));
            fits.push(refit.map_err(FitError::from).and_then(|refit| finisher.finished(&refit)));
        }
    }
    let (fits, failures): (Vec<_>, Vec<_>) = fits.into_iter().partition(Result::is_ok);
    let best = fits.into_iter().flatten().min_by(|a, b| square(a).total_cmp(&square(b)));
    let best = best.ok_or_else(|| failures.into_iter().find_map(Result::err).unwrap_or(FitError::NoRun))?;
    let parameters = best.parameters.len() - start.parameters.len();
    let evidence = worth(&best, ground.features()).evidence(square(start), square(&best), parameters);
    Ok((best, evidence))
}

/// A glimpse of every form; those of the most promising effects are followed.
fn refits(ground: &Ground, progress: &(dyn Fn(&str) + Sync)) -> Vec<Refit> {
    let forms: Vec<_> = crate::diagnose::candidate::candidates(ground.rig, &ground.effects, ground.runs.len());
    let done = AtomicUsize::new(0);
    let glimpses: Vec<Refit> = forms
        .par_iter()
        .filter_map(|form| {
            let glimpse = glimpse(ground, form).ok();
            let n = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(&format!("{n} of {} candidates looked at", forms.len()));
            glimpse
        })
        .collect();
    let mut order = best_forms(&glimpses, |r| -r.square);
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let worthy: Vec<&str> = order.iter().take(FOLLOWED_EFFECTS).map(|(_, r)| r.form.effect).collect();
    // Next to the noise a straight line tells all: what a glimpse does not promise will not come.
    let quiet = ground.mean_square(&ground.residuals) < QUIET.powi(2);
    let worth = Worth::of(&ground.residuals[..ground.samples], ground.features());
    let hopeful = |r: &Refit| worth.evidence(ground.square, r.square, r.added) > NOT_WORTH;
    glimpses
        .par_iter()
        .map(|glimpse| {
            // What boils does so past a threshold that no straight line sees.
            let worthy = worthy.contains(&glimpse.form.effect) || glimpse.form.chosen.effect.lets_boil();
            if !worthy || (quiet && !hopeful(glimpse)) {
                return glimpse.clone();
            }
            progress(&format!("{} refitted", glimpse.form.chosen.label()));
            follow(ground, glimpse).ok().unwrap_or_else(|| glimpse.clone())
        })
        .collect()
}

fn candidate(ground: &Ground, start: &Fit, rivals: &[Rival], i: usize, probability: f64) -> Candidate {
    let rival = &rivals[i];
    let near = rivals.iter().enumerate().filter(|(j, other)| {
        *j != i
            && other.evidence > LEAST_EVIDENCE
            && (other.log_odds(&ground.known) - rival.log_odds(&ground.known)).abs() < INDISTINGUISHABLE
    });
    let parameters = rival.own_parameters(ground);
    Candidate {
        effect: rival.refit.form.effect,
        label: rival.label(),
        probability,
        evidence: rival.evidence,
        rmse_m: rival.fit.as_ref().map_or_else(|| start.pooled().0 * rival.left_of(start), |f| f.pooled().0),
        over_noise: rival
            .fit
            .as_ref()
            .map_or_else(|| over_noise(start, &ground.runs) * rival.left_of(start), |f| over_noise(f, &ground.runs)),
        within_class: !rival.is_noteworthy(ground),
        parameters,
        held_out_m: None,
        indistinguishable_from: near.map(|(_, other)| other.refit.form.effect).collect(),
        fit: rival.fit.clone(),
    }
}

/// Error of a fit over what disturbs each sensor while nothing happens, rms over all samples.
fn over_noise(fit: &Fit, runs: &[RunData]) -> f64 {
    let (mut square, mut n) = (0.0, 0.0);
    for (fitted, run) in fit.runs.iter().zip(runs) {
        for (sensor, data) in fitted.sensors.iter().zip(&run.sensors) {
            let samples = sensor.time_s.len() as f64;
            square += samples * (sensor.rmse_m / data.total_noise_m).powi(2);
            n += samples;
        }
    }
    (square / f64::max(n, 1.0)).sqrt()
}
