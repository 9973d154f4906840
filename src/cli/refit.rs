//! `surgescope refit`: the model in force once more, after a person has edited its file.

use std::path::PathBuf;

use super::calibrate::progress_bar;
use super::{CommandResult, Outcome, models};
use crate::report::models::{json as models_json, text};

/// Fit the model in force again, from the values in its file, with what is held (`fixed = true`) and bounded there.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file of models.
    #[arg(value_name = "MODEL.toml")]
    file: PathBuf,
}

/// Runs it.
///
/// # Errors
/// A file or a recording that cannot be read, a parameter that the model does not have, a fit that fails.
pub fn run(args: Args, json: bool) -> CommandResult {
    let mut at = models::open(&args.file)?;
    let before = at.file.current().clone();
    let held: Vec<&str> = before.parameters.iter().filter(|p| p.fixed).map(|p| p.name.as_str()).collect();
    let why = match held.as_slice() {
        [] => "refitted".to_owned(),
        [one] => format!("refitted with {one} held"),
        more => format!("refitted with {} values held", more.len()),
    };
    let bar = progress_bar();
    let fit = before.refit(&at.rig, &at.runs, &at.options, &|p| bar.set_message(p.stage.clone()));
    bar.finish_and_clear();
    at.file.append(&fit?, &why, None, models::now());
    models::save(&mut at.file, &at.path)?;
    if json {
        super::say!("{}", models_json(&at.file)?);
    } else {
        super::say_text!(text(&at.file));
        super::say!("\n{why}: RMSE {:.4} m → {:.4} m", before.rmse_m, at.file.current().rmse_m);
    }
    Ok(Outcome::Done)
}
