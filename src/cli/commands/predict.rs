//! `surgescope predict`: a fitted model on recordings that it was not fitted to.

use std::path::{Path, PathBuf};

use crate::cli::args::recordings;
use crate::cli::commands::calibrate::{progress_bar, write_page};
use crate::cli::{CommandResult, Outcome};
use crate::fit::data::run_data::RunData;
use crate::fit::search::options::{Options, Progress};
use crate::fit::validate::predict::{Prediction, predict};
use crate::model::constraint::Constraint;
use crate::report::Stage;
use crate::report::html::page::Page;
use crate::report::prediction::text::{ahead, document, text};
use crate::results::model_file::ModelFile;
use crate::rig::Rig;
use crate::rig::compare::differences;
use crate::storage::output;
use crate::study::models;
use crate::study::open;
use crate::study::open::Loaded;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// Difference of water temperatures from which wave speed and creep are others, K.
const OTHER_TEMPERATURE: f64 = 2.0;

/// Let a fitted model predict recordings that it was not fitted to: another flow, another closure, another sensor.
///
/// What the runs of a rig share is held as the model has it. A run's own values (velocity, head, closing time, zeros) are read from its
/// signals up to the first return of the wave; all after that is predicted.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file of models (`calibrate --save`); the one in force predicts.
    #[arg(value_name = "MODEL.toml")]
    model: PathBuf,
    /// The recordings.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    own: Own,
    /// Write a page with charts of measurement and prediction; an older page of that name is replaced, no other file.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
}

/// What is known of the predicted runs better than from their signals.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Own {
    /// The closing time of the runs, where it is known; otherwise it is read from the first rise.
    #[arg(long, value_name = "SECONDS", value_parser = crate::cli::args::values::positive, allow_negative_numbers = true)]
    closing_time: Option<f64>,
    /// Other values of the runs that are known, such as initial_velocity_m_s=0.4.
    #[arg(long, value_name = "NAME=VALUE", value_parser = crate::cli::args::values::setting, num_args = 1..)]
    hold: Vec<(String, f64)>,
    /// A rig to read the recordings with, instead of the one that is stored in them.
    #[arg(long, value_name = "RIG")]
    pub rig: Option<PathBuf>,
    /// Predict although the line (pipes, supply, fluid) is another than the model's.
    #[arg(long)]
    other_rig: bool,
}

/// A prediction with what there is to say about it.
pub struct Predicted {
    /// The recordings.
    pub loaded: Vec<Loaded>,
    /// The same as a fit takes them.
    pub runs: Vec<RunData>,
    /// Their rig.
    pub rig: Rig,
    /// The prediction.
    pub prediction: Prediction,
    /// What to know about it.
    pub warnings: Vec<String>,
}

/// Runs it.
///
/// # Errors
/// A model or a recording that cannot be read, another line than the model's, a report that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    if let Some(path) = &args.report {
        output::check_report(path)?;
    }
    let predicted = predicted(&args.model, &args.recordings, &args.own)?;
    for warning in &predicted.warnings {
        crate::cli::tell!("warning: {warning}");
    }
    if json {
        crate::cli::say!("{}", serde_json::to_string(&document(&predicted.prediction, &predicted.warnings))?);
    } else {
        crate::cli::say_text!(text(&predicted.prediction));
    }
    if let Some(path) = &args.report {
        let stage = Stage { title: "prediction".into(), fit: &predicted.prediction.fit };
        let prediction = Some(&predicted.prediction);
        write_page(path, &predicted.loaded, Page { stages: vec![stage], prediction, ..Page::of(&predicted.rig) })?;
        crate::cli::tell!("report: {}", path.display());
    }
    Ok(if ahead(&predicted.prediction).error_m.is_finite() { Outcome::Done } else { Outcome::No })
}

/// What the model in force in a file predicts of recordings.
///
/// # Errors
/// See [`run`].
pub fn predicted(model: &Path, recordings: &[PathBuf], own: &Own) -> Result<Predicted, AnyError> {
    crate::cli::args::hold::check(&own.hold)?;
    let file = models::load(model)?;
    let loaded = recordings::load(recordings, own.rig.as_deref())?;
    let rig = loaded[0].recording.rig.clone();
    let runs = open::runs(&loaded);
    let known = file.current().known();
    let mut warnings = origin(model, &file, &rig, &loaded, recordings, own.other_rig)?;
    let mut held = own.hold.clone();
    if let Some(seconds) = own.closing_time {
        held.retain(|(name, _)| name != "closing_time_s");
        held.push(("closing_time_s".to_owned(), seconds));
    }
    if let Some((name, _)) = held.iter().find(|(name, _)| known.shared.iter().any(|p| p.name == *name)) {
        return Err(format!("{name} is the model's, not the run's: to change it, edit {}", model.display()).into());
    }
    let held: Vec<Constraint> = (runs.iter())
        .flat_map(|run| held.iter().map(|(name, v)| (Some(run.file.clone()), name.clone(), *v)))
        .map(|(run, name, value)| Constraint { name, run, lower: value, upper: value })
        .collect();
    let bar = progress_bar();
    let shown =
        |p: &Progress| bar.set_message(format!("{}: {} reaches, iteration {}", p.stage, p.reaches, p.iteration));
    let prediction = predict(&rig, &runs, &known, &held, &Options::default(), &shown);
    bar.finish_and_clear();
    let prediction = prediction?;
    warnings.extend(crate::fit::validate::conflict::conflicts(&prediction.fit, &runs));
    Ok(Predicted { loaded, runs, rig, prediction, warnings })
}

/// Compares where a model comes from with what it is to predict.
fn origin(
    path: &Path,
    file: &ModelFile,
    rig: &Rig,
    loaded: &[Loaded],
    recordings: &[PathBuf],
    other_rig: bool,
) -> Result<Vec<String>, AnyError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let sources: Vec<PathBuf> = file.recordings.iter().map(|r| folder.join(r)).collect();
    let mut warnings: Vec<String> = recordings
        .iter()
        .filter(|r| sources.iter().any(|s| output::same_file(s, r)))
        .map(|r| format!("{} is one of the recordings that the model was fitted to", r.display()))
        .collect();
    let own_rig = file.rig.as_ref().map(|r| folder.join(r));
    let first = sources.first().map(|s| recordings::load(std::slice::from_ref(s), own_rig.as_deref()));
    let Some(Ok(first)) = first else {
        warnings.push(format!(
            "the recordings that {} was fitted to cannot be read: whether its rig was this one is not known",
            path.display()
        ));
        return Ok(warnings);
    };
    let found = differences(&first[0].recording.rig, rig);
    if !found.line.is_empty() {
        let what = found.line.join("; ");
        if !other_rig {
            return Err(format!(
                "the model is of another line than these recordings ({what}): a wave speed or creep does not carry over; say --other-rig to \
                 predict all the same"
            )
            .into());
        }
        warnings.push(format!("the model is of another line: {what}"));
    }
    if !found.sensors.is_empty() {
        warnings.push(format!("sensors differ from the model's rig: {}", found.sensors.join("; ")));
    }
    for run in loaded {
        let (here, there) = (run.features.temperature_degc, first[0].features.temperature_degc);
        if (here - there).abs() > OTHER_TEMPERATURE {
            warnings.push(format!(
                "{}: water of {here:.1} °C, the model's had {there:.1} °C: wave speed and creep depend on it",
                run.file
            ));
        }
    }
    Ok(warnings)
}
