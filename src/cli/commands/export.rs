//! `surgescope export`: a recording becomes a time series, or gets a model beside it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::args::recordings;
use crate::cli::console::document::{document, say_document};
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell, tell_warning};
use crate::cli::console::progress::{busy, shown};
use crate::number::significant;
use crate::shown::Shown as _;
use crate::storage::with_model::{Curve, write_with_model};
use crate::storage::{Summary, disk, export_csv_file, read};
use crate::study::beside::{Beside, beside};
use crate::study::models;

/// Turn a recording into a time series (CSV), or add a model to it (MCAP).
///
/// A recording with a model is a copy that has two channels more for each pressure sensor, in its unit: the modelled
/// value, and the residual (measured − modelled). The run's own values are those of the fit; of a recording that the
/// model was not fitted to, they are read from its signals, as `predict` does.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording.
    mcap: PathBuf,
    /// Write a copy of the recording with the current model of this model file beside the data.
    #[arg(long, value_name = "MODEL.toml")]
    with_model: Option<PathBuf>,
    /// Time series to write, or with --with-model the recording; must not exist.
    #[arg(short, long, value_name = "CSV|MCAP")]
    output: PathBuf,
}

/// Runs it.
///
/// # Errors
/// A recording or a model that cannot be read, a file that exists or cannot be written.
pub fn run(args: &Args, json: bool) -> CommandResult {
    match &args.with_model {
        Some(model) => with_model(args, model, json),
        None => time_series(args, json),
    }
}

fn time_series(args: &Args, json: bool) -> CommandResult {
    let recording = busy(&args.mcap, || read(&args.mcap))?;
    busy(&args.output, || export_csv_file(&recording, &args.output))?;
    let summary = Summary::of(&recording);
    if json {
        say_document(document(json!({ "file": args.output, "source": args.mcap }), &summary)?)?;
    } else {
        say!("{}: {summary}", args.output.shown());
    }
    let gaps: usize = summary.sensors.iter().map(|s| s.gaps).sum();
    if gaps > 0 {
        tell!("note: a CSV file cannot mark gaps: the recording has {gaps}, which show as missing lines only");
    }
    Ok(Outcome::Done)
}

fn with_model(args: &Args, model: &Path, json: bool) -> CommandResult {
    if !args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) {
        let name = args.output.shown();
        return Err(format!("{name} must end in .mcap: with a model beside it, a recording stays one").into());
    }
    if args.mcap.metadata().is_ok_and(|about| !about.is_file() && !about.is_dir()) {
        let name = args.mcap.shown();
        return Err(format!(
            "{name} is no file, and a recording is read twice to get a model: save it to a file first"
        )
        .into());
    }
    disk::refuse_existing(&args.output)?;
    let file = models::load(model)?;
    let rig = models::rig_of(None, Some((model, &file)));
    let mut study = recordings::open(std::slice::from_ref(&args.mcap), rig.as_deref())?;
    let found = shown(&mut study, "", |study| beside(study, &args.mcap, model, &file))?;
    for warning in &found.warnings {
        tell_warning!("{warning}");
    }
    busy(&args.output, || write_with_model(&args.mcap, &args.output, about(model, &found), &found.curves))?;
    let own_values = own_values(&found);
    if json {
        let sensors = found.curves.iter().map(|c| {
            let (sensor, unit) = (&c.sensor.name, c.sensor.unit.symbol);
            json!({ "sensor": sensor, "unit": unit, "samples": c.time_s.len(), "residual_rms": rms(&c.residual) })
        });
        let document = json!({
            "file": args.output, "source": args.mcap, "model": model, "effects": found.effects, "own_values": own_values,
            "sensors": sensors.collect::<Vec<_>>(), "warnings": found.warnings,
        });
        say_document(document)?;
        return Ok(Outcome::Done);
    }
    let effects = if found.effects.is_empty() { "the base model".to_owned() } else { found.effects.join(", ") };
    say!("{}: the recording with {effects}; the run's own values are {own_values}", args.output.shown());
    for Curve { sensor, residual, .. } in &found.curves {
        let (name, unit, samples) = (&sensor.name, sensor.unit, residual.len());
        say!("{name:<10} residual {} {unit} rms over {samples} samples", significant(rms(residual), 3));
    }
    Ok(Outcome::Done)
}

/// What the copy says of its model.
fn about(model: &Path, found: &Beside) -> BTreeMap<String, String> {
    let text = |key: &str, value: String| (key.to_owned(), value);
    let settings = found.settings.iter().map(|(name, value)| text(name, value.to_string()));
    let file = model.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let effects = found.effects.join(",");
    let head = [text("model_file", file), text("effects", effects), text("own_values", own_values(found).to_owned())];
    settings.chain(head).collect()
}

fn own_values(found: &Beside) -> &'static str {
    if found.fitted { "fitted" } else { "read from its signals" }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
