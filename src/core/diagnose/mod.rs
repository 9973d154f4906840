//! Diagnosis: where a model fails, and which effect of the catalogue is missing from it.
//!
//! 1. The start model is fitted. A coarse problem around its fit makes refits cheap ([`baseline`]).
//! 2. Each other effect is added alone. [`refit`] screens every form of it and refines the most promising ones.
//! 3. The best candidates are fitted to all samples on the fine grid; if none explains the records, a fallback search tries
//!    further.
//! 4. [`evidence`] turns what each fit leaves into probabilities, and [`verdict`] into the answer. Effects that the data
//!    cannot tell apart are named together, with the test that would tell them apart.
//!
//! [`limits`] holds every threshold.

pub mod baseline;
pub mod candidate;
pub(crate) mod candidate_fit;
pub mod evidence;
pub(crate) mod fallback_search;
pub mod limits;
pub(crate) mod next_test;
pub(crate) mod outcome;
pub mod refit;
pub mod residual_patterns;
pub mod verdict;
pub mod visible;
pub mod warnings;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::{candidates, forms_of, left_out};
use crate::diagnose::candidate_fit::{CandidateFit, FullFitter, best_forms, evidence_scale, over_noise, square};
use crate::diagnose::evidence::{EvidenceScale, probabilities};
use crate::diagnose::fallback_search::fallback_search;
pub use crate::diagnose::limits::NEGLIGIBLE_EVIDENCE;
use crate::diagnose::limits::{
    CONVERGE_BELOW, EXPLAINED_OVER_NOISE, FULL_FITS, INDISTINGUISHABLE, LEAST_EVIDENCE, LEAST_FALL, NO_FULL_FIT_ABOVE,
    REFINED_EFFECTS, START_DOUBTFUL, START_NEAR_NOISE, START_USELESS,
};
use crate::diagnose::next_test::next_test;
pub use crate::diagnose::outcome::{Candidate, Diagnosis, Verdict};
use crate::diagnose::refit::{Refit, refine, screen};
use crate::diagnose::residual_patterns::residual_patterns;
use crate::diagnose::visible::visible;
use crate::diagnose::warnings::warnings;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::search::calibrate::calibrate;
use crate::fit::search::options::{Options, Progress};
use crate::fit::validate::conflict::faded_noise;
use crate::fit::validate::held_out::held_out_m;
use crate::model::check_sensors;
use crate::model::effects::{CERTAIN, Chosen};
use crate::rig::Rig;

/// Diagnoses `runs` of a rig, starting from a model with `effects`. `progress` receives a few words on each step.
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

/// The same from a start model that is fitted already, with `options`; `effects` are its effects, which may leave a number of
/// elements open.
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
    let baseline = Baseline::new(rig, runs, &start, options)?;
    let refits = refits(&baseline, progress);
    let fitter = FullFitter { rig, runs, effects, options, progress };
    let mut candidate_fits = candidate_fits(&baseline, &start, &refits);
    fit(&fitter, &baseline, &start, &mut candidate_fits);
    let scale = weigh(&baseline, &start, &mut candidate_fits);
    rank(&baseline, &mut candidate_fits);
    let shares =
        probabilities(&candidate_fits.iter().map(|r| (r.evidence, r.odds(&baseline.known))).collect::<Vec<_>>());
    let mut candidates: Vec<Candidate> =
        (0..candidate_fits.len()).map(|i| candidate(&baseline, &start, &candidate_fits, i, shares[i])).collect();
    let certain = is_certain(&baseline, &candidate_fits);
    let (verdict, other) = verdict::verdict(over_noise(&start, runs), &candidates, certain);
    // The effects of the catalogue share the rest of the probability.
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
        warnings: warnings(rig, runs, &start, effects, options),
        residual_patterns: residual_patterns(&start),
        candidates,
        left_out: left_out(rig, &baseline.effects),
        held_out_m: None,
        visible: Vec::new(),
        next_test: None,
        start,
    };
    match verdict {
        Verdict::MissingEffect => explain(&fitter, &baseline, &candidate_fits, &mut diagnosis),
        Verdict::NothingMissing => {
            let forms: Vec<_> = candidate_fits.iter().map(|r| r.refit.form.clone()).collect();
            diagnosis.visible = visible(&baseline, &forms, scale);
        }
        Verdict::UnknownEffect => {}
    }
    Ok(diagnosis)
}

/// The best form of each effect with the square that its refit forecasts, the most promising first.
fn candidate_fits<'a>(baseline: &Baseline, start: &Fit, refits: &'a [Refit]) -> Vec<CandidateFit<'a>> {
    let Some(closest) = refits.iter().min_by(|a, b| a.square.total_cmp(&b.square)) else { return Vec::new() };
    let coarse = EvidenceScale::of(&closest.residuals[..baseline.samples], baseline.features());
    let mut candidate_fits: Vec<CandidateFit> =
        best_forms(refits, |r| coarse.evidence(baseline.square, r.square, r.added))
            .into_iter()
            .map(|(evidence, refit)| CandidateFit::forecast(baseline, start, refit, evidence))
            .collect();
    rank(baseline, &mut candidate_fits);
    candidate_fits
}

/// The most probable first.
fn rank(baseline: &Baseline, candidate_fits: &mut [CandidateFit]) {
    candidate_fits.sort_by(|a, b| b.log_odds(&baseline.known).total_cmp(&a.log_odds(&baseline.known)));
}

/// Fits the best candidates to all samples, and tries further if none of them explains the records.
fn fit(fitter: &FullFitter, baseline: &Baseline, start: &Fit, candidate_fits: &mut [CandidateFit]) {
    let Some(best) = candidate_fits.first().map(|r| r.square) else { return };
    let tried = candidate_fits.len().min(FULL_FITS);
    candidate_fits[..tried].par_iter_mut().enumerate().for_each(|(i, candidate_fit)| {
        let first = i == 0 && candidate_fit.evidence > NEGLIGIBLE_EVIDENCE;
        if first || (candidate_fit.evidence > LEAST_EVIDENCE && candidate_fit.square < NO_FULL_FIT_ABOVE * best) {
            candidate_fit.take(fitter.fit_from_refit(candidate_fit.refit));
        }
    });
    let start_error = over_noise(start, fitter.runs);
    if is_certain(baseline, candidate_fits) {
        if candidate_fits[0].fit.as_ref().is_none_or(|f| over_noise(f, fitter.runs) > EXPLAINED_OVER_NOISE) {
            let fit = fitter.fit_from_scratch(candidate_fits[0].refit);
            candidate_fits[0].take(fit);
        }
    } else if start_error > START_DOUBTFUL {
        let most = if start_error > START_USELESS { usize::MAX } else { REFINED_EFFECTS };
        fallback_search(fitter, candidate_fits, square(start), EXPLAINED_OVER_NOISE, most);
    }
    let near = CONVERGE_BELOW * candidate_fits.iter().map(|r| r.square).fold(f64::INFINITY, f64::min);
    candidate_fits.par_iter_mut().filter(|r| r.fit.as_ref().is_some_and(|f| !f.converged) && r.square < near).for_each(
        |candidate_fit| {
            let converged = fitter.converged(candidate_fit);
            candidate_fit.take(converged);
        },
    );
}

/// Sets the evidence of each candidate, on the scale of the best fit. Candidates that are not worth a model get
/// [`NEGLIGIBLE_EVIDENCE`] at most, however sure the data are of them.
fn weigh(baseline: &Baseline, start: &Fit, candidate_fits: &mut [CandidateFit]) -> EvidenceScale {
    let fine = candidate_fits.iter().filter_map(|r| r.fit.as_ref()).min_by(|a, b| square(a).total_cmp(&square(b)));
    let scale = evidence_scale(fine.unwrap_or(start), baseline.features());
    let before = over_noise(start, &baseline.runs);
    for candidate_fit in candidate_fits {
        candidate_fit.evidence =
            scale.evidence(square(start), candidate_fit.square, candidate_fit.added(baseline, start));
        let fall = before.powi(2) * (1.0 - candidate_fit.square / square(start));
        if fall < LEAST_FALL.powi(2) || !candidate_fit.is_noteworthy(baseline) {
            candidate_fit.evidence = candidate_fit.evidence.min(NEGLIGIBLE_EVIDENCE);
        }
    }
    scale
}

/// Whether the most probable candidate is at work for certain: a record on the floor of vapour pressure has cavities, even
/// if no model follows their collapse well.
fn is_certain(baseline: &Baseline, candidate_fits: &[CandidateFit]) -> bool {
    candidate_fits.first().is_some_and(|r| r.odds(&baseline.known) >= CERTAIN)
}

/// Adds to the diagnosis of a missing effect: how well the effect predicts the end of the records, and the test that would
/// tell it from the candidate that the data cannot tell it from.
fn explain(fitter: &FullFitter, baseline: &Baseline, candidate_fits: &[CandidateFit], diagnosis: &mut Diagnosis) {
    (fitter.progress)("predicting the end of the records from their beginning");
    let predicted = |fit: Option<&Fit>| {
        fit.and_then(|fit| held_out_m(fitter.rig, fitter.runs, fit, fitter.options).ok()).filter(|m| m.is_finite())
    };
    let best = diagnosis.candidates.first().and_then(|c| c.fit.as_ref());
    let (start, with) = rayon::join(|| predicted(Some(&diagnosis.start)), || predicted(best));
    diagnosis.held_out_m = start;
    let Some(first) = diagnosis.candidates.first_mut() else { return };
    first.held_out_m = with;
    let effect = first.effect;
    if let Some(fit) = first.fit.as_ref().filter(|_| faded_noise(&diagnosis.start).is_empty()) {
        diagnosis.warnings.extend(faded_noise(fit));
    }
    if diagnosis.predicts_worse() {
        diagnosis.warnings.push(format!(
            "fitted to the beginning of the records, the model with {effect} predicts the rest worse than the start model: it \
             describes these records, but not what happens in the pipe"
        ));
    }
    let Some(first) = diagnosis.candidates.first() else { return };
    diagnosis.next_test = first.indistinguishable_from.first().and_then(|name| {
        let other = candidate_fits.iter().find(|r| r.refit.form.effect == *name)?;
        next_test(baseline, &candidate_fits[0], other)
    });
}

/// Adds one effect to a fitted start model and fits the result to all samples. Returns the fit and the evidence for the effect.
///
/// # Errors
/// As [`calibrate`]; also if no start of the effect can be simulated.
pub fn grow(
    rig: &Rig,
    runs: &[RunData],
    start: &Fit,
    added: &Chosen,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<(Fit, f64), FitError> {
    check_sensors(rig, std::slice::from_ref(added))?;
    let baseline = Baseline::new(rig, runs, start, options)?;
    let shown = |p: &Progress| progress(&format!("{}, {}", added.label(), p.stage));
    let mut fits = Vec::new();
    if added.effect.elements().is_some() {
        // The calibration adds elements one by one.
        let effects: Vec<Chosen> = baseline.effects.iter().cloned().chain([added.clone()]).collect();
        fits.push(calibrate(rig, runs, &effects, options, &shown));
    } else {
        let fitter = FullFitter { rig, runs, effects: &baseline.effects, options, progress };
        for form in forms_of(rig, added) {
            let refit = screen(&baseline, &form).and_then(|screened| refine(&baseline, &screened));
            fits.push(refit.map_err(FitError::from).and_then(|refit| fitter.fit_from_refit(&refit)));
        }
    }
    let (fits, failures): (Vec<_>, Vec<_>) = fits.into_iter().partition(Result::is_ok);
    let best = fits.into_iter().flatten().min_by(|a, b| square(a).total_cmp(&square(b)));
    let best = best.ok_or_else(|| failures.into_iter().find_map(Result::err).unwrap_or(FitError::NoRun))?;
    let parameters = best.parameters.len() - start.parameters.len();
    let evidence = evidence_scale(&best, baseline.features()).evidence(square(start), square(&best), parameters);
    Ok((best, evidence))
}

/// Screens every form and refines those of the most promising effects.
fn refits(baseline: &Baseline, progress: &(dyn Fn(&str) + Sync)) -> Vec<Refit> {
    let forms: Vec<_> = candidates(baseline.rig, &baseline.effects, baseline.runs.len());
    let done = AtomicUsize::new(0);
    let screened: Vec<Refit> = forms
        .par_iter()
        .filter_map(|form| {
            let refit = screen(baseline, form).ok();
            let n = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(&format!("{n} of {} candidates screened", forms.len()));
            refit
        })
        .collect();
    let mut order = best_forms(&screened, |r| -r.square);
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let promising: Vec<&str> = order.iter().take(REFINED_EFFECTS).map(|(_, r)| r.form.effect).collect();
    // Near the noise the linear forecast is accurate: an effect that screening does not promise will not appear.
    let quiet = baseline.mean_square(&baseline.residuals) < START_NEAR_NOISE.powi(2);
    let scale = EvidenceScale::of(&baseline.residuals[..baseline.samples], baseline.features());
    let hopeful = |r: &Refit| scale.evidence(baseline.square, r.square, r.added) > NEGLIGIBLE_EVIDENCE;
    screened
        .par_iter()
        .map(|screened| {
            // Boiling sets in beyond a threshold that no linear forecast sees.
            let promising = promising.contains(&screened.form.effect) || screened.form.chosen.effect.lets_boil();
            if !promising || (quiet && !hopeful(screened)) {
                return screened.clone();
            }
            progress(&format!("{} refitted", screened.form.chosen.label()));
            refine(baseline, screened).ok().unwrap_or_else(|| screened.clone())
        })
        .collect()
}

fn candidate(
    baseline: &Baseline,
    start: &Fit,
    candidate_fits: &[CandidateFit],
    i: usize,
    probability: f64,
) -> Candidate {
    let candidate_fit = &candidate_fits[i];
    let near = candidate_fits.iter().enumerate().filter(|(j, other)| {
        *j != i
            && other.evidence > LEAST_EVIDENCE
            && (other.log_odds(&baseline.known) - candidate_fit.log_odds(&baseline.known)).abs() < INDISTINGUISHABLE
    });
    let parameters = candidate_fit.own_parameters(baseline);
    Candidate {
        effect: candidate_fit.refit.form.effect,
        label: candidate_fit.label(),
        probability,
        evidence: candidate_fit.evidence,
        rmse_m: candidate_fit
            .fit
            .as_ref()
            .map_or_else(|| start.pooled().0 * candidate_fit.left_of(start), |f| f.pooled().0),
        over_noise: candidate_fit.fit.as_ref().map_or_else(
            || over_noise(start, &baseline.runs) * candidate_fit.left_of(start),
            |f| over_noise(f, &baseline.runs),
        ),
        within_class: !candidate_fit.is_noteworthy(baseline),
        parameters,
        held_out_m: None,
        indistinguishable_from: near.map(|(_, other)| other.refit.form.effect).collect(),
        fit: candidate_fit.fit.clone(),
    }
}
