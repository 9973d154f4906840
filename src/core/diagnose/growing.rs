//! A model that grows by what it lacks: one search, which goes on from each answer.
//!
//! The models that the search has met stay known, so what was added first is compared with what was found later. Where
//! a model without it, or with another effect in its place, turns out to be more probable, it is taken out.

use crate::diagnose::baseline::Baseline;
use crate::diagnose::conclusion::diagnosis;
use crate::diagnose::limits::MOST_MISSING;
use crate::diagnose::met::{Done, Key, Met, has_all};
use crate::diagnose::models::Search;
use crate::diagnose::outcome::Diagnosis;
use crate::diagnose::start::Start;
use crate::diagnose::weigh::weigh;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::error::FitError;
use crate::fit::progress::OnProgress;
use crate::fit::search::calibrate::Fitter;
use crate::fit::search::options::Options;
use crate::model::effects::Chosen;
use crate::model::stop;
use crate::rig::Rig;

/// See the module.
pub struct Growing {
    start: Start,
    /// The start model's effects as they were asked for: they stay.
    asked: Vec<Chosen>,
    options: Options,
    met: Vec<Met>,
    done: Vec<Done>,
    /// What the current model adds to the start model.
    state: Key,
    /// The models that were current.
    answered: Vec<Key>,
    is_done: bool,
}

/// What a step did.
#[derive(Debug)]
pub enum Step {
    /// The current model was diagnosed. It has grown if the diagnosis has an answer.
    Diagnosed(Box<Diagnosis>),
    /// The current model did not need these effects, which were taken out: the model without them, and the effects.
    TakenOut(Box<Fit>, Vec<Chosen>),
}

impl Growing {
    /// From a start model that is fitted already, with these options.
    pub(crate) fn of(start: Start, asked: &[Chosen], options: &Options) -> Growing {
        let (asked, options) = (asked.to_vec(), options.clone());
        let (met, done, answered) = (Vec::new(), Vec::new(), Vec::new());
        Growing { start, asked, options, met, done, state: Key::new(), answered, is_done: false }
    }

    /// From a start model with `effects`, fitted to the runs.
    ///
    /// # Errors
    /// As [`crate::diagnose::diagnose`].
    pub fn starting(
        rig: &Rig,
        runs: &[RunData],
        effects: &[Chosen],
        options: &Options,
        progress: &OnProgress<'_>,
    ) -> Result<Growing, FitError> {
        Ok(Growing::of(Start::fitted(rig, runs, effects, options, progress)?, effects, options))
    }

    /// What the start model lacks.
    pub(crate) fn diagnosed(
        mut self,
        rig: &Rig,
        runs: &[RunData],
        progress: &OnProgress<'_>,
    ) -> Result<Diagnosis, FitError> {
        let state = self.state.clone();
        self.searched(rig, runs, progress, |search, is_held| diagnosis(search, &state, is_held))?
    }

    /// The current model is this fit, which has more effects than the start model.
    ///
    /// # Errors
    /// As [`crate::diagnose::diagnose`].
    pub fn grown_to(mut self, rig: &Rig, runs: &[RunData], fit: Fit) -> Result<Growing, FitError> {
        let state = self.with_search(rig, runs, &|_| {}, |search| {
            let state = search.key(&fit.effects);
            search.take(fit);
            state
        })?;
        self.state = state;
        Ok(self)
    }

    /// Diagnoses the current model and adds what it lacks, or takes out what it does not need. None where nothing is
    /// left to do.
    ///
    /// # Errors
    /// As [`crate::diagnose::diagnose`].
    pub fn step(&mut self, rig: &Rig, runs: &[RunData], progress: &OnProgress<'_>) -> Result<Option<Step>, FitError> {
        let state = self.state.clone();
        if self.is_done {
            return Ok(None);
        }
        let step = self.searched(rig, runs, progress, |search, is_held| -> Result<(Key, Step), FitError> {
            if let Some(rest) = needed(search, &state) {
                let fit = search.fit_of(&rest).clone();
                let stays = |c: &Chosen| fit.effects.iter().any(|own| own.effect.name() == c.effect.name());
                let gone = search.fit_of(&state).effects.iter().filter(|c| !stays(c)).cloned().collect();
                return Ok((rest, Step::TakenOut(Box::new(fit), gone)));
            }
            let found = diagnosis(search, &state, is_held)?;
            let grown = found.answer().map_or_else(|| state.clone(), |fit| search.key(&fit.effects));
            Ok((grown, Step::Diagnosed(Box::new(found))))
        })?;
        let (next, step) = step?;
        // a model that was left for a smaller one does not come back
        self.is_done = next == state || self.answered.contains(&next) && has_all(&next, &state);
        if !self.is_done {
            self.answered.push(next.clone());
            self.state = next;
        }
        Ok(Some(step))
    }

    /// The search, gone on from the current model, and what it `says`.
    fn searched<T>(
        &mut self,
        rig: &Rig,
        runs: &[RunData],
        progress: &OnProgress<'_>,
        says: impl FnOnce(&Search, bool) -> T,
    ) -> Result<T, FitError> {
        let (state, is_held) = (self.state.clone(), self.start.held.is_some() && self.state.is_empty());
        self.with_search(rig, runs, progress, |search| {
            search.run(&state, MOST_MISSING);
            says(search, is_held)
        })
    }

    fn with_search<T>(
        &mut self,
        rig: &Rig,
        runs: &[RunData],
        progress: &OnProgress<'_>,
        work: impl FnOnce(&mut Search) -> T,
    ) -> Result<T, FitError> {
        let Start { fit: start, held } = &self.start;
        let from = held.as_ref().unwrap_or(start);
        let baseline = Baseline::new(rig, runs, from, &self.options)?;
        let fitter = Fitter::new(rig, runs, &self.options, progress);
        let mut search = Search::new(fitter, &self.asked, start, from, &baseline);
        (search.met, search.done) = (std::mem::take(&mut self.met), std::mem::take(&mut self.done));
        let done = work(&mut search);
        stop::check()?;
        (self.met, self.done) = (search.met, search.done);
        Ok(done)
    }
}

/// What a state needs, if that is not all of it: what it shares with a model that is more probable, by odds that tell
/// models apart.
fn needed(search: &Search, state: &[&'static str]) -> Option<Key> {
    let weighed = weigh(search, &[]);
    let own = weighed.models.iter().find(|m| m.met.key == state)?;
    let claim = weighed.claim();
    let is_better = claim.map_or(own.evidence < 0.0, |c| c.log_odds() - own.log_odds() > STRONG_EVIDENCE);
    let claimed: &[&str] = claim.map_or(&[], |c| &c.met.key);
    if !is_better || has_all(claimed, state) {
        return None;
    }
    let rest: Key = state.iter().copied().filter(|name| claimed.contains(name)).collect();
    Some(if search.get(&rest).is_some_and(|m| m.fit.is_some()) { rest } else { Key::new() })
}
