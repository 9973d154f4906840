//! `surgescope export`: a recording becomes a time series.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::console::document::document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell};
use crate::cli::console::progress::busy;
use crate::shown::Shown as _;
use crate::storage::{Summary, export_csv_file, read};

/// Turn a recording into a time series (CSV).
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording.
    mcap: PathBuf,
    /// Time series to write; must not exist.
    #[arg(short, long, value_name = "CSV")]
    output: PathBuf,
}

/// Runs it.
///
/// # Errors
/// See [`read`] and [`export_csv_file`].
pub fn run(args: Args, json: bool) -> CommandResult {
    let recording = busy(&args.mcap, || read(&args.mcap))?;
    busy(&args.output, || export_csv_file(&recording, &args.output))?;
    let summary = Summary::of(&recording);
    if json {
        say!("{}", document(json!({ "file": args.output, "source": args.mcap }), &summary)?);
    } else {
        say!("{}: {summary}", args.output.shown());
    }
    let gaps: usize = summary.sensors.iter().map(|s| s.gaps).sum();
    if gaps > 0 {
        tell!("note: a CSV file cannot mark gaps: the recording has {gaps}, which show as missing lines only");
    }
    Ok(Outcome::Done)
}
