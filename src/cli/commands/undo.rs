//! `surgescope undo`: a step back in a file of models.

use std::path::PathBuf;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say_text;
use crate::report::models::{document, text};
use crate::shown::Shown as _;
use crate::study::models;

/// Go back to the previous model; nothing is deleted.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model file.
    #[arg(value_name = "MODEL.toml")]
    file: PathBuf,
}

/// Runs it.
///
/// # Errors
/// A file that cannot be read or written, a model in force that grew out of none.
pub fn run(args: Args, json: bool) -> CommandResult {
    let mut file = models::load(&args.file)?;
    if !file.step_back() {
        return Err(format!(
            "model {} in {} is the first one: there is no step back from it",
            file.in_force,
            args.file.shown()
        )
        .into());
    }
    models::save(&mut file, &args.file)?;
    if json {
        say_document(document(&file))?;
    } else {
        say_text!(text(&file));
    }
    Ok(Outcome::Done)
}
