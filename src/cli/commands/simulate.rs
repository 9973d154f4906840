//! `surgescope simulate`: the model alone, no recording needed.

use std::io::{BufWriter, Write, stdout};
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::json;

use crate::cli::args::beside::Beside;
use crate::cli::args::recordings;
use crate::cli::args::solver::SolverChoice;
use crate::cli::args::values::{self, not_negative, positive, setting};
use crate::cli::console::document::{document, say_document};
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell, tell_warning};
use crate::cli::console::progress::busy;
use crate::fit::problem::observed::Place;
use crate::model::constraint::Given;
use crate::model::effects::{Chosen, parse_list};
use crate::model::trace::Trace;
use crate::record::session::output::check_path;
use crate::report::energy;
use crate::report::pest::observations::{HEADER, Table};
use crate::report::profiles;
use crate::report::text::number::rounded;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::simulate::as_recorded::as_recorded;
use crate::simulate::cavities::unmodelled;
use crate::simulate::playback::Timing;
use crate::simulate::profiles::profiles as profiles_at;
use crate::simulate::scenario::{Scenario, ValveForm};
use crate::simulate::synthetic::{Instruments, recording_of};
use crate::simulate::values_file;
use crate::storage::{Summary, output, write};
use crate::text_file::read_text;

/// Simulate a closure on a rig; needs no recording.
///
/// With an output named `.mcap`, the simulation is recorded as a laboratory would: with noise, resolution, steady
/// seconds before the closure, flow and temperature. Hide an effect in it, and let `diagnose` find it.
///
/// Every model has the settings wave_speed_m_s, friction_factor (a constant; by default it follows from Reynolds number
/// and roughness), initial_velocity_m_s, valve_head_m, closing_time_s and reaches; each effect adds its own
/// (J1_per_GPa, tau1_s, …).
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The rig; with --recording, it replaces the stored one.
    #[arg(long, value_name = "RIG", required_unless_present = "recording")]
    rig: Option<PathBuf>,
    #[command(flatten)]
    beside: Beside,
    /// Effects added to the base model; `none` for the base model alone.
    #[arg(long, value_name = "A,B", default_value = "none", value_parser = parse_list)]
    effects: ::std::vec::Vec<Chosen>,
    #[command(flatten)]
    solver: SolverChoice,
    #[command(flatten)]
    profiles: ProfileArgs,
    /// Parameter values [default: the rig's values].
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting, num_args = 1..)]
    set: Vec<(String, f64)>,
    /// Read values from a file with one NAME = VALUE per line; --set overrides them.
    #[arg(long, value_name = "FILE")]
    values: Option<PathBuf>,
    /// How the valve closes.
    #[arg(long, value_enum, default_value_t = ValveForm::Linear)]
    valve: ValveForm,
    /// Simulated time after the start of the closure, s [default: ten periods; of a recording twelve, or the closing
    /// time and ten more].
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    duration: Option<f64>,
    /// Write values at 0, DT, 2 DT, … s [default: the simulation's own steps].
    #[arg(long, value_name = "DT", value_parser = positive, allow_negative_numbers = true)]
    csv_times: Option<f64>,
    /// Time series to write, one column per pressure sensor in its unit; replaces an older one with the same columns
    /// [default: standard output]. A recording of all sensors, if it ends with .mcap; it must not exist.
    #[arg(short, long, value_name = "CSV|MCAP")]
    output: Option<PathBuf>,
    #[command(flatten)]
    instruments: InstrumentArgs,
    /// Replace an existing output, unless it is the rig or a recording.
    #[arg(long, requires = "output")]
    overwrite: bool,
    /// Write the energy balance in J at the same times: kinetic and strain energy in the line, energy from the supply,
    /// energy taken by valve, friction and each effect; replaces an older file of that name.
    #[arg(long, value_name = "CSV")]
    energy: Option<PathBuf>,
}

/// What to write of the velocity profiles.
#[derive(Debug, clap::Args)]
struct ProfileArgs {
    /// Write velocity profiles and wall shear at one place, at the same times; needs --solver quasi-2d; replaces an
    /// older file of that name.
    #[arg(long, value_name = "CSV", conflicts_with = "recording")]
    profiles: Option<PathBuf>,
    /// Draw a few of the profiles and the wall shear.
    #[arg(long, value_name = "SVG", conflicts_with = "recording")]
    profiles_svg: Option<PathBuf>,
    /// Where, m along the line to the valve [default: halfway].
    #[arg(long, value_name = "M", value_parser = not_negative, allow_negative_numbers = true)]
    profiles_at: Option<f64>,
}

/// How a simulated test is recorded.
#[derive(Debug, clap::Args)]
struct InstrumentArgs {
    /// Seed of the noise of a simulated recording [default: 1].
    #[arg(long, value_name = "N", requires = "output", conflicts_with_all = ["recording", "csv_times"])]
    seed: Option<u64>,
    /// Samples per second of a simulated recording [default: 1000, or 500 a period if that is more].
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true, requires = "output", conflicts_with_all = ["recording", "csv_times"])]
    rate: Option<f64>,
    /// Standard deviation of the noise of a simulated recording's pressures, m [default: 0.1% of the Joukowsky head].
    #[arg(long, value_name = "M", value_parser = not_negative, allow_negative_numbers = true, requires = "output", conflicts_with_all = ["recording", "csv_times"])]
    noise_m: Option<f64>,
}

/// Steady time before the closure of a simulated recording, s.
const LEAD_S: f64 = 1.0;
/// Least number of samples of a period, and of samples a second, in a simulated recording.
const SAMPLES_A_PERIOD: f64 = 500.0;
const LEAST_RATE_HZ: f64 = 1000.0;

/// Most rows that one file may have.
const MOST_ROWS: f64 = 1e8;

/// Runs it.
///
/// # Errors
/// A rig that cannot be read, settings that do not exist or are out of range, a file that cannot be written.
pub fn run(mut args: Args, json: bool) -> CommandResult {
    let given = given(&args)?;
    args.effects = args.solver.effects(&args.effects);
    let rig = match args.rig.clone() {
        Some(rig) if args.beside.recording.is_empty() => rig,
        _ => return run_beside(&args, given, json),
    };
    if let Some(run) = given.iter().find_map(|g| g.run.as_ref()) {
        return Err(format!("the file of values has values of '{run}': name this recording with --recording").into());
    }
    args.set = given.into_iter().map(|g| (g.name, g.value)).collect();
    let scenario = Scenario::new(Rig::load(&rig)?, &args.effects, args.valve, &args.set)?;
    let recorded =
        args.output.as_deref().filter(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")));
    if let Some(path) = recorded {
        return run_recorded(&args, &scenario, path, json);
    }
    if let Some(option) = args.instruments.first_given() {
        return Err(format!("option `{option}` is for a recording: name the output with .mcap").into());
    }
    if let Some(path) = &args.output {
        output::check_series(path, &header(&scenario), args.overwrite, &rig)?;
    }
    args.profiles.check(args.solver, &scenario)?;
    output::check_apart(&[
        ("-o", args.output.as_deref()),
        ("--energy", args.energy.as_deref()),
        ("--profiles", args.profiles.profiles.as_deref()),
        ("--profiles-svg", args.profiles.profiles_svg.as_deref()),
    ])?;
    let duration_s = args.duration.unwrap_or(10.0 * scenario.period_s());
    let start = Instant::now();
    let (traces, book) = scenario.simulate_with(duration_s, args.energy.is_some())?;
    let seconds = start.elapsed().as_secs_f64();
    let step_s = args.csv_times.unwrap_or(traces.first().map_or(duration_s, |t| t.dt_s));
    tell_what_was_not_set(
        &scenario,
        &args,
        &[("duration_s", args.duration, duration_s), ("csv_times_s", args.csv_times, step_s)],
    );
    if duration_s / step_s > MOST_ROWS {
        return Err(format!(
            "{duration_s} s in steps of {step_s} s are more than {MOST_ROWS:.0} rows; choose a longer step"
        )
        .into());
    }
    unmodelled(&scenario, &traces).iter().for_each(|warning| tell_warning!("{warning}"));
    match &args.output {
        Some(path) => output::write_with(path, |out| write_csv(&scenario, &traces, step_s, duration_s, out))?,
        None if json => {}
        None => match write_csv(&scenario, &traces, step_s, duration_s, BufWriter::new(stdout().lock())) {
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {}
            other => other?,
        },
    }
    args.profiles.write(&scenario, duration_s, step_s)?;
    let kept = args.energy.as_deref().zip(book.as_ref());
    if let Some((path, book)) = kept {
        output::check_series(path, &format!("time_s,{}", book.columns().join(",")), args.overwrite, &rig)?;
        output::write_with(path, |out| energy::write_csv(book, out, times(step_s, duration_s)))?;
        tell!("{}", energy::sentence(book, duration_s));
    }
    if json {
        let document = json!({
            "file": args.output,
            "effects": scenario.effects.iter().map(Chosen::label).collect::<Vec<_>>(),
            "settings": settings(&scenario),
            "reaches": scenario.reaches,
            "time_step_s": traces.first().map(|t| t.dt_s),
            "duration_s": duration_s,
            "sensors": scenario.rig.pressure_sensors().map(|(_, s)| &s.name).collect::<Vec<_>>(),
            "energy": kept.map(|(path, book)| energy::json(book, duration_s, path)),
            "seconds": seconds,
        });
        say_document(document)?;
    }
    Ok(Outcome::Done)
}

impl ProfileArgs {
    /// Refuses what cannot be written before anything is computed.
    fn check(&self, solver: SolverChoice, scenario: &Scenario) -> Result<(), AnyError> {
        let asked = self.profiles.is_some() || self.profiles_svg.is_some();
        if asked && !solver.quasi_2d() {
            return Err("velocity profiles need option `solver quasi-2d`: a model in one dimension has none".into());
        }
        if !asked && self.profiles_at.is_some() {
            return Err("option `profiles-at` is for `profiles` or `profiles-svg`: name a file".into());
        }
        let (at_m, length_m) = self.place(scenario);
        if at_m > length_m {
            return Err(format!("the place of the profiles, {at_m} m, is not within 0 to {length_m} m").into());
        }
        self.profiles.iter().try_for_each(|path| output::check_result(path, profiles::HEADING))?;
        self.profiles_svg.iter().try_for_each(|path| output::check_picture(path))
    }

    /// Where, and the length of the line, m.
    fn place(&self, scenario: &Scenario) -> (f64, f64) {
        let length_m = scenario.rig.line_length_m(scenario.rig.graph.line_to_valve());
        (self.profiles_at.unwrap_or(0.5 * length_m), length_m)
    }

    fn write(&self, scenario: &Scenario, duration_s: f64, step_s: f64) -> Result<(), AnyError> {
        if self.profiles.is_none() && self.profiles_svg.is_none() {
            return Ok(());
        }
        let found = profiles_at(scenario, self.place(scenario).0, duration_s, times(step_s, duration_s))?;
        if let Some(path) = &self.profiles {
            output::write_with(path, |out| profiles::write_csv(&found, out))?;
        }
        if let Some(path) = &self.profiles_svg {
            output::write(path, &profiles::picture(&found))?;
        }
        Ok(())
    }
}

impl InstrumentArgs {
    fn first_given(&self) -> Option<&'static str> {
        let given = [("seed", self.seed.is_some()), ("rate", self.rate.is_some()), ("noise-m", self.noise_m.is_some())];
        given.into_iter().find(|(_, given)| *given).map(|(name, _)| name)
    }
}

/// The model as a laboratory would have recorded it.
fn run_recorded(args: &Args, scenario: &Scenario, path: &Path, json: bool) -> CommandResult {
    check_path(path)?;
    if args.profiles.profiles.is_some() || args.profiles.profiles_svg.is_some() {
        return Err("option `profiles` needs a time series (.csv) as output, not a recording".into());
    }
    if args.energy.is_some() {
        return Err("option `energy` needs a time series (.csv) as output, not a recording".into());
    }
    // a valve that closes slowly is recorded until it has closed, and the oscillation after it
    let after_closure_s = scenario.run.closing_time_s + 10.0 * scenario.period_s();
    let after_s = args.duration.unwrap_or(after_closure_s.max(12.0 * scenario.period_s()));
    let usual_hz = (SAMPLES_A_PERIOD / scenario.period_s()).max(LEAST_RATE_HZ);
    let rate_hz = args.instruments.rate.unwrap_or_else(|| to_digits(usual_hz, 2));
    let timing = Timing { rate_hz, lead_s: LEAD_S, after_s };
    let instruments =
        Instruments { timing, noise_m: args.instruments.noise_m, seed: args.instruments.seed.unwrap_or(1) };
    let start = Instant::now();
    let traces = scenario.simulate(after_s)?;
    let recording = busy(path, || recording_of(scenario, &traces, &instruments))?;
    unmodelled(scenario, &traces).iter().for_each(|warning| tell_warning!("{warning}"));
    write(path, &recording)?;
    let seconds = start.elapsed().as_secs_f64();
    tell_what_was_not_set(
        scenario,
        args,
        &[("duration_s", args.duration, after_s), ("rate_hz", args.instruments.rate, rate_hz)],
    );
    let summary = Summary::of(&recording);
    if json {
        let head = json!({
            "file": path,
            "effects": scenario.effects.iter().map(Chosen::label).collect::<Vec<_>>(),
            "settings": settings(scenario),
            "reaches": scenario.reaches,
            "seed": instruments.seed,
            "seconds": seconds,
        });
        say_document(document(head, &summary)?)?;
    } else {
        say!("{}: {summary}", path.shown());
    }
    Ok(Outcome::Done)
}

/// Every setting with its value.
fn settings(scenario: &Scenario) -> serde_json::Map<String, serde_json::Value> {
    scenario.values().into_iter().map(|(n, v)| (n, json!(v))).collect()
}

/// The model beside recordings.
fn run_beside(args: &Args, mut given: Vec<Given>, json: bool) -> CommandResult {
    let recordings = &args.beside.recording;
    if let Some(path) = &args.output {
        output::check_series(path, HEADER, args.overwrite, args.rig.as_ref().unwrap_or(&recordings[0]))?;
    }
    let study = recordings::open(recordings, args.rig.as_deref())?;
    let files: Vec<String> = study.recordings().iter().map(|l| l.file.clone()).collect();
    let table = Table { rig: study.rig(), runs: study.runs(), files: &files };
    let places = args.beside.times.as_ref().map(|path| rows(&table, path)).transpose()?;
    let set = given.iter().find(|g| g.name == "reaches" && g.run.is_none()).map(|g| g.value.to_string());
    let reaches = set.map(|n| values::reaches(&n).map_err(|e| format!("reaches: {e}"))).transpose()?;
    given.retain(|g| g.name != "reaches");
    let start = Instant::now();
    let shown = as_recorded(study.rig(), study.runs(), &args.effects, &given, reaches, places)?;
    let seconds = start.elapsed().as_secs_f64();
    if !shown.not_set.is_empty() {
        let list: Vec<String> = shown.not_set.iter().map(|(name, v)| format!("{name}={v:.6}")).collect();
        tell!("not set, start values of a fit used: {}", list.join(" "));
    }
    let rows = shown.places.len();
    let text = table.text(shown.places.into_iter().zip(shown.values));
    match &args.output {
        Some(path) => output::write(path, &text)?,
        None if json => {}
        None => say_text!(text),
    }
    if json {
        let settings: serde_json::Map<_, _> = shown.settings.into_iter().map(|(n, v)| (n, json!(v))).collect();
        let document = json!({
            "file": args.output,
            "recordings": files,
            "effects": shown.effects,
            "settings": settings,
            "reaches": shown.reaches,
            "rows": rows,
            "seconds": seconds,
        });
        say_document(document)?;
    }
    Ok(Outcome::Done)
}

/// The rows of an older table.
fn rows(table: &Table, path: &Path) -> Result<Vec<Place>, AnyError> {
    let name = path.shown();
    let text = read_text(path).map_err(|e| format!("cannot read the rows in {name}: {e}"))?;
    Ok(table.places(&text, &name)?)
}

/// Values from the command line, then those of the file that it does not set.
fn given(args: &Args) -> Result<Vec<Given>, String> {
    let set = args.set.iter().map(|(name, value)| Given { name: name.clone(), run: None, value: *value });
    let mut given: Vec<Given> = set.collect();
    if let Some(path) = &args.values {
        let own = values_file::read(path)?;
        given.extend(own.into_iter().filter(|g| !args.set.iter().any(|(name, _)| *name == g.name)));
    }
    Ok(given)
}

/// Nothing is made up in silence: each value that nobody set, from the rig, its law or a default.
fn tell_what_was_not_set(scenario: &Scenario, args: &Args, more: &[(&str, Option<f64>, f64)]) {
    let mut used = scenario.not_set(&args.set);
    used.extend(more.iter().filter(|(_, given, _)| given.is_none()).map(|(name, _, v)| ((*name).to_owned(), *v)));
    used.push(("temperature_degC".to_owned(), scenario.rig.fluid.temperature_degc));
    let list: Vec<String> = used.iter().map(|(name, v)| format!("{name}={}", to_digits(*v, 6))).collect();
    tell!("not set, defaults used: {}", list.join(" "));
}

/// First line of the time series.
fn header(scenario: &Scenario) -> String {
    let names = scenario.rig.pressure_sensors().map(|(_, s)| s.name.as_str());
    std::iter::once("time_s").chain(names).collect::<Vec<_>>().join(",")
}

/// The times 0, DT, 2 DT, … up to the duration.
fn times(step_s: f64, duration_s: f64) -> impl Iterator<Item = f64> {
    // The last time counts although it may be a rounding error beyond the duration.
    let rows = (duration_s / step_s * (1.0 + 1e-12) + 1e-9).floor() as u64;
    (0..=rows).map(move |row| row as f64 * step_s)
}

fn write_csv(
    scenario: &Scenario,
    traces: &[Trace],
    step_s: f64,
    duration_s: f64,
    mut out: impl Write,
) -> std::io::Result<()> {
    let sensors: Vec<usize> = scenario.rig.pressure_sensors().map(|(i, _)| i).collect();
    writeln!(out, "{}", header(scenario))?;
    for time_s in times(step_s, duration_s) {
        write!(out, "{}", rounded(time_s))?;
        for (&i, trace) in sensors.iter().zip(traces) {
            write!(out, ",{}", rounded(scenario.displayed(i, trace.at(time_s))))?;
        }
        writeln!(out)?;
    }
    out.flush()
}

fn to_digits(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}
