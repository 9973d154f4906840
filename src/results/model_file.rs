//! The models of a rig's runs, one after the other, in a file that people may edit: `MODEL.toml`.
//!
//! It is to be worked with. A result that is written once and says all about one fit is another file
//! (`calibrate -o FIT.toml`).
//!
//! Every model that was fitted stays in it, with what it was fitted to, how well it did, and why it was made. One of
//! them is in force; a step back puts the one in force that it grew out of. A value may be held, or its bounds moved,
//! with an editor.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::progress::OnProgress;
use crate::fit::search::calibrate::refine;
use crate::fit::search::options::Options;
use crate::fit::validate::predict::{Known, Shared, geometric_mean};
use crate::model::constraint::{Constraint, Given};
use crate::model::effects::{Chosen, name_of, parse_list};
use crate::model::prior::Prior;
use crate::model::{Model, ModelError};
use crate::rig::Rig;
use crate::shown::Shown as _;

/// First line of such a file.
pub const HEADING: &str = "# surgescope models";

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelFile {
    /// Number of the model in force, from 1.
    pub in_force: usize,
    /// The recordings, as paths from the folder of this file.
    pub recordings: Vec<PathBuf>,
    /// The rig file to read them with, where that is not the one stored in them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rig: Option<PathBuf>,
    /// All models, oldest first.
    #[serde(rename = "model")]
    pub models: Vec<Entry>,
    /// Its text when it was read, to see whether another has written to it since.
    #[serde(skip)]
    pub as_read: Option<String>,
}

/// Why a text holds no models.
fn not_models(text: &str, error: toml::de::Error) -> String {
    if text.lines().any(|line| line.trim() == "[[pipe]]") {
        return "it is a rig file; a calibration saves its models in a file of their own".to_owned();
    }
    if text.lines().any(|line| line.starts_with("converged = ")) {
        return "it is the file of one fit; a calibration with option `save` writes a file of models".to_owned();
    }
    error.to_string()
}

/// One model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// What it is called in tables.
    pub name: String,
    /// The model that it grew out of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grown_from: Option<usize>,
    /// When it was fitted, RFC 3339.
    pub when: String,
    /// Why it was made.
    pub why: String,
    /// Effects beside the base model.
    pub effects: Vec<String>,
    /// Error over all samples, m.
    pub rmse_m: f64,
    /// Noise of the same, m.
    pub noise_m: f64,
    /// Evidence for it over the model that it grew out of, natural logarithm of odds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence: Option<f64>,
    /// Features that a stepwise calibration had still to use when it was stopped, by name; one that is taken out is not
    /// used.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub features_left: Vec<String>,
    /// Correlations of the errors of the parameters that runs share, in their order; 0 where they are not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub correlation: Vec<Vec<f64>>,
    /// Its parameters, shared ones first.
    #[serde(default, rename = "parameter")]
    pub parameters: Vec<Value>,
}

/// One parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Value {
    /// Its name, with the unit.
    pub name: String,
    /// The run it belongs to where it is not shared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Its value.
    pub value: f64,
    /// Standard error; none where it was held or the data do not determine it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<f64>,
    /// Least value that a fit may take.
    pub lower: f64,
    /// Greatest value that a fit may take.
    pub upper: f64,
    /// Held at its value.
    #[serde(default)]
    pub fixed: bool,
    /// What is known of it from elsewhere, such as a creep test: mean and relative standard deviation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<[f64; 2]>,
    /// Where the value came from.
    #[serde(default)]
    pub source: String,
}

/// A model file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum ModelFileError {
    #[error("{} is not a file of models: {}", .0.shown(), .1)]
    Parse(PathBuf, String),
    #[error("{} names no recordings", .0.shown())]
    NoRecording(PathBuf),
    #[error("{}: model {number} {what}", .file.shown())]
    Contradiction { file: PathBuf, number: usize, what: String },
    #[error("{}: model {number}", .file.shown())]
    Effects { file: PathBuf, number: usize, source: ModelError },
}

impl ModelFile {
    /// From the text of a file; `path` is for messages.
    ///
    /// # Errors
    /// One that is no file of models, or contradicts itself.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ModelFileError> {
        let file: ModelFile =
            toml::from_str(text).map_err(|e| ModelFileError::Parse(path.to_owned(), not_models(text, e)))?;
        file.check(path)?;
        Ok(file)
    }

    /// Reads the rig, whose own effects are known then; what is wrong with it, a fit of the recordings says.
    fn read_rig(&self, folder: &Path) {
        match (&self.rig, self.recordings.first()) {
            (Some(rig), _) => drop(Rig::load(&folder.join(rig))),
            (None, Some(recording)) => drop(crate::storage::read(&folder.join(recording))),
            (None, None) => {}
        }
    }

    fn check(&self, path: &Path) -> Result<(), ModelFileError> {
        let wrong = |number: usize, what: String| ModelFileError::Contradiction { file: path.to_owned(), number, what };
        if self.recordings.is_empty() {
            return Err(ModelFileError::NoRecording(path.to_owned()));
        }
        if self.in_force == 0 || self.in_force > self.models.len() {
            return Err(wrong(
                self.in_force,
                format!("is in force but does not exist: the file has {}", self.models.len()),
            ));
        }
        for (i, model) in self.models.iter().enumerate() {
            if let Some(parent) = model.grown_from.filter(|&p| p == 0 || p > i) {
                return Err(wrong(i + 1, format!("claims to grow from model {parent}, which does not come before it")));
            }
            let effects = || parse_list(&model.effects.join(","));
            let known = effects().or_else(|_| {
                self.read_rig(path.parent().unwrap_or(Path::new("")));
                effects()
            });
            known.map_err(|source| ModelFileError::Effects { file: path.to_owned(), number: i + 1, source })?;
            for (k, p) in model.parameters.iter().enumerate() {
                if model.parameters[..k].iter().any(|q| q.name == p.name && q.run == p.run) {
                    return Err(wrong(i + 1, format!("has {} twice: keep one of them", p.name)));
                }
                if p.prior.is_some_and(|known| !known.iter().all(|v| *v > 0.0 && v.is_finite())) {
                    return Err(wrong(i + 1, format!("has a prior of {} that is not above 0", p.name)));
                }
                if !(p.lower <= p.value && p.value <= p.upper) {
                    return Err(wrong(
                        i + 1,
                        if p.lower > p.upper {
                            format!("has a lower bound of {}, {}, above the upper one, {}", p.name, p.lower, p.upper)
                        } else {
                            format!(
                                "has {} = {:.6} outside its bounds, {:.6} to {:.6}: set its value between them, too",
                                p.name, p.value, p.lower, p.upper
                            )
                        },
                    ));
                }
            }
        }
        Ok(())
    }

    /// The text of the file.
    ///
    /// # Errors
    /// None in practice: all values can be written.
    pub fn text(&self) -> Result<String, toml::ser::Error> {
        let body = toml::to_string(self)?;
        Ok(format!(
            "{HEADING}: the one in force may be edited (fixed, lower, upper, value); comments are not kept\n\n{body}"
        ))
    }

    /// The model in force.
    pub fn current(&self) -> &Entry {
        &self.models[self.in_force - 1]
    }

    /// The model from which the one in force has grown at first.
    pub fn root(&self) -> &Entry {
        let parent = |entry: &&Entry| entry.grown_from.map(|number| &self.models[number - 1]);
        std::iter::successors(Some(self.current()), parent).last().unwrap_or_else(|| self.current())
    }

    /// Adds a model, grown out of the one in force if there is one, and puts it in force.
    pub fn append(&mut self, fit: &Fit, why: &str, evidence: Option<f64>, when: String) {
        let grown_from = (!self.models.is_empty()).then_some(self.in_force);
        let mut model = Entry::of(fit, why, evidence, when, grown_from);
        if let Some(parent) = grown_from.map(|n| &self.models[n - 1]) {
            // What is held keeps the bounds that it will have when it is let go.
            for value in model.parameters.iter_mut().filter(|v| v.fixed) {
                if let Some(known) = parent.parameters.iter().find(|p| p.name == value.name && p.run == value.run) {
                    (value.lower, value.upper) = (known.lower, known.upper);
                }
            }
        }
        self.models.push(model);
        self.in_force = self.models.len();
    }

    /// This file's own models behind those that another process has added to it, where it did nothing else: `read` is
    /// the file as it was read, none where there was none, `there` as it is now.
    pub fn behind(&self, there: &ModelFile, read: Option<&ModelFile>) -> Option<ModelFile> {
        let known = read.map_or(0, |file| file.models.len());
        let unchanged = |models: &[Entry]| models.get(..known) == read.map(|file| &file.models[..]).or(Some(&[]));
        let same = there.recordings == self.recordings && there.rig == self.rig;
        if !same || !unchanged(&there.models) || !unchanged(&self.models) || self.models.len() == known {
            return None;
        }
        let later = there.models.len() - known;
        let moved = |n: usize| if n > known { n + later } else { n };
        let own = self.models[known..].iter().map(|m| Entry { grown_from: m.grown_from.map(moved), ..m.clone() });
        Some(ModelFile {
            in_force: moved(self.in_force),
            models: there.models.iter().cloned().chain(own).collect(),
            ..self.clone()
        })
    }

    /// The model to which a step forward leads: the last that grew out of the one in force.
    pub fn next(&self) -> Option<usize> {
        self.models.iter().rposition(|m| m.grown_from == Some(self.in_force)).map(|i| i + 1)
    }

    /// The nearest model that the one in force grew out of and that is the same but for an effect, named by its label
    /// or its name; none where there is no such model, or where values have been held or bounded since.
    pub fn before(&self, effect: &str) -> Option<usize> {
        let now = self.current();
        let is_it = |label: &String| label == effect || label.split([':', '@']).next() == Some(effect);
        let rest: Vec<&String> = now.effects.iter().filter(|label| !is_it(label)).collect();
        let parent = |number: &usize| self.models[number - 1].grown_from;
        let mut chain = std::iter::successors(now.grown_from, parent);
        chain.find(|number| {
            let was = &self.models[number - 1];
            rest.len() < now.effects.len() && was.effects.iter().eq(rest.iter().copied()) && was.is_settled_as(now)
        })
    }

    /// Puts the model in force that the present one grew out of; false where it is the first.
    pub fn step_back(&mut self) -> bool {
        let Some(parent) = self.current().grown_from else { return false };
        self.in_force = parent;
        true
    }
}

impl Entry {
    fn of(fit: &Fit, why: &str, evidence: Option<f64>, when: String, grown_from: Option<usize>) -> Self {
        let (rmse_m, noise_m) = fit.pooled();
        Entry {
            name: name_of(&fit.effects),
            grown_from,
            when,
            why: why.to_owned(),
            effects: fit.labels(),
            rmse_m,
            noise_m,
            evidence,
            features_left: fit.features_left.iter().map(|name| (*name).to_owned()).collect(),
            correlation: known_only(&Known::of(fit).correlation),
            parameters: fit.parameters.iter().map(Value::of).collect(),
        }
    }

    /// What it knows of other recordings on its rig.
    pub fn known(&self) -> Known {
        let shared: Vec<Shared> = (self.parameters.iter().filter(|p| p.run.is_none()))
            .map(|p| Shared { name: p.name.clone(), value: p.value, standard_error: p.standard_error })
            .collect();
        let scales = self.parameters.iter().filter(|p| p.name == "friction_scale").map(|p| p.value);
        Known {
            effects: self.chosen(),
            correlation: if self.correlation.len() == shared.len() { self.correlation.clone() } else { Vec::new() },
            shared,
            friction_scale: geometric_mean(scales),
        }
    }

    /// Its effects.
    pub fn chosen(&self) -> Vec<Chosen> {
        // checked when it was read
        parse_list(&self.effects.join(",")).unwrap_or_default()
    }

    /// What it settles: held values and bounds.
    pub fn constraints(&self) -> Vec<Constraint> {
        self.parameters
            .iter()
            .map(|p| {
                let (lower, upper) = if p.fixed { (p.value, p.value) } else { (p.lower, p.upper) };
                Constraint { name: p.name.clone(), run: p.run.clone(), lower, upper }
            })
            .collect()
    }

    /// Whether what it holds, bounds and knows beforehand is the same in another model.
    fn is_settled_as(&self, other: &Entry) -> bool {
        self.parameters.iter().all(|own| {
            let same = other.parameters.iter().find(|p| p.name == own.name && p.run == own.run);
            same.is_some_and(|p| {
                let bounds = (p.lower, p.upper) == (own.lower, own.upper);
                (p.fixed, p.prior) == (own.fixed, own.prior) && if own.fixed { p.value == own.value } else { bounds }
            })
        })
    }

    /// Its values, each with its name and run.
    pub fn given(&self) -> Vec<Given> {
        self.parameters.iter().map(|p| Given { name: p.name.clone(), run: p.run.clone(), value: p.value }).collect()
    }

    /// What a refit of it is called.
    pub fn refit_words(&self) -> String {
        let held: Vec<&str> = self.parameters.iter().filter(|p| p.fixed).map(|p| p.name.as_str()).collect();
        match held.as_slice() {
            [] => "refitted".to_owned(),
            [one] => format!("refitted with {one} held"),
            more => format!("refitted with {} values held", more.len()),
        }
    }

    /// What is known of its parameters from elsewhere.
    pub fn priors(&self) -> Vec<Prior> {
        let known = self.parameters.iter().filter_map(|p| p.prior.map(|known| (p, known)));
        known.map(|(p, [mean, sd])| Prior { name: p.name.clone(), mean, sd }).collect()
    }

    /// Fits it again, from the values in the file, with what is held and bounded there.
    ///
    /// # Errors
    /// As [`refine`]; a parameter in the file that the model does not have.
    pub fn refit(
        &self,
        rig: &Rig,
        runs: &[RunData],
        options: &Options,
        progress: &OnProgress<'_>,
    ) -> Result<Fit, FitError> {
        let options = Options { constraints: self.constraints(), priors: self.priors(), ..options.clone() };
        let effects = self.chosen();
        let water = &runs.first().ok_or(FitError::NoRun)?.conditions.water;
        let model = Model::new(rig, water, &effects).constrained(&options.constraints).informed(&options.priors);
        let window = Window { reaches: 1, horizon_s: f64::INFINITY, stride: 1 };
        let problem = FitProblem::new(&model, runs, window);
        problem.validate_constraints(&options.constraints)?;
        let file = |j: usize| problem.run_of(j).map(|r| runs[r].file.as_str());
        let own = problem.parameters.iter().enumerate().map(|(j, p)| {
            let known = self.parameters.iter().find(|v| v.name == p.name && v.run.as_deref() == file(j));
            known.map_or(p.start, |v| v.value)
        });
        let values: Vec<f64> = own.collect();
        refine(rig, runs, &effects, &values, &options, progress)
    }
}

/// Correlations with 0 for those that are not known, to eight digits.
fn known_only(correlation: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let plain = |r: &f64| if r.is_finite() { (r * 1e8).round() / 1e8 } else { 0.0 };
    correlation.iter().map(|row| row.iter().map(plain).collect()).collect()
}

impl Value {
    fn of(p: &FittedParameter) -> Self {
        let source = match (p.held, p.at_bound) {
            (true, _) => "held by hand",
            (_, true) => "fitted, at its bound",
            _ => "fitted",
        };
        Value {
            name: p.name.clone(),
            run: p.run.clone(),
            value: p.value,
            standard_error: p.known_error(),
            lower: p.lower,
            upper: p.upper,
            fixed: p.held,
            prior: p.prior.map(|(mean, sd)| [mean, sd]),
            source: source.to_owned(),
        }
    }
}
