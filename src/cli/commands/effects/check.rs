//! `surgescope effects check`: does an effect of one's own vanish where it should, and does refinement converge?

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say_text;
use crate::model::effects::Chosen;
use crate::model::own::compiled;
use crate::report::effects::check::Checked;
use crate::report::effects::example::{Example, demo_rig};
use crate::report::effects::json::{about, described, example as example_json};
use crate::report::effects::text::table;
use crate::rig::Rig;
use crate::rig::own_effects::{stem, text};
use crate::storage::output;

/// Check an effect of your own: where it vanishes nothing changes, finer grids converge; plots what it does.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The effect's file, effects/NAME.toml.
    file: PathBuf,
    /// Rig to check it on [default: the rig of the demonstration].
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Write a chart of its influence on a record; replaces an older picture of that name, and no other file.
    #[arg(long, value_name = "SVG")]
    svg: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// A file that cannot be read or is faulty, a rig that cannot be simulated, a chart that cannot be written.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let name = stem(&args.file);
    let text = text(&args.file)?;
    let effect = compiled(&name, &text)?;
    let mut rig = args.rig.as_deref().map_or_else(demo_rig, |path: &Path| Rig::load(path))?;
    rig.own_effects.insert(name, text);
    let chosen = Chosen::of(effect);
    let checked = Checked::on(&rig, &chosen)?;
    let example = Example::on(&rig, &chosen)?;
    if let Some(path) = &args.svg {
        output::check_picture(path)?;
        output::write(path, &example.chart().to_svg(900.0, 420.0))?;
    }
    if json {
        let mut document = about(effect);
        document["parameters"] = example.parameters.iter().map(described).collect();
        document["check"] = json!(checked);
        document["example"] = example_json(&example);
        say_document(document)?;
    } else {
        say_text!(format_args!("{checked}\nParameters, with their start values and bounds on rig '{}':\n", rig.name));
        say_text!(table(&example.parameters));
        say_text!(format_args!("\n{example}"));
    }
    Ok(if checked.holds() { Outcome::Done } else { Outcome::No })
}
