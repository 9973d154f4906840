//! `surgescope refit`: the model in force once more, after a person has edited its file.

use std::path::PathBuf;

use crate::cli::args::recordings;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text};
use crate::cli::console::progress::{refit, shown};
use crate::report::models::{document, text};
use crate::report::text::number::error_m;
use crate::study::models;

/// Fit the current model again after you have edited its file.
///
/// The fit starts from the values in the file, holds those with `fixed = true` and keeps to the bounds there. Where it
/// ends above the noise, it is also tried from the signals, and the better end is kept.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model file.
    #[arg(value_name = "MODEL.toml")]
    file: PathBuf,
}

/// Runs it.
///
/// # Errors
/// A file or a recording that cannot be read, a parameter that the model does not have, a fit that fails.
pub fn run(args: Args, json: bool) -> CommandResult {
    let mut at = models::open(&args.file)?;
    recordings::warn_of(&at.study);
    let before = at.file.current().clone();
    let why = before.refit_words();
    let fit = refit(&mut at, "")?;
    let fit = shown(&mut at.study, "", |study| study.or_from_signals(fit))?;
    at.append(&fit, &why, None)?;
    if json {
        say_document(document(&at.file))?;
    } else {
        say_text!(text(&at.file));
        say!("\n{why}: RMSE {} m → {} m", error_m(before.rmse_m), error_m(at.file.current().rmse_m));
    }
    Ok(Outcome::Done)
}
