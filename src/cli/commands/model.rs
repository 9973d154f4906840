//! `surgescope model`: what a file of models holds.

use std::path::PathBuf;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say_text;
use crate::report::models::{document, text};
use crate::study::models;

/// Show the models in a file: their errors, which one is current, its parameters.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model file.
    #[arg(value_name = "MODEL.toml")]
    file: PathBuf,
}

/// Runs it.
///
/// # Errors
/// A file that cannot be read.
pub fn run(args: Args, json: bool) -> CommandResult {
    let file = models::load(&args.file)?;
    if json {
        say_document(document(&file))?;
    } else {
        say_text!(text(&file));
    }
    Ok(Outcome::Done)
}
