//! `surgescope rig show`: a drawing of the rig.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say_text, tell};
use crate::report::rig_drawing;
use crate::rig::{Rig, SensorKind};
use crate::shown::Shown as _;
use crate::storage::output;

/// Draw a rig to scale: in the terminal, or as SVG.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The rig file (TOML).
    rig: PathBuf,
    /// Write the drawing to this file.
    #[arg(long, value_name = "SVG")]
    svg: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// A rig that cannot be read, a drawing that cannot be written.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let rig = Rig::load(&args.rig)?;
    if let Some(path) = &args.svg {
        if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("svg")) {
            return Err(format!("{}: the drawing must be named .svg", path.shown()).into());
        }
        output::write(path, &rig_drawing::svg(&rig))?;
        tell!("{}: the rig to scale", path.shown());
    }
    if json {
        let sensors = rig.sensors.iter().filter(|s| s.kind == SensorKind::Pressure);
        let document = json!({
            "rig": args.rig, "name": rig.name, "length_m": rig.length_m(), "svg": args.svg,
            "pressure_sensors": sensors.map(|s| json!({ "name": s.name, "position_m": s.position_m })).collect::<Vec<_>>(),
        });
        say_document(document)?;
    } else if args.svg.is_none() {
        say_text!(rig_drawing::text(&rig));
    }
    Ok(Outcome::Done)
}
