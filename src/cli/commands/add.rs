//! `surgescope add`: the model in force with one effect more, refitted.

use std::path::PathBuf;
use std::time::Instant;

use crate::cli::commands::calibrate::progress_bar;
use crate::cli::{CommandResult, Outcome};
use crate::diagnose::grow;
use crate::model::effects::{Chosen, parse_list};
use crate::report::models::{json as models_json, text};
use crate::study::models;

/// Add an effect to the model in force of a file of models, refit, and keep the result as the model in force.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The effect, such as leak or viscoelastic-wall:2.
    #[arg(value_name = "EFFECT", value_parser = one_effect)]
    effect: Chosen,
    /// The file of models, as `calibrate --save` or `diagnose --apply` writes it.
    #[arg(value_name = "MODEL.toml")]
    file: PathBuf,
}

fn one_effect(text: &str) -> Result<Chosen, String> {
    let mut list = parse_list(text).map_err(|e| e.to_string())?;
    match (list.pop(), list.is_empty()) {
        (Some(one), true) => Ok(one),
        _ => Err("name one effect; `surgescope effects` lists them".to_owned()),
    }
}

/// Runs it.
///
/// # Errors
/// A file or a recording that cannot be read, an effect that the model has already or that excludes another, a fit that fails.
pub fn run(args: Args, json: bool) -> CommandResult {
    let mut at = models::open(&args.file)?;
    for doubt in &at.doubts {
        crate::cli::tell!("warning: {doubt}");
    }
    let before = at.file.current().clone();
    let label = args.effect.label();
    // The list as a whole says what stands against the newcomer.
    parse_list(&before.effects.iter().cloned().chain([label.clone()]).collect::<Vec<_>>().join(","))?;
    if let Some(why) = args.effect.effect.impossible(&at.rig) {
        crate::cli::tell!("warning: {label}: {why}; whatever it absorbs belongs to another effect");
    }
    let began = Instant::now();
    let bar = progress_bar();
    let shown = |message: &str| bar.set_message(message.to_owned());
    let grown = before
        .refit(&at.rig, &at.runs, &at.options, &|p| shown(&format!("the model in force, {}", p.stage)))
        .and_then(|start| grow(&at.rig, &at.runs, &start, &args.effect, &at.options, &shown));
    bar.finish_and_clear();
    let (fit, evidence) = grown?;
    crate::cli::tell!("{:.1} s", began.elapsed().as_secs_f64());
    at.file.append(&fit, &format!("{label} added"), Some(evidence), models::now());
    models::save(&mut at.file, &at.path)?;
    if json {
        crate::cli::say!("{}", models_json(&at.file)?);
    } else {
        crate::cli::say_text!(text(&at.file));
        let (rmse_m, _) = fit.pooled();
        crate::cli::say!(
            "\n{label} added: RMSE {:.4} m → {rmse_m:.4} m, evidence {evidence:.1}{}",
            before.rmse_m,
            if evidence > 0.0 { "" } else { "; the data do not ask for it: `surgescope undo` takes it back" }
        );
    }
    Ok(Outcome::Done)
}
