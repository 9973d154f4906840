//! `surgescope add`: the model in force with one effect more, refitted.

use std::path::PathBuf;
use std::time::Instant;

use crate::cli::args::recordings;
use crate::cli::args::values::one_effect;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell, tell_warning};
use crate::cli::console::progress::{refit, shown};
use crate::model::effects::Chosen;
use crate::report::models::{document, text};
use crate::report::text::number::{duration, error_m, grouped};
use crate::study::{Grown, models};

/// Add an effect to the current model and refit.
///
/// The result becomes the current model of the file; `surgescope undo` takes it back.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The effect, such as leak or viscoelastic-wall:2.
    #[arg(value_name = "EFFECT", value_parser = one_effect)]
    effect: Chosen,
    /// The model file that `calibrate --save` or `diagnose --apply` wrote.
    #[arg(value_name = "MODEL.toml")]
    file: PathBuf,
}

/// Runs it.
///
/// # Errors
/// A file or a recording that cannot be read, an effect that the model has already or that excludes another, a fit that
/// fails.
pub fn run(args: Args, json: bool) -> CommandResult {
    let mut at = models::open(&args.file)?;
    recordings::warn_of(&at.study);
    let before = at.file.current().clone();
    let label = args.effect.label();
    if let Some(why) = args.effect.effect.impossible(at.study.rig()) {
        tell_warning!("{label}: {why}; whatever it explains belongs to another effect");
    }
    let began = Instant::now();
    let start = refit(&mut at, "current model, ")?;
    let Grown { fit, evidence, .. } = shown(&mut at.study, "", |study| study.grow(&start, &args.effect))?;
    tell!("done in {}", duration(began.elapsed().as_secs_f64()));
    at.append(&fit, &format!("{label} added"), Some(evidence))?;
    if json {
        say_document(document(&at.file))?;
    } else {
        say_text!(text(&at.file));
        let (rmse_m, _) = fit.pooled();
        say!(
            "\n{label} added: RMSE {} m → {} m, ln odds {}{}",
            error_m(before.rmse_m),
            error_m(rmse_m),
            grouped(evidence),
            if evidence > 0.0 { "" } else { "; the data do not support it: `surgescope undo` takes it back" }
        );
    }
    Ok(Outcome::Done)
}
