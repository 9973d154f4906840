//! `surgescope cross-validate`: whether a model predicts what it was not fitted to.

use std::path::PathBuf;

use clap::ValueEnum;

use crate::cli::args::hold;
use crate::cli::args::recordings;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say_text;
use crate::cli::console::progress::progress_bar;
use crate::fit::search::options::Options;
use crate::fit::validate::cross_validate::{By, CrossValidation, cross_validate};
use crate::model::effects::{Chosen, parse_list};
use crate::report::prediction::cross_validation::{document, text};
use crate::report::title;
use crate::study::hold::Hold;

/// Leave out a sensor, a run or the end of the record, and predict it.
///
/// The model is fitted to the rest each time.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings of one rig.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    /// Effects of the model.
    #[arg(long, value_name = "A,B", default_value = "none", value_parser = parse_list)]
    effects: ::std::vec::Vec<Chosen>,
    /// Another model to compare it with.
    #[arg(long, value_name = "A,B", value_parser = parse_list)]
    against: Option<::std::vec::Vec<Chosen>>,
    /// What to leave out [default: all that the recordings allow].
    #[arg(long, value_enum, value_name = "KIND,KIND", value_delimiter = ',')]
    by: Vec<Kind>,
    /// Hold parameters at these values, or keep them between two (NAME=LEAST:MOST); a parameter of each run is held in
    /// all runs. Name the recordings first.
    #[arg(long, value_name = "NAME=VALUE", value_parser = hold::held, num_args = 1..)]
    hold: Vec<Hold>,
    /// Read the recordings with this rig instead of the stored one.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Finest grid of the fits.
    #[arg(long, value_name = "REACHES", default_value_t = Options::default().most_reaches, value_parser = crate::cli::args::values::reaches,
          allow_negative_numbers = true)]
    most_reaches: usize,
}

/// What is left out at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// One pressure sensor after the other.
    Sensors,
    /// One recording after the other.
    Runs,
    /// The last 40% of each record.
    Time,
}

/// Runs it.
///
/// # Errors
/// Recordings that cannot be read or show no closure, effects that do not exist, nothing that could be left out.
pub fn run(args: Args, json: bool) -> CommandResult {
    hold::check(args.hold.iter().map(|hold| &hold.name))?;
    let study = recordings::open(&args.recordings, args.rig.as_deref())?;
    let by: Vec<By> = [(Kind::Sensors, By::Sensors), (Kind::Runs, By::Runs), (Kind::Time, By::Time)]
        .into_iter()
        .filter(|(kind, _)| args.by.is_empty() || args.by.contains(kind))
        .map(|(_, by)| by)
        .collect();
    let asked: Vec<Vec<Chosen>> = std::iter::once(args.effects.clone()).chain(args.against.clone()).collect();
    let held = hold::constraints(&study, &asked, &args.hold);
    let bar = progress_bar();
    let mut models: Vec<CrossValidation> = Vec::new();
    for (effects, constraints) in asked.iter().zip(held) {
        let options = Options { constraints, most_reaches: args.most_reaches, ..Options::default() };
        let title = title(effects);
        let watcher = |what: &str| bar.set_message(format!("{title}: {what}"));
        models.push(cross_validate(study.rig(), study.runs(), effects, &by, &options, &watcher)?);
    }
    bar.finish_and_clear();
    if models.iter().all(|m| m.folds.is_empty()) {
        let why = models.first().map_or(String::new(), |m| m.skipped.join("; "));
        return Err(format!("nothing can be left out of these recordings: {why}; try --by time").into());
    }
    if json {
        say_document(document(&models))?;
    } else {
        say_text!(text(&models));
    }
    Ok(Outcome::Done)
}
