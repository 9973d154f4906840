//! `surgescope calibrate`: the fitted model of one run, or of several at once.

use std::path::PathBuf;

use crate::cli::args::creep_prior::WALL;
use crate::cli::args::hold;
use crate::cli::args::recordings;
use crate::cli::args::search::Search;
use crate::cli::args::solver::SolverChoice;
use crate::cli::console::advice::Again;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::page::write_page;
use crate::cli::console::print::{say, say_text, tell, tell_warning};
use crate::cli::console::progress::shown;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::method::Method;
use crate::fit::search::options::Options;
use crate::fit::validate::conflict::warnings;
use crate::model::effects::{Chosen, parse_list};
use crate::report::Page;
use crate::report::calibration::text as table;
use crate::report::{Stage, title};
use crate::results::fit_record::now;
use crate::results::model_file::Entry;
use crate::shown::Shown as _;
use crate::storage::output;
use crate::study::hold::Hold;
use crate::study::models;

/// Fit a model to recordings of one rig.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings of one rig.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    /// Effects added to the base model, such as viscoelastic-wall:2; `none` for the base model alone.
    #[arg(long, value_name = "A,B", value_parser = parse_list)]
    effects: Option<::std::vec::Vec<Chosen>>,
    #[command(flatten)]
    solver: SolverChoice,
    #[command(flatten)]
    search: Search,
    #[command(flatten)]
    compare: crate::cli::args::misfit::CompareBy,
    /// Also fit this model, for comparison in tables and report; may be repeated.
    #[arg(long, value_name = "A,B", value_parser = parse_list)]
    against: Vec<::std::vec::Vec<Chosen>>,
    /// Hold parameters at these values, or keep them between two (NAME=LEAST:MOST); a parameter of each run is held in
    /// all runs. Name the recordings first.
    #[arg(long, value_name = "NAME=VALUE", value_parser = hold::held, num_args = 1..)]
    hold: Vec<Hold>,
    #[command(flatten)]
    creep: crate::cli::args::creep_prior::CreepPrior,
    #[command(flatten)]
    profiles: crate::cli::args::profile::Profiles,
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
    #[command(flatten)]
    output: crate::cli::args::fit_output::FitOutput,
    /// Save the fitted model in this model file as the current one; older models stay in it.
    #[arg(long, value_name = "MODEL.toml")]
    save: Option<PathBuf>,
    /// Finest grid of the fit.
    #[arg(long, value_name = "REACHES", default_value_t = Options::default().most_reaches, value_parser = crate::cli::args::values::reaches,
          allow_negative_numbers = true)]
    most_reaches: usize,
}

/// Runs it.
///
/// # Errors
/// Recordings that cannot be read or show no closure, effects that do not exist, a report that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    let from = args.search.from()?;
    let searched = args.compare.options(args.search.said().options(from.as_ref())?)?;
    output::check_apart(&[
        ("-o", args.output.path()),
        ("--save", args.save.as_deref()),
        ("--report", args.report.as_deref()),
    ])?;
    if let Some(path) = &args.report {
        output::check_report(path)?;
    }
    args.output.check()?;
    hold::check(args.hold.iter().map(|hold| &hold.name))?;
    let fixed = from.iter().flat_map(|model| &model.parameters).filter(|p| p.fixed).map(|p| p.name.as_str());
    let held = args.hold.iter().filter(|hold| hold.fixed()).map(|hold| hold.name.as_str()).chain(fixed);
    args.search.said().check_held(held.clone())?;
    args.profiles.check(held)?;
    args.sampling.check(&searched)?;
    let mut file =
        args.save.as_ref().map(|path| models::about(path, &args.recordings, args.rig.as_deref())).transpose()?;
    let rig_file = models::rig_of(args.rig.as_deref(), args.save.as_deref().zip(file.as_ref()));
    let mut study = recordings::open_without(&args.recordings, rig_file.as_deref(), &args.ignored.sensors)?;
    let mut effects = continued(args.effects.clone(), from.as_ref());
    // What is known is for the model asked for: those that it is compared with show what the recordings alone say.
    let mut priors = args.creep.priors(&study, &mut effects)?;
    if let Some(from) = from.as_ref().filter(|_| !args.creep.given()) {
        priors = from.priors();
    }
    let mut models = args.against.clone();
    models.push(args.solver.effects(&effects));
    let mut fits: Vec<(String, Fit)> = Vec::new();
    let held = hold::constraints(&study, &models, &args.hold);
    if let Some(last) = models.last() {
        hold::warn_beyond("--start", &study, last, args.search.started());
    }
    for (i, (effects, mut constraints)) in models.iter().zip(held).enumerate() {
        let last = i + 1 == models.len();
        if let Some(from) = &from {
            hold::settle(&mut constraints, from, &study, effects, last);
        }
        let priors = if last { priors.clone() } else { Vec::new() };
        let options = Options { most_reaches: args.most_reaches, constraints, priors, ..searched.clone() };
        let mut fit = shown(&mut study, "", |study| {
            let calibrate = study.calibrate(effects).options(options.clone());
            if last && args.solver.quasi_2d() { calibrate.quasi_2d() } else { calibrate }.run()
        })?;
        if last {
            args.profiles.apply(&study, &mut fit, &options)?;
            args.sampling.apply(&mut study, &mut fit, options.seed)?;
        }
        fits.push((title(effects), fit));
    }
    args.search.said().check(fits.iter().flat_map(|(_, fit)| &fit.parameters).map(|p| p.name.as_str()))?;
    let stages: Vec<Stage> = fits.iter().map(|(title, fit)| Stage { title: title.clone(), fit }).collect();
    let Some((_, last)) = fits.last() else { return Ok(Outcome::Done) };
    let warned = warnings(last, study.runs());
    warned.iter().for_each(|warning| tell_warning!("{warning}"));
    let record = study.record(last, &warned);
    if json {
        say_document(&record)?;
    } else {
        say_text!(table::calibration(&stages));
        if last.effects.iter().any(|c| c.effect.name() == WALL)
            && let Some(constraint) = study.rig().constraint_in_words()
        {
            say!("\n{constraint}.");
        }
    }
    args.output.write(&record)?;
    if let (Some(path), Some(file)) = (&args.save, &mut file) {
        file.append(last, &why(last), None, now());
        models::save(file, path)?;
        tell!("model {} in {}", file.in_force, path.shown());
    }
    // last, so that a page that cannot be written costs no result
    if let Some(path) = &args.report {
        let again = Again::of(&args.recordings, args.rig.as_deref(), &args.ignored.sensors, &args.hold);
        write_page(path, &study, Page { stages, warnings: &warned, ..Page::of(study.rig()) }, &again)?;
        tell!("report: {}", path.shown());
    }
    Ok(Outcome::Done)
}

/// The effects asked for, with the numbers of elements of the model given with `--from` where none are given; without
/// any, that model's.
fn continued(asked: Option<Vec<Chosen>>, from: Option<&Entry>) -> Vec<Chosen> {
    let known = from.map_or(Vec::new(), Entry::chosen);
    let Some(mut asked) = asked else { return known };
    for c in asked.iter_mut().filter(|c| c.elements.is_none()) {
        let own = known.iter().find(|k| k.effect.name() == c.effect.name()).and_then(|k| k.elements);
        if let Some(n) = own {
            *c = c.with_elements(n);
        }
    }
    asked
}

/// Why a fit is kept in a file of models.
fn why(fit: &Fit) -> String {
    let how = match fit.method {
        Method::LeastSquares => "calibrated".to_owned(),
        method => format!("calibrated, {}", method.name()),
    };
    if fit.converged { how } else { how + ", no optimum reached" }
}
