//! `surgescope recover`: a recording cut off by a crash becomes a whole one.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::console::document::{document, say_document};
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell};
use crate::cli::console::progress::busy;
use crate::shown::Shown as _;
use crate::storage::recover;

/// Save what is in a recording that was cut off.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recording that was cut off or damaged; it stays as it is.
    torn: PathBuf,
    /// Recording to write; must not exist.
    #[arg(short, long, value_name = "MCAP")]
    output: PathBuf,
}

/// Runs it; [`Outcome::DataLost`] if something was lost.
///
/// # Errors
/// See [`recover`](crate::storage::recover).
pub fn run(args: Args, json: bool) -> CommandResult {
    let recovery = busy(&args.torn, || recover(&args.torn, &args.output))?;
    if json {
        say_document(document(json!({ "file": args.output, "source": args.torn }), &recovery)?)?;
    } else {
        say!("{}: {}", args.output.shown(), recovery.kept);
        match recovery.last_good_time_s {
            _ if recovery.whole => say!("nothing was lost"),
            Some(time) => say!("last good sample: {time} s"),
            None => say!("no sample was saved"),
        }
    }
    for loss in &recovery.lost {
        tell!("lost: {loss}");
    }
    Ok(if recovery.whole { Outcome::Done } else { Outcome::DataLost })
}
