//! `surgescope campaign plan`: from a plan file to a folder of tasks.

use std::path::PathBuf;

use serde_json::json;

use crate::campaign::plan::plan;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell};
use crate::shown::Shown as _;

/// Turn a plan into tasks: each combination of recording, model, method and seed is one.
///
/// The plan is a TOML file; its patterns are relative to its folder. A task's name is a hash of all that decides its
/// result, with the checksum of each input. Planning the same again changes nothing.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plan.
    #[arg(value_name = "PLAN.toml")]
    plan: PathBuf,
    /// Folder of the campaign; made where it does not exist.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Copy the inputs into the folder, so that it can be moved to another machine [default: name them by path and
    /// checksum].
    #[arg(long)]
    copy: bool,
}

/// Runs it.
///
/// # Errors
/// As [`plan`].
pub fn run(args: &Args, json: bool) -> CommandResult {
    let planned = plan(&args.plan, &args.output, args.copy)?;
    if planned.doubles > 0 {
        tell!("{} combinations were others over again and are planned once", planned.doubles);
    }
    if planned.was_there {
        tell!("the folder holds this campaign already: nothing was changed");
    }
    if json {
        say_document(json!({ "tasks": planned.tasks, "folder": args.output }))?;
    } else {
        say!("{}: {} tasks", args.output.shown(), planned.tasks);
    }
    Ok(Outcome::Done)
}
