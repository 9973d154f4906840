//! Diagnosis: where a model fails, and which effect of the catalogue is missing from it.
//!
//! The start model is fitted fully; every other effect is then added alone and everything refitted ([`refit`]), from the starts whose
//! signatures, projected off the fitted parameters, promise most ([`ground`]). The evidence of each ([`evidence`]) becomes a
//! probability and a verdict, rivals that the data cannot tell apart are named together, with the test that would ([`next_test`]).

pub mod candidate;
pub mod evidence;
pub mod ground;
pub mod misfit;
pub mod next_test;
pub mod refit;
mod rescue;
mod rival;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::fit::calibrate::{FitError, Options, Progress, calibrate};
use crate::fit::data::RunData;
use crate::fit::outcome::{Fit, FittedParameter};
use crate::model::effects::Chosen;
use crate::rig::Rig;
use evidence::{Worth, probabilities};
use ground::Ground;
use refit::{Refit, follow, glimpse};
use rival::{Finisher, Rival, best_forms, square, worth};

/// Evidence below which an effect is not worth having: the largest of sixteen searches by chance stays below.
const LEAST_EVIDENCE: f64 = 10.0;
/// Difference of tempered evidence within which two effects cannot be told apart: a Bayes factor of twenty (Kass & Raftery 1995).
const INDISTINGUISHABLE: f64 = 3.0;
/// Error over noise up to which a residual may be noise.
const NOISE: f64 = 1.3;
/// An effect that leaves more than this share of what the start model's error has beyond the noise, and more than
/// [`LEFT_OVER_NOISE`] times the noise, does not explain it.
const LEFT_SHARE: f64 = 0.35;
const LEFT_OVER_NOISE: f64 = 2.5;
/// What an effect must take away of the error, in quadrature, over the noise: less is not worth a model.
const LEAST_FALL: f64 = 0.25;
/// Effects that are refitted to the end; the others have been looked at.
const FOLLOWED_EFFECTS: usize = 6;
/// Most candidates that are fitted to all samples on the fine grid.
const FINISHED: usize = 3;
/// Error over noise of the best candidate from which on it is not down to the noise.
const POOR: f64 = 1.2;
/// Error over noise of the start model from which on its parameters may be astray, and from which on they tell nothing of the effects.
const ASTRAY: f64 = 3.0;
const FAR_ASTRAY: f64 = 10.0;
/// Odds before any fit from which on an effect is at work for certain, whatever it leaves unexplained.
const CERTAIN: f64 = 100.0;
/// Times the best candidate's square: what leaves more is not worth a full fit.
const HOPELESS: f64 = 4.0;
/// Times the best candidate's square up to which a fit is worth all patience.
const SETTLED: f64 = 1.2;
/// What a diagnosis says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// An effect of the catalogue is missing.
    MissingEffect,
    /// The residual is noise.
    NothingMissing,
    /// Something is missing that no effect of the catalogue explains.
    UnknownEffect,
}

impl Verdict {
    /// As the contract names it.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::MissingEffect => "missing-effect",
            Verdict::NothingMissing => "nothing-missing",
            Verdict::UnknownEffect => "unknown-effect",
        }
    }
}

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
    /// The start model, fitted.
    pub start: Fit,
    /// Where it fails, a sentence each.
    pub failings: Vec<String>,
    /// Effects that could be missing, best first.
    pub candidates: Vec<Candidate>,
    /// Effects that were not tried, each with the reason.
    pub left_out: Vec<(&'static str, String)>,
    /// What would tell the best apart, where these data cannot.
    pub next_test: Option<String>,
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
    let ground = Ground::new(rig, runs, &start, &options.constraints)?;
    let refits = refits(&ground, progress);
    let failings = misfit::failings(&start);
    let Some(closest) = refits.iter().min_by(|a, b| a.square.total_cmp(&b.square)) else {
        return Ok(Diagnosis {
            verdict: unexplained(&start, total_noise_m(runs)),
            left_out: candidate::left_out(rig, &ground.effects),
            start,
            failings,
            candidates: Vec::new(),
            next_test: None,
        });
    };
    let coarse = Worth::of(&closest.residuals[..ground.samples], ground.features());
    let mut rivals: Vec<Rival> = best_forms(&refits, |r| coarse.evidence(ground.square, r.square, r.added))
        .into_iter()
        .map(|(evidence, refit)| Rival::forecast(&ground, &start, refit, evidence))
        .collect();
    let by_odds = |a: &Rival, b: &Rival| b.log_odds(&ground.known).total_cmp(&a.log_odds(&ground.known));
    rivals.sort_by(by_odds);
    let finisher = Finisher { rig, runs, effects, options, progress };
    let hopeless = HOPELESS * rivals[0].square;
    let tried = rivals.len().min(FINISHED);
    rivals[..tried].par_iter_mut().enumerate().for_each(|(i, rival)| {
        if i == 0 || (rival.evidence > LEAST_EVIDENCE && rival.square < hopeless) {
            rival.take(finisher.finished(rival.refit));
        }
    });
    let noise_m = total_noise_m(runs);
    // A record on the floor of vapour pressure has cavities, however well or badly a model of them follows their collapse.
    let certain = rivals.first().is_some_and(|r| r.odds(&ground.known) >= CERTAIN);
    let astray = start.pooled().0 / noise_m;
    if astray > ASTRAY && !certain {
        rescue::rescue(
            &finisher,
            &mut rivals,
            POOR * noise_m,
            if astray > FAR_ASTRAY { usize::MAX } else { FOLLOWED_EFFECTS },
        );
    }
    rivals.sort_by(|a, b| a.square.total_cmp(&b.square));
    let near = SETTLED * rivals[0].square;
    rivals.par_iter_mut().filter(|r| r.fit.as_ref().is_some_and(|f| !f.converged) && r.square < near).for_each(
        |rival| {
            let settled = finisher.settled(rival);
            rival.take(settled);
        },
    );
    let fine = rivals.iter().filter_map(|r| r.fit.as_ref()).min_by(|a, b| square(a).total_cmp(&square(b)));
    if let Some(best) = fine {
        let worth = worth(best, ground.features());
        rivals.iter_mut().for_each(|r| r.evidence = worth.evidence(square(&start), r.square, r.added(&ground, &start)));
    }
    // What is not worth a model is no explanation, however sure.
    let (rmse_m, samples) = (start.pooled().0, ground.run_samples() as f64);
    for rival in &mut rivals {
        let fall_m2 = rmse_m.powi(2) - ground.noise_m().powi(2) * rival.square / samples;
        let values: Vec<f64> = rival.own_parameters(&ground).iter().map(|p| p.value).collect();
        if fall_m2 < (LEAST_FALL * noise_m).powi(2) || !rival.refit.form.chosen.effect.noteworthy(&values) {
            rival.evidence = rival.evidence.min(0.0);
        }
    }
    rivals.sort_by(by_odds);
    let shares = probabilities(&rivals.iter().map(|r| (r.evidence, r.odds(&ground.known))).collect::<Vec<_>>());
    let candidates: Vec<Candidate> = (0..rivals.len()).map(|i| candidate(&ground, &rivals, i, shares[i])).collect();
    let verdict = verdict(&start, noise_m, &candidates, certain);
    let other =
        candidates.first().filter(|_| verdict == Verdict::MissingEffect).and_then(|c| c.indistinguishable_from.first());
    let next_test = other.and_then(|name| {
        let other = rivals.iter().find(|r| r.refit.form.effect == *name)?;
        next_test::next_test(&ground, rivals[0].refit, other.refit)
    });
    let left_out = candidate::left_out(rig, &ground.effects);
    Ok(Diagnosis { verdict, failings, start, candidates, left_out, next_test })
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
    let ground = Ground::new(rig, runs, start, &options.constraints)?;
    let shown = |p: &Progress| progress(&format!("{}, {}", added.label(), p.stage));
    let mut fits = Vec::new();
    if added.effect.elements().is_some() {
        // Elements are added one by one.
        let effects: Vec<Chosen> = ground.effects.iter().cloned().chain([added.clone()]).collect();
        fits.push(calibrate(rig, runs, &effects, options, &shown));
    } else {
        let finisher = Finisher { rig, runs, effects: &ground.effects, options, progress };
        for form in candidate::forms_of(rig, added) {
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
    let forms: Vec<_> = candidate::candidates(ground.rig, &ground.effects);
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
    glimpses
        .par_iter()
        .map(|glimpse| {
            // What boils does so past a threshold that no straight line sees.
            if !worthy.contains(&glimpse.form.effect) && !glimpse.form.chosen.effect.lets_boil() {
                return glimpse.clone();
            }
            progress(&format!("{} refitted", glimpse.form.chosen.label()));
            follow(ground, glimpse).ok().unwrap_or_else(|| glimpse.clone())
        })
        .collect()
}

fn candidate(ground: &Ground, rivals: &[Rival], i: usize, probability: f64) -> Candidate {
    let rival = &rivals[i];
    let near = rivals.iter().enumerate().filter(|(j, other)| {
        *j != i
            && other.evidence > LEAST_EVIDENCE
            && (other.log_odds(&ground.known) - rival.log_odds(&ground.known)).abs() < INDISTINGUISHABLE
    });
    let samples: usize = ground.run_samples();
    let parameters = rival.own_parameters(ground);
    Candidate {
        effect: rival.refit.form.effect,
        label: rival.label(),
        probability,
        evidence: rival.evidence,
        rmse_m: rival
            .fit
            .as_ref()
            .map_or_else(|| ground.noise_m() * (rival.square / samples.max(1) as f64).sqrt(), |f| f.pooled().0),
        parameters,
        indistinguishable_from: near.map(|(_, other)| other.refit.form.effect).collect(),
        fit: rival.fit.clone(),
    }
}

/// What disturbs the sensors while nothing happens, rms over all samples, m.
fn total_noise_m(runs: &[RunData]) -> f64 {
    let sensors = runs.iter().flat_map(|r| &r.sensors);
    let (sum, n) = sensors.fold((0.0, 0.0), |(sum, n), s| {
        let samples = s.time_s.len() as f64;
        (sum + samples * s.total_noise_m.powi(2), n + samples)
    });
    (sum / f64::max(n, 1.0)).sqrt()
}

fn unexplained(start: &Fit, noise_m: f64) -> Verdict {
    let (rmse_m, _) = start.pooled();
    if rmse_m <= NOISE * noise_m { Verdict::NothingMissing } else { Verdict::UnknownEffect }
}

fn verdict(start: &Fit, noise_m: f64, candidates: &[Candidate], certain: bool) -> Verdict {
    let (rmse_m, _) = start.pooled();
    let Some(best) = candidates.first().filter(|c| c.evidence >= LEAST_EVIDENCE) else {
        return unexplained(start, noise_m);
    };
    let excess = |rmse: f64| (rmse.powi(2) - noise_m.powi(2)).max(0.0);
    let left = excess(best.rmse_m) / excess(rmse_m).max(f64::MIN_POSITIVE);
    if !certain && left > LEFT_SHARE && best.rmse_m > LEFT_OVER_NOISE * noise_m {
        Verdict::UnknownEffect
    } else {
        Verdict::MissingEffect
    }
}
