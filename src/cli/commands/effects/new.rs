//! `surgescope effects new`: a commented start of an effect of one's own.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::say_text;
use crate::model::own::file::read;
use crate::rig::own_effects::{FOLDER, stem};
use crate::shown::Shown as _;
use crate::storage::output;

/// Write the start of an effect of your own, with a comment on each line.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Name of the effect, in lower-case letters, digits and '-', such as relief-valve.
    name: String,
    /// File to write; the folder `effects` belongs beside the rig file [default: effects/NAME.toml].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// A relief valve: it names every key.
const START: &str = include_str!("start.toml");

/// Runs it.
///
/// # Errors
/// A name that no effect may have, a file that is there already or cannot be written.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let path = args.output.clone().unwrap_or_else(|| usual(&args.name));
    write(&path, &args.name, &START.replace("NAME", &args.name))?;
    if json {
        say_document(json!({ "file": path.to_string_lossy() }))?;
    } else {
        let shown = path.shown();
        say_text!(format_args!("{shown} written. Change it, then: surgescope effects check {shown}\n"));
    }
    Ok(Outcome::Done)
}

/// Where an effect belongs, beside the rig file.
pub(crate) fn usual(name: &str) -> PathBuf {
    PathBuf::from(FOLDER).join(format!("{name}.toml"))
}

/// Whether an effect of this name can be written there.
///
/// # Errors
/// A name that no effect may have, a file that is called otherwise or is there already.
pub(crate) fn check(path: &Path, name: &str) -> Result<(), AnyError> {
    if crate::model::effects::CATALOGUE.iter().any(|e| e.name() == name) {
        return Err(format!("'{name}' is an effect of the catalogue: choose another name").into());
    }
    read(&START.replace("NAME", name), &path.shown(), name)?;
    if stem(path) != name {
        return Err(format!("the file of an effect has its name: write -o …/{name}.toml").into());
    }
    if path.exists() {
        return Err(format!("{} exists: choose another name, or move it away", path.shown()).into());
    }
    Ok(())
}

/// Writes the file of an effect where none stands.
///
/// # Errors
/// As [`check`]; a text that is no effect, a file that cannot be written.
pub(crate) fn write(path: &Path, name: &str, text: &str) -> Result<(), AnyError> {
    check(path, name)?;
    read(text, &path.shown(), name)?;
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|e| format!("cannot make the folder {}: {e}", folder.shown()))?;
    }
    output::write_new(path, text, false)
}
