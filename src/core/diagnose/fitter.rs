//! Fits of models that are compared: one place for how far each of them goes.

use crate::diagnose::limits::{MOST_REACHES_WITH_CAVITIES, START_DOUBTFUL};
use crate::diagnose::measures::{over_noise, square};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::{CoarseFit, calibrate, fit_coarsely, go_on, refine, without};
use crate::fit::search::nested::with_more_elements;
use crate::fit::search::options::Options;
use crate::model::effects::{Chosen, boils};
use crate::rig::Rig;

/// Fits models of a rig to all samples of its runs.
pub(crate) struct Fitter<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) runs: &'a [RunData],
    /// The start model's effects as the user asked for them: they may leave a number of elements open.
    pub(crate) asked: &'a [Chosen],
    pub(crate) options: &'a Options,
    pub(crate) progress: &'a OnProgress<'a>,
}

impl Fitter<'_> {
    /// A brief fit from `values`.
    pub(crate) fn on_from(&self, effects: &[Chosen], values: &[f64]) -> Result<Fit, FitError> {
        refine(self.rig, self.runs, effects, values, &self.brief(effects), &self.shown(effects))
    }

    /// A brief fit from the signals; the fit chooses the elements of the effects that are `added`.
    pub(crate) fn anew(&self, added: &[Chosen]) -> Result<Fit, FitError> {
        let open = added.iter().map(|c| Chosen { elements: None, ..c.clone() });
        let asked = self.asked.iter().filter(|c| added.iter().all(|a| a.effect.name() != c.effect.name()));
        let effects: Vec<Chosen> = asked.cloned().chain(open).collect();
        calibrate(self.rig, self.runs, &effects, &self.brief(&effects), &self.shown(&effects))
    }

    /// A coarse fit from the signals; the fit chooses the sensors of the effects that are `added`.
    pub(crate) fn coarse(&self, start: &[Chosen], added: &[Chosen]) -> Result<CoarseFit, FitError> {
        let open = added.iter().map(|c| Chosen { sensor: None, ..c.clone() });
        let effects: Vec<Chosen> = start.iter().cloned().chain(open).collect();
        self.shown(&effects)(&Progress::from("from the signals"));
        fit_coarsely(self.rig, self.runs, &effects, self.options)
    }

    /// A fit led on to its optimum: until it converges, and with as many more elements of its effect `open` as the
    /// evidence supports. Near the noise a model with cavities has a finer grid than before: the grid's error decides
    /// between rivals there.
    pub(crate) fn to_its_end(&self, fit: &Fit, open: Option<usize>) -> Result<Fit, FitError> {
        let most = if self.is_held_back(fit) { usize::MAX } else { MOST_REACHES_WITH_CAVITIES };
        let options = self.bounded(&fit.effects, most);
        let end = match self.is_at_optimum(fit) {
            true => fit.clone(),
            false => refine(self.rig, self.runs, &fit.effects, &fit.values(), &options, &self.shown(&fit.effects))?,
        };
        // on a finer grid it may leave more, which is nearer to what its model leaves
        let end = if end.reaches > fit.reaches || square(&end) < square(fit) { end } else { fit.clone() };
        Ok(open.and_then(|i| self.with_more_elements(&end, i)).unwrap_or(end))
    }

    /// A fitted model with as many more elements of its effect `i` as the evidence supports; none where it supports no
    /// more.
    pub(crate) fn with_more_elements(&self, fit: &Fit, i: usize) -> Option<Fit> {
        let most = *fit.effects[i].effect.elements()?.end();
        let (options, shown) = (self.bounded(&fit.effects, MOST_REACHES_WITH_CAVITIES), self.shown(&fit.effects));
        let more = with_more_elements(self.rig, self.runs, fit.clone(), (i, most), &options, &shown).ok()?;
        (more.effects != fit.effects).then_some(more)
    }

    /// A fit past the elements of creep that keep it from its optimum; none where it is there, or does not get there.
    pub(crate) fn pruned(&self, fit: &Fit) -> Option<Fit> {
        let options = Options { brief: true, ..self.options.clone() };
        let go_on = || go_on(self.rig, self.runs, fit, &options, &self.shown(&fit.effects)).ok();
        if fit.converged { None } else { go_on().filter(|pruned| pruned.converged) }
    }

    /// The model without its effect `i`, briefly fitted.
    pub(crate) fn without(&self, fit: &Fit, i: usize) -> Result<Fit, FitError> {
        without(self.rig, self.runs, fit, i, &self.brief(&fit.effects), &|_| {})
    }

    fn is_at_optimum(&self, fit: &Fit) -> bool {
        fit.converged && !self.is_held_back(fit)
    }

    /// Whether a fit with cavities stopped on a coarse grid, whose error may decide between rivals so near the noise.
    fn is_held_back(&self, fit: &Fit) -> bool {
        boils(&fit.effects) && over_noise(fit, self.runs) < START_DOUBTFUL
    }

    fn brief(&self, effects: &[Chosen]) -> Options {
        Options { brief: true, ..self.bounded(effects, MOST_REACHES_WITH_CAVITIES) }
    }

    /// The options, on no more reaches than so many where the effects have cavities. Models are compared, so their
    /// elements are not pruned.
    fn bounded(&self, effects: &[Chosen], with_cavities: usize) -> Options {
        let most = if boils(effects) { with_cavities } else { usize::MAX };
        Options { most_reaches: self.options.most_reaches.min(most), prune: false, ..self.options.clone() }
    }

    fn shown(&self, effects: &[Chosen]) -> impl Fn(&Progress) + Sync + use<'_> {
        let labels: Vec<String> = effects.iter().map(Chosen::label).collect();
        let labels = if labels.is_empty() { "base model".to_owned() } else { labels.join(" + ") };
        move |p| (self.progress)(&p.within(&labels))
    }
}
