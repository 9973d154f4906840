//! `surgescope campaign submit`: writes the job of an engine that schedules, and starts it.

use std::path::PathBuf;

use crate::cli::console::outcome::CommandResult;

/// Write the job of a scheduler.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The campaign's folder.
    dir: PathBuf,
}

/// Runs it.
pub fn run(_args: &Args, _json: bool) -> CommandResult {
    Err("not yet".into())
}
