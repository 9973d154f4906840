//! `surgescope predict`: a fitted model on recordings that it was not fitted to.

use std::path::PathBuf;

use crate::cli::args::own_values::Own;
use crate::cli::console::advice::Again;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::page::write_page;
use crate::cli::console::print::{say_text, tell, tell_warning};
use crate::report::prediction::text::{ahead, document, text};
use crate::report::{Page, Stage};
use crate::shown::Shown as _;
use crate::storage::output;

/// Predict recordings that a model was not fitted to.
///
/// They may have another flow, closure or sensor. Parameters that all runs share are held at the model's values. A
/// run's own values (velocity, head, closing time, zeros) are read from its signals up to the first return of the wave;
/// everything after that is predicted.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model file; its current model predicts.
    #[arg(value_name = "MODEL.toml")]
    model: PathBuf,
    /// The recordings.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    own: Own,
    /// Write a page with charts of measurement and prediction; replaces an older page of that name, and no other file.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// A model or a recording that cannot be read, another line than the model's, a report that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    if let Some(path) = &args.report {
        output::check_report(path)?;
    }
    let (study, predicted) = args.own.predicted(&args.model, &args.recordings)?;
    for warning in &predicted.warnings {
        tell_warning!("{warning}");
    }
    if json {
        say_document(document(&predicted.prediction, &predicted.warnings))?;
    } else {
        say_text!(text(&predicted.prediction));
    }
    if let Some(path) = &args.report {
        let stage = Stage { title: "prediction".into(), fit: &predicted.prediction.fit };
        let prediction = Some(&predicted.prediction);
        let again = Again::of(&args.recordings, args.own.rig.as_deref(), &[], &[]);
        write_page(path, &study, Page { stages: vec![stage], prediction, ..Page::of(study.rig()) }, &again)?;
        tell!("report: {}", path.shown());
    }
    Ok(if ahead(&predicted.prediction).error_m.is_finite() { Outcome::Done } else { Outcome::No })
}
