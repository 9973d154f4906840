//! `surgescope campaign child`: the process in which a runner has its tasks done. Nobody types it.

use std::io::{stdin, stdout};
use std::path::PathBuf;

use crate::campaign::child;
use crate::cli::console::outcome::{CommandResult, Outcome};

/// Do the tasks that standard input names; for `campaign run`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The campaign's folder.
    dir: PathBuf,
}

/// Runs it.
///
/// # Errors
/// An output that nobody reads.
pub fn run(args: &Args) -> CommandResult {
    // a runner that is killed takes its children with it
    #[cfg(any(target_os = "linux", target_os = "android"))]
    nix::sys::prctl::set_pdeathsig(nix::sys::signal::Signal::SIGKILL)?;
    child::keep_panics();
    child::serve(&args.dir, stdin().lock(), stdout().lock())?;
    Ok(Outcome::Done)
}
