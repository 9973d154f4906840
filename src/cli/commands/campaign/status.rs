//! `surgescope campaign status`: what is done, what has failed and why, what is left.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::campaign::folder::Folder;
use crate::campaign::status::{retry, status};
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell};
use crate::report::text::number::duration;

/// Show what is done, what has failed and why, and the time left.
///
/// Exit code 0: all tasks are done; 1: some are missing or have failed.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The campaign's folder.
    dir: PathBuf,
    /// Let the next run try again what has failed.
    #[arg(long)]
    retry: bool,
}

/// Failed tasks that are listed for one reason; --json lists all.
const LISTED: usize = 3;

/// Runs it.
///
/// # Errors
/// A folder without a campaign, files that cannot be read.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let folder = Folder::open(&args.dir)?;
    if args.retry {
        tell!("{} failed tasks are missing again: `surgescope campaign run` tries them", retry(&folder)?);
    }
    let now = status(&folder)?;
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
