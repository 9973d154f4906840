//! `surgescope model`: what a file of models holds.

use std::path::PathBuf;

use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text};
use crate::report::models::{json as models_json, text};
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
        say!("{}", models_json(&file)?);
    } else {
        say_text!(text(&file));
    }
    Ok(Outcome::Done)
}
