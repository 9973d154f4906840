//! What may be done with the models of a bench: the same that the commands do, in the same files.

use std::collections::BTreeMap;
use std::error::Error;
use std::sync::Arc;

use serde::Deserialize;

use crate::diagnose::Diagnosis;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::outcome::posterior::WANTED;
use crate::fit::search::options::Options;
use crate::fit::validate::profile::profiles;
use crate::model::constraint::Given;
use crate::model::effects::{Chosen, parse_list};
use crate::report::calibration::posterior::reservation;
use crate::results::model_file::Entry;
use crate::study::Grown;
use crate::study::hold::options_of;
use crate::web::session::bench::Bench;

type AnyError = Box<dyn Error + Send + Sync>;

/// What a person changed of parameters before a fit, by name. A name stands for the parameter in all runs.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wishes {
    /// Values to start from.
    #[serde(default)]
    pub set: BTreeMap<String, f64>,
    /// Parameters to hold where they are.
    #[serde(default)]
    pub hold: Vec<String>,
    /// Parameters to let go.
    #[serde(default)]
    pub free: Vec<String>,
    /// Bounds.
    #[serde(default)]
    pub bounds: BTreeMap<String, [f64; 2]>,
}

/// One action.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Find out what the model lacks.
    Diagnose,
    /// Add an effect, its parameters starting at these values where some are given; or the two that the diagnosis found
    /// together.
    Add(String, BTreeMap<String, f64>),
    /// Take an effect out.
    Remove(String),
    /// Fit the model again.
    Fit(Wishes),
    /// Find out how far a parameter may move before the fit is worse than noise explains; of one run where it is named.
    Profile(String, Option<String>),
    /// Take the intervals from the joint posterior, sampled until each parameter has so many independent draws.
    Sample(usize),
    /// To the model that this one grew out of.
    Undo,
    /// To the last model that grew out of this one.
    Redo,
    /// To a model by its number.
    Force(usize),
}

impl Action {
    /// What the program does then, in words.
    pub fn words(&self) -> String {
        match self {
            Action::Diagnose => "diagnosing".into(),
            Action::Add(effect, _) => format!("adding {effect}"),
            Action::Remove(effect) => format!("removing {effect}"),
            Action::Fit(_) => "fitting".into(),
            Action::Profile(name, _) => format!("profiling {name}"),
            Action::Sample(_) => "sampling the posterior".into(),
            Action::Undo => "undoing".into(),
            Action::Redo => "redoing".into(),
            Action::Force(number) => format!("going to model {number}"),
        }
    }
}

impl Bench {
    /// Carries an action out; a diagnosis comes back.
    ///
    /// # Errors
    /// What the model does not have or cannot take, a fit that fails, a file that cannot be written. Nothing is changed
    /// then.
    pub fn act(&self, action: &Action) -> Result<Option<Arc<Diagnosis>>, AnyError> {
        match action {
            Action::Diagnose => return self.diagnose().map(Some),
            Action::Add(effect, set) => self.add(effect, set)?,
            Action::Remove(effect) => {
                self.take_out(effect)?;
                // an effect that is taken out asks what is missing instead
                if self.is_undiagnosed_of_old() {
                    return self.diagnose().map(Some);
                }
            }
            Action::Profile(name, run) => self.walk(name, run.as_deref())?,
            Action::Sample(wanted) => self.sample(*wanted)?,
            Action::Fit(wishes) => {
                self.fit_in_force()?;
                let entry = wished(self.file().current().clone(), wishes)?;
                let study = &self.study;
                let fit = entry.refit(study.rig(), study.runs(), &Options::default(), study.watcher())?;
                self.append(study.or_from_signals(fit)?, &entry.refit_words(), None)?;
            }
            Action::Undo => self.put_in_force(|file| {
                if file.step_back() { Ok(()) } else { Err("this is the first model: there is no step back".into()) }
            })?,
            Action::Redo => self.put_in_force(|file| {
                file.in_force = file.next().ok_or("no model grew out of this one: there is no step forward")?;
                Ok(())
            })?,
            Action::Force(number) => self.put_in_force(|file| {
                if !(1..=file.models.len()).contains(number) {
                    return Err(format!("there is no model {number}: the last is {}", file.models.len()).into());
                }
                file.in_force = *number;
                Ok(())
            })?,
        }
        self.fit_in_force()?;
        Ok(None)
    }

    fn diagnose(&self) -> Result<Arc<Diagnosis>, AnyError> {
        self.fit_in_force()?;
        let current = self.file().current().clone();
        let options = Options { constraints: current.constraints(), priors: current.priors(), ..Options::default() };
        let found = Arc::new(self.study.diagnose_model(&current.chosen(), &options)?);
        self.keep(found.clone());
        Ok(found)
    }

    /// Goes back to the model that was before an effect came, with its diagnosis; where there is none, what is left is
    /// fitted anew.
    fn take_out(&self, effect: &str) -> Result<(), AnyError> {
        let fit = self.fit_in_force()?;
        if let Some(number) = self.file().before(effect) {
            return self.put_in_force(|file| {
                file.in_force = number;
                Ok(())
            });
        }
        let fit = self.study.without(&fit, effect)?;
        self.append(self.study.or_from_signals(fit)?, &format!("{effect} taken out"), None)
    }

    fn walk(&self, name: &str, run: Option<&str>) -> Result<(), AnyError> {
        let fit = self.fit_in_force()?;
        let j = index_of(&fit, name, run)?;
        if fit.parameters[j].held {
            return Err(format!("{name} is held, so it has no profile: let it go and fit again first").into());
        }
        let study = &self.study;
        let found = profiles(study.rig(), study.runs(), &fit, &[j], &options_of(&fit), study.watcher())?;
        found.of_each.into_iter().for_each(|profile| self.keep_profile(j, profile));
        Ok(())
    }

    fn sample(&self, wanted: usize) -> Result<(), AnyError> {
        if !WANTED.contains(&wanted) {
            return Err(format!("draws must be from {} to {}", WANTED.start(), WANTED.end()).into());
        }
        let mut fit = (*self.fit_in_force()?).clone();
        self.study.sample(&mut fit, wanted, Options::default().seed)?;
        if fit.posterior.is_none() {
            return Err(reservation(&fit).unwrap_or_default().into());
        }
        self.keep_fit(fit);
        Ok(())
    }

    fn add(&self, effect: &str, set: &BTreeMap<String, f64>) -> Result<(), AnyError> {
        let mut named = parse_list(effect)?;
        let Some(chosen) = named.pop().filter(|_| named.is_empty()) else { return self.add_pair(effect) };
        if let Some(why) = chosen.effect.impossible(self.study.rig()) {
            return Err(format!("{effect}: {why}; whatever it explains belongs to another effect").into());
        }
        let start = self.fit_in_force()?;
        let (fit, evidence) = if set.is_empty() {
            let Grown { fit, evidence, .. } = self.study.grow(&start, &chosen)?;
            (fit, evidence)
        } else {
            let given = given(set).chain(start.given()).collect::<Vec<_>>();
            let effects: Vec<Chosen> = start.effects.iter().cloned().chain([chosen.clone()]).collect();
            let fit = self.study.refined(&effects, &given, &options_of(&start))?;
            let evidence = fit.evidence_over(&start);
            (fit, evidence)
        };
        self.append(fit, &format!("{} added", chosen.label()), Some(evidence))
    }

    /// Adds what the diagnosis of the model in force found together, as `diagnose --apply` does.
    fn add_pair(&self, effects: &str) -> Result<(), AnyError> {
        let found = self.diagnosis();
        let of_pair =
            |found: &&Arc<Diagnosis>| found.pair.as_ref().is_some_and(|pair| pair.labels.join(",") == effects);
        let answer = found.as_ref().filter(of_pair).and_then(|found| Some((found, found.answer()?.clone())));
        let (found, fit) = answer.ok_or("name one effect, or the two that the diagnosis found together")?;
        self.append(fit, &found.reason(), Some(found.answer_evidence()))
    }
}

/// The number of a parameter in a fit; of one that each run has of its own, the first run's where no run is named.
///
/// # Errors
/// A name that the model does not have, a run that does not have it.
pub fn index_of(fit: &Fit, name: &str, run: Option<&str>) -> Result<usize, AnyError> {
    fit.parameter(name)?;
    let is_it = |p: &FittedParameter| p.name == name && (run.is_none() || p.run.as_deref() == run);
    let found = fit.parameters.iter().position(is_it);
    found.ok_or_else(|| format!("{name} is no parameter of the run '{}'", run.unwrap_or_default()).into())
}

/// Values that a person gave, each for all runs.
pub fn given(set: &BTreeMap<String, f64>) -> impl Iterator<Item = Given> {
    set.iter().map(|(name, value)| Given { name: name.clone(), run: None, value: *value })
}

/// A model as a person wants it fitted.
fn wished(mut entry: Entry, wishes: &Wishes) -> Result<Entry, AnyError> {
    let known = |name: &String| entry.parameters.iter().any(|p| p.name == *name);
    let named = wishes.set.keys().chain(&wishes.hold).chain(&wishes.free).chain(wishes.bounds.keys());
    if let Some(name) = named.into_iter().find(|name| !known(name)) {
        return Err(format!("the model has no parameter '{name}'").into());
    }
    for p in &mut entry.parameters {
        p.fixed = wishes.hold.contains(&p.name) || (p.fixed && !wishes.free.contains(&p.name));
        if let Some([lower, upper]) = wishes.bounds.get(&p.name) {
            if !(lower < upper && lower.is_finite() && upper.is_finite()) {
                return Err(format!("{}: the lower bound must lie below the upper one", p.name).into());
            }
            (p.lower, p.upper) = (*lower, *upper);
        }
        if let Some(&value) = wishes.set.get(&p.name) {
            if !value.is_finite() {
                return Err(format!("{} must be a number", p.name).into());
            }
            // a value that is held may lie anywhere that the physics allows
            (p.value, p.lower, p.upper) = (value, p.lower.min(value), p.upper.max(value));
        }
        p.value = p.value.clamp(p.lower, p.upper);
    }
    Ok(entry)
}
