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

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::fit::calibrate::{FitError, Options, calibrate, refine};
use crate::fit::data::RunData;
use crate::fit::outcome::{Fit, FittedParameter};
use crate::model::effects::Chosen;
use crate::rig::Rig;
use evidence::{Worth, probabilities, tempered};
use ground::Ground;
use refit::{Refit, refit};

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
/// Most candidates that are fitted to all samples on the fine grid.
const FINISHED: usize = 2;
/// Finest grid of a fit with cavities: the spikes of their collapse belong to the grid (Bergant, Simpson & Tijsseling 2006).
const MOST_REACHES_WITH_CAVITIES: usize = 128;

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
    /// What would tell the best apart, where these data cannot.
    pub next_test: Option<String>,
}

/// RMSE and noise over all runs, m: each weighs as its number of samples.
pub fn pooled(fit: &Fit) -> (f64, f64) {
    let weight = |r: &crate::fit::outcome::RunFit| r.sensors.iter().map(|s| s.time_s.len()).sum::<usize>() as f64;
    let total: f64 = fit.runs.iter().map(weight).sum();
    let mean = |f: &dyn Fn(&crate::fit::outcome::RunFit) -> f64| {
        (fit.runs.iter().map(|r| weight(r) * f(r).powi(2)).sum::<f64>() / total.max(1.0)).sqrt()
    };
    (mean(&|r| r.rmse_m), mean(&|r| r.noise_m))
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
    let ground = Ground::new(rig, runs, &start)?;
    let forms: Vec<_> = candidate::candidates(rig, &ground.effects).into_iter().flatten().collect();
    let done = AtomicUsize::new(0);
    let refits: Vec<Refit> = forms
        .par_iter()
        .filter_map(|form| {
            let refit = refit(&ground, form).ok();
            let n = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(&format!("{n} of {} candidates refitted", forms.len()));
            refit
        })
        .collect();
    let Some(closest) = refits.iter().min_by(|a, b| a.square.total_cmp(&b.square)) else {
        let failings = misfit::failings(&start);
        return Ok(Diagnosis {
            verdict: unexplained(&start),
            start,
            failings,
            candidates: Vec::new(),
            next_test: None,
        });
    };
    let worth = Worth::of(&closest.residuals[..ground.samples]);
    let mut ranked = best_forms(&refits, |r| worth.evidence(ground.square, r));
    let odds = |r: &Refit| r.form.chosen.effect.odds(rig);
    ranked.sort_by(|a, b| (tempered(b.0) + odds(b.1).ln()).total_cmp(&(tempered(a.0) + odds(a.1).ln())));
    let shares = probabilities(&ranked.iter().map(|(evidence, r)| (*evidence, odds(r))).collect::<Vec<_>>());
    let fits: Vec<Option<Fit>> = ranked
        .par_iter()
        .enumerate()
        .map(|(i, (evidence, r))| {
            let worthy = i == 0 || (*evidence > LEAST_EVIDENCE && i < FINISHED);
            worthy.then(|| finished(rig, runs, r, options, progress).ok()).flatten()
        })
        .collect();
    let mut candidates: Vec<Candidate> = Vec::new();
    for (i, (((evidence, r), probability), fit)) in ranked.iter().zip(&shares).zip(fits).enumerate() {
        let alike = ranked.iter().enumerate().filter(|(j, _)| *j != i);
        let near = alike.filter(|(_, other)| {
            (tempered(other.0) - tempered(*evidence)).abs() < INDISTINGUISHABLE && other.0 > LEAST_EVIDENCE
        });
        candidates.push(Candidate {
            effect: r.form.effect,
            label: r.form.chosen.label(),
            probability: *probability,
            evidence: *evidence,
            rmse_m: fit.as_ref().map_or_else(|| forecast_rmse_m(&ground, &start, r), |f| pooled(f).0),
            parameters: own_parameters(&ground, r, fit.as_ref()),
            indistinguishable_from: near.map(|(_, (_, other))| other.form.effect).collect(),
            fit,
        });
    }
    let verdict = verdict(&start, &candidates);
    let rival =
        candidates.first().filter(|_| verdict == Verdict::MissingEffect).and_then(|c| c.indistinguishable_from.first());
    let next_test = rival.and_then(|name| {
        let other = ranked.iter().find(|(_, r)| r.form.effect == *name)?;
        next_test::next_test(&ground, ranked[0].1, other.1)
    });
    Ok(Diagnosis { verdict, failings: misfit::failings(&start), start, candidates, next_test })
}

/// The best form of each effect, with its evidence.
fn best_forms(refits: &[Refit], evidence: impl Fn(&Refit) -> f64) -> Vec<(f64, &Refit)> {
    let mut best: Vec<(f64, &Refit)> = Vec::new();
    for refit in refits {
        let own = evidence(refit);
        match best.iter_mut().find(|(_, b)| b.form.effect == refit.form.effect) {
            Some(known) if own > known.0 => *known = (own, refit),
            Some(_) => {}
            None => best.push((own, refit)),
        }
    }
    best
}

/// A candidate fitted to all samples on the fine grid.
fn finished(
    rig: &Rig,
    runs: &[RunData],
    refit: &Refit,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Fit, FitError> {
    let boils = refit.effects.iter().any(|c| c.effect.lets_boil());
    let most_reaches = if boils { options.most_reaches.min(MOST_REACHES_WITH_CAVITIES) } else { options.most_reaches };
    let options = Options { most_reaches, ..*options };
    let shown = |p: &crate::fit::calibrate::Progress| progress(&format!("{} added, {}", refit.form.effect, p.stage));
    refine(rig, runs, &refit.effects, &refit.values, &options, &shown)
}

/// The start model's error less what the refit takes away, m.
fn forecast_rmse_m(ground: &Ground, start: &Fit, refit: &Refit) -> f64 {
    let mean = |r: &[f64]| r[..ground.samples].iter().map(|x| x * x).sum::<f64>() / ground.samples.max(1) as f64;
    let (rmse_m, _) = pooled(start);
    rmse_m * (mean(&refit.residuals) / mean(&ground.residuals).max(f64::MIN_POSITIVE)).sqrt()
}

fn own_parameters(ground: &Ground, refit: &Refit, fit: Option<&Fit>) -> Vec<FittedParameter> {
    let model = ground.model(&refit.effects);
    match fit {
        Some(fit) => fit.parameters[ground.shared..model.shared.len()].to_vec(),
        None => model.shared[ground.shared..]
            .iter()
            .zip(&refit.values[ground.shared..])
            .map(|(p, &value)| FittedParameter {
                name: p.name.clone(),
                about: p.about,
                run: None,
                value,
                standard_error: f64::NAN,
                unit: p.unit,
                at_bound: value <= p.lower || value >= p.upper,
            })
            .collect(),
    }
}

fn unexplained(start: &Fit) -> Verdict {
    let (rmse_m, noise_m) = pooled(start);
    if rmse_m <= NOISE * noise_m { Verdict::NothingMissing } else { Verdict::UnknownEffect }
}

fn verdict(start: &Fit, candidates: &[Candidate]) -> Verdict {
    let Some(best) = candidates.first().filter(|c| c.evidence >= LEAST_EVIDENCE) else {
        return unexplained(start);
    };
    let (rmse_m, noise_m) = pooled(start);
    let excess = |rmse: f64| (rmse.powi(2) - noise_m.powi(2)).max(0.0);
    let left = excess(best.rmse_m) / excess(rmse_m).max(f64::MIN_POSITIVE);
    if left > LEFT_SHARE && best.rmse_m > LEFT_OVER_NOISE * noise_m {
        Verdict::UnknownEffect
    } else {
        Verdict::MissingEffect
    }
}
