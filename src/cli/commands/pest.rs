//! `surgescope pest`: a calibration taken along, as a problem of PEST, PEST++ and pyEMU.

use std::error::Error;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::args::hold;
use crate::cli::args::recordings;
use crate::cli::args::search::Search;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell};
use crate::cli::console::progress::shown;
use crate::fit::numeric::least_squares::Problem as _;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::search::from_signals::numbered;
use crate::fit::search::options::Options;
use crate::model::Model;
use crate::model::effects::{Chosen, parse_list};
use crate::report::pest::case::Case;
use crate::report::pest::control::{control, readme};
use crate::report::pest::form::file;
use crate::shown::Shown as _;
use crate::storage::output;
use crate::study::Study;
use crate::study::hold::Hold;

type AnyError = Box<dyn Error + Send + Sync>;

/// Write a calibration as a problem for PEST, PEST++ or pyEMU.
///
/// The folder is ready to run, with `surgescope simulate` as the model.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings of one rig; they are copied into the folder.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    /// Effects added to the base model, such as viscoelastic-wall:2; `none` for the base model alone.
    #[arg(long, value_name = "A,B", default_value = "none", value_parser = parse_list)]
    effects: ::std::vec::Vec<Chosen>,
    /// Folder to write; must be empty or not exist.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Write into a folder with files, over those of an older problem.
    #[arg(long)]
    overwrite: bool,
    /// Fit first, and let PEST start from the fitted values.
    #[arg(long)]
    fitted: bool,
    #[command(flatten)]
    search: Search,
    /// Fix parameters at these values, or keep them between two (NAME=LEAST:MOST); a parameter of each run is fixed in
    /// all runs. Name the recordings first.
    #[arg(long, value_name = "NAME=VALUE", value_parser = hold::held, num_args = 1..)]
    hold: Vec<Hold>,
    #[command(flatten)]
    creep: crate::cli::args::creep_prior::CreepPrior,
    /// Read the recordings with this rig instead of the stored one.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Use every Nth sample as an observation [default: chosen for at most 20000 observations].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    /// Reaches of the model's grid [default: those of the fit with --fitted, otherwise 128, or more if short pipes need
    /// them].
    #[arg(long, value_name = "REACHES", value_parser = crate::cli::args::values::reaches, allow_negative_numbers = true)]
    reaches: Option<usize>,
}

/// More observations than these are thinned out unless somebody says otherwise: PEST keeps one matrix of them by the
/// parameters.
const MOST_OBSERVATIONS: usize = 20_000;
/// Reaches before a fit has chosen any: twice where a fit's refinement begins.
const REACHES: usize = 128;
/// What the copy of a rig file is called.
const RIG_FILE: &str = "rig.toml";

/// Runs it.
///
/// # Errors
/// Recordings that cannot be read, a model that cannot be simulated, a folder that may not or cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    check_folder(&args.output, args.overwrite)?;
    hold::check(args.hold.iter().map(|hold| &hold.name))?;
    let from = args.search.from()?;
    args.search.said().check_held(args.hold.iter().filter(|hold| hold.fixed()).map(|hold| hold.name.as_str()))?;
    let searched = args.search.said().options(from.as_ref())?;
    let mut study = recordings::open(&args.recordings, args.rig.as_deref())?;
    let mut effects = args.effects.clone();
    let priors = args.creep.priors(&study, &mut effects)?;
    let mut constraints = hold::constraints(&study, std::slice::from_ref(&effects), &args.hold).remove(0);
    if let Some(from) = &from {
        hold::settle(&mut constraints, from, &study, &effects, true);
    }
    let options = Options { constraints, priors, ..searched };
    let fit =
        args.fitted.then(|| shown(&mut study, "", |study| study.calibrate(&effects).options(options.clone()).run()));
    let fit = fit.transpose()?;
    let (rig, runs) = (study.rig(), study.runs());
    let effects = numbered(rig, runs, &effects, &options)?;
    let model = Model::new(rig, &runs[0].conditions.water, fit.as_ref().map_or(&effects, |f| &f.effects))
        .constrained(&options.constraints)
        .starting_at(&options.starts_at)
        .informed(&options.priors);
    let mut window = Window { reaches: REACHES, horizon_s: f64::INFINITY, stride: 1 };
    let mut problem = FitProblem::new(&model, runs, window);
    problem.validate_constraints(&options.constraints)?;
    args.search.said().check(problem.parameters.iter().map(|p| p.name.as_str()))?;
    let values = fit.as_ref().map_or_else(|| problem.values(&problem.start()), |f| f.values());
    let shared = &values[..model.shared.len()];
    let default = || model.fitting_reaches(shared, REACHES.max(model.least_reaches(shared)));
    window.reaches = args.reaches.or(fit.as_ref().map(|f| f.reaches)).unwrap_or_else(default);
    window.stride = args.every.map_or(problem.samples().div_ceil(MOST_OBSERVATIONS), |n| n as usize).max(1);
    problem.set_window(window);
    let files = file_names(&args.recordings);
    let command = command(&files, args.rig.is_some(), &model.effects, window.reaches);
    let case = Case::new(&problem, rig, &values, &files, &command);
    let phi = phi(&problem, &values)?;
    write(&args, &case, &study, &files, window.stride)?;
    let size = case.size();
    if json {
        let document = json!({
            "folder": args.output, "control_file": file::CONTROL, "command": command, "fitted": args.fitted,
            "parameters": size.parameters, "observations": size.observations, "priors": size.priors,
            "every": window.stride, "reaches": window.reaches, "phi": phi,
        });
        say_document(document)?;
    } else {
        say!(
            "{}: {} parameters, {} observations, {} priors, objective function {phi:.6}",
            args.output.join(file::CONTROL).shown(),
            size.parameters,
            size.observations,
            size.priors
        );
    }
    if window.stride > 1 {
        tell!(
            "one of {} samples is an observation: standard errors will be {:.1} times those of all samples",
            window.stride,
            (window.stride as f64).sqrt()
        );
    }
    Ok(Outcome::Done)
}

/// The objective function of PEST: without what is known of parameters that it does not move.
fn phi(problem: &FitProblem, values: &[f64]) -> Result<f64, AnyError> {
    let residuals = problem.residuals(&problem.variables(values))?;
    let (samples, rest) = residuals.split_at(problem.samples());
    let known: Vec<bool> = problem.parameters.iter().filter(|p| p.prior.is_some()).map(|p| p.lower < p.upper).collect();
    let (priors, meters) = rest.split_at(known.len());
    let moved = priors.iter().zip(&known).filter(|(_, moved)| **moved).map(|(r, _)| r);
    Ok(samples.iter().chain(moved).chain(meters).map(|r| r * r).sum())
}

/// The model command. It names its files alone, which stand in the folder.
fn command(files: &[String], own_rig: bool, effects: &[Chosen], reaches: usize) -> String {
    let labels = effects.iter().map(Chosen::label).collect::<Vec<_>>().join(",");
    let effects = match labels.as_str() {
        "" => "none".to_owned(),
        // The name of a sensor may be anything.
        l if l.chars().all(|c| c.is_ascii_alphanumeric() || ",:@/_.-".contains(c)) => labels,
        _ => format!("\"{labels}\""),
    };
    let rig = if own_rig { format!(" --rig {RIG_FILE}") } else { String::new() };
    format!(
        "surgescope simulate --recording {}{rig} --effects {effects} --set reaches={reaches} --values {} --times {} -o {}",
        files.join(" "),
        file::VALUES,
        file::MEASURED,
        file::MODELLED
    )
}

/// What recordings are called in the folder: as they are called, where that is one word and says which.
fn file_names(paths: &[PathBuf]) -> Vec<String> {
    let own: Vec<Option<String>> = paths
        .iter()
        .map(|p| {
            let name = p.file_name()?.to_str()?.to_owned();
            let word = name.chars().all(|c| c.is_ascii_alphanumeric() || "._-".contains(c)) && !name.starts_with('-');
            word.then_some(name)
        })
        .collect();
    let unique = |name: &String| own.iter().flatten().filter(|n| n.eq_ignore_ascii_case(name)).count() == 1;
    if own.iter().all(|n| n.as_ref().is_some_and(unique)) {
        return own.into_iter().flatten().collect();
    }
    (1..=paths.len()).map(|r| format!("run{r}.mcap")).collect()
}

fn check_folder(folder: &Path, overwrite: bool) -> Result<(), AnyError> {
    let name = folder.shown();
    match std::fs::read_dir(folder).map(|mut entries| entries.next().is_some()) {
        Ok(true) if !overwrite => Err(format!("{name} is not empty: choose another folder, or add --overwrite").into()),
        Ok(_) => Ok(()),
        Err(_) if folder.exists() => Err(format!("{name} is not a folder: choose another name").into()),
        Err(_) => Ok(()),
    }
}

/// All files of the folder.
fn write(args: &Args, case: &Case, study: &Study, files: &[String], every: usize) -> Result<(), AnyError> {
    let folder = &args.output;
    std::fs::create_dir_all(folder).map_err(|e| format!("cannot make the folder {}: {e}", folder.shown()))?;
    let copy = |from: &Path, name: &str| -> Result<(), AnyError> {
        let to = folder.join(name);
        if output::same_content(from, &to) {
            return Ok(());
        }
        output::check_new(&to, false)?;
        std::fs::copy(from, &to).map_err(|e| format!("cannot copy {} to {}: {e}", from.shown(), to.shown()))?;
        Ok(())
    };
    for (from, name) in args.recordings.iter().zip(files) {
        copy(from, name)?;
    }
    if args.rig.is_some() {
        output::write_new(&folder.join(RIG_FILE), &study.rig().source, args.overwrite)?;
    }
    let sources: Vec<String> = study.recordings().iter().map(|l| l.file.clone()).collect();
    for (name, text) in [
        (file::MEASURED, case.measured()),
        (file::TEMPLATE, case.template()),
        (file::VALUES, case.values()),
        (file::INSTRUCTIONS, case.instructions()),
        (file::README, readme(case, &sources, every)),
        // last, so that a folder with a control file is whole
        (file::CONTROL, control(case)),
    ] {
        output::write_new(&folder.join(name), &text, args.overwrite)?;
    }
    Ok(())
}
