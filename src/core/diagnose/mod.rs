//! Diagnosis: where a model fails, and which effect of the catalogue is missing from it.
//!
//! 1. The start model is fitted ([`start`]).
//! 2. [`search`] meets models with one further effect, or two, the most promising first, and fits them with the
//!    [`Fitter`] of every command.
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
use crate::diagnose::candidate::{Form, forms_of};
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
use crate::fit::search::calibrate::{Begin, Fitter};
use crate::fit::search::options::{Effort, Options};
use crate::model::check_places;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// Diagnoses `runs` of a rig, starting from a model with `effects`. `progress` receives a few words on each step.
///
/// # Errors
/// As [`calibrate`](crate::fit::search::calibrate::calibrate); a candidate that cannot be simulated is left out.
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
/// As [`calibrate`](crate::fit::search::calibrate::calibrate); also if no start of the effect can be simulated.
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
    let fitter = Fitter::new(rig, runs, options, &shown);
    let fit = if added.effect.elements().is_some() {
        // they are added one by one
        let effects: Vec<Chosen> = baseline.effects.iter().cloned().chain([added.clone()]).collect();
        fitter.fit(&effects, Begin::Signals, Effort::Whole)?
    } else {
        let forecast = |form: &Form| screen(&baseline, form).and_then(|screened| refine(&baseline, &screened));
        let (forecasts, failures): (Vec<_>, Vec<_>) =
            forms_of(rig, added).iter().map(forecast).partition(Result::is_ok);
        let best = forecasts.into_iter().flatten().min_by(|a, b| a.square.total_cmp(&b.square));
        let Some(best) = best else {
            return Err(failures.into_iter().find_map(Result::err).map_or(FitError::NoRun, FitError::from));
        };
        // where the smaller model ended without the effect may be far from where it ends with it
        fitter.or_from_signals(fitter.fit(&best.effects, Begin::At(&best.values), Effort::Whole)?)?
    };
    let parameters = fit.parameters.len() - start.parameters.len();
    let evidence = evidence_scale(&fit, baseline.features()).evidence(square(start), square(&fit), parameters);
    Ok((fit, evidence))
}
