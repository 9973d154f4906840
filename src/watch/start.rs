//! The model that a run is fitted with: the rig's last accepted one, or what its material asks for.

use crate::fit::data::run_data::RunData;
use crate::fit::search::options::Options;
use crate::model::constraint::Given;
use crate::model::effects::{Chosen, parse_list};
use crate::model::{Model, ModelError};
use crate::results::history::Accepted;
use crate::results::model_file::Entry;
use crate::rig::Rig;

/// See the module.
#[derive(Debug, Clone)]
pub struct Start {
    /// Effects of the model.
    pub effects: Vec<Chosen>,
    /// Options of its fit: where it starts, what is held.
    pub options: Options,
}

/// An accepted model that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("the accepted model of {file} cannot be read: {why}; accept another run with `surgescope accept`")]
pub struct BadModel {
    file: String,
    why: String,
}

impl Start {
    /// From the rig's accepted model: its effects, their values as start, and what a person has held or bounded in it.
    /// Wave speed and what is each run's own start from the signals, which know them better.
    ///
    /// # Errors
    /// A model in the index that cannot be read.
    pub fn from_accepted(accepted: &Accepted, rig: &Rig, run: &RunData, options: Options) -> Result<Start, BadModel> {
        let bad = |why: String| BadModel { file: accepted.file.clone(), why };
        let entry: Entry = toml::from_str(&accepted.model).map_err(|e| bad(e.to_string()))?;
        let effects = parse_list(&entry.effects.join(",")).map_err(|e| bad(e.to_string()))?;
        let model = Model::new(rig, &run.conditions.water, &effects);
        let of_effects = &model.shared[model.effects_from()..];
        let shared = || entry.parameters.iter().filter(|p| p.run.is_none());
        let known = |name: &str| of_effects.iter().any(|p| p.name == name);
        let starts_at =
            shared().filter(|p| known(&p.name)).map(|p| Given { name: p.name.clone(), run: None, value: p.value });
        let constraints = entry.constraints().into_iter().filter(|c| c.run.is_none());
        let options = Options {
            starts_at: starts_at.collect(),
            constraints: constraints.collect(),
            priors: entry.priors(),
            ..options
        };
        Ok(Start { effects, options })
    }

    /// From the effects asked for, or else from what the rig's pipes are made of: plastic creeps, metal shows unsteady
    /// friction.
    ///
    /// # Errors
    /// None in practice: both effects are in the catalogue.
    pub fn from_scratch(asked: Option<&[Chosen]>, rig: &Rig, options: Options) -> Result<Start, ModelError> {
        let creeps = rig.pipes.iter().any(|p| p.material().viscoelastic);
        let effects = match asked {
            Some(effects) => effects.to_vec(),
            None => parse_list(if creeps { "viscoelastic-wall" } else { "unsteady-friction" })?,
        };
        Ok(Start { effects, options })
    }
}

/// Names and units of the parameters that a model shares among runs.
pub fn units(rig: &Rig, effects: &[Chosen], temperature_degc: Option<f64>) -> Vec<(String, &'static str)> {
    let water = rig.fluid.properties(temperature_degc.unwrap_or(rig.fluid.temperature_degc));
    Model::new(rig, &water, effects).shared.into_iter().map(|p| (p.name, p.unit)).collect()
}
