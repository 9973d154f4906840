//! `surgescope import`: a time series becomes a recording.

use std::path::PathBuf;

use chrono::DateTime;
use serde_json::json;

use super::{CommandResult, Outcome};
use crate::log::{ImportOptions, Summary, import_csv_with, write};
use crate::rig::Rig;

/// Arguments of `import`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The time series: `time_s`, then one column a sensor, by its name and in its unit.
    csv: PathBuf,
    /// The rig it was made on; goes into the recording.
    #[arg(long, value_name = "RIG")]
    rig: PathBuf,
    /// The recording to make; must not exist.
    #[arg(short, long, value_name = "MCAP")]
    output: PathBuf,
    /// Wall-clock time of time 0, such as 2026-03-14T09:26:53Z; unknown if not given.
    #[arg(long, value_name = "RFC3339", value_parser = unix_ns)]
    start: Option<u64>,
    /// Sensors of the rig that were not recorded, and so have no column.
    #[arg(long, value_name = "SENSOR", value_delimiter = ',')]
    without: Vec<String>,
}

/// Runs it.
///
/// # Errors
/// See [`import_csv_with`] and [`write`].
pub fn run(args: Args, json: bool) -> CommandResult {
    let rig = Rig::load(&args.rig)?;
    let options = ImportOptions { start_unix_ns: args.start.unwrap_or_default(), without: args.without };
    let recording = import_csv_with(&args.csv, &rig, &options)?;
    write(&args.output, &recording)?;
    let summary = Summary::of(&recording);
    if json {
        super::say!("{}", super::document(json!({ "file": args.output, "source": args.csv }), &summary)?);
    } else {
        super::say!("{}: {summary}", args.output.display());
    }
    Ok(Outcome::Done)
}

fn unix_ns(text: &str) -> Result<u64, String> {
    let time = DateTime::parse_from_rfc3339(text).map_err(|e| format!("{e}; write it like 2026-03-14T09:26:53Z"))?;
    let ns = time.timestamp_nanos_opt().and_then(|ns| u64::try_from(ns).ok());
    ns.ok_or_else(|| "must lie between 1970 and 2262".into())
}
