//! A model of a file on recordings that it was not fitted to.

use std::path::{Path, PathBuf};

use crate::fit::search::options::Options;
use crate::fit::validate::conflict::conflicts;
use crate::fit::validate::predict::{Prediction, predict};
use crate::model::constraint::Constraint;
use crate::results::model_file::ModelFile;
use crate::rig::compare::differences;
use crate::shown::Shown as _;
use crate::storage::output;
use crate::study::Study;
use crate::study::error::{Error, Result};
use crate::study::models;
use crate::study::open::{Loaded, load};

/// Difference of water temperatures from which wave speed and creep are others, K.
const OTHER_TEMPERATURE: f64 = 2.0;

/// A prediction with what there is to say about it.
pub struct Predicted {
    /// The prediction.
    pub prediction: Prediction,
    /// What to know about it.
    pub warnings: Vec<String>,
}

/// What is asked of a prediction.
pub struct Question<'a> {
    /// The file of models; the one in force predicts.
    pub model: &'a Path,
    /// Where the recordings of the study are.
    pub recordings: &'a [PathBuf],
    /// Values of the runs that are known better than from their signals.
    pub hold: &'a [(String, f64)],
    /// Predict although pipes, supply or fluid differ from the model's, or are not known.
    pub other_pipeline: bool,
}

/// What the model in force in a file predicts of a study's recordings.
///
/// # Errors
/// A model that cannot be read, another pipeline than the model's or one that cannot be compared with it, a value that
/// is none of a run's.
pub fn predicted(study: &Study, asked: &Question) -> Result<Predicted> {
    let file = models::load(asked.model)?;
    let known = file.current().known();
    let mut warnings = origin(study, asked, &file)?;
    if let Some((name, _)) = asked.hold.iter().find(|(name, _)| known.shared.iter().any(|p| p.name == *name)) {
        return Err(Error::NotOfARun { name: name.clone(), file: asked.model.to_owned() });
    }
    let held: Vec<Constraint> = (study.runs().iter())
        .flat_map(|run| asked.hold.iter().map(|(name, v)| (Some(run.file.clone()), name.clone(), *v)))
        .map(|(run, name, value)| Constraint { name, run, lower: value, upper: value })
        .collect();
    let prediction = predict(study.rig(), study.runs(), &known, &held, &Options::default(), study.watcher())?;
    warnings.extend(conflicts(&prediction.fit, study.runs()));
    Ok(Predicted { prediction, warnings })
}

/// Compares where a model comes from with what it is to predict.
fn origin(study: &Study, asked: &Question, file: &ModelFile) -> Result<Vec<String>> {
    let folder = asked.model.parent().unwrap_or(Path::new(""));
    let sources: Vec<PathBuf> = file.recordings.iter().map(|r| folder.join(r)).collect();
    let mut warnings: Vec<String> = (asked.recordings.iter())
        .filter(|r| sources.iter().any(|s| output::same_file(s, r)))
        .map(|r| format!("{} is one of the recordings that the model was fitted to", r.shown()))
        .collect();
    let own_rig = file.rig.as_ref().map(|r| folder.join(r));
    let first = sources.first().and_then(|s| load(std::slice::from_ref(s), own_rig.as_deref(), &[]).ok());
    let Some(first) = first.as_ref().and_then(|loaded| loaded.first()) else {
        let unknown = Error::UnknownPipeline(asked.model.to_owned());
        if !asked.other_pipeline {
            return Err(unknown);
        }
        warnings.push(unknown.to_string());
        return Ok(warnings);
    };
    let found = differences(&first.recording.rig, study.rig());
    if !found.line.is_empty() {
        let what = found.line.join("; ");
        if !asked.other_pipeline {
            return Err(Error::OtherPipeline(what));
        }
        warnings.push(format!("these recordings are of another pipeline than the model's: {what}"));
    }
    if !found.sensors.is_empty() {
        warnings.push(format!("sensors differ from the model's rig: {}", found.sensors.join("; ")));
    }
    warnings.extend(study.recordings().iter().filter_map(|run| other_temperature(run, first)));
    Ok(warnings)
}

fn other_temperature(run: &Loaded, first: &Loaded) -> Option<String> {
    let (here, there) = (run.features.temperature_degc, first.features.temperature_degc);
    ((here - there).abs() > OTHER_TEMPERATURE).then(|| {
        format!(
            "{}: the water is at {here:.1} °C, the model was fitted at {there:.1} °C: wave speed and creep depend on it",
            run.file
        )
    })
}
