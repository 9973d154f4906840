//! What the records say of every model that the search has met: its evidence over the start model, and its share of the
//! probability.

use crate::diagnose::candidate::base_name;
use crate::diagnose::evidence::{EvidenceScale, probabilities, tempered};
use crate::diagnose::limits::{NEGLIGIBLE_EVIDENCE, ODDS_AT_BOUND, PRIOR_ODDS_OF_NOTHING};
use crate::diagnose::measures::{evidence_scale, fall, square};
use crate::diagnose::met::{Met, has_all};
use crate::diagnose::models::Search;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::outcome::uncertainty::Uncertainty;
use crate::model::Model;
use crate::model::effects::{Chosen, SHOWN};
use crate::model::parameter::Parameter;

/// The models, weighed.
pub(crate) struct Weighed<'s> {
    pub(crate) scale: EvidenceScale,
    /// Each model, the most probable first.
    pub(crate) models: Vec<WeighedModel<'s>>,
}

impl<'s> Weighed<'s> {
    /// The most probable of the fitted models whose evidence is enough.
    pub(crate) fn claim(&self) -> Option<&WeighedModel<'s>> {
        self.models.iter().find(|m| m.met.fit.is_some() && tempered(m.evidence) >= STRONG_EVIDENCE)
    }
}

/// One of them.
pub(crate) struct WeighedModel<'s> {
    pub(crate) met: &'s Met,
    /// What it adds to the smaller model.
    pub(crate) added: Vec<Chosen>,
    /// The parameters of that.
    pub(crate) parameters: Vec<FittedParameter>,
    /// Free parameters of the whole model that the rig does not know beforehand.
    free: usize,
    /// It is stronger than what every rig has of it.
    pub(crate) is_noteworthy: bool,
    /// Evidence over the smaller model, natural logarithm of odds before tempering.
    pub(crate) evidence: f64,
    /// Odds before any fit.
    pub(crate) odds: f64,
    /// Odds, as a logarithm, that it may come to have at its optimum, if its values turn out to be noteworthy and
    /// within their bounds.
    pub(crate) promised_log_odds: f64,
    /// Its share of the probability.
    pub(crate) share: f64,
    /// It is the only reason why a record looks as it does, whatever is left of it.
    pub(crate) is_shown: bool,
    stands_for: Option<&'static str>,
}

impl WeighedModel<'_> {
    pub(crate) fn log_odds(&self) -> f64 {
        tempered(self.evidence) + self.odds.ln()
    }

    /// The name of what it adds, where that is one effect.
    pub(crate) fn effect(&self) -> Option<&'static str> {
        (self.added.len() == 1).then(|| base_name(self.added[0].effect.name()))
    }

    /// As on the command line.
    pub(crate) fn label(&self) -> String {
        self.added.iter().map(Chosen::label).collect::<Vec<_>>().join(" and ")
    }
}

/// Weighs all models that a search has met and that have the effects of a `state` and more, over the model of that
/// state.
pub(crate) fn weigh<'s>(search: &'s Search, state: &[&'static str]) -> Weighed<'s> {
    let (baseline, start) = (search.baseline, search.fit_of(state));
    let bigger = || search.met.iter().filter(|m| m.key.len() > state.len() && has_all(&m.key, state));
    let fits = bigger().filter_map(|m| m.fit.as_ref()).chain([start]);
    let closest = fits.min_by(|a, b| square(a).total_cmp(&square(b))).unwrap_or(start);
    let scale = evidence_scale(closest, baseline.features());
    let mut models: Vec<WeighedModel> = bigger().filter_map(|met| described(search, state, met)).collect();
    // Instruments within their class are at work on every rig: an effect is claimed only over the best model that they
    // allow.
    let within_class = models.iter().filter(|m| m.added.len() == 1 && !m.is_noteworthy && m.met.fit.is_some());
    let allowed = within_class.map(|m| m.met.square()).fold(square(start), f64::min);
    let of_start = free(&baseline.model(&start.effects));
    // A model has to be worth more than each smaller one: the least that these leave, and their greatest evidence.
    let mut smaller = (allowed, 0.0);
    for size in 1..=models.iter().map(|m| m.added.len()).max().unwrap_or(0) {
        let taken = if size == 1 { 0.0 } else { fall(start, square(start), smaller.0) };
        let least = search.least_fall_after(search.taken(start) + taken);
        let worth = |model: &WeighedModel, left: f64| {
            let evidence = scale.evidence(allowed, left, model.free.saturating_sub(of_start));
            let falls = fall(start, smaller.0, left) >= least;
            let evident = size == 1 || tempered(evidence - smaller.1) > STRONG_EVIDENCE;
            if falls && evident { evidence } else { evidence.min(NEGLIGIBLE_EVIDENCE) }
        };
        let mut best = smaller;
        for model in models.iter_mut().filter(|m| m.added.len() == size) {
            let promised = worth(model, model.met.promise());
            model.promised_log_odds = tempered(promised) + prior(search, model, promised).ln();
            model.evidence = worth(model, model.met.square());
            if !model.is_noteworthy {
                model.evidence = model.evidence.min(NEGLIGIBLE_EVIDENCE);
            }
            if model.met.fit.is_some() {
                best = (best.0.min(model.met.square()), best.1.max(model.evidence));
            }
        }
        smaller = best;
    }
    hand_over(&mut models);
    for model in &mut models {
        model.is_shown = is_shown(search, model);
        let at_bound = !model.is_shown && model.parameters.iter().any(|p| p.at_bound);
        model.odds = prior(search, model, model.evidence) * if at_bound { ODDS_AT_BOUND } else { 1.0 };
    }
    let shares = probabilities(&models.iter().map(|m| (m.evidence, m.odds)).collect::<Vec<_>>());
    models.iter_mut().zip(shares).for_each(|(model, share)| model.share = share);
    models.sort_by(|a, b| b.log_odds().total_cmp(&a.log_odds()));
    Weighed { scale, models }
}

/// Whether a record shows one of its effects by itself.
fn is_shown(search: &Search, model: &WeighedModel) -> bool {
    model.added.iter().any(|c| c.effect.odds(&search.baseline.known) >= SHOWN)
}

/// Odds of a model before any fit. Those in favour of an effect do not make up for a fit without evidence. If a record
/// shows the effect by itself, any improvement will do. Each effect after the first has the same against it as the
/// first has against nothing.
fn prior(search: &Search, model: &WeighedModel, evidence: f64) -> f64 {
    let odds: f64 = model.added.iter().map(|c| c.effect.odds(&search.baseline.known)).product();
    let least = if is_shown(search, model) { 0.0 } else { STRONG_EVIDENCE };
    let odds = if tempered(evidence) < least { odds.min(1.0) } else { odds };
    odds / PRIOR_ODDS_OF_NOTHING.powi(model.added.len().saturating_sub(1) as i32)
}

/// The evidence for an effect that stands in for another one is evidence for that one.
fn hand_over(models: &mut [WeighedModel]) {
    for i in 0..models.len() {
        let Some(name) = models[i].stands_for else { continue };
        let evidence = models[i].evidence;
        if let Some(other) = models.iter_mut().find(|m| m.effect() == Some(name)) {
            other.evidence = other.evidence.max(evidence);
            models[i].evidence = evidence.min(NEGLIGIBLE_EVIDENCE);
        }
    }
}

fn described<'s>(search: &Search, state: &[&'static str], met: &'s Met) -> Option<WeighedModel<'s>> {
    let (effects, values) = met.model()?;
    let mut which = search.added(effects);
    which.retain(|&i| !state.contains(&base_name(effects[i].effect.name())));
    let model = search.baseline.model(effects);
    let ranges = which.iter().map(|&i| model.parameters_of(i));
    let values_of = |i: usize| &values[model.parameters_of(i)];
    let parameters = match &met.fit {
        Some(fit) => ranges.flat_map(|r| fit.parameters[r].to_vec()).collect(),
        None => ranges.flatten().map(|j| unfitted(&model.shared[j], values[j])).collect(),
    };
    let single = (which.len() == 1).then(|| which[0]);
    Some(WeighedModel {
        met,
        free: free(&model),
        is_noteworthy: which.iter().all(|&i| effects[i].effect.noteworthy(values_of(i), &search.baseline.known)),
        stands_for: single.and_then(|i| effects[i].effect.stands_for(values_of(i))),
        added: which.into_iter().map(|i| effects[i].clone()).collect(),
        parameters,
        evidence: 0.0,
        odds: 1.0,
        promised_log_odds: f64::NEG_INFINITY,
        share: 0.0,
        is_shown: false,
    })
}

/// Free parameters that the rig does not know beforehand.
fn free(model: &Model) -> usize {
    model.shared.iter().filter(|p| p.prior.is_none()).count()
}

/// A parameter as a forecast has it.
fn unfitted(p: &Parameter, value: f64) -> FittedParameter {
    FittedParameter {
        name: p.name.clone(),
        about: p.about,
        value,
        uncertainty: Uncertainty::NotAtOptimum,
        interval_95: (f64::NEG_INFINITY, f64::INFINITY),
        unit: p.unit,
        at_bound: value <= p.lower || value >= p.upper,
        lower: p.lower,
        upper: p.upper,
        scale: p.scale,
        belief: p.prior,
        ..FittedParameter::default()
    }
}

/// Error over noise of a model: of its fit, or as forecast.
pub(crate) fn over_noise_of(met: &Met, search: &Search) -> f64 {
    let forecast = || search.start.over_noise() * left_of(met, search.start);
    met.fit.as_ref().map_or_else(forecast, Fit::over_noise)
}

/// Its error as a share of the start model's.
pub(crate) fn left_of(met: &Met, start: &Fit) -> f64 {
    (met.square() / square(start)).sqrt()
}
