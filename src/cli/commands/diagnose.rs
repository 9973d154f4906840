//! `surgescope diagnose`: where the model fails, and which effect is missing.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::args::hold;
use crate::cli::args::recordings;
use crate::cli::console::advice::Again;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::page::write_page;
use crate::cli::console::print::{say, say_text, tell};
use crate::cli::console::progress::shown;
use crate::diagnose::Verdict;
use crate::fit::outcome::fit::Fit;
use crate::fit::search::options::Options;
use crate::fit::validate::conflict::warnings;
use crate::fit::validate::energy::energy_of;
use crate::model::effects::{Chosen, name_of, parse_list};
use crate::report::Page;
use crate::report::calibration::{posterior, text as table};
use crate::report::diagnosis::text as diagnosis;
use crate::report::text::number::{error_m, times};
use crate::report::{Stage, title};
use crate::results::fit_record::now;
use crate::shown::Shown as _;
use crate::signal::faults::{SensorFault, in_words};
use crate::storage::output;
use crate::study::Study;
use crate::study::error::Error;
use crate::study::hold::Hold;
use crate::study::models;
use crate::study::until_done::{Step, UntilDone};

/// Find out where a model fails and which effect it lacks.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings of one rig.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    /// Effects of the start model, such as viscoelastic-wall:2; `none` for the base model alone.
    #[arg(long, value_name = "A,B", value_parser = parse_list)]
    effects: Option<::std::vec::Vec<Chosen>>,
    /// Add the missing effect and diagnose again, until nothing is missing or no effect explains the rest.
    #[arg(long)]
    until_done: bool,
    /// Add the missing effect to the current model of this model file. Without --effects, that model is the start
    /// model. A missing file is created.
    #[arg(long, value_name = "MODEL.toml")]
    apply: Option<PathBuf>,
    /// Hold parameters of the start model at these values, or keep them between two (NAME=LEAST:MOST); a parameter of
    /// each run is held in all runs. Name the recordings first.
    #[arg(long, value_name = "NAME=VALUE", value_parser = hold::held, num_args = 1..)]
    hold: Vec<Hold>,
    #[command(flatten)]
    creep: crate::cli::args::creep_prior::CreepPrior,
    #[command(flatten)]
    sampling: crate::cli::args::posterior::Sampling,
    #[command(flatten)]
    ignored: crate::cli::args::ignore::Ignored,
    /// Read the recordings with this rig instead of the stored one.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Write a page with charts of measurement, models and residuals; replaces an older page of that name, and no other
    /// file.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
    /// Finest grid of the fits.
    #[arg(long, value_name = "REACHES", default_value_t = Options::default().most_reaches, value_parser = crate::cli::args::values::reaches,
          allow_negative_numbers = true)]
    most_reaches: usize,
}

/// The answer where a sensor is at fault: before any physics, for an effect would only stand in for the fault.
fn faulty(file: &str, faults: &[SensorFault], effects: &[Chosen], json: bool) -> CommandResult {
    let what = in_words(faults);
    if json {
        say_document(json!({
            "verdict": "unknown-effect", "sensor_faults": faults, "candidates": [], "next_test": what,
            "start": { "effects": effects.iter().map(Chosen::label).collect::<Vec<_>>(), "rmse_m": null, "noise_m": null },
        }))?;
    } else {
        say!("No diagnosis of {file}: {what}.");
    }
    Ok(Outcome::No)
}

/// Runs it.
///
/// # Errors
/// Recordings that cannot be read or show no closure, effects that do not exist, a report that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    let effects = args.effects.clone().unwrap_or_default();
    match diagnosed(args, json) {
        Err(error) => match error.downcast_ref() {
            Some(Error::Faulty { file, faults, .. }) => faulty(file, faults, &effects, json),
            _ => Err(error),
        },
        done => done,
    }
}

fn diagnosed(args: Args, json: bool) -> CommandResult {
    if let Some(path) = &args.report {
        output::check_report(path)?;
        if args.apply.as_ref() == Some(path) {
            return Err(format!("{} cannot be both model file and report", path.shown()).into());
        }
    }
    hold::check(args.hold.iter().map(|hold| &hold.name))?;
    let mut file =
        args.apply.as_ref().map(|path| models::about(path, &args.recordings, args.rig.as_deref())).transpose()?;
    let rig_file = models::rig_of(args.rig.as_deref(), args.apply.as_deref().zip(file.as_ref()));
    let mut study = recordings::open_without(&args.recordings, rig_file.as_deref(), &args.ignored.sensors)?;
    let mut options = Options { most_reaches: args.most_reaches, ..Options::default() };
    let mut effects = args.effects.clone().unwrap_or_default();
    if let Some(file) = file.as_ref().filter(|f| !f.models.is_empty()) {
        let current = file.current();
        options.constraints = current.constraints();
        options.priors = current.priors();
        if args.effects.as_ref().is_some_and(|asked| title(asked) != title(&current.chosen())) {
            return Err(format!(
                "the current model is the {}, not that of --effects: leave --effects out, or choose another file",
                current.name
            )
            .into());
        }
        effects = current.chosen();
    }
    if args.creep.given() {
        options.priors = args.creep.priors(&study, &mut effects)?;
    }
    let held = hold::constraints(&study, std::slice::from_ref(&effects), &args.hold);
    // The first that concerns a parameter counts: the command line goes before the file.
    options.constraints.splice(0..0, held.into_iter().flatten());
    // what was added to the first model of a file has to hold its own like what is added now
    let start = match file.as_ref().filter(|f| !f.models.is_empty()) {
        Some(file) => file.root().chosen(),
        None => effects.clone(),
    };
    let mut search = UntilDone::grown_from(start, effects, options);
    let mut unsaved = None;
    while let Some(step) = shown(&mut study, "", |study| search.step(study))? {
        match (step, search.diagnoses(), search.models()) {
            (Step::Diagnosed, [.., found], _) => {
                if let Some(file) = file.as_mut().filter(|f| f.models.is_empty()) {
                    file.append(&found.start, "the start of a diagnosis", None, now());
                }
                if let (Some(fit), Some(file)) = (found.answer(), &mut file) {
                    file.append(fit, &found.reason(), Some(found.answer_evidence()), now());
                }
                if args.until_done && !json {
                    say_text!(diagnosis::text(found));
                }
                if found.verdict == Verdict::MissingEffect && found.answer().is_none() {
                    tell!("the missing effect could not be fitted to the whole record, so nothing was added");
                }
            }
            (Step::TakenOut(gone), _, [.., smaller]) => {
                let gone = gone.iter().map(Chosen::label).collect::<Vec<_>>().join(", ");
                tell!("no longer needed and taken out: {gone}");
                if let Some(file) = &mut file {
                    file.append(smaller, &format!("diagnosed: no longer needed: {gone}"), None, now());
                }
            }
            _ => {}
        }
        if let (Some(path), Some(file)) = (&args.apply, &mut file) {
            // each as soon as it is there: a later one may be interrupted
            unsaved = models::save(file, path).err();
        }
        if !args.until_done || unsaved.is_some() {
            break;
        }
    }
    let (mut models, diagnoses) = (search.models().to_vec(), search.diagnoses());
    let Some(last) = diagnoses.last() else { return Ok(Outcome::Done) };
    if search.is_cut_short() {
        tell!("stopped after {} models", models.len());
    }
    if !json {
        say_text!(if args.until_done { staircase(&models) } else { diagnosis::text(last) });
    }
    let sampled = models.last_mut().filter(|_| args.sampling.is_wanted());
    if let Some(fit) = sampled {
        args.sampling.apply(&mut study, fit, Options::default().seed)?;
        if !json {
            let (model, intervals) = (name_of(&fit.effects), table::parameters(fit));
            say_text!(format!("\nThe final model, {model}:\n{intervals}\n{}", posterior::text(fit)));
        }
    }
    if json {
        let mut document = diagnosis::value(diagnoses, &faults_of(&study))?;
        if let Some(fit) = models.last().filter(|_| args.sampling.is_wanted()) {
            document["final"] = serde_json::to_value(study.record(fit, &warnings(fit, study.runs())))?;
        }
        say_document(document)?;
    }
    if let (Some(path), Some(file), None) = (&args.apply, &file, &unsaved) {
        tell!("model {} is now current in {}", file.in_force, path.shown());
    }
    // last, so that a page that cannot be written costs no result
    if let Some(path) = &args.report {
        let stages = models.iter().map(|fit| Stage { title: title(&fit.effects), fit }).collect();
        let energy = models.last().and_then(|fit| energy_of(study.rig(), study.runs(), fit, 0).ok().flatten());
        let again = Again::of(&args.recordings, args.rig.as_deref(), &args.ignored.sensors, &args.hold)
            .kept_in(args.apply.as_deref());
        write_page(path, &study, Page { stages, diagnoses, energy, ..Page::of(study.rig()) }, &again)?;
        tell!("report: {}", path.shown());
    }
    unsaved.map_or(Ok(Outcome::Done), |error| Err(error.into()))
}

/// What is odd about sensors that a model can be fitted to all the same.
fn faults_of(study: &Study) -> Vec<SensorFault> {
    study.recordings().iter().flat_map(|l| l.faults.iter().cloned()).collect()
}

/// The errors of the models, one after the other.
fn staircase(models: &[Fit]) -> String {
    let mut out = String::from("\nModels, one after the other:\n");
    for fit in models {
        let (rmse_m, noise_m) = fit.pooled();
        let title = title(&fit.effects);
        out += &format!("  {:>7} m  {:>6} × noise  {title}\n", error_m(rmse_m), times(rmse_m, noise_m));
    }
    out
}
