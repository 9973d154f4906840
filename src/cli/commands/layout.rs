//! `surgescope layout`: the plots with which other programs open a recording.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::output;
use crate::storage::viewer::plots::plots;
use crate::storage::viewer::{foxglove, plotjuggler};

/// Write the plots with which Foxglove or PlotJuggler opens a recording.
///
/// There is a plot for each unit of the pressure sensors, and for each other quantity.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The rig whose sensors are plotted.
    #[arg(long, value_name = "RIG")]
    rig: PathBuf,
    /// Add what `export --with-model` writes: modelled values in the plots of pressure, and plots of the residuals.
    #[arg(long)]
    with_model: bool,
    /// Layout to write: for Foxglove where the name ends in .json, for PlotJuggler where it ends in .xml.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Replace an existing file, unless it is the rig or a recording.
    #[arg(long)]
    overwrite: bool,
}

/// Runs it.
///
/// # Errors
/// A rig that cannot be read, a name that ends otherwise, a file that may not or cannot be written.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let path = &args.output;
    let ends = |end: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(end));
    let (program, write): (_, fn(&_) -> String) = match () {
        () if ends("json") => ("Foxglove", foxglove::layout),
        () if ends("xml") => ("PlotJuggler", plotjuggler::layout),
        () => return Err(wrong_name(path).into()),
    };
    let rig = Rig::load(&args.rig)?;
    if output::same_file(path, &args.rig) {
        return Err(format!("{} is the rig file: choose another name for the layout", path.shown()).into());
    }
    let plots = plots(&rig, args.with_model);
    output::write_new(path, write(&plots), args.overwrite)?;
    if json {
        say_document(json!({ "file": path, "program": program, "plots": plots }))?;
    } else {
        say!("{}: {} plots for {program}", path.shown(), plots.len());
    }
    Ok(Outcome::Done)
}

fn wrong_name(path: &Path) -> String {
    format!("{} must end in .json for Foxglove, or in .xml for PlotJuggler: name the layout so", path.shown())
}
