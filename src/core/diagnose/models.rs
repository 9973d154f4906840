//! The models that a search has met, by what they add to the start model.

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::{Form, base_name};
use crate::diagnose::measures::{error_of_effects, least_fall, square};
use crate::diagnose::met::{Done, Key, Met};
use crate::fit::outcome::fit::Fit;
use crate::fit::search::calibrate::Fitter;
use crate::model::effects::Chosen;

/// What a search works with, and what it has found so far.
pub(crate) struct Search<'a> {
    pub(crate) fitter: Fitter<'a>,
    /// The start model's effects as the user asked for them: they may leave a number of elements open.
    pub(crate) asked: &'a [Chosen],
    /// The start model: what every effect is counted from.
    pub(crate) start: &'a Fit,
    /// The fit that the search begins at.
    pub(crate) from: &'a Fit,
    /// The problem around that fit.
    pub(crate) baseline: &'a Baseline<'a>,
    /// The least fall of the squared error over noise that is worth a model.
    pub(crate) least_fall: f64,
    pub(crate) met: Vec<Met>,
    /// The steps that were taken to grow models.
    pub(crate) done: Vec<Done>,
}

impl<'a> Search<'a> {
    /// A search from a fitted start model.
    pub(crate) fn new(
        fitter: Fitter<'a>,
        asked: &'a [Chosen],
        start: &'a Fit,
        from: &'a Fit,
        baseline: &'a Baseline<'a>,
    ) -> Self {
        let least_fall = least_fall(fitter.runs);
        Search { least_fall, fitter, asked, start, from, baseline, met: Vec::new(), done: Vec::new() }
    }

    /// The same where effects have `taken` some more of it.
    pub(crate) fn least_fall_after(&self, taken: f64) -> f64 {
        self.least_fall + error_of_effects(taken)
    }

    /// How much of the squared error over noise a model has taken.
    pub(crate) fn taken(&self, fit: &Fit) -> f64 {
        self.start.mean_square() - fit.mean_square()
    }

    pub(crate) fn get(&self, key: &[&'static str]) -> Option<&Met> {
        self.met.iter().find(|m| m.key == key)
    }

    /// The fit of a state; the start model's where it adds nothing or was not fitted.
    pub(crate) fn fit_of(&self, state: &[&'static str]) -> &Fit {
        self.get(state).and_then(|m| m.fit.as_ref()).unwrap_or(self.start)
    }

    /// Keeps a fit where it leaves less than what is known of its model. A model that is at its end gives way to
    /// another end alone, on the same grid.
    pub(crate) fn take(&mut self, fit: Fit) {
        let key = self.key(&fit.effects);
        if key.is_empty() {
            return;
        }
        let place = self.place(&key);
        let is_coarser = self.met[place].fit.as_ref().is_some_and(|known| fit.reaches < known.reaches);
        let fit = match self.met[place].is_at_end && is_coarser && square(&fit) < self.met[place].square() {
            true => self.fitter.to_its_end(&fit).unwrap_or(fit),
            false => fit,
        };
        self.met[place].take(fit);
    }

    /// Where a model stands in the list; at its end where it is new.
    pub(crate) fn place(&mut self, key: &[&'static str]) -> usize {
        let known = self.met.iter().position(|m| m.key == key);
        known.unwrap_or_else(|| {
            self.met.push(Met::new(key.to_vec()));
            self.met.len() - 1
        })
    }

    /// Which effects of a model the start model lacks, or has with fewer elements.
    pub(crate) fn added(&self, effects: &[Chosen]) -> Vec<usize> {
        let known = |c: &Chosen| {
            let own = self.asked.iter().find(|a| base_name(a.effect.name()) == base_name(c.effect.name()));
            own.is_some_and(|own| own.elements.is_none() || own.elements >= c.elements)
        };
        (0..effects.len()).filter(|&i| !known(&effects[i])).collect()
    }

    /// What a model adds to the start model.
    pub(crate) fn added_effects(&self, effects: &[Chosen]) -> Vec<Chosen> {
        self.added(effects).into_iter().map(|i| effects[i].clone()).collect()
    }

    pub(crate) fn key(&self, effects: &[Chosen]) -> Key {
        let mut key: Key = self.added(effects).into_iter().map(|i| base_name(effects[i].effect.name())).collect();
        key.sort_unstable();
        key
    }

    /// What a state adds to the start model.
    pub(crate) fn effects_of(&self, state: &Key) -> Option<Vec<Chosen>> {
        if state.is_empty() {
            return Some(Vec::new());
        }
        Some(self.added_effects(self.get(state)?.effects()?))
    }

    /// The best form of each effect alone.
    pub(crate) fn forms_alone(&self) -> Vec<Form> {
        let is_asked = |name: &str| self.asked.iter().any(|c| base_name(c.effect.name()) == name);
        let alone = self.met.iter().filter(|m| m.key.len() == 1 && !is_asked(m.key[0]));
        alone.filter_map(|m| Some(Form { effect: m.key[0], chosen: self.effects_of(&m.key)?.pop()? })).collect()
    }
}
