//! `surgescope explain`: what would explain what a model leaves.

use std::path::{Path, PathBuf};

use crate::cli::args::recordings;
use crate::cli::commands::effects::new::{check, usual, write};
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell};
use crate::cli::console::progress::{refit, shown};
use crate::diagnose::rest::draft::{draft, draft_of_pulsation};
use crate::model::effects::{Chosen, name_of, parse_list};
use crate::report::diagnosis::rest;
use crate::shown::Shown as _;
use crate::study::models;

/// Find what would explain what no effect of the catalogue explains.
///
/// The forcing that is missing is solved for without a shape given: a head of the supply against time, a flow at the
/// valve or out of the pipe, a head added at a sensor, a strain of the wall. The places are ranked by evidence. The
/// most probable comes first, with those that the recordings cannot tell from it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A model file, whose current model is explained; or recordings of one rig.
    #[arg(required = true, value_name = "MODEL.toml|MCAP")]
    of: Vec<PathBuf>,
    /// Effects of the model of recordings, such as viscoelastic-wall:2; `none` for the base model alone.
    #[arg(long, value_name = "A,B", value_parser = parse_list)]
    effects: Option<::std::vec::Vec<Chosen>>,
    /// Read the recordings with this rig instead of the stored one.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Draft an effect of your own of this name from the law that the best explanation follows; `diagnose` then weighs
    /// it.
    #[arg(long, value_name = "NAME")]
    as_effect: Option<String>,
    /// File of that effect; the folder `effects` belongs beside the rig file [default: effects/NAME.toml].
    #[arg(short, long, value_name = "FILE", requires = "as_effect")]
    output: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// A file that cannot be read, effects that do not exist, a model that cannot be simulated.
pub fn run(args: Args, json: bool) -> CommandResult {
    let drafted_to = args.as_effect.map(|name| (args.output.unwrap_or_else(|| usual(&name)), name));
    if let Some((path, name)) = &drafted_to {
        check(path, name)?;
    }
    let is_model = |path: &Path| path.extension().is_some_and(|e| e == "toml");
    let (fit, found) = match args.of.as_slice() {
        [file] if is_model(file) => {
            if args.effects.is_some() || args.rig.is_some() {
                return Err("a model file has its own effects and rig: leave --effects and --rig out".into());
            }
            let mut at = models::open(file)?;
            recordings::warn_of(&at.study);
            let fit = refit(&mut at, "current model, ")?;
            let found = shown(&mut at.study, "", |study| study.explain(&fit))?;
            (fit, found)
        }
        several if several.iter().any(|path| is_model(path)) => {
            return Err("give one model file, or recordings".into());
        }
        several => {
            let mut study = recordings::open(several, args.rig.as_deref())?;
            let effects = args.effects.unwrap_or_default();
            let fit = shown(&mut study, "", |study| study.calibrate(&effects[..]).run())?;
            let found = shown(&mut study, "", |study| study.explain(&fit))?;
            (fit, found)
        }
    };
    if json {
        say_document(rest::document(&found)?)?;
    } else if found.is_empty() {
        say!("Nothing is left to explain: what the {} leaves is noise.", name_of(&fit.effects));
    } else {
        say_text!(rest::text(&found));
        say!("An effect of the catalogue may explain it as well: `surgescope diagnose` tries those first.");
    }
    let Some((path, name)) = drafted_to else { return Ok(Outcome::Done) };
    let of = |one| draft_of_pulsation(&name, one).or_else(|| draft(&name, one)).map(|text| (one, text));
    let Some((one, text)) = found.iter().find_map(of) else {
        tell!("no effect was drafted: nothing that was found follows a law");
        return Ok(Outcome::No);
    };
    write(&path, &name, &text)?;
    tell!("{} written, from: {}. Next: surgescope effects check {}", path.shown(), one.says, path.shown());
    Ok(Outcome::Done)
}
