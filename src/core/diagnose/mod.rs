//! Diagnosis: where a model fails, and which effect of the catalogue is missing from it.
//!
//! 1. The start model is fitted ([`start`]).
//! 2. [`search`] meets models with one further effect, or two, the most promising first, and fits them with one
//!    [`fitter`].
//! 3. [`mod@weigh`] turns what each of them leaves into [`evidence`] and probabilities, and [`verdict`] into the
//!    answer. Effects that the data cannot tell apart are named together, with the test that would tell them apart
//!    ([`next`]).
//!
//! [`limits`] holds every threshold.

pub mod baseline;
pub mod candidate;
pub(crate) mod circumstances;
pub(crate) mod conclusion;
pub mod evidence;
pub(crate) mod fitter;
pub mod growing;
#[cfg(test)]
mod invariants;
pub mod limits;
pub(crate) mod measures;
pub(crate) mod met;
pub(crate) mod models;
pub(crate) mod neighbours;
pub mod next;
pub(crate) mod outcome;
pub mod refit;
pub mod residual_patterns;
pub mod rest;
pub(crate) mod rivals;
pub(crate) mod screening;
pub(crate) mod search;
pub(crate) mod start;
pub mod verdict;
pub mod visible;
pub mod warnings;
pub(crate) mod weigh;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::forms_of;
use crate::diagnose::fitter::Fitter;
use crate::diagnose::growing::Growing;
pub use crate::diagnose::limits::NEGLIGIBLE_EVIDENCE;
use crate::diagnose::measures::{evidence_scale, square};
pub use crate::diagnose::outcome::{Candidate, Diagnosis, Pair, RivalPair, Verdict};
use crate::diagnose::refit::{refine, screen};
use crate::diagnose::start::Start;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::calibrate;
use crate::fit::search::nested::or_from_signals;
use crate::fit::search::options::Options;
use crate::model::check_places;
use crate::model::effects::Chosen;
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
    progress: &OnProgress<'_>,
) -> Result<Diagnosis, FitError> {
    progress(&Progress::from("the start model"));
    let start = Start::fitted(rig, runs, effects, options, progress)?;
    Growing::of(start, effects, options).diagnosed(rig, runs, progress)
}

/// The same from a start model that is fitted already, with `options`; `effects` are its effects, which may leave a
/// number of elements open.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_fit(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    start: Fit,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Diagnosis, FitError> {
    Growing::of(Start::of(start), effects, options).diagnosed(rig, runs, progress)
}

/// Adds one effect to a fitted start model and fits the result to all samples. Returns the fit and the evidence for the
/// effect.
///
/// # Errors
/// As [`calibrate`]; also if no start of the effect can be simulated.
pub fn grow(
    rig: &Rig,
    runs: &[RunData],
    start: &Fit,
    added: &Chosen,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<(Fit, f64), FitError> {
    check_places(rig, std::slice::from_ref(added))?;
    let baseline = Baseline::new(rig, runs, start, options)?;
    let shown = |p: &Progress| progress(&p.within(&added.label()));
    let mut fits = Vec::new();
    if added.effect.elements().is_some() {
        // The calibration adds elements one by one.
        let effects: Vec<Chosen> = baseline.effects.iter().cloned().chain([added.clone()]).collect();
        fits.push(calibrate(rig, runs, &effects, options, &shown));
    } else {
        let fitter = Fitter { rig, runs, asked: &baseline.effects, options, progress };
        for form in forms_of(rig, added) {
            let refit = screen(&baseline, &form).and_then(|screened| refine(&baseline, &screened));
            fits.push(refit.map_err(FitError::from).and_then(|refit| fitter.on_from(&refit.effects, &refit.values)));
        }
    }
    let (fits, failures): (Vec<_>, Vec<_>) = fits.into_iter().partition(Result::is_ok);
    let best = fits.into_iter().flatten().min_by(|a, b| square(a).total_cmp(&square(b)));
    let best = best.ok_or_else(|| failures.into_iter().find_map(Result::err).unwrap_or(FitError::NoRun))?;
    // where the smaller model ended without the effect may be far from where it ends with it
    let best = or_from_signals(best, rig, runs, options, progress)?;
    let parameters = best.parameters.len() - start.parameters.len();
    let evidence = evidence_scale(&best, baseline.features()).evidence(square(start), square(&best), parameters);
    Ok((best, evidence))
}
