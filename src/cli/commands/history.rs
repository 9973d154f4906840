//! `surgescope history`: how a rig's parameters drift over runs and temperatures.

use std::path::{Path, PathBuf};

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say_text, tell};
use crate::report::advice::quoted;
use crate::report::history::html::{html, svg};
use crate::report::history::text::{csv, document, text};
use crate::results::history::{History, Index};
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::output;

/// Show how a rig's wave speed and creep drift over runs and temperatures.
///
/// Reads the index that `surgescope watch` and `record --calibrate` keep beside the recordings. Drift is a weighted
/// regression over the runs whose model lacks nothing, per run and per kelvin, with 95% intervals.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The rig's name or rig file; optional if the index holds one rig only.
    #[arg(value_name = "RIG")]
    rig: Option<String>,
    /// Folder of the recordings.
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    folder: PathBuf,
    /// Write the runs, one per line; replaces an older such table, and no other file.
    #[arg(long, value_name = "CSV")]
    csv: Option<PathBuf>,
    /// Write a picture of each parameter over runs and over temperature.
    #[arg(long, value_name = "SVG")]
    svg: Option<PathBuf>,
    /// Write a page with plots and tables; replaces an older page of that name, and no other file.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// A folder without an index, a rig that it does not know, a file that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    let folder = args.rig.as_ref().filter(|rig| Path::new(rig).is_dir());
    let index = match (Index::read(&args.folder), folder) {
        (Ok(index), None) => index,
        (Ok(index), Some(rig)) if index.rigs()?.contains(rig) => index,
        (_, Some(folder)) => {
            return Err(format!(
                "{} is a folder, and RIG is the name of a rig or its file: write `surgescope history --folder {}`",
                folder.shown(),
                quoted(&folder.shown())
            )
            .into());
        }
        (Err(error), None) => return Err(error.into()),
    };
    let rig = match args.rig {
        Some(rig) => name_of(&rig)?,
        None => match index.rigs()?.as_slice() {
            [one] => one.clone(),
            known => {
                return Err(format!("the index holds {} rigs ({}): name one", known.len(), known.join(", ")).into());
            }
        },
    };
    let history = History::of(&index, &rig)?;
    if json {
        say_document(document(&history))?;
    } else {
        say_text!(text(&history));
    }
    if let Some(path) = &args.csv {
        output::check_result(path, "run,file,recorded_utc")?;
        output::write(path, &csv(&history)?)?;
    }
    if let Some(path) = &args.svg {
        output::check_picture(path)?;
        output::write(path, &svg(&history))?;
    }
    if let Some(path) = &args.report {
        output::check_report(path)?;
        output::write(path, &html(&history))?;
        tell!("report: {}", path.shown());
    }
    Ok(Outcome::Done)
}

/// A rig's name as given, or that in a rig file.
fn name_of(rig: &str) -> Result<String, crate::rig::RigError> {
    let path = Path::new(rig);
    if path.is_file() { Rig::load(path).map(|r| r.name) } else { Ok(rig.to_owned()) }
}
