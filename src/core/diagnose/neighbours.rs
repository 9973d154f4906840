//! The neighbours of a state of the search: forecast on the coarse grid, or looked for from the signals, and fitted to
//! all samples.

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::{Form, base_name, reason_apart};
use crate::diagnose::evidence::{EvidenceScale, tempered};
use crate::diagnose::limits::{LEAST_FORECAST, NO_FULL_FIT_ABOVE};
use crate::diagnose::measures::{beyond, fall, square};
use crate::diagnose::met::{Forecast, Key, Met};
use crate::diagnose::models::Search;
use crate::diagnose::screening::{best_forms, refits, screened};
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::error::FitError;
use crate::fit::progress::Progress;
use crate::fit::search::calibrate::Begin;
use crate::fit::search::from_signals::{CoarseFit, fit_coarsely};
use crate::fit::search::options::Effort;
use crate::fit::search::thresholds::LEADING;
use crate::model::effects::{Chosen, SHOWN, labels_of};

impl Search<'_> {
    /// A brief fit from the signals; the fit chooses the elements of the effects that are `added`.
    fn anew(&self, added: &[Chosen]) -> Result<Fit, FitError> {
        let fit = |added: &[Chosen]| {
            let open = added.iter().map(|c| Chosen { elements: None, ..c.clone() });
            let asked = self.asked.iter().filter(|c| added.iter().all(|a| a.effect.name() != c.effect.name()));
            self.fitter.fit(&asked.cloned().chain(open).collect::<Vec<_>>(), Begin::Signals, Effort::Brief)
        };
        of_either(added, fit, |fit| fit.cost)
    }

    /// A coarse fit from the signals; the fit chooses the sensors of the effects that are `added`.
    fn coarse(&self, start: &[Chosen], added: &[Chosen]) -> Result<CoarseFit, FitError> {
        let fit = |added: &[Chosen]| {
            let open = added.iter().map(|c| Chosen { sensor: None, ..c.clone() });
            let effects: Vec<Chosen> = start.iter().cloned().chain(open).collect();
            (self.fitter.progress)(&Progress::from("from the signals").within(&labels_of(&effects)));
            fit_coarsely(self.fitter.rig, self.fitter.runs, &effects, self.fitter.options)
        };
        of_either(added, fit, |fit| fit.mean_square)
    }

    /// A fitted model with as many more elements of its effect `i` as the evidence supports; none where it supports no
    /// more.
    pub(crate) fn with_more_elements(&self, fit: &Fit, i: usize) -> Option<Fit> {
        let most = *fit.effects[i].effect.elements()?.end();
        let more = self.fitter.with_more_elements(fit, i, most, Effort::Converged).ok()?;
        (more.effects != fit.effects).then_some(more)
    }

    /// Forecasts what each effect would leave beside a fitted model, or in the place of its effect `gone`. Returns the
    /// models that may be better than what is known of them.
    pub(crate) fn expand(&mut self, fit: &Fit, gone: Option<usize>) -> Vec<usize> {
        let fitter = &self.fitter;
        let baseline = match gone {
            None => Baseline::new(fitter.rig, fitter.runs, fit, fitter.options),
            Some(i) => Baseline::without(fitter.rig, fitter.runs, fit, i, fitter.options),
        };
        let Ok(baseline) = baseline else { return Vec::new() };
        let found =
            if gone.is_none() { refits(&baseline, fitter.progress) } else { screened(&baseline, fitter.progress) };
        let Some(closest) = found.iter().min_by(|a, b| a.square.total_cmp(&b.square)) else { return Vec::new() };
        let scale = EvidenceScale::of(&closest.residuals[..baseline.samples], baseline.features());
        let best = best_forms(&found, |r| scale.evidence(baseline.square, r.square, r.added));
        // what the fit leaves is known of the fit itself: of the model as it is, or with the effect that is gone put
        // back
        let own = gone.map(|i| base_name(fit.effects[i].effect.name()));
        let reference = match own {
            None => Some(baseline.mean_square(&baseline.residuals)),
            Some(own) => {
                best.iter().find(|(_, r)| r.form.effect == own).map(|(_, r)| baseline.mean_square(&r.residuals))
            }
        };
        let Some(reference) = reference else { return Vec::new() };
        let of_fit = square(fit) / reference;
        let forecasts: Vec<Forecast> = best
            .into_iter()
            .filter(|(_, r)| gone.is_none_or(|i| r.form.chosen.label() != fit.effects[i].label()))
            .map(|(evidence, r)| Forecast {
                effects: r.effects.clone(),
                values: r.values.clone(),
                square: of_fit * baseline.mean_square(&r.residuals),
                evidence,
            })
            .collect();
        forecasts.into_iter().filter_map(|f| self.meet(f)).collect()
    }

    /// Keeps a forecast that promises more than what is known of its model, and returns where that stands.
    fn meet(&mut self, forecast: Forecast) -> Option<usize> {
        let place = self.place(&self.key(&forecast.effects));
        let met = &mut self.met[place];
        let known = met.forecast.iter().map(|f| f.square).chain(met.fit.iter().map(square));
        if known.fold(f64::INFINITY, f64::min) <= forecast.square {
            return None;
        }
        met.forecast = Some(forecast);
        Some(place)
    }

    /// Fits those of some models whose forecasts, of one origin, promise most: more than a model that leaves the square
    /// `known`.
    pub(crate) fn fit_leading(&mut self, which: &[usize], known: f64) {
        let mut order: Vec<(usize, &Forecast)> =
            which.iter().filter_map(|&i| Some((i, self.met[i].forecast.as_ref()?))).collect();
        order.sort_by(|a, b| a.1.square.total_cmp(&b.1.square));
        let most = NO_FULL_FIT_ABOVE * self.met.iter().map(Met::square).fold(f64::INFINITY, f64::min);
        let least = LEAST_FORECAST * self.least_fall;
        let best = order.first().map_or(0.0, |(_, f)| f.evidence);
        let may_win = |(_, f): &(usize, &Forecast)| {
            let evident = tempered(f.evidence) > STRONG_EVIDENCE || tempered(best - f.evidence) < STRONG_EVIDENCE;
            evident && f.square < most && fall(self.start, known, f.square) > least
        };
        let leading: Vec<usize> = order.into_iter().filter(may_win).take(LEADING).map(|(i, _)| i).collect();
        self.fit_forecasts(&leading);
    }

    /// Fits models from where their forecasts say.
    pub(crate) fn fit_forecasts(&mut self, which: &[usize]) {
        let this = &*self;
        let fits: Vec<(usize, Option<Fit>, bool)> = which
            .par_iter()
            .filter_map(|&i| {
                let forecast = this.met[i].forecast.as_ref()?;
                let added = this.added_effects(&forecast.effects);
                // elements are added one by one, from the signals, which is more reliable
                let grows = added.len() == 1 && added[0].elements.is_some();
                let fit = match grows {
                    true => this.anew(&added),
                    false => this.fitter.fit(&forecast.effects, Begin::At(&forecast.values), Effort::Brief),
                };
                Some((i, fit.ok(), grows))
            })
            .collect();
        for (i, fit, from_signals) in fits {
            self.met[i].is_from_signals |= from_signals;
            self.met[i].forecast = None;
            if let Some(fit) = fit {
                self.take(fit);
            }
        }
    }

    /// Fits the leading models of a size from the signals: what they leave may be the way that their fits came.
    pub(crate) fn leading_from_signals(&mut self, size: usize) {
        let mut order: Vec<usize> =
            (0..self.met.len()).filter(|&i| self.met[i].key.len() == size && self.met[i].fit.is_some()).collect();
        order.sort_by(|&a, &b| self.met[a].square().total_cmp(&self.met[b].square()));
        let most = NO_FULL_FIT_ABOVE * order.first().map_or(0.0, |&i| self.met[i].square());
        order.retain(|&i| self.met[i].square() < most && !self.met[i].is_from_signals);
        order.truncate(LEADING);
        let this = &*self;
        let fits: Vec<(usize, Option<Fit>)> = order
            .par_iter()
            .map(|&i| {
                let added = this.effects_of(&this.met[i].key).unwrap_or_default();
                (i, this.anew(&added).ok())
            })
            .collect();
        for (i, fit) in fits {
            self.met[i].is_from_signals = true;
            if let Some(fit) = fit {
                self.take(fit);
            }
        }
    }

    /// Fits a state with each further effect coarsely from the signals, and those that leave least to all samples.
    pub(crate) fn all_from_signals(&mut self, state: &Key) {
        let Some(of_state) = self.effects_of(state) else { return };
        let alone: Vec<Form> = self.forms_alone();
        let root = &self.from.effects;
        let mut coarse: Vec<Forecast> = alone
            .par_iter()
            .filter(|form| !state.contains(&form.effect))
            .filter(|form| of_state.iter().all(|c| reason_apart(c.effect, form.chosen.effect).is_none()))
            .filter_map(|form| {
                let added: Vec<Chosen> = of_state.iter().chain([&form.chosen]).cloned().collect();
                let fit = self.coarse(root, &added).ok()?;
                let square = fit.mean_square * self.start.samples() as f64;
                Some(Forecast { effects: fit.effects, values: fit.values, square, evidence: f64::INFINITY })
            })
            .collect();
        coarse.sort_by(|a, b| a.square.total_cmp(&b.square));
        let most = NO_FULL_FIT_ABOVE * coarse.first().map_or(0.0, |f| f.square);
        coarse.retain(|f| f.square <= most);
        coarse.truncate(LEADING);
        let which: Vec<usize> = coarse
            .into_iter()
            .map(|f| {
                let place = self.place(&self.key(&f.effects));
                self.met[place].forecast = Some(f);
                place
            })
            .collect();
        self.fit_forecasts(&which);
    }

    /// More elements of a start model's effect whose number is fixed: an effect that makes up for missing ones would be
    /// named in their place.
    pub(crate) fn more_elements(&mut self) {
        let fixed = self.asked.iter().position(|c| c.elements.is_some());
        if let Some(fit) = fixed.and_then(|i| self.with_more_elements(self.start, i)) {
            let place = self.place(&self.key(&fit.effects));
            self.met[place].is_from_signals = true;
            self.take(fit);
        }
    }

    /// What a record shows by itself is fitted, whatever a coarse grid says of it.
    pub(crate) fn shown_by_itself(&mut self) {
        let shown = self.met.iter().position(|m| {
            let effects = self.effects_of(&m.key).unwrap_or_default();
            m.key.len() == 1 && effects.iter().any(|c| c.effect.odds(&self.baseline.known) >= SHOWN)
        });
        let Some(i) = shown else { return };
        let enough = |fit: &Fit| beyond(fit, self.fitter.runs) < self.least_fall;
        if self.met[i].fit.as_ref().is_some_and(enough) {
            return;
        }
        let added = self.effects_of(&self.met[i].key).unwrap_or_default();
        if let Ok(fit) = self.anew(&added) {
            self.take(fit);
        }
        self.met[i].is_from_signals = true;
    }
}

/// The fit of a model with `added` effects or, where it leaves less, with those that they extend: with less to fit, it
/// may find the better optimum.
fn of_either<F: Send>(
    added: &[Chosen],
    fit: impl Fn(&[Chosen]) -> Result<F, FitError> + Sync,
    left: fn(&F) -> f64,
) -> Result<F, FitError> {
    let simpler = |c: &Chosen| Chosen { effect: c.effect.extends().unwrap_or(c.effect), ..c.clone() };
    let simpler: Vec<Chosen> = added.iter().map(simpler).collect();
    if simpler == added {
        return fit(added);
    }
    match rayon::join(|| fit(added), || fit(&simpler)) {
        (Ok(own), Ok(simpler)) => Ok(if left(&simpler) < left(&own) { simpler } else { own }),
        (own, simpler) => own.or(simpler),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::search::tests::{run, searched};
    use crate::fit::problem::test_record::{copper, record};
    use crate::fit::search::options::Options;
    use crate::model::effects::parse_list;

    /// Dry friction may lead a fit to where the valve sticks; without it the wall that moves is found.
    #[test]
    fn what_extends_an_effect_is_also_tried_as_that_effect() {
        let rig = copper();
        let truth = parse_list("fluid-structure").unwrap();
        let runs = [record(&rig, &truth, &[1200.0, 0.34, 3500.0, 0.05], run(0.3), 0.02, 1.0)];
        let options = Options { most_reaches: 64, ..Options::default() };
        searched(&rig, &runs, "none", &options, |search| {
            let dry = parse_list("fluid-structure/dry").unwrap();
            let fit = search.anew(&dry).unwrap();
            let alone = search.fitter.fit(&dry, Begin::Signals, Effort::Brief).unwrap();
            assert!(fit.over_noise() < 1.1 && alone.over_noise() > 1.5, "{} {}", fit.over_noise(), alone.over_noise());
            let left = |added: &[Chosen]| Ok(if added[0].effect.name() == "fluid-structure" { 1.0 } else { 2.0 });
            assert_eq!(of_either(&dry, left, |left| *left).unwrap(), 1.0);
            assert_eq!(of_either(&dry, |added| Ok(-left(added)?), |left| *left).unwrap(), -2.0);
            assert_eq!(of_either(&truth, left, |left| *left).unwrap(), 1.0);
            assert_eq!(of_either(&parse_list("leak").unwrap(), left, |left| *left).unwrap(), 2.0);
        });
    }
}
