//! `surgescope sensitivity`: which parameter moves what.

use std::path::PathBuf;

use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::args::values::{number, pair, positive, setting};
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say_text, tell};
use crate::model::Conditions;
use crate::model::effects::{Chosen, name_of, parse_list};
use crate::report::sensitivity::html as page;
use crate::shown::Shown as _;
use crate::simulate::scenario::{Scenario, ValveForm};
use crate::storage::output;
use crate::study::models;

use crate::report::sensitivity as text;
use crate::rig::Rig;
use crate::sensitivity::factor::{Factor, Range, Reach};
use crate::sensitivity::study::{Study, elementary_effects, variance_shares};
use crate::sensitivity::subject::{Subject, sensor};
use crate::sensitivity::{SensitivityError, levels, map};

/// Show which parameter affects peaks, phase and damping of a closure.
///
/// A parameter varies over its bounds in the catalogue; velocity, head, closing time and friction vary by 20 % to
/// either side. --within and --range narrow that.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The rig.
    #[arg(value_name = "RIG")]
    rig: PathBuf,
    /// Effects of the model.
    #[arg(long, value_name = "A,B", value_parser = parse_list)]
    effects: Option<::std::vec::Vec<Chosen>>,
    /// Parameter values around which to study the model [default: the rig's values].
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting, num_args = 1..)]
    set: Vec<(String, f64)>,
    /// Take effects and values from the current model of this model file; --set overrides them.
    #[arg(long, value_name = "MODEL", conflicts_with = "effects")]
    model: Option<PathBuf>,
    /// The pressure sensor to read [default: the one nearest to the valve].
    #[arg(long, value_name = "NAME")]
    sensor: Option<String>,
    /// What to compute.
    #[arg(long, value_enum, value_name = "METHODS", value_delimiter = ',', default_values_t = [Method::Morris, Method::Sobol])]
    method: Vec<Method>,
    /// The range of a parameter.
    #[arg(long, value_name = "NAME=LOW:HIGH", value_parser = range, num_args = 1..)]
    range: Vec<Range>,
    /// All other parameters vary from their value divided by this factor to their value times it, within their bounds.
    #[arg(long, value_name = "FACTOR", value_parser = above_one)]
    within: Option<f64>,
    /// Vary these parameters only.
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    only: Vec<String>,
    /// Morris: trajectories; each takes one simulation more than there are parameters.
    #[arg(long, value_name = "N", default_value_t = 50)]
    trajectories: usize,
    /// Sobol: rows; each takes two simulations more than there are parameters. Use a power of two.
    #[arg(long, value_name = "N", default_value_t = 512)]
    rows: usize,
    /// Analysis of variance: levels of each parameter, from half to twice its value unless a range is given.
    #[arg(long, value_name = "N", default_value_t = 4)]
    levels: usize,
    /// Analysis of variance: runs per level; all other parameters are drawn anew for each.
    #[arg(long, value_name = "N", default_value_t = 3)]
    repeats: usize,
    /// Analysis of variance: spread of the other parameters around their values unless a range is given, in percent to
    /// either side.
    #[arg(long, value_name = "PERCENT", value_parser = positive, default_value_t = 5.0)]
    scatter: f64,
    /// Maps: two parameters, horizontal and vertical [default for two elements: tau1_s:tau2_s, tau1_s:J1_per_GPa and
    /// tau2_s:J2_per_GPa].
    #[arg(long, value_name = "X:Y", value_parser = two_names, num_args = 1..)]
    map: Vec<(String, String)>,
    /// Maps: cells per side.
    #[arg(long, value_name = "N", default_value_t = 25)]
    cells: usize,
    /// Maps: write each as X-Y.csv into this folder.
    #[arg(long, value_name = "FOLDER")]
    csv: Option<PathBuf>,
    /// Seed of the random draws.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write a page with tables and plots.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
}

/// What can be computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Method {
    /// One-way analysis of variance of each parameter of the effects.
    Anova,
    /// Features over two parameters.
    Map,
    /// Elementary effects.
    Morris,
    /// Shares of the variance.
    Sobol,
}

/// Reaches unless `reaches` is set: features are within a percent of those on four times as many (a test says so), and
/// thousands of runs are to be made.
const REACHES: f64 = 96.0;

fn range(text: &str) -> Result<Range, String> {
    let (name, ends) = pair(text)?;
    let (low, high) = ends.split_once(':').ok_or("write it as NAME=LOW:HIGH")?;
    Ok(Range { name, low: number(low)?, high: number(high)? })
}

fn above_one(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v > 1.0 { Ok(v) } else { Err("must be above 1".to_owned()) })
}

fn two_names(text: &str) -> Result<(String, String), String> {
    match text.split_once(':') {
        Some((x, y)) if !x.is_empty() && !y.is_empty() && x != y => Ok((x.to_owned(), y.to_owned())),
        _ => Err("write it as X:Y, two parameters".to_owned()),
    }
}

/// Runs it.
///
/// # Errors
/// A rig that cannot be read, unknown parameters, ranges that are none, a file that cannot be written; if all
/// simulations fail.
pub fn run(args: Args, json: bool) -> CommandResult {
    let scenario = scenario(&args)?;
    if let Some(path) = &args.report {
        output::check_report(path)?;
    }
    if args.csv.as_ref().is_some_and(|folder| !folder.is_dir()) {
        return Err("--csv must name an existing folder for the maps".into());
    }
    let subject = Subject {
        model: scenario.model(),
        conditions: Conditions::of(scenario.water),
        values: scenario.values().into_iter().map(|(_, value)| value).collect(),
        reaches: scenario.reaches,
        sensor: sensor(&scenario.rig, args.sensor.as_deref())?,
    };
    // What does not work at the values themselves is reported once, before thousands of runs.
    subject.features(&subject.values)?;
    let study = study(&args, &subject, &scenario)?;
    if let Some(folder) = &args.csv {
        for map in &study.maps {
            let path = folder.join(format!("{}-{}.csv", map.x.name, map.y.name));
            let content = map.csv();
            output::check_series(&path, content.lines().next().unwrap_or_default(), false, &args.rig)?;
            output::write(&path, &content)?;
            tell!("wrote {}", path.shown());
        }
    }
    if let Some(path) = &args.report {
        output::write(path, &page::html(&study))?;
        tell!("wrote {}", path.shown());
    }
    if json {
        say_document(&study)?;
    } else {
        say_text!(text::text(&study));
    }
    Ok(Outcome::Done)
}

/// The model around which is studied, and what was used although nobody set it.
fn scenario(args: &Args) -> Result<Scenario, Box<dyn std::error::Error + Send + Sync>> {
    let mut effects = args.effects.clone().unwrap_or_default();
    let mut settings = args.set.clone();
    let set = |settings: &[(String, f64)], name: &str| settings.iter().any(|(n, _)| n == name);
    if let Some(path) = &args.model {
        let file = models::load(path)?;
        let entry = file.current();
        effects = parse_list(&entry.effects.join(","))?;
        // What belongs to a recording (its clock, its sensors' offsets and places) is none of a simulation's.
        let of_recording =
            |name: &str| name == "closure_start_s" || name.starts_with("offset_m") || name.starts_with("position_m[");
        for p in entry.parameters.iter().filter(|p| !of_recording(&p.name)) {
            if !set(&settings, &p.name) {
                settings.push((p.name.clone(), p.value));
            }
        }
    }
    if !set(&settings, "reaches") {
        settings.push(("reaches".to_owned(), REACHES));
    }
    let scenario = Scenario::new(Rig::load(&args.rig)?, &effects, ValveForm::Linear, &settings)?;
    let used: Vec<String> = scenario.not_set(&settings).iter().map(|(n, v)| format!("{n}={v:.6}")).collect();
    tell!("not set, defaults used: {}", used.join(" "));
    Ok(scenario)
}

/// Makes the studies that are asked for.
fn study(args: &Args, subject: &Subject, scenario: &Scenario) -> Result<Study, SensitivityError> {
    let asked = |method: Method| args.method.contains(&method);
    let wide = args.within.map_or(Reach::Bounds, Reach::Factor);
    let factors = subject.factors(wide, &args.range, &args.only)?;
    let plan = levels::Plan { levels: args.levels, repeats: args.repeats, seed: args.seed };
    let studied = studied(args, subject)?;
    let maps = if asked(Method::Map) { maps(args, subject)? } else { Vec::new() };

    let mut runs = 0;
    if asked(Method::Anova) {
        runs += levels::runs(plan, studied.len());
    }
    if asked(Method::Morris) {
        runs += args.trajectories * (factors.len() + 1);
    }
    if asked(Method::Sobol) {
        runs += args.rows * (factors.len() + 2);
    }
    runs += maps.iter().map(|(_, _, raised)| map::runs(args.cells, raised.len())).sum::<usize>();
    let bar = progress(runs as u64);
    let tick = || bar.inc(1);
    let mut study = Study {
        rig: scenario.rig.name.clone(),
        effects: scenario.effects.iter().map(Chosen::label).collect(),
        sensor: subject.sensor.name.clone(),
        reaches: subject.reaches,
        period_s: subject.period_s(),
        values: scenario.values(),
        seed: args.seed,
        ..Study::default()
    };
    if asked(Method::Anova) {
        let drawn = subject.factors(Reach::Share(args.scatter / 100.0), &args.range, &[])?;
        study.anova = Some(levels::study(subject, &studied, &drawn, plan, &tick)?);
    }
    if asked(Method::Morris) {
        study.morris = Some(elementary_effects(subject, &factors, args.trajectories, args.seed, &tick)?);
    }
    if asked(Method::Sobol) {
        study.sobol = Some(variance_shares(subject, &factors, args.rows, args.seed, &tick)?);
    }
    for (x, y, raised) in &maps {
        study.maps.push(map::draw(subject, x, y, raised, args.cells, &tick)?);
    }
    bar.finish_and_clear();
    Ok(study)
}

/// What an analysis of variance studies: the parameters of effects, or all where there are none, from half to twice
/// their values.
fn studied(args: &Args, subject: &Subject) -> Result<Vec<Factor>, SensitivityError> {
    let all = subject.factors(Reach::Factor(2.0), &args.range, &args.only)?;
    let of_effects = subject.model.effects_from()..subject.model.shared.len();
    let any = !of_effects.is_empty() && args.only.is_empty();
    Ok(all.into_iter().filter(|f| !any || of_effects.contains(&f.slot)).collect())
}

type MapPlan = (Factor, Factor, Vec<Factor>);

/// The maps that are asked for, each with the compliances that are raised.
fn maps(args: &Args, subject: &Subject) -> Result<Vec<MapPlan>, SensitivityError> {
    let factors = subject.factors(args.within.map_or(Reach::Bounds, Reach::Factor), &args.range, &[])?;
    let find = |name: &str| -> Result<Factor, SensitivityError> {
        let slot = subject.slot(name)?;
        Ok(factors[slot].clone())
    };
    let usual = [("tau1_s", "tau2_s"), ("tau1_s", "J1_per_GPa"), ("tau2_s", "J2_per_GPa")];
    let mut names = args.map.clone();
    if names.is_empty() {
        if find("tau2_s").is_err() {
            return Err(SensitivityError::NeedsTwoElements { effects: name_of(&subject.model.effects) });
        }
        names = usual.map(|(x, y)| (x.to_owned(), y.to_owned())).to_vec();
    }
    let compliance = |f: &&Factor| f.name.starts_with('J') && f.name.ends_with("_per_GPa");
    let plan = |(x, y): &(String, String)| {
        // Of a map over one element's values its own compliance is raised, of any other map all.
        let own: Vec<Factor> = factors.iter().filter(compliance).filter(|f| f.name == *y).cloned().collect();
        let raised = if own.is_empty() { factors.iter().filter(compliance).cloned().collect() } else { own };
        Ok((find(x)?, find(y)?, raised))
    };
    names.iter().map(plan).collect()
}

fn progress(runs: u64) -> ProgressBar {
    let bar = ProgressBar::new(runs);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} simulations, {eta} left") {
        bar.set_style(style);
    }
    bar
}
