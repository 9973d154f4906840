//! `surgescope accept`: the model of a run becomes the one that later runs of its rig are fitted with.

use std::path::PathBuf;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say;
use crate::report::history::text::RunDocument;
use crate::results::history::{Finding, HistoryError, Index, Value};
use crate::results::model_file::ModelFile;
use crate::shown::Shown as _;
use crate::study::models;
use crate::watch::evaluate::{acceptance, place};
use crate::watch::start::units;

/// Accept a run's model as the model of its rig.
///
/// Later runs of the rig start from it and are diagnosed against it. It is the current model in the run's
/// NAME.model.toml; to accept another one, edit that file first, or use `surgescope add` or `surgescope undo`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording, fitted by `surgescope watch` or `record --calibrate`.
    #[arg(value_name = "MCAP")]
    recording: PathBuf,
}

/// Runs it.
///
/// # Errors
/// A recording that the index of its folder does not know or that failed, a fit that cannot be read.
pub fn run(args: Args, json: bool) -> CommandResult {
    let (folder, file) = place(&args.recording);
    Index::read(&folder)?;
    let mut index = Index::open(&folder)?;
    let run = index.named(&file)?.ok_or_else(|| HistoryError::UnknownRun(args.recording.shown().into_owned()))?;
    let Some(finding) = &run.finding else {
        let why = run.error.clone().unwrap_or_else(|| run.state.name().to_owned());
        return Err(format!("{} has no model to accept: {why}", run.file).into());
    };
    let models = models::load(&folder.join(&finding.model_file))?;
    let finding = with_model(&folder.join(&run.file), finding, &models)?;
    let accepted = acceptance(&run.file, &models, "by hand")?;
    index.done(&run, &run.rig, &finding, Some(&accepted))?;
    let now = index.run(run.id)?;
    if json {
        say_document(RunDocument::from(&now))?;
    } else {
        say!("{}: {} accepted for rig '{}'", now.file.shown(), models.current().name, now.rig);
    }
    Ok(Outcome::Done)
}

/// A run's finding with the values of the model in force.
fn with_model(
    recording: &std::path::Path,
    finding: &Finding,
    models: &ModelFile,
) -> Result<Finding, Box<dyn std::error::Error + Send + Sync>> {
    let entry = models.current();
    if entry.effects == finding.effects && entry.rmse_m == finding.rmse_m {
        return Ok(finding.clone());
    }
    let rig = crate::storage::read(recording)?.rig;
    let units = units(&rig, &entry.chosen(), finding.temperature_degc);
    let unit = |name: &str| {
        let known = finding.parameters.iter().find(|v| v.name == name).map(|v| v.unit.clone());
        known.or_else(|| units.iter().find(|(n, _)| n == name).map(|(_, u)| (*u).to_owned())).unwrap_or_default()
    };
    let value = |p: &crate::results::model_file::Value| Value {
        name: p.name.clone(),
        value: p.value,
        standard_error: p.standard_error,
        unit: unit(&p.name),
        own: p.run.is_some(),
    };
    Ok(Finding {
        effects: entry.effects.clone(),
        rmse_m: entry.rmse_m,
        noise_m: entry.noise_m,
        parameters: entry.parameters.iter().map(value).collect(),
        line: format!("{}; accepted by hand: {}", finding.line.split("; ").next().unwrap_or_default(), entry.name),
        ..finding.clone()
    })
}
