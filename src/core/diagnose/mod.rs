//! Diagnosis: where a model fails, and which effect of the catalogue is missing from it.
//!
//! 1. The start model is fitted. A coarse problem around its fit makes refits cheap ([`baseline`]).
//! 2. Each other effect is added alone. [`refit`] screens every form of it and refines the most promising ones.
//! 3. The best candidates are fitted to all samples on the fine grid; if none comes near the records, pairs of effects are tried, those beside the
//!    best candidate among them, and if none explains them, a fallback search tries further, and then pairs again.
//! 4. [`evidence`] turns what each fit leaves into probabilities, and [`verdict`] into the answer. Effects that the data
//!    cannot tell apart are named together, with the test that would tell them apart ([`next`]).
//!
//! [`limits`] holds every threshold.

pub mod baseline;
pub mod candidate;
pub(crate) mod candidate_fit;
pub(crate) mod circumstances;
pub(crate) mod contest;
pub mod evidence;
pub mod exchange;
pub(crate) mod fallback_search;
pub mod limits;
pub(crate) mod more_elements;
pub mod needless;
pub mod next;
pub(crate) mod outcome;
pub(crate) mod pairs;
pub mod refit;
pub mod residual_patterns;
pub(crate) mod screening;
pub(crate) mod start;
pub mod verdict;
pub mod visible;
pub mod warnings;

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::{Form, forms_of, left_out};
use crate::diagnose::candidate_fit::{
    CandidateFit, FullFitter, best_forms, beyond, evidence_scale, fall, least_fall, over_noise, square,
};
use crate::diagnose::contest::contest;
use crate::diagnose::evidence::{EvidenceScale, probabilities};
use crate::diagnose::fallback_search::{begin_afresh, search_on};
pub use crate::diagnose::limits::NEGLIGIBLE_EVIDENCE;
use crate::diagnose::limits::{
    AS_FAST, EXPLAINED_OVER_NOISE, FULL_FITS, INDISTINGUISHABLE, LEAST_EVIDENCE, LEAST_FORECAST, NO_FULL_FIT_ABOVE,
    PRIOR_ODDS_OF_PAIR, RIG_FILE_IS_WRONG, START_DOUBTFUL, UNEXPLAINED_OVER_NOISE, WANTED_ODDS,
};
use crate::diagnose::more_elements::MoreElements;
use crate::diagnose::next::in_words;
pub use crate::diagnose::outcome::{Candidate, Diagnosis, Pair, RivalPair, Verdict};
use crate::diagnose::pairs::{PairFit, PairSearch};
use crate::diagnose::refit::{Refit, refine, screen};
use crate::diagnose::residual_patterns::{Pattern, residual_patterns};
use crate::diagnose::screening::refits;
use crate::diagnose::start::Start;
use crate::diagnose::visible::visible;
use crate::diagnose::warnings::warnings;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::calibrate;
use crate::fit::search::nested::or_from_signals;
use crate::fit::search::options::Options;
use crate::fit::validate::held_out::held_out_m;
use crate::model::effects::{Chosen, SHOWN};
use crate::model::{Model, check_places};
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
    diagnose_start(rig, runs, effects, start, None, options, progress)
}

/// The same from a start model that is fitted already, with `options`; `effects` are its effects, which may leave a number of
/// elements open. It may have `grown` out of a smaller one by effects that were found missing.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_fit(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    start: Fit,
    grown: Option<&Fit>,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Diagnosis, FitError> {
    diagnose_start(rig, runs, effects, Start::of(start), grown, options, progress)
}

fn diagnose_start(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    Start { fit: start, held }: Start,
    grown: Option<&Fit>,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Diagnosis, FitError> {
    let from = held.as_ref().unwrap_or(&start);
    let baseline = Baseline::new(rig, runs, from, options)?;
    let refits = refits(&baseline, progress);
    let taken = grown.map_or(0.0, |smaller| over_noise(smaller, runs).powi(2) - over_noise(&start, runs).powi(2));
    let fitter = FullFitter { rig, runs, effects, options, progress, least_fall: least_fall(runs, taken) };
    let mut candidate_fits = candidate_fits(&baseline, from, &refits);
    fit(&fitter, &baseline, from, &mut candidate_fits);
    let more = MoreElements::of(&fitter, &start);
    // what the model's own effect explains needs no further search
    let explained = more.as_ref().is_some_and(|more| over_noise(&more.fit, runs) < EXPLAINED_OVER_NOISE);
    let mut pairs = PairSearch::default();
    if !explained {
        let done = begin_afresh(&fitter, from, &mut candidate_fits);
        // Where single effects stay that far away, two that get down to the noise need no further search for one.
        let any_shown = candidate_fits.iter().any(|r| r.odds(&baseline) >= SHOWN);
        if is_far(&candidate_fits, runs) && !any_shown {
            pairs.go_on(&fitter, &baseline, &refits, best_fit(&candidate_fits), &leading(&candidate_fits));
        }
        if !pairs.explains(runs) {
            search_on(&fitter, &start, &mut candidate_fits, done);
        }
    }
    // A single effect that is far from the records is no rival of a pair, and where no pair is found it is soon enough to converge.
    let far = is_far(&candidate_fits, runs);
    if !far {
        contest(&fitter, &mut candidate_fits);
    }
    // by what the fits leave, not by what the coarse grid forecast
    weigh(&fitter, &baseline, &start, &mut candidate_fits, &[]);
    rank(&baseline, &mut candidate_fits);
    let shown = is_shown(&baseline, &candidate_fits) || is_shown_by_another(&baseline, &candidate_fits);
    // How cavities collapse no model follows well: what is left of them is no second effect.
    let mut pair_fits = if shown || explained {
        Vec::new()
    } else {
        pairs_of(&fitter, &baseline, &start, &refits, &mut candidate_fits, pairs)
    };
    if pair_fits.is_empty() && (far || best_fitted(&candidate_fits).is_some_and(|best| !best.is_settled(&fitter))) {
        contest(&fitter, &mut candidate_fits);
    }
    let others = pair_fits.iter().map(|pair| &pair.fit).chain(more.as_ref().map(|more| &more.fit));
    let scale = weigh(&fitter, &baseline, &start, &mut candidate_fits, &others.collect::<Vec<_>>());
    rank(&baseline, &mut candidate_fits);
    let leading = pair_fits.first_mut().map(|pair| &mut pair.fit);
    let single = candidate_fits.first_mut().filter(|r| r.evidence > LEAST_EVIDENCE).and_then(|r| r.fit.as_mut());
    if let Some(fit) = leading.or(single).filter(|fit| !fit.converged) {
        fitter.prune(fit);
    }
    let evidence_of = |pair: &PairFit| {
        // further elements of the start model's effects among them
        let added = pair.fit.parameters.len().saturating_sub(start.parameters.len());
        scale.evidence(square(&start), square(&pair.fit), added)
    };
    let singles = candidate_fits.iter().map(|r| (r.evidence, r.odds(&baseline)));
    let two = pair_fits.iter().map(|pair| (evidence_of(pair), PRIOR_ODDS_OF_PAIR));
    let elements = more.as_ref().map(|more| more.evidence(scale, &baseline, &start));
    let shares = probabilities(&singles.chain(two).chain(elements).collect::<Vec<_>>());
    let (single_shares, others) = shares.split_at(candidate_fits.len());
    let (pair_shares, element_shares) = others.split_at(pair_fits.len());
    let mut candidates: Vec<Candidate> =
        (0..candidate_fits.len()).map(|i| candidate(&baseline, &start, &candidate_fits, i, single_shares[i])).collect();
    let grown = more.iter().zip(elements).zip(element_shares);
    candidates.extend(grown.map(|((more, (evidence, _)), share)| more.candidate(&baseline, evidence, *share)));
    let mut pair = answer(&baseline, &pair_fits, pair_shares, &candidates, evidence_of);
    let mut rival_pairs = rivals_of(pair.as_ref(), &baseline, &pair_fits, pair_shares);
    // An effect is missing alone, or with another.
    for (both, share) in pair_fits.iter().zip(pair_shares) {
        let in_pair = |c: &&mut Candidate| both.of.iter().any(|form| form.effect == c.effect);
        candidates.iter_mut().filter(in_pair).for_each(|c| c.probability += share);
    }
    candidates.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let (mut verdict, mut other) = verdict::verdict(over_noise(&start, runs), &candidates, pair.as_ref(), shown);
    // No effect makes a wave faster. Where the record shows one that the pipe of the rig file cannot have, an answer that follows it all the same, or
    // that explains nothing, makes up for a wrong length, wall or material.
    let answered = pair.as_ref().map(|p| &p.fit).or(candidates.first().and_then(|c| c.fit.as_ref()));
    let astray = |fit: &Fit| over_noise(fit, runs) > UNEXPLAINED_OVER_NOISE || follows_too_fast(rig, runs, fit);
    let rig_file_is_wrong =
        verdict != Verdict::NothingMissing && shows_too_fast(rig, runs) && answered.is_none_or(astray);
    if rig_file_is_wrong {
        (verdict, other) = (Verdict::UnknownEffect, other.max(RIG_FILE_IS_WRONG));
        pair = None;
        rival_pairs.clear();
    }
    // The effects of the catalogue share the rest of the probability.
    let none = (1.0 - shares.iter().sum::<f64>()).max(0.0) * (1.0 - other);
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
        residual_patterns: residual_patterns(&start).iter().map(Pattern::sentence).collect(),
        candidates,
        pair,
        rival_pairs,
        left_out: left_out(rig, &baseline.effects),
        held_out_m: None,
        visible: Vec::new(),
        next_test: None,
        is_held: held.is_some(),
        start,
    };
    diagnosis.warnings = warnings(rig, runs, &diagnosis, effects);
    if rig_file_is_wrong {
        diagnosis.warnings.push(
            "the wave is faster than the rig file's pipe allows, whichever effect is added, and no effect makes a wave faster: correct the pipe's \
             length, wall or material in the rig file, or the rate of the samples"
                .into(),
        );
    }
    match verdict {
        Verdict::MissingEffect => explain(&fitter, &baseline, &candidate_fits, &mut diagnosis),
        Verdict::NothingMissing => {
            let forms: Vec<_> = candidate_fits.iter().map(|r| r.refit.form.clone()).collect();
            diagnosis.visible = visible(&baseline, &forms, scale, fitter.least_fall);
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
    candidate_fits.sort_by(|a, b| b.log_odds(baseline).total_cmp(&a.log_odds(baseline)));
}

/// Fits the best candidates to all samples.
fn fit(fitter: &FullFitter, baseline: &Baseline, start: &Fit, candidate_fits: &mut [CandidateFit]) {
    let Some(best) = candidate_fits.first().map(|r| r.square) else { return };
    let tried = candidate_fits.len().min(FULL_FITS);
    let worth = LEAST_FORECAST * fitter.least_fall;
    candidate_fits[..tried].par_iter_mut().enumerate().for_each(|(i, candidate_fit)| {
        let least = if i == 0 { NEGLIGIBLE_EVIDENCE } else { LEAST_EVIDENCE };
        let may_win = candidate_fit.evidence > least && candidate_fit.square < NO_FULL_FIT_ABOVE * best;
        if may_win && fall(start, fitter.runs, square(start), candidate_fit.square) > worth {
            candidate_fit.take(fitter.fit_from_refit(candidate_fit.refit));
        }
    });
    // What the record shows by itself is given its best fit, whatever a coarse grid says of it.
    let by_itself = |r: &&mut CandidateFit| r.refit.form.chosen.effect.odds(&baseline.known) >= SHOWN;
    if let Some(shown) = candidate_fits.iter_mut().find(by_itself)
        && shown.fit.as_ref().is_none_or(|f| over_noise(f, fitter.runs) > EXPLAINED_OVER_NOISE)
    {
        let fit = fitter.fit_from_scratch(shown.refit);
        shown.take(fit);
    }
}

/// Whether the best single effect leaves far more than noise.
fn is_far(candidate_fits: &[CandidateFit], runs: &[RunData]) -> bool {
    best_fit(candidate_fits).is_some_and(|(_, best)| beyond(best, runs) > START_DOUBTFUL.powi(2) - 1.0)
}

/// A form of each effect, that which leaves least alone first.
fn leading<'a>(candidate_fits: &[CandidateFit<'a>]) -> Vec<&'a Refit> {
    let mut leading: Vec<&CandidateFit> = candidate_fits.iter().collect();
    leading.sort_by(|a, b| a.square.total_cmp(&b.square));
    leading.into_iter().map(|r| r.refit).collect()
}

/// The candidate whose full fit leaves least.
fn best_fitted<'f, 'a>(candidate_fits: &'f [CandidateFit<'a>]) -> Option<&'f CandidateFit<'a>> {
    candidate_fits.iter().filter(|r| r.fit.is_some()).min_by(|a, b| a.square.total_cmp(&b.square))
}

/// Form and fit of that candidate.
fn best_fit<'a>(candidate_fits: &'a [CandidateFit]) -> Option<(&'a Form, &'a Fit)> {
    best_fitted(candidate_fits).and_then(|best| Some((&best.refit.form, best.fit.as_ref()?)))
}

/// The fit of that candidate, or the start model where no candidate leaves less.
fn best_or<'f>(start: &'f Fit, candidate_fits: &'f [CandidateFit]) -> &'f Fit {
    best_fit(candidate_fits).map(|(_, fit)| fit).filter(|fit| square(fit) < square(start)).unwrap_or(start)
}

/// Pairs of effects, where something is missing and no single effect explains the records.
fn pairs_of(
    fitter: &FullFitter,
    baseline: &Baseline,
    start: &Fit,
    refits: &[Refit],
    candidate_fits: &mut [CandidateFit],
    search: PairSearch,
) -> Vec<PairFit> {
    if beyond(best_or(start, candidate_fits), fitter.runs) < EXPLAINED_OVER_NOISE.powi(2) - 1.0 {
        return Vec::new();
    }
    let (single, leading) = (best_fit(candidate_fits), leading(candidate_fits));
    let mut pairs = search.fitted(fitter, baseline, refits, single, &leading, start);
    // Beside the other one an effect may have got where it explains the records alone.
    if let Some(best) = pairs.first() {
        let last = best.fit.effects.len() - 1;
        let (first, second) = rayon::join(|| fitter.without(&best.fit, last), || fitter.without(&best.fit, last - 1));
        for (form, alone) in best.of.iter().zip([first, second]) {
            if let Some(candidate) = candidate_fits.iter_mut().find(|r| r.refit.form.effect == form.effect) {
                candidate.take(alone);
                // In the pair it has as many elements as it was screened with.
                let explains = |fit: &Fit| over_noise(fit, fitter.runs) < EXPLAINED_OVER_NOISE;
                if candidate.refit.form.chosen.elements.is_some() && candidate.fit.as_ref().is_some_and(explains) {
                    candidate.take(fitter.fit_from_scratch(candidate.refit));
                }
            }
        }
    }
    let single = over_noise(best_or(start, candidate_fits), fitter.runs);
    let alone = over_noise(start, fitter.runs);
    pairs.retain(|pair| pair.is_worth(baseline, fitter.runs, alone, single));
    pairs
}

/// The most probable pair, where the evidence for the second effect is enough.
fn answer(
    baseline: &Baseline,
    pair_fits: &[PairFit],
    shares: &[f64],
    singles: &[Candidate],
    evidence_of: impl Fn(&PairFit) -> f64,
) -> Option<Pair> {
    let (best, share) = pair_fits.iter().zip(shares).max_by(|a, b| a.1.total_cmp(b.1))?;
    let evidence = evidence_of(best);
    let single = singles.iter().map(|c| c.evidence).fold(f64::NEG_INFINITY, f64::max);
    (evidence > single + LEAST_EVIDENCE).then(|| Pair {
        effects: best.of.each_ref().map(|form| form.effect),
        labels: best.of.each_ref().map(|form| form.chosen.label()),
        probability: *share,
        evidence,
        over_noise: over_noise(&best.fit, &baseline.runs),
        parameters: best.own_parameters(baseline),
        fit: best.fit.clone(),
    })
}

/// The other pairs whose share is not negligible beside the answer's.
fn rivals_of(answer: Option<&Pair>, baseline: &Baseline, pair_fits: &[PairFit], shares: &[f64]) -> Vec<RivalPair> {
    let Some(answer) = answer else { return Vec::new() };
    let of = |(pair, &probability): (&PairFit, &f64)| RivalPair {
        labels: pair.of.each_ref().map(|form| form.chosen.label()),
        probability,
        over_noise: over_noise(&pair.fit, &baseline.runs),
    };
    let least = answer.probability / WANTED_ODDS;
    let mut rivals: Vec<RivalPair> = pair_fits.iter().zip(shares).map(of).collect();
    rivals.retain(|pair| pair.labels != answer.labels && pair.probability > least);
    rivals.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    rivals
}

/// Sets the evidence of each candidate, on the scale of the best fit, `others` among them. Candidates that are not worth a model get
/// [`NEGLIGIBLE_EVIDENCE`] at most, however sure the data are of them.
fn weigh(
    fitter: &FullFitter,
    baseline: &Baseline,
    start: &Fit,
    candidate_fits: &mut [CandidateFit],
    others: &[&Fit],
) -> EvidenceScale {
    let fits = candidate_fits.iter().filter_map(|r| r.fit.as_ref()).chain(others.iter().copied());
    let fine = fits.min_by(|a, b| square(a).total_cmp(&square(b)));
    let scale = evidence_scale(fine.unwrap_or(start), baseline.features());
    // Instruments within their class are at work on every rig: an effect is claimed only over the best model that they allow.
    let within_class = candidate_fits.iter().filter(|r| !r.is_noteworthy(baseline)).map(|r| r.square);
    let allowed = within_class.fold(square(start), f64::min);
    for candidate_fit in candidate_fits.iter_mut() {
        candidate_fit.evidence = scale.evidence(allowed, candidate_fit.square, candidate_fit.added(baseline, start));
        let fall = fall(start, &baseline.runs, allowed, candidate_fit.square);
        if fall < fitter.least_fall || !candidate_fit.is_noteworthy(baseline) {
            candidate_fit.evidence = candidate_fit.evidence.min(NEGLIGIBLE_EVIDENCE);
        }
    }
    hand_over(baseline, candidate_fits);
    scale
}

/// The evidence for a candidate that stands in for another one is evidence for that one.
fn hand_over(baseline: &Baseline, candidate_fits: &mut [CandidateFit]) {
    for i in 0..candidate_fits.len() {
        let Some(name) = candidate_fits[i].stands_for(baseline) else { continue };
        let evidence = candidate_fits[i].evidence;
        if let Some(other) = candidate_fits.iter_mut().find(|r| r.refit.form.effect == name) {
            other.evidence = other.evidence.max(evidence);
            candidate_fits[i].evidence = evidence.min(NEGLIGIBLE_EVIDENCE);
        }
    }
}

/// Whether the candidate that leaves least stands in for one that the record shows by itself.
fn is_shown_by_another(baseline: &Baseline, candidate_fits: &[CandidateFit]) -> bool {
    let best = candidate_fits.iter().min_by(|a, b| a.square.total_cmp(&b.square));
    let Some(name) = best.and_then(|best| best.stands_for(baseline)) else { return false };
    let of_that_name = |r: &&CandidateFit| r.refit.form.effect == name;
    candidate_fits.iter().find(of_that_name).is_some_and(|r| r.refit.form.chosen.effect.odds(&baseline.known) >= SHOWN)
}

/// Whether the record shows the most probable candidate by itself: one that lies on the floor of vapour pressure has cavities, even if no model
/// follows their collapse well.
fn is_shown(baseline: &Baseline, candidate_fits: &[CandidateFit]) -> bool {
    candidate_fits.first().is_some_and(|r| r.odds(baseline) >= SHOWN)
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

/// Adds to the diagnosis of a missing effect: how well the effect predicts the end of the records, and the test that would
/// tell it from the candidate that the data cannot tell it from.
fn explain(fitter: &FullFitter, baseline: &Baseline, candidate_fits: &[CandidateFit], diagnosis: &mut Diagnosis) {
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
    diagnosis.next_test = first.indistinguishable_from.first().and_then(|name| {
        let other = candidate_fits.iter().find(|r| r.refit.form.effect == *name)?;
        in_words(baseline, [&candidate_fits[0], other].map(CandidateFit::answer))
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
        let least_fall = least_fall(runs, 0.0);
        let fitter = FullFitter { rig, runs, effects: &baseline.effects, options, progress, least_fall };
        for form in forms_of(rig, added) {
            let refit = screen(&baseline, &form).and_then(|screened| refine(&baseline, &screened));
            fits.push(refit.map_err(FitError::from).and_then(|refit| fitter.fit_from_refit(&refit)));
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
            && (other.log_odds(baseline) - candidate_fit.log_odds(baseline)).abs() < INDISTINGUISHABLE
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
