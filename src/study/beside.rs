//! A model of a file beside a recording: what each pressure sensor would show at its samples.

use std::path::{Path, PathBuf};

use crate::fit::problem::observed::{Gauge, Place};
use crate::model::constraint::Given;
use crate::model::effects::Chosen;
use crate::results::model_file::{Entry, ModelFile};
use crate::shown::Shown as _;
use crate::simulate::as_recorded::{AsRecordedError, Setting, as_recorded};
use crate::simulate::scenario::displayed;
use crate::storage::output::{same_content, same_file};
use crate::storage::with_model::Curve;
use crate::study::Study;
use crate::study::error::{Error, Result};
use crate::study::predict::{Question, predicted};

/// A model beside a recording.
pub struct Beside {
    /// Its effects, as on the command line.
    pub effects: Vec<String>,
    /// Values of its parameters, the run's own included.
    pub settings: Vec<Setting>,
    /// The run's own values are those of the fit; otherwise its signals gave them, as for a prediction.
    pub fitted: bool,
    /// Each pressure sensor that the model shows.
    pub curves: Vec<Curve>,
    /// What to know about it.
    pub warnings: Vec<String>,
}

/// The model in force in `file`, which was read from `path`, beside the only recording of a study, which is at
/// `recording`. Of a long recording it is beside the part that a fit uses. Before the closure the model is at rest.
///
/// # Errors
/// Another pipeline than the model's, a model that cannot be simulated.
pub fn beside(study: &Study, recording: &Path, path: &Path, file: &ModelFile) -> Result<Beside> {
    let entry = file.current();
    let own = own_name(path, file, recording).and_then(|name| values_of(entry, &name));
    let fitted = own.is_some();
    let mut warnings = Vec::new();
    let (effects, given) = match own {
        Some(given) => (entry.chosen(), given),
        None => {
            let recordings = [PathBuf::from(recording)];
            let asked = Question { model: path, recordings: &recordings, hold: &[], other_pipeline: false };
            let found = predicted(study, &asked)?;
            warnings = found.warnings;
            let given = found.prediction.fit.given();
            (found.prediction.fit.effects, given)
        }
    };
    let curves = curves(study, &effects, &given)?;
    Ok(Beside {
        effects: effects.iter().map(Chosen::label).collect(),
        settings: given.into_iter().map(|g| (g.name, g.value)).collect(),
        fitted,
        curves,
        warnings,
    })
}

/// What the file calls the recording, where it is one of those that the model was fitted to, or a copy of one.
fn own_name(path: &Path, file: &ModelFile, recording: &Path) -> Option<String> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut sources = file.recordings.iter().map(|r| folder.join(r));
    let source = sources.find(|source| same_file(source, recording) || same_content(source, recording))?;
    Some(source.file_name()?.to_string_lossy().shown().into_owned())
}

/// The model's values for a run; none where the fit knew the run by another name.
fn values_of(entry: &Entry, run: &str) -> Option<Vec<Given>> {
    let own = |of: &Option<String>| of.as_deref() == Some(run);
    let values = entry.parameters.iter().filter(|p| p.run.is_none() || own(&p.run));
    let given = values.map(|p| Given { name: p.name.clone(), run: None, value: p.value }).collect();
    entry.parameters.iter().any(|p| own(&p.run)).then_some(given)
}

fn curves(study: &Study, effects: &[Chosen], given: &[Given]) -> Result<Vec<Curve>> {
    let (rig, run, series) = (study.rig(), &study.runs()[0], &study.recordings()[0].recording.series);
    // One that drives the model is not among the run's sensors.
    let index = |name: &str| rig.sensors.iter().position(|s| s.name == name);
    let shown: Vec<usize> = run.sensors.iter().filter_map(|s| index(&s.sensor.name)).collect();
    let places = shown.iter().enumerate().flat_map(|(s, &i)| {
        series[i].time_s.iter().map(move |&time_s| Place { run: 0, gauge: Gauge::Sensor(s), time_s })
    });
    let modelled = as_recorded(rig, study.runs(), effects, given, None, Some(places.collect())).map_err(unshown)?;
    let density = run.conditions.water.density_kg_m3;
    let mut heads_m = modelled.values.into_iter();
    let beside = |sensor: usize| {
        let (time_s, measured) = (series[sensor].time_s.clone(), &series[sensor].value);
        let own = heads_m.by_ref().take(time_s.len());
        let model: Vec<f64> = own.map(|head_m| displayed(rig, &rig.sensors[sensor], density, head_m)).collect();
        let residual = measured.iter().zip(&model).map(|(measured, model)| measured - model).collect();
        Curve { sensor: rig.sensors[sensor].clone(), time_s, model, residual }
    };
    Ok(shown.into_iter().map(beside).collect())
}

/// The file was checked where it was read: what is left is a model that cannot be simulated, or values that an editor
/// has added.
fn unshown(error: AsRecordedError) -> Error {
    match error {
        AsRecordedError::Model(error) => error.into(),
        other => Error::Unshown(other),
    }
}
