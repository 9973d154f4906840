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

use crate::fit::calibrate::{FitError, Options, Progress, calibrate, refine};
use crate::fit::data::RunData;
use crate::fit::outcome::{Fit, FittedParameter};
use crate::model::effects::{Chosen, parse_list};
use crate::rig::Rig;
use evidence::{Worth, probabilities, tempered};
use ground::Ground;
use refit::{Refit, follow, glimpse};

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
/// Error over noise of the best candidate from which on candidates are fitted from scratch, and how many.
const POOR: f64 = 1.5;
const FROM_SCRATCH: usize = 4;
/// Error over noise of the start model up to which its parameters cannot be far astray.
const ASTRAY: f64 = 3.0;
/// Times the best candidate's square: what leaves more is not worth a full fit.
const HOPELESS: f64 = 4.0;
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
    let refits = refits(&ground, progress);
    let failings = misfit::failings(&start);
    let Some(closest) = refits.iter().min_by(|a, b| a.square.total_cmp(&b.square)) else {
        return Ok(Diagnosis {
            verdict: unexplained(&start, total_noise_m(runs)),
            start,
            failings,
            candidates: Vec::new(),
            next_test: None,
        });
    };
    let coarse = Worth::of(&closest.residuals[..ground.samples]);
    let mut rivals: Vec<Rival> = best_forms(&refits, |r| coarse.evidence(ground.square, r.square, r.added))
        .into_iter()
        .map(|(evidence, refit)| Rival { refit, evidence, square: forecast(&ground, &start, refit), fit: None })
        .collect();
    let by_odds = |a: &Rival, b: &Rival| b.log_odds(rig).total_cmp(&a.log_odds(rig));
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
    let tried = rivals.len().min(FROM_SCRATCH);
    for two in rivals[..tried].chunks_mut(2) {
        let least = two.iter().filter_map(|r| r.fit.as_ref()).map(|f| pooled(f).0).fold(f64::INFINITY, f64::min);
        // None is down to the noise. The start model's parameters may have gone too far astray to find a way back from.
        if least < POOR * noise_m || pooled(&start).0 < ASTRAY * noise_m {
            break;
        }
        two.par_iter_mut().for_each(|rival| rival.take(finisher.scratch_fit(rival.refit)));
        if two.iter().filter_map(|r| r.fit.as_ref()).any(|f| pooled(f).0 < POOR * noise_m) {
            break;
        }
    }
    let fine = rivals.iter().filter_map(|r| r.fit.as_ref()).min_by(|a, b| square(a).total_cmp(&square(b)));
    if let Some(best) = fine {
        let worth = worth(best);
        rivals.iter_mut().for_each(|r| r.evidence = worth.evidence(square(&start), r.square, r.refit.added));
    }
    // What is not worth a model is no explanation, however sure.
    let (rmse_m, samples) = (pooled(&start).0, ground.run_samples() as f64);
    for rival in &mut rivals {
        let fall_m2 = rmse_m.powi(2) - ground.noise_m().powi(2) * rival.square / samples;
        let values: Vec<f64> = own_parameters(&ground, rival).iter().map(|p| p.value).collect();
        if fall_m2 < (LEAST_FALL * noise_m).powi(2) || !rival.refit.form.chosen.effect.noteworthy(&values) {
            rival.evidence = rival.evidence.min(0.0);
        }
    }
    rivals.sort_by(by_odds);
    let shares = probabilities(&rivals.iter().map(|r| (r.evidence, r.odds(rig))).collect::<Vec<_>>());
    let candidates: Vec<Candidate> =
        (0..rivals.len()).map(|i| candidate(&ground, rig, &rivals, i, shares[i])).collect();
    let verdict = verdict(&start, noise_m, &candidates);
    let other =
        candidates.first().filter(|_| verdict == Verdict::MissingEffect).and_then(|c| c.indistinguishable_from.first());
    let next_test = other.and_then(|name| {
        let other = rivals.iter().find(|r| r.refit.form.effect == *name)?;
        next_test::next_test(&ground, rivals[0].refit, other.refit)
    });
    Ok(Diagnosis { verdict, failings, start, candidates, next_test })
}

/// A glimpse of every form; those of the most promising effects are followed.
fn refits(ground: &Ground, progress: &(dyn Fn(&str) + Sync)) -> Vec<Refit> {
    let forms: Vec<_> = candidate::candidates(ground.rig, &ground.effects).into_iter().flatten().collect();
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

/// An effect in its best form.
struct Rival<'a> {
    refit: &'a Refit,
    evidence: f64,
    /// Sum over all samples of the residual's square over the noise's, of the fit or as forecast.
    square: f64,
    fit: Option<Fit>,
}

impl Rival<'_> {
    fn odds(&self, rig: &Rig) -> f64 {
        self.refit.form.chosen.effect.odds(rig)
    }

    fn log_odds(&self, rig: &Rig) -> f64 {
        tempered(self.evidence) + self.odds(rig).ln()
    }

    /// Keeps a fit if it is better than the one known.
    fn take(&mut self, fit: Result<Fit, FitError>) {
        if let Ok(fit) = fit
            && self.fit.as_ref().is_none_or(|known| square(&fit) < square(known))
        {
            self.square = square(&fit);
            self.fit = Some(fit);
        }
    }
}

/// Sum over all samples of the residual's square over the noise's.
fn square(fit: &Fit) -> f64 {
    let sensors = fit.runs.iter().flat_map(|r| &r.sensors);
    sensors.map(|s| s.time_s.len() as f64 * (s.rmse_m / s.noise_m).powi(2)).sum()
}

/// What a fit's residuals say evidence is worth.
fn worth(fit: &Fit) -> Worth {
    let residuals: Vec<f64> = fit
        .runs
        .iter()
        .flat_map(|r| &r.sensors)
        .flat_map(|s| s.measured_m.iter().zip(&s.model_m).map(|(a, b)| (a - b) / s.noise_m))
        .collect();
    Worth::of(&residuals)
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

/// Fits candidates to all samples on the fine grid.
struct Finisher<'a> {
    rig: &'a Rig,
    runs: &'a [RunData],
    /// The start model's effects as they were asked for.
    effects: &'a [Chosen],
    options: &'a Options,
    progress: &'a (dyn Fn(&str) + Sync),
}

impl Finisher<'_> {
    /// From where the refit ended; with elements, which a fit had better add one by one, from scratch.
    fn finished(&self, refit: &Refit) -> Result<Fit, FitError> {
        if refit.form.chosen.elements.is_some() {
            return self.scratch_fit(refit);
        }
        let shown = |p: &Progress| (self.progress)(&format!("{} added, {}", refit.form.effect, p.stage));
        refine(self.rig, self.runs, &refit.effects, &refit.values, &self.options_of(refit), &shown)
    }

    /// From the signals, as if nothing had been fitted before.
    fn scratch_fit(&self, refit: &Refit) -> Result<Fit, FitError> {
        if refit.form.chosen.effect.lets_boil() {
            return Err(FitError::NoRun);
        }
        let effects: Vec<Chosen> =
            self.effects.iter().cloned().chain([Chosen { elements: None, ..refit.form.chosen.clone() }]).collect();
        let shown = |p: &Progress| (self.progress)(&format!("{} from scratch, {}", refit.form.effect, p.stage));
        calibrate(self.rig, self.runs, &effects, &self.options_of(refit), &shown)
    }

    fn options_of(&self, refit: &Refit) -> Options {
        let boils = refit.effects.iter().any(|c| c.effect.lets_boil());
        let most = if boils { MOST_REACHES_WITH_CAVITIES } else { usize::MAX };
        Options { most_reaches: self.options.most_reaches.min(most), ..*self.options }
    }
}

/// The square of a full fit, in all samples, by what the coarse refit leaves of the start model's.
fn forecast(ground: &Ground, start: &Fit, refit: &Refit) -> f64 {
    square(start) * ground.mean_square(&refit.residuals) / ground.mean_square(&ground.residuals)
}

fn candidate(ground: &Ground, rig: &Rig, rivals: &[Rival], i: usize, probability: f64) -> Candidate {
    let rival = &rivals[i];
    let near = rivals.iter().enumerate().filter(|(j, other)| {
        *j != i
            && other.evidence > LEAST_EVIDENCE
            && (other.log_odds(rig) - rival.log_odds(rig)).abs() < INDISTINGUISHABLE
    });
    let samples: usize = ground.run_samples();
    let parameters = own_parameters(ground, rival);
    Candidate {
        effect: rival.refit.form.effect,
        label: rival.refit.form.chosen.label(),
        probability,
        evidence: rival.evidence,
        rmse_m: rival
            .fit
            .as_ref()
            .map_or_else(|| ground.noise_m() * (rival.square / samples.max(1) as f64).sqrt(), |f| pooled(f).0),
        parameters,
        indistinguishable_from: near.map(|(_, other)| other.refit.form.effect).collect(),
        fit: rival.fit.clone(),
    }
}

/// The added effect's parameters.
fn own_parameters(ground: &Ground, rival: &Rival) -> Vec<FittedParameter> {
    let own = |effects: &[Chosen]| {
        let model = ground.model(effects);
        let size = model.effect_sizes().last().copied().unwrap_or(0);
        (model.shared.len() - size..model.shared.len(), model.shared)
    };
    if let Some(fit) = &rival.fit
        && let Ok(effects) = parse_list(&fit.effects.join(","))
    {
        return fit.parameters[own(&effects).0].to_vec();
    }
    let (range, shared) = own(&rival.refit.effects);
    shared[range.clone()]
        .iter()
        .zip(&rival.refit.values[range])
        .map(|(p, &value)| FittedParameter {
            name: p.name.clone(),
            about: p.about,
            run: None,
            value,
            standard_error: f64::NAN,
            unit: p.unit,
            at_bound: value <= p.lower || value >= p.upper,
        })
        .collect()
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
    let (rmse_m, _) = pooled(start);
    if rmse_m <= NOISE * noise_m { Verdict::NothingMissing } else { Verdict::UnknownEffect }
}

fn verdict(start: &Fit, noise_m: f64, candidates: &[Candidate]) -> Verdict {
    let (rmse_m, _) = pooled(start);
    let Some(best) = candidates.first().filter(|c| c.evidence >= LEAST_EVIDENCE) else {
        return unexplained(start, noise_m);
    };
    let excess = |rmse: f64| (rmse.powi(2) - noise_m.powi(2)).max(0.0);
    let left = excess(best.rmse_m) / excess(rmse_m).max(f64::MIN_POSITIVE);
    if left > LEFT_SHARE && best.rmse_m > LEFT_OVER_NOISE * noise_m {
        Verdict::UnknownEffect
    } else {
        Verdict::MissingEffect
    }
}
