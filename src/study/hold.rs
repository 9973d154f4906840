//! Values that a person holds: what they mean for a model, and which of them no fit would take.

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::parameters;
use crate::fit::search::options::Options;
use crate::model::Model;
use crate::model::constraint::Constraint;
use crate::model::effects::Chosen;
use crate::model::parameter::Parameter;
use crate::model::prior::Prior;
use crate::number::significant;
use crate::results::model_file::Entry;
use crate::rig::Rig;

/// A parameter that a person holds, at a value or between two.
#[derive(Debug, Clone, PartialEq)]
pub struct Hold {
    /// The parameter.
    pub name: String,
    /// Least value that a fit may take, in the parameter's unit.
    pub lower: f64,
    /// Greatest value; the same where it is held at one.
    pub upper: f64,
}

impl Hold {
    /// Whether it is held at one value.
    pub fn fixed(&self) -> bool {
        self.lower == self.upper
    }
}

impl std::fmt::Display for Hold {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Hold { name, lower, upper } = self;
        if self.fixed() { write!(f, "{name}={lower}") } else { write!(f, "{name}={lower}:{upper}") }
    }
}

/// The parameters of a model that all runs share.
fn shared_names(rig: &Rig, runs: &[RunData], effects: &[Chosen]) -> Vec<String> {
    let Some(run) = runs.first() else { return Vec::new() };
    let model = Model::new(rig, &run.conditions.water, effects);
    parameters::shared(&model, runs).into_iter().map(|p| p.name).collect()
}

/// What `hold` means for each of several models. A value that one of them shares among runs concerns only those that
/// have it; any other is held in every run, and the fit refuses it where there is no such parameter.
pub fn constraints(rig: &Rig, runs: &[RunData], models: &[Vec<Chosen>], hold: &[Hold]) -> Vec<Vec<Constraint>> {
    let own: Vec<Vec<String>> = models.iter().map(|effects| shared_names(rig, runs, effects)).collect();
    let of = |known: &Vec<String>| {
        let mut all = Vec::new();
        for Hold { name, lower, upper } in hold {
            let held = |run: Option<String>| Constraint { name: name.clone(), run, lower: *lower, upper: *upper };
            if known.contains(name) {
                all.push(held(None));
            } else if !own.iter().flatten().any(|n| n == name) {
                all.extend(runs.iter().map(|run| held(Some(run.file.clone()))));
            }
        }
        all
    };
    own.iter().map(of).collect()
}

/// A value outside the bounds of its parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Beyond {
    /// The parameter.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Least value that a fit may take.
    pub lower: f64,
    /// Greatest value that a fit may take.
    pub upper: f64,
}

impl std::fmt::Display for Beyond {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Beyond { name, value, .. } = self;
        let [lower, upper] = [self.lower, self.upper].map(|bound| significant(bound, 3));
        let value = if (1e-4..1e9).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") };
        write!(f, "{name}={value} lies outside the bounds of a fit, {lower} to {upper}: check its unit")
    }
}

/// Which of the `values` lie outside the bounds that a fit of the model keeps to.
pub fn beyond(rig: &Rig, runs: &[RunData], effects: &[Chosen], values: &[(String, f64)]) -> Vec<Beyond> {
    let Some(run) = runs.first().filter(|_| !values.is_empty()) else { return Vec::new() };
    // With as many elements as there may be, so that each parameter is known.
    let most = |c: &Chosen| c.most_elements().map_or_else(|| c.clone(), |n| c.with_elements(n));
    let effects: Vec<Chosen> = effects.iter().map(most).collect();
    let model = Model::new(rig, &run.conditions.water, &effects);
    let (known, _) = parameters::of(&model, runs);
    let outside = |(name, value): &(String, f64)| {
        let outside = |p: &&Parameter| p.name == *name && !(p.lower..=p.upper).contains(value);
        let p = known.iter().find(outside)?;
        Some(Beyond { name: name.clone(), value: *value, lower: p.lower, upper: p.upper })
    };
    values.iter().filter_map(outside).collect()
}

/// Adds what a model of a file settles where `held` says nothing else: values held, and bounds of parameters that a
/// model with these `effects` has. Returns the held parameters that it does not have.
pub fn settle(
    held: &mut Vec<Constraint>,
    from: &Entry,
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
) -> Vec<String> {
    if runs.is_empty() {
        return Vec::new();
    }
    let shared = shared_names(rig, runs, effects);
    let has = |c: &Constraint| match &c.run {
        Some(file) => runs.iter().any(|run| run.file == *file),
        None => shared.contains(&c.name),
    };
    let own = held.len();
    let mut unknown = Vec::new();
    for settled in from.constraints() {
        if held[..own].iter().any(|c| c.concerns(&settled.name, settled.run.as_deref())) {
            continue;
        }
        if has(&settled) {
            held.push(settled);
        } else if settled.holds() {
            unknown.push(settled.name);
        }
    }
    unknown
}

/// The options that a fit was made with, as far as it remembers them: bounds, values held, and priors.
pub fn options_of(fit: &Fit) -> Options {
    let bounds = |p: &crate::fit::outcome::fit::FittedParameter| {
        let (lower, upper) = if p.held { (p.value, p.value) } else { (p.lower, p.upper) };
        Constraint { name: p.name.clone(), run: p.run.clone(), lower, upper }
    };
    let priors =
        fit.parameters.iter().filter_map(|p| p.prior.map(|(mean, sd)| Prior { name: p.name.clone(), mean, sd }));
    Options { constraints: fit.parameters.iter().map(bounds).collect(), priors: priors.collect(), ..Options::default() }
}
