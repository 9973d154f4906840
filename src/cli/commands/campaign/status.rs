//! `surgescope campaign status`: what is done, what has failed and why, what is left.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::ValueEnum;

use crate::campaign::folder::Folder;
use crate::campaign::program::put_aside;
use crate::campaign::status::{retry, status};
use crate::cli::commands::campaign::others::warn_of_others;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell};
use crate::report::text::number::duration;
use crate::shown::Shown as _;

/// Show what is done, what has failed and why, and the time left.
///
/// Exit code 0: all tasks are done; 1: some are missing or have failed.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The campaign's folder.
    dir: PathBuf,
    /// Let the next run try again what has failed; with `=other-program`, do again what another version or build of the
    /// program has found.
    #[arg(long, value_enum, value_name = "WHAT", num_args = 0..=1, require_equals = true, default_missing_value = "failed")]
    retry: Option<Retry>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Retry {
    /// Tasks that have failed.
    Failed,
    /// Tasks whose results another version or build of the program has found; they are kept in results/aside.
    OtherProgram,
}

/// Failed tasks that are listed for one reason; --json lists all.
const LISTED: usize = 3;

/// Runs it.
///
/// # Errors
/// A folder without a campaign, files that cannot be read.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let folder = Folder::open(&args.dir)?;
    match args.retry {
        None => {}
        Some(Retry::Failed) => {
            tell!("{} failed tasks are missing again: `surgescope campaign run` tries them", retry(&folder)?);
        }
        Some(Retry::OtherProgram) => match put_aside(&folder)? {
            0 => tell!("no result is of another program: nothing was changed"),
            tasks => tell!(
                "{tasks} tasks that another program had done are missing again: `surgescope campaign run` does them. Their results stand in {}",
                folder.results().join("aside").shown()
            ),
        },
    }
    let now = status(&folder)?;
    warn_of_others(&folder, &now.other_programs);
    if json {
        say_document(&now)?;
    } else {
        say!("{} of {} tasks done, {} failed, {} missing", now.done, now.tasks, now.failed, now.missing);
        match (now.missing, now.time_left_s) {
            (0, _) => {}
            (_, None) => say!("{} at work", now.at_work),
            (_, Some(left)) if now.at_work > 0 => say!("{} at work, about {} left", now.at_work, duration(left)),
            (_, Some(left)) => say!("none at work; about {} of one core left", duration(left)),
        }
        let mut reasons: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for failure in &now.failures {
            reasons.entry(&failure.reason).or_default().push(format!("{}  {}", failure.task, failure.what));
        }
        for (reason, tasks) in reasons {
            say!("\n{} failed: {reason}", tasks.len());
            for task in tasks.iter().take(LISTED) {
                say!("  {task}");
            }
            if tasks.len() > LISTED {
                say!("  … and {} more", tasks.len() - LISTED);
            }
        }
    }
    Ok(if now.done == now.tasks { Outcome::Done } else { Outcome::No })
}
