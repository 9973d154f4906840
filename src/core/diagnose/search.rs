//! The search: models with more effects than the start model, the most promising first.
//!
//! A state is a set of effects that the start model lacks. Its neighbours have one more, one less, or one exchanged for another. A step looks at all
//! neighbours of a state: the projected residual on the coarse grid forecasts what each would leave ([`screening`](crate::diagnose::screening)), and
//! those that may win are fitted from there. The search goes on from the best model of each size, first by these forecasts, then from the signals,
//! and ends where nothing is left that a further effect could be worth. No rival of the best model stays short of its optimum.

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::{Form, base_name, can_be_combined};
use crate::diagnose::evidence::EvidenceScale;
use crate::diagnose::fitter::Fitter;
use crate::diagnose::limits::{
    CONVERGE_BELOW, EXPLAINED_OVER_NOISE, FULL_FITS, LEAST_EVIDENCE, LEAST_FORECAST, NEGLIGIBLE_EVIDENCE,
    NO_FULL_FIT_ABOVE, START_DOUBTFUL,
};
use crate::diagnose::measures::{beyond, fall, least_fall, over_noise, square, square_at_optimum};
use crate::diagnose::met::{Forecast, Key, Met};
use crate::diagnose::screening::{best_forms, refits, screened};
use crate::diagnose::weigh::weigh;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::search::calibrate::with_more_elements;
use crate::fit::search::starts::may_be_anywhere;
use crate::fit::validate::conflict::{at_bounds, contradicts};
use crate::model::Model;
use crate::model::effects::{Chosen, SHOWN};

/// See the module.
pub(crate) struct Search<'a> {
    pub(crate) fitter: Fitter<'a>,
    /// The start model: what every effect is counted from.
    pub(crate) start: &'a Fit,
    /// The fit that the search begins at.
    pub(crate) from: &'a Fit,
    /// The problem around that fit.
    pub(crate) baseline: &'a Baseline<'a>,
    /// The least fall of the squared error over noise that is worth a model.
    pub(crate) least_fall: f64,
    pub(crate) met: Vec<Met>,
}

/// How a step looks for the fits of a state's neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Starts {
    /// From the state's own fit, by a forecast.
    Forecast,
    /// The leading ones of them from the signals.
    LeadingFromSignals,
    /// All of them from the signals.
    AllFromSignals,
}

const ORDER: [Starts; 3] = [Starts::Forecast, Starts::LeadingFromSignals, Starts::AllFromSignals];

impl<'a> Search<'a> {
    /// A search from a fitted start model, which may have `grown` out of a smaller one.
    pub(crate) fn new(
        fitter: Fitter<'a>,
        start: &'a Fit,
        from: &'a Fit,
        baseline: &'a Baseline<'a>,
        grown: Option<&Fit>,
    ) -> Self {
        let runs = fitter.runs;
        let taken = grown.map_or(0.0, |smaller| over_noise(smaller, runs).powi(2) - over_noise(start, runs).powi(2));
        Search { least_fall: least_fall(runs, taken), fitter, start, from, baseline, met: Vec::new() }
    }

    /// The same where effects have `taken` some more of it.
    pub(crate) fn least_fall_after(&self, taken: f64) -> f64 {
        self.least_fall + least_fall(self.fitter.runs, taken) - least_fall(self.fitter.runs, 0.0)
    }

    /// Leads the best model on to its optimum where elements of creep kept it from there.
    pub(crate) fn prune_best(&mut self) {
        let Some(best) = self.leader().map(|m| m.key.clone()) else { return };
        if let Some(mut fit) = self.get(&best).and_then(|m| m.fit.clone()).filter(|fit| !fit.converged) {
            self.fitter.prune(&mut fit);
            self.get_mut(&best).fit = Some(fit);
        }
    }

    /// Looks for models with as many further effects as `most`.
    pub(crate) fn run(&mut self, most: usize) {
        let mut done: Vec<(Key, Starts)> = Vec::new();
        while let Some(step) = self.next(most, &done) {
            self.step(&step);
            done.push(step);
            if self.is_near() {
                self.contest();
            }
        }
        self.contest();
    }

    /// The next step: small models before big ones, cheap starts before dear ones. A model is gone on from where it is better than the start model; one
    /// that a record shows by itself leaves no second effect, for no model follows the collapse of cavities well.
    fn next(&self, most: usize, done: &[(Key, Starts)]) -> Option<(Key, Starts)> {
        let weighed = weigh(self);
        let best_of = |size| weighed.models.iter().find(|m| m.added.len() == size && m.met.fit.is_some());
        let bigger = (1..most).map_while(best_of);
        let bigger = bigger.take_while(|m| m.evidence > 0.0 && !m.is_shown && self.leaves_room(m.met));
        let states: Vec<Key> = std::iter::once(Key::new()).chain(bigger.map(|m| m.met.key.clone())).collect();
        let open = |starts| {
            let promising = move |state: &Key| starts == Starts::Forecast || !self.is_quiet(state.len() + 1);
            move |state: &&Key| promising(state) && !done.iter().any(|(key, how)| key == *state && *how == starts)
        };
        ORDER.into_iter().find_map(|starts| states.iter().find(open(starts)).map(|state| (state.clone(), starts)))
    }

    /// Whether a model leaves so much that a further effect could be worth it.
    fn leaves_room(&self, met: &Met) -> bool {
        met.fit.as_ref().is_some_and(|fit| beyond(fit, self.fitter.runs) >= self.least_fall_after(self.taken(fit)))
    }

    /// How much of the squared error over noise a model has taken.
    fn taken(&self, fit: &Fit) -> f64 {
        let runs = self.fitter.runs;
        over_noise(self.start, runs).powi(2) - over_noise(fit, runs).powi(2)
    }

    /// Whether a model of at most that size leaves so little that forecasts are accurate: what they do not promise will not appear. A single effect that
    /// gets there against what the instruments say has not shown that no other would.
    fn is_quiet(&self, size: usize) -> bool {
        let runs = self.fitter.runs;
        let quiet = |fit: &Fit| over_noise(fit, runs) < EXPLAINED_OVER_NOISE && (size > 1 || is_sound(fit, runs));
        let fits = self.met.iter().filter(|m| m.key.len() <= size).filter_map(|m| m.fit.as_ref());
        fits.chain([self.start]).any(quiet)
    }

    fn step(&mut self, (state, starts): &(Key, Starts)) {
        match starts {
            Starts::Forecast => {
                let fit = if state.is_empty() {
                    Some(self.from.clone())
                } else {
                    self.get(state).and_then(|m| m.fit.clone())
                };
                if let Some(fit) = fit {
                    self.expand(&fit, None);
                    self.fit_leading(state.len() + 1);
                }
                if state.is_empty() {
                    self.more_elements();
                    self.shown_by_itself();
                }
            }
            Starts::LeadingFromSignals => self.leading_from_signals(state.len() + 1),
            Starts::AllFromSignals => {
                self.all_from_signals(state);
                self.leading_from_signals(state.len() + 1);
            }
        }
    }

    /// The most probable of the fitted models.
    fn leader(&self) -> Option<&Met> {
        weigh(self).models.into_iter().map(|m| m.met).find(|m| m.fit.is_some())
    }

    pub(crate) fn get(&self, key: &[&'static str]) -> Option<&Met> {
        self.met.iter().find(|m| m.key == key)
    }

    fn get_mut(&mut self, key: &[&'static str]) -> &mut Met {
        let known = self.met.iter().position(|m| m.key == key);
        let i = known.unwrap_or_else(|| {
            self.met.push(Met::new(key.to_vec()));
            self.met.len() - 1
        });
        &mut self.met[i]
    }

    /// Which effects of a model the start model lacks, or has with fewer elements.
    pub(crate) fn added(&self, effects: &[Chosen]) -> Vec<usize> {
        let known = |c: &Chosen| {
            let own = self.fitter.asked.iter().find(|a| base_name(a.effect.name()) == base_name(c.effect.name()));
            own.is_some_and(|own| own.elements.is_none() || own.elements >= c.elements)
        };
        (0..effects.len()).filter(|&i| !known(&effects[i])).collect()
    }

    pub(crate) fn key(&self, effects: &[Chosen]) -> Key {
        let mut key: Key = self.added(effects).into_iter().map(|i| base_name(effects[i].effect.name())).collect();
        key.sort_unstable();
        key
    }

    /// Whether the best model is near enough for its rivals to be compared with it.
    fn is_near(&self) -> bool {
        let near = START_DOUBTFUL.powi(2) - 1.0;
        self.leader().and_then(|m| m.fit.as_ref()).is_some_and(|fit| beyond(fit, self.fitter.runs) < near)
    }

    /// Forecasts what each effect would leave beside a fitted model, or in the place of its effect `gone`.
    fn expand(&mut self, fit: &Fit, gone: Option<usize>) {
        let fitter = &self.fitter;
        let baseline = match gone {
            None => Baseline::new(fitter.rig, fitter.runs, fit, fitter.options),
            Some(i) => Baseline::without(fitter.rig, fitter.runs, fit, i, fitter.options),
        };
        let Ok(baseline) = baseline else { return };
        let found =
            if gone.is_none() { refits(&baseline, fitter.progress) } else { screened(&baseline, fitter.progress) };
        let Some(closest) = found.iter().min_by(|a, b| a.square.total_cmp(&b.square)) else { return };
        let scale = EvidenceScale::of(&closest.residuals[..baseline.samples], baseline.features());
        let best = best_forms(&found, |r| scale.evidence(baseline.square, r.square, r.added));
        // what the fit leaves is known of the fit itself: of the model as it is, or with the effect that is gone put back
        let own = gone.map(|i| base_name(fit.effects[i].effect.name()));
        let reference = match own {
            None => Some(baseline.mean_square(&baseline.residuals)),
            Some(own) => {
                best.iter().find(|(_, r)| r.form.effect == own).map(|(_, r)| baseline.mean_square(&r.residuals))
            }
        };
        let Some(reference) = reference else { return };
        let of_fit = square(fit) / reference;
        let forecasts: Vec<Forecast> = best
            .into_iter()
            .filter(|(_, r)| own != Some(r.form.effect))
            .map(|(evidence, r)| Forecast {
                effects: r.effects.clone(),
                values: r.values.clone(),
                square: of_fit * baseline.mean_square(&r.residuals),
                evidence,
                is_tried: false,
            })
            .collect();
        forecasts.into_iter().for_each(|f| self.meet(f));
    }

    /// Keeps a forecast that promises more than what is known.
    fn meet(&mut self, forecast: Forecast) {
        let key = self.key(&forecast.effects);
        let met = self.get_mut(&key);
        let known = met.forecast.as_ref().is_some_and(|f| !f.is_tried && f.square <= forecast.square);
        let fitted = met.fit.as_ref().is_some_and(|fit| square(fit) <= forecast.square);
        if !known && !fitted {
            met.forecast = Some(forecast);
        }
    }

    /// Fits the models of a size whose forecasts promise most.
    fn fit_leading(&mut self, size: usize) {
        let promise = |m: &Met| m.forecast.as_ref().filter(|f| !f.is_tried).map(|f| (f.evidence, f.square));
        let mut order: Vec<usize> =
            (0..self.met.len()).filter(|&i| self.met[i].key.len() == size && promise(&self.met[i]).is_some()).collect();
        order.sort_by(|&a, &b| {
            self.met[a]
                .forecast
                .as_ref()
                .map(|f| f.square)
                .partial_cmp(&self.met[b].forecast.as_ref().map(|f| f.square))
                .unwrap()
        });
        let least = self.met.iter().map(Met::square).fold(f64::INFINITY, f64::min);
        let worth = LEAST_FORECAST * self.least_fall;
        let mut leading = Vec::new();
        for (n, i) in order.into_iter().take(FULL_FITS).enumerate() {
            let Some((evidence, promised)) = promise(&self.met[i]) else { continue };
            let enough = evidence > if n == 0 { NEGLIGIBLE_EVIDENCE } else { LEAST_EVIDENCE };
            let falls = fall(self.start, self.fitter.runs, square(self.start), promised) > worth;
            if enough && falls && promised < NO_FULL_FIT_ABOVE * least {
                leading.push(i);
            }
        }
        self.fit_forecasts(&leading);
    }

    fn fit_forecasts(&mut self, which: &[usize]) {
        let this = &*self;
        let fits: Vec<(usize, Option<Fit>, bool)> = which
            .par_iter()
            .filter_map(|&i| {
                let forecast = this.met[i].forecast.as_ref()?;
                let added: Vec<Chosen> =
                    this.added(&forecast.effects).into_iter().map(|k| forecast.effects[k].clone()).collect();
                // elements are added one by one, from the signals, which is more reliable
                let grows = added.len() == 1 && added[0].elements.is_some();
                let fit = match grows {
                    true => this.fitter.from_signals(&added),
                    false => this.fitter.from(&forecast.effects, &forecast.values),
                };
                Some((i, fit.ok(), grows))
            })
            .collect();
        for (i, fit, from_signals) in fits {
            let met = &mut self.met[i];
            met.is_from_signals |= from_signals;
            if let Some(f) = &mut met.forecast {
                f.is_tried = true;
            }
            if let Some(fit) = fit {
                met.take(fit);
            }
        }
    }

    /// Fits the leading models of a size from the signals: what they leave may be the way that their fits came.
    fn leading_from_signals(&mut self, size: usize) {
        let mut order: Vec<usize> =
            (0..self.met.len()).filter(|&i| self.met[i].key.len() == size && self.met[i].fit.is_some()).collect();
        order.sort_by(|&a, &b| self.met[a].square().total_cmp(&self.met[b].square()));
        let most = NO_FULL_FIT_ABOVE * order.first().map_or(0.0, |&i| self.met[i].square());
        order.retain(|&i| self.met[i].square() < most && !self.met[i].is_from_signals);
        order.truncate(FULL_FITS);
        let this = &*self;
        let fits: Vec<(usize, Option<Fit>)> = order
            .par_iter()
            .map(|&i| {
                let effects = this.met[i].model().map_or(Vec::new(), |(effects, _)| effects.to_vec());
                let added: Vec<Chosen> = this.added(&effects).into_iter().map(|k| effects[k].clone()).collect();
                (i, this.fitter.from_signals(&added).ok())
            })
            .collect();
        for (i, fit) in fits {
            self.met[i].is_from_signals = true;
            if let Some(fit) = fit {
                self.met[i].take(fit);
            }
        }
    }

    /// Fits a state with each further effect coarsely from the signals, and those that leave least to all samples.
    fn all_from_signals(&mut self, state: &Key) {
        let Some(of_state) = self.effects_of(state) else { return };
        let alone: Vec<Form> = self.forms_alone();
        let root = &self.from.effects;
        let coarse: Vec<Forecast> = alone
            .par_iter()
            .filter(|form| !state.contains(&form.effect))
            .filter(|form| of_state.iter().all(|c| can_be_combined(c.effect, form.chosen.effect)))
            .filter_map(|form| {
                let added: Vec<Chosen> = of_state.iter().chain([&form.chosen]).cloned().collect();
                let fit = self.fitter.coarse(root, &added).ok()?;
                let square = fit.mean_square * self.start.samples() as f64;
                Some(Forecast {
                    effects: fit.effects,
                    values: fit.values,
                    square,
                    evidence: f64::INFINITY,
                    is_tried: false,
                })
            })
            .collect();
        let mut coarse = coarse;
        coarse.sort_by(|a, b| a.square.total_cmp(&b.square));
        let most = NO_FULL_FIT_ABOVE * coarse.first().map_or(0.0, |f| f.square);
        coarse.retain(|f| f.square <= most);
        coarse.truncate(FULL_FITS);
        let which: Vec<usize> = coarse
            .into_iter()
            .map(|f| {
                let key = self.key(&f.effects);
                self.get_mut(&key).forecast = Some(f);
                self.met.iter().position(|m| m.key == key).unwrap_or(0)
            })
            .collect();
        self.fit_forecasts(&which);
    }

    /// What a state adds to the start model.
    fn effects_of(&self, state: &Key) -> Option<Vec<Chosen>> {
        if state.is_empty() {
            return Some(Vec::new());
        }
        let (effects, _) = self.get(state)?.model()?;
        Some(self.added(effects).into_iter().map(|i| effects[i].clone()).collect())
    }

    /// The best form of each effect alone.
    pub(crate) fn forms_alone(&self) -> Vec<Form> {
        let alone = self.met.iter().filter(|m| m.key.len() == 1);
        alone
            .filter_map(|m| {
                let chosen = self.effects_of(&m.key)?.pop()?;
                self.fitter
                    .asked
                    .iter()
                    .all(|c| base_name(c.effect.name()) != m.key[0])
                    .then_some(Form { effect: m.key[0], chosen })
            })
            .collect()
    }

    /// More elements of a start model's effect whose number is fixed: an effect that makes up for missing ones would be named in their place.
    fn more_elements(&mut self) {
        let fitter = &self.fitter;
        if fitter.asked.iter().all(|c| c.elements.is_none()) {
            return;
        }
        let open: Vec<Chosen> = fitter.asked.iter().map(|c| Chosen { elements: None, ..c.clone() }).collect();
        let more = with_more_elements(fitter.rig, fitter.runs, self.start, &open, fitter.options, &|_| {});
        if let Ok(Some(fit)) = more {
            let key = self.key(&fit.effects);
            let met = self.get_mut(&key);
            met.is_from_signals = true;
            met.take(fit);
        }
    }

    /// What a record shows by itself is fitted, whatever a coarse grid says of it.
    fn shown_by_itself(&mut self) {
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
        if let Ok(fit) = self.fitter.from_signals(&added) {
            self.met[i].take(fit);
        }
        self.met[i].is_from_signals = true;
    }

    /// Compares rivals at their optima: the best model is fitted until it converges, the other effects are tried in the place of each of its own, and
    /// whoever comes near it is fitted on from where it ended.
    fn contest(&mut self) {
        loop {
            let Some(best) = self.leader().map(|m| m.key.clone()) else { return };
            self.converge(&best);
            let met = self.get_mut(&best);
            if std::mem::replace(&mut met.is_contested, true) {
                return;
            }
            let Some(winner) = met.fit.clone() else { return };
            for i in self.added(&winner.effects) {
                if may_be_anywhere(&winner.effects[i]) {
                    self.expand(&winner, Some(i));
                    self.fit_leading(best.len());
                }
            }
            self.rivals(&winner, &best);
            self.without_one(&winner);
            if self.leader().is_some_and(|m| m.key == best) {
                return;
            }
        }
    }

    /// Fits on the rivals of a model from where that ended.
    fn rivals(&mut self, winner: &Fit, own: &Key) {
        let near = CONVERGE_BELOW * square(winner);
        let rivals: Vec<usize> = (0..self.met.len())
            .filter(|&i| self.met[i].key != *own && self.met[i].key.len() == own.len() && self.met[i].fit.is_some())
            .filter(|&i| self.met[i].square() < near && !self.met[i].is_converged)
            .collect();
        let this = &*self;
        let fits: Vec<(usize, Vec<Fit>)> = rivals
            .par_iter()
            .map(|&i| {
                let mut fits = Vec::new();
                let Some((effects, values)) = this.met[i].model() else { return (i, fits) };
                let moved = this.transplanted(winner, effects, &values);
                fits.extend(this.fitter.from(effects, &moved).ok());
                let better =
                    fits.first().filter(|f| square(f) < this.met[i].square()).or(this.met[i].fit.as_ref()).cloned();
                if let Some(better) = better {
                    let may_win = square_at_optimum(&better) < square(winner) || this.fitter.is_held_back(&better);
                    if may_win && (!better.converged || this.fitter.is_held_back(&better)) {
                        fits.extend(this.fitter.converged(&better).ok());
                    }
                }
                (i, fits)
            })
            .collect();
        for (i, fits) in fits {
            for fit in fits {
                self.met[i].take(fit);
            }
            self.met[i].is_converged = true;
        }
    }

    /// The model without each of its added effects, from where the rest stands: beside the other one an effect may have got where it explains the
    /// records alone.
    fn without_one(&mut self, winner: &Fit) {
        let added = self.added(&winner.effects);
        if added.len() < 2 {
            return;
        }
        let fitter = &self.fitter;
        let fits: Vec<Fit> = added.par_iter().filter_map(|&i| fitter.without(winner, i).ok()).collect();
        for fit in fits {
            let key = self.key(&fit.effects);
            self.get_mut(&key).take(fit);
        }
    }

    /// Values of a model with `effects`: those of the winner where it has the same effect, else its own.
    fn transplanted(&self, winner: &Fit, effects: &[Chosen], own: &[f64]) -> Vec<f64> {
        let water = &self.fitter.runs[0].conditions.water;
        let of = |effects: &[Chosen]| Model::new(self.fitter.rig, water, effects);
        let (ours, theirs, from) = (of(effects), of(&winner.effects), winner.values());
        let mut values: Vec<f64> = from[..theirs.effects_from()].to_vec();
        for (i, c) in effects.iter().enumerate() {
            let same = winner.effects.iter().position(|w| w == c);
            values.extend(match same {
                Some(k) => &from[theirs.parameters_of(k)],
                None => &own[ours.parameters_of(i)],
            });
        }
        values.extend(&from[theirs.shared.len()..]);
        values
    }

    fn converge(&mut self, key: &Key) {
        let Some(met) = self.get(key) else { return };
        let Some(fit) = met.fit.as_ref().filter(|_| !met.is_converged) else { return };
        let at_end = fit.converged && !self.fitter.is_held_back(fit);
        let on = if at_end { None } else { self.fitter.converged(fit).ok() };
        let met = self.get_mut(key);
        if let Some(on) = on {
            met.take(on);
        }
        met.is_converged = true;
    }
}

/// Whether a fit keeps to what the instruments say, and to what its parameters may be.
fn is_sound(fit: &Fit, runs: &[RunData]) -> bool {
    !contradicts(fit, runs) && at_bounds(fit).is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::test_record::{HDPE, record, short_branch};
    use crate::fit::search::calibrate::{calibrate, refine};
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;

    /// What `check` finds in a search from a model with these effects.
    fn searched(rig: &Rig, runs: &[RunData], effects: &str, options: &Options, check: impl Fn(&mut Search)) {
        let asked = parse_list(effects).unwrap();
        let start = calibrate(rig, runs, &asked, options, &|_| {}).unwrap();
        let baseline = Baseline::new(rig, runs, &start, options).unwrap();
        let fitter = Fitter { rig, runs, asked: &asked, options, progress: &|_| {} };
        check(&mut Search::new(fitter, &start, &start, &baseline, None));
    }

    fn copper() -> Rig {
        Rig::from_toml(&HDPE.replace("HDPE", "copper"), "rig.toml").unwrap()
    }

    fn run(initial_velocity_m_s: f64) -> RunValues {
        RunValues { initial_velocity_m_s, valve_head_m: 40.0, closing_time_s: 0.05, friction_scale: 1.0 }
    }

    /// A leak that was driven to the valve imitates a valve that does not close. That one has no fit of its own, and is found all the same.
    #[test]
    fn a_leak_at_the_valve_meets_the_leaking_seat() {
        let rig = copper();
        let runs = [record(&rig, &parse_list("valve-seat-leak").unwrap(), &[1200.0, 3.0], run(0.5), 0.02, 3.0)];
        let options = Options { most_reaches: 128, ..Options::default() };
        searched(&rig, &runs, "none", &options, |search| {
            let mut values = search.start.values();
            values.splice(1..1, [0.98 * rig.length_m(), 3.0]);
            let leak = refine(&rig, &runs, &parse_list("leak").unwrap(), &values, &options, &|_| {}).unwrap();
            assert!(leak.parameter("leak_position_m").unwrap().at_bound);
            search.get_mut(&["leak"]).take(leak);
            search.contest();
            let [leak, seat] = ["leak", "valve-seat-leak"].map(|name| search.get(&[name]).unwrap());
            let found = seat.fit.as_ref().unwrap();
            assert!(over_noise(found, &runs) < 1.05 && seat.square() < leak.square());
            let area_mm2 = found.parameter("seat_cda_mm2").unwrap().value;
            assert!((area_mm2 - 3.0).abs() < 0.1, "{area_mm2}");
        });
    }

    /// Near the noise a fit with gas, whose grid was kept coarse, goes on to a finer one, though it has converged; one without cavities has had it.
    #[test]
    fn gas_meets_its_rivals_on_a_fine_grid() {
        let rig = copper();
        let runs = [record(&rig, &parse_list("entrained-gas").unwrap(), &[1200.0, 2e-6, 1e-5], run(0.3), 0.2, 2.0)];
        let options = Options { most_reaches: 256, grid_error_over_noise: 0.0, ..Options::default() };
        let coarse = Options { most_reaches: 64, ..Options::default() };
        searched(&rig, &runs, "none", &options, |search| {
            for (name, finer) in [("entrained-gas", true), ("valve-seat-leak", false)] {
                let begun = calibrate(&rig, &runs, &parse_list(name).unwrap(), &coarse, &|_| {}).unwrap();
                assert!(begun.converged && begun.reaches < 200 && over_noise(&begun, &runs) < 2.0, "{name}");
                let from = begun.reaches;
                search.get_mut(&[name]).take(begun);
                search.converge(&vec![name]);
                let reaches = search.get(&[name]).unwrap().fit.as_ref().unwrap().reaches;
                assert_eq!(reaches > from, finer, "{name}: {reaches}");
            }
        });
    }

    /// In a pipe that creeps a change of section imitates a short branch, whose forecast cannot leave the place where the creep has made up for it.
    #[test]
    fn a_short_branch_is_found_where_a_change_of_section_imitates_it() {
        let (rig, record) = short_branch();
        let (runs, options) = ([record], Options { most_reaches: 128, ..Options::default() });
        searched(&rig, &runs, "viscoelastic-wall:2", &options, |search| {
            search.run(1);
            let best = search.leader().unwrap();
            assert_eq!(best.key, ["side-branch"]);
            let place_m = best.fit.as_ref().unwrap().parameter("branch_position_m").unwrap().value;
            assert!((place_m - 89.9).abs() < 0.5, "{place_m}");
        });
    }

    /// A model with an effect more starts where the smaller one ended, so it leaves no more.
    #[test]
    fn a_bigger_model_leaves_no_more() {
        let rig = copper();
        let truth = parse_list("leak,valve-seat-leak").unwrap();
        let runs = [record(&rig, &truth, &[1200.0, 12.0, 4.0, 3.0], run(0.5), 0.02, 3.0)];
        let options = Options { most_reaches: 64, ..Options::default() };
        searched(&rig, &runs, "none", &options, |search| {
            search.run(2);
            let fitted: Vec<&Met> = search.met.iter().filter(|m| m.fit.is_some()).collect();
            let best = search.leader().unwrap();
            assert_eq!(best.key, ["leak", "valve-seat-leak"]);
            for smaller in fitted.iter().filter(|m| m.key.iter().all(|name| best.key.contains(name))) {
                assert!(best.square() <= smaller.square(), "{:?} {:?}", best.key, smaller.key);
            }
        });
    }
}
