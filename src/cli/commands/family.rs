//! `surgescope family`: runs of one rig at several temperatures.

use std::path::PathBuf;

use crate::cli::args::run_models::RunModels;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say_text, tell, tell_warning};
use crate::cli::console::progress::progress_bar;
use crate::fit::data::prepare::prepare;
use crate::fit::data::run_data::RunData;
use crate::fit::search::options::Options;
use crate::model::effects::{Chosen, parse_list};
use crate::report::temperature::html::html;
use crate::report::temperature::text::{CSV_HEADER, csv, document, text};
use crate::rig::SensorKind;
use crate::shown::Shown as _;
use crate::signal::inspect;
use crate::storage::output;
use crate::study::open::{Loaded, load};
use crate::temperature::law::{Laws, Shift};
use crate::temperature::{Member, Plan, Source, family, same_rig};

/// Fit runs at several temperatures together.
///
/// Shows how wave speed and creep depend on temperature.
/// First, each run is fitted separately, and lines are drawn through the values. Then all runs are fitted together:
/// they share creep compliances, a temperature law shifts the retardation times, and the wall's modulus is log-linear
/// in temperature. The result tells whether these laws describe the runs.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings of one rig.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    /// Effects of the model; the first run decides an open number of elements.
    #[arg(long, value_name = "A,B", default_value = "viscoelastic-wall", value_parser = parse_list)]
    effects: ::std::vec::Vec<Chosen>,
    #[command(flatten)]
    laws: LawArgs,
    /// Temperatures of the recordings in their order, where they have no temperature sensor, such as 15,25,35.
    #[arg(long = "temperature-degC", value_name = "T,T", value_delimiter = ',', value_parser = celsius,
          allow_negative_numbers = true)]
    temperature_degc: Vec<f64>,
    /// Standard deviation of the runs' temperatures: thermometers, and wall against water.
    #[arg(long = "temperature-sd-K", value_name = "K", default_value_t = 0.1, value_parser = crate::cli::args::values::positive,
          allow_negative_numbers = true)]
    temperature_sd_k: f64,
    /// Read the recordings with this rig instead of the stored ones.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Write a page with each quantity over temperature; replaces an older page of that name, and no other file.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
    /// Write the runs' values and the lines through them as a table; replaces an older table of that name, and no other
    /// file.
    #[arg(long, value_name = "CSV")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    models: RunModels,
    /// Finest grid of the fits.
    #[arg(long, value_name = "REACHES", default_value_t = Options::default().most_reaches, value_parser = crate::cli::args::values::reaches,
          allow_negative_numbers = true)]
    most_reaches: usize,
}

/// What ties the runs together.
#[derive(Debug, clap::Args)]
pub struct LawArgs {
    /// Fit each run separately and draw lines; no laws.
    #[arg(long, conflicts_with_all = ["law", "modulus", "vertical"])]
    apart: bool,
    /// How retardation times shift with temperature.
    #[arg(long, value_enum, default_value = "arrhenius")]
    law: ShiftLaw,
    /// How the wall's modulus depends on temperature.
    #[arg(long, value_enum, default_value = "log-linear")]
    modulus: ModulusLaw,
    /// Let compliances change with temperature too, all by one factor.
    #[arg(long)]
    vertical: bool,
    /// Reference temperature of the laws [default: the runs' mean, rounded to a degree].
    #[arg(long = "reference-degC", value_name = "T", value_parser = celsius, allow_negative_numbers = true)]
    reference_degc: Option<f64>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum ShiftLaw {
    /// ln a_T = (Ea/R)(1/T - 1/T0)
    Arrhenius,
    /// log10 a_T = -C1 (T - T0)/(C2 + T - T0)
    Wlf,
    /// One factor for each run
    Free,
}

#[derive(Debug, Clone, Copy, PartialEq, clap::ValueEnum)]
enum ModulusLaw {
    /// ln E0 is linear in the temperature
    LogLinear,
    /// One modulus for each run
    Free,
}

impl LawArgs {
    fn laws(&self) -> Option<Laws> {
        let shift = match self.law {
            ShiftLaw::Arrhenius => Shift::Arrhenius,
            ShiftLaw::Wlf => Shift::Wlf,
            ShiftLaw::Free => Shift::Free,
        };
        let modulus_free = self.modulus == ModulusLaw::Free;
        (!self.apart).then_some(Laws { shift, modulus_free, vertical: self.vertical })
    }
}

/// Runs it.
///
/// # Errors
/// Recordings that cannot be read, of several rigs, at one temperature, or at none that is known; files that cannot be
/// written.
pub fn run(args: Args, json: bool) -> CommandResult {
    if let Some(path) = &args.report {
        output::check_report(path)?;
    }
    if let Some(path) = &args.csv {
        output::check_result(path, CSV_HEADER)?;
    }
    let loaded = loaded(&args)?;
    let models = args.models.open(&args.recordings, args.rig.as_deref())?;
    let members: Vec<Member> = loaded.iter().map(|l| member(l, !args.temperature_degc.is_empty())).collect();
    let rig = loaded[0].recording.rig.clone();
    let options = Options { most_reaches: args.most_reaches, ..Options::default() };
    let plan = Plan {
        laws: args.laws.laws(),
        reference_degc: args.laws.reference_degc,
        temperature_sd_k: args.temperature_sd_k,
        options,
    };
    let bar = progress_bar();
    let fitted = family(&rig, members, &args.effects, &plan, &|of, p| {
        bar.set_message(format!("{of}: {p}"));
    });
    bar.finish_and_clear();
    let fitted = fitted?;
    if json {
        say_document(document(&fitted))?;
    } else {
        say_text!(text(&fitted));
    }
    models.save(&fitted.fits, "fitted separately, in a family over temperature")?;
    if let Some(path) = &args.csv {
        output::check_result(path, CSV_HEADER)?;
        output::write(path, &csv(&fitted))?;
        tell!("table: {}", path.shown());
    }
    // last, so that a page that cannot be written costs no result
    if let Some(path) = &args.report {
        output::check_report(path)?;
        output::write(path, &html(&fitted, &rig.name))?;
        tell!("report: {}", path.shown());
    }
    Ok(Outcome::Done)
}

/// Reads the recordings, which may have rig files of their own as long as those describe one rig.
fn loaded(args: &Args) -> Result<Vec<Loaded>, Box<dyn std::error::Error + Send + Sync>> {
    let paths = &args.recordings;
    if !args.temperature_degc.is_empty() && args.temperature_degc.len() != paths.len() {
        let (runs, given) = (paths.len(), args.temperature_degc.len());
        return Err(format!(
            "{runs} recordings but {given} temperatures: give one for each, in the order of the recordings"
        )
        .into());
    }
    let mut all: Vec<Loaded> = Vec::new();
    for (i, path) in paths.iter().enumerate() {
        let twin = paths[..i].iter().find(|p| output::same_file(p, path) || output::same_content(p, path));
        if let Some(twin) = twin {
            return Err(format!("{} and {} are one recording: it counts once", twin.shown(), path.shown()).into());
        }
        let mut one = load(std::slice::from_ref(path), args.rig.as_deref(), &[])?.remove(0);
        one.doubts.iter().for_each(|doubt| tell_warning!("{}: {doubt}", one.file));
        if all.iter().any(|l| l.file == one.file) {
            one.file = path.shown().into_owned();
        }
        if let Some(&degc) = args.temperature_degc.get(i) {
            if has_thermometer(&one) {
                return Err(format!("{} contains its temperature: leave --temperature-degC out", one.file).into());
            }
            one.recording.rig.fluid.temperature_degc = degc;
            one.features = inspect(&one.recording).map_err(|e| format!("{}: {e}", path.shown()))?;
        }
        if let Some(first) = all.first() {
            same_rig((&first.file, &first.recording.rig), (&one.file, &one.recording.rig))?;
        }
        all.push(one);
    }
    Ok(all)
}

fn has_thermometer(loaded: &Loaded) -> bool {
    let sensors = &loaded.recording.rig.sensors;
    let recorded = |(i, s): (usize, &crate::rig::Sensor)| {
        s.kind == SensorKind::Temperature && loaded.recording.series[i].value.iter().any(|v| v.is_finite())
    };
    sensors.iter().enumerate().any(recorded)
}

fn member(loaded: &Loaded, given: bool) -> Member {
    let source = match (given, has_thermometer(loaded)) {
        (true, _) => Source::Given,
        (_, true) => Source::Sensor,
        _ => Source::Rig,
    };
    let data: RunData = prepare(&loaded.file, &loaded.recording.rig, &loaded.recording, &loaded.features);
    Member { temperature_degc: loaded.features.temperature_degc, source, data }
}

/// A temperature of liquid water.
fn celsius(text: &str) -> Result<f64, String> {
    let number = crate::cli::args::values::number(text)?;
    if (0.0..=100.0).contains(&number) {
        Ok(number)
    } else {
        Err("must be from 0 to 100, where water is liquid".into())
    }
}
