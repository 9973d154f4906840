//! `surgescope record`: a live stream, a simulated device or a replayed file becomes a recording.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::ArgGroup;

use crate::cli::args::evaluation;
use crate::cli::args::live::Live;
use crate::cli::args::triggers::Triggers;
use crate::cli::args::values::{not_negative, pair, positive, setting};
use crate::cli::console::document::{document, say_document};
use crate::cli::console::last_words::{LastWords, tell_first};
use crate::cli::console::live::Reporter;
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell, tell_warning};
use crate::cli::console::progress::progress_bar;
use crate::cli::console::recorded::table;
use crate::cli::console::stop::{STOP, stop_on_signals};
use crate::live::Server;
use crate::model::effects::{Chosen, parse_list};
use crate::record::clock::host_clock::HostClock;
use crate::record::devices::source::Sources;
use crate::record::health::snapshot::Snapshot;
use crate::record::session::feed::Watched;
use crate::record::session::live_test as session;
use crate::record::session::live_test::{Options, SILENCE_S, live_devices};
use crate::record::session::output::{Summary, check_path};
use crate::record::session::replay;
use crate::recording::CsvFormat;
use crate::report::history::text::RunDocument;
use crate::results::history::{Run, State};
use crate::rig::Rig;
use crate::rig::check::coarse_counts;
use crate::shown::Shown as _;
#[cfg(unix)]
use crate::simulate::playback::Timing;
use crate::simulate::scenario::{Scenario, ValveForm};
#[cfg(unix)]
use crate::simulate::through_ports::{LEAD_S, record_scenario};
use crate::watch::evaluate::{Settings, evaluate_new};
use crate::watch::verdict::line_of;

/// Record a test: live, simulated, or replayed from a file.
#[derive(Debug, clap::Args)]
#[command(group = ArgGroup::new("paced").args(["replay", "simulate"]))]
pub struct Args {
    /// Rig file; a replayed recording contains its own.
    #[arg(long, value_name = "RIG", required_unless_present = "replay")]
    rig: Option<PathBuf>,
    /// Recording to write; must not exist.
    #[arg(short, long, value_name = "MCAP", required_unless_present = "trigger")]
    output: Option<PathBuf>,
    #[command(flatten)]
    triggers: Triggers,
    #[command(flatten)]
    live: Live,
    /// Stop after this time, in seconds.
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    duration: Option<f64>,
    /// Use this port for a device instead of the rig file's: a path, or tcp://HOST:PORT.
    #[arg(long, value_name = "NAME=PORT", value_parser = pair, conflicts_with = "paced")]
    port: Vec<(String, String)>,
    /// Play a recording or a CSV as if it were live.
    #[arg(long, value_name = "FILE")]
    replay: Option<PathBuf>,
    /// Sensors of the rig without a column in the replayed CSV.
    #[arg(long, value_name = "SENSOR", value_delimiter = ',', requires = "replay")]
    without: Vec<String>,
    /// Record a simulated test of this rig, each device sending through a pseudo-terminal.
    #[arg(long)]
    simulate: bool,
    /// Play this many times faster than real time; 0: as fast as possible.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = not_negative, requires = "paced", allow_negative_numbers = true)]
    speed: f64,
    /// Let the simulated devices misbehave, as in flip=0.01,drop=0.02,seed=7: probabilities per frame of flip, drop,
    /// duplicate, noise, cut, crc, stall, reset and late (Modbus answers), drift_ppm of their clocks, and echo=true, a
    /// Modbus line that sends back the requests.
    #[arg(long, value_name = "FAULTS", requires = "simulate")]
    faults: Option<String>,
    /// Effects of the simulated test.
    #[arg(long, value_name = "A,B", default_value = "none", value_parser = parse_list)]
    effects: ::std::vec::Vec<Chosen>,
    /// Samples per second and channel of the simulated device.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0, value_parser = positive, allow_negative_numbers = true)]
    rate: f64,
    /// Set values of the simulated test, as in `simulate`.
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting, requires = "simulate", num_args = 1..)]
    set: Vec<(String, f64)>,
    /// Store a note in the recording, such as ambient=12degC; may be repeated. `inspect` shows the notes.
    #[arg(long, value_name = "KEY=VALUE", value_parser = pair)]
    note: Vec<(String, String)>,
    /// Name of the operator, stored as the note `operator`.
    #[arg(long, value_name = "NAME")]
    operator: Option<String>,
    /// Calibrate and diagnose the finished recording, as `surgescope watch` does, and write fit and report beside it.
    #[arg(long)]
    calibrate: bool,
    /// A stream has ended after this many seconds without a valid frame.
    #[arg(long, value_name = "S", default_value_t = SILENCE_S, value_parser = positive, allow_negative_numbers = true)]
    silence: f64,
    /// Wait this many seconds for a device whose port has vanished.
    #[arg(long, value_name = "S", default_value_t = 60.0, value_parser = not_negative, allow_negative_numbers = true)]
    wait: f64,
}

/// Records until the duration, a signal or the stream's end.
pub fn run(args: Args, json: bool) -> CommandResult {
    if let Some(output) = &args.output {
        check_path(output)?;
        if args.calibrate && output.extension().is_none_or(|e| !e.eq_ignore_ascii_case("mcap")) {
            return Err(format!(
                "{} does not end with .mcap, which --calibrate needs: `surgescope watch` looks for that",
                output.shown()
            )
            .into());
        }
    }
    stop_on_signals()?;
    let rig = args.rig.as_deref().map(Rig::load).transpose()?;
    let operator = args.operator.iter().map(|name| ("operator".to_owned(), name.clone()));
    let options = Options {
        duration_s: args.duration,
        silence: Duration::try_from_secs_f64(args.silence)?,
        wait: Duration::try_from_secs_f64(args.wait)?,
        notes: operator.chain(args.note.iter().cloned()).collect(),
        ..Options::new(args.output.clone().unwrap_or_default())
    };
    let reporter = Reporter::open();
    let summary = record(&args, rig.as_ref(), &options, &mut |snapshot| reporter.show(snapshot));
    reporter.close();
    let (summary, watched) = summary?;
    let outcome = |failed: bool| match (summary.data_lost, failed) {
        (true, _) => Outcome::DataLost,
        (false, true) => Outcome::No,
        (false, false) => Outcome::Done,
    };
    let words = LastWords::before(outcome(false).code(), &STOP);
    tell!("{}: {}", summary.file.shown(), summary.ended.shown());
    if !json {
        say_text!(table(&summary));
        if let Some(Watched { clients, dropped }) = watched {
            say!("live: {clients} watched; {dropped} samples did not reach one that was too slow");
        }
    }
    drop(words);
    let runs = if args.calibrate { calibrated(&summary, json)? } else { Vec::new() };
    let failed = runs.iter().any(|run| run.state == State::Failed);
    let _words = LastWords::before(outcome(failed).code(), &STOP);
    if json {
        let documents: Vec<RunDocument> = runs.iter().map(RunDocument::from).collect();
        let mut head = match &documents[..] {
            [] => serde_json::json!({}),
            [one] if summary.shots.is_empty() => serde_json::json!({ "calibration": one }),
            all => serde_json::json!({ "calibrations": all }),
        };
        if let Some(watched) = watched {
            head["live"] = serde_json::to_value(watched)?;
        }
        say_document(document(head, &summary)?)?;
    }
    Ok(outcome(failed))
}

/// The run of a recording, its progress and warnings shown; none where a watch is at work in its folder, which will do
/// it.
fn evaluated(path: &Path) -> Result<Option<Run>, AnyError> {
    let bar = progress_bar();
    let run = evaluate_new(path, &Settings::default(), &|notice| evaluation::show(&bar, notice));
    bar.finish_and_clear();
    run
}

/// The runs of the recordings that a session left, calibrated and diagnosed; each is printed when it is done.
fn calibrated(summary: &Summary, json: bool) -> Result<Vec<Run>, AnyError> {
    let one = [summary.file.clone()];
    let files = if summary.shots.is_empty() { &one } else { &summary.shots[..] };
    let mut runs = Vec::new();
    // a triggered session that saw no shot names its folder
    for file in files.iter().filter(|file| Path::new(file).is_file()) {
        let Some(run) = evaluated(Path::new(file))? else { continue };
        if json {
            tell!("{}", line_of(&run));
        } else {
            say!("{}", line_of(&run));
        }
        runs.push(run);
    }
    Ok(runs)
}

/// What is recorded, and how it was watched, where it could be.
fn record(
    args: &Args,
    rig: Option<&Rig>,
    options: &Options,
    report: &mut dyn FnMut(Snapshot),
) -> Result<(Summary, Option<Watched>), AnyError> {
    if let Some(path) = &args.replay {
        let recording = replay::load(path, rig, &args.without)?;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        return watched(args, options, (&recording.rig, recording.run.csv.as_ref()), |options| {
            Ok(replay::replay(&recording, &name, args.speed, options, &STOP, report)?)
        });
    }
    let rig = rig.ok_or("--rig is missing: it describes what is recorded")?;
    watched(args, options, (rig, None), |options| {
        if args.simulate {
            record_simulated(rig, args, options, report)
        } else {
            record_live(rig, args, options, report)
        }
    })
}

/// Records with triggers and watchers, where they are asked for.
fn watched(
    args: &Args,
    options: &Options,
    (rig, csv): (&Rig, Option<&CsvFormat>),
    record: impl FnOnce(&Options) -> Result<Summary, AnyError>,
) -> Result<(Summary, Option<Watched>), AnyError> {
    let options = args.triggers.applied(options, rig)?;
    let (options, server) = args.live.start(&options, rig, csv)?;
    let summary = record(&options);
    drop(options);
    let watched = server.map(Server::finish);
    Ok((summary?, watched))
}

fn record_live(
    rig: &Rig,
    args: &Args,
    options: &Options,
    report: &mut dyn FnMut(Snapshot),
) -> Result<Summary, AnyError> {
    if !HostClock::start().is_set() {
        tell_warning!(
            "this computer's clock is not set: the recording keeps no date. Set the clock (`timedatectl set-time`), and begin again"
        );
    }
    let devices = live_devices(rig, &args.port)?;
    coarse_counts(rig).iter().for_each(|f| tell_warning!("{}: {}", f.subject, f.message));
    let sources = Sources::open(rig, &devices, args.wait > 0.0)?;
    let listening = devices.iter().map(|device| match device.port.command() {
        Some(_) => format!("device '{}' is the command {}, which was started", device.name, device.port),
        None => format!("listening to device '{}' on {}", device.name, device.port),
    });
    tell_first(listening.chain(["Ctrl-C ends the recording".to_owned()]).collect());
    Ok(session::record(rig, &sources, options, &STOP, report)?)
}

#[cfg(unix)]
fn record_simulated(
    rig: &Rig,
    args: &Args,
    options: &Options,
    report: &mut dyn FnMut(Snapshot),
) -> Result<Summary, AnyError> {
    let scenario = Scenario::new(rig.clone(), &args.effects, ValveForm::Linear, &args.set)?;
    let total_s = args.duration.unwrap_or(LEAD_S + 12.0 * scenario.period_s());
    let faults = args.faults.as_deref().map(str::parse).transpose()?.unwrap_or_default();
    let timing = Timing { rate_hz: args.rate, lead_s: LEAD_S, after_s: (total_s - LEAD_S).max(0.0) };
    let warn = |warning: &str| tell_warning!("{warning}");
    record_scenario(&scenario, &timing, (args.speed, faults), options, (&STOP, report), &warn)
}

#[cfg(not(unix))]
fn record_simulated(_: &Rig, _: &Args, _: &Options, _: &mut dyn FnMut(Snapshot)) -> Result<Summary, AnyError> {
    Err("--simulate needs pseudo-terminals, which this system does not have".into())
}
