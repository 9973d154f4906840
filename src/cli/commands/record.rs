//! `surgescope record`: a live stream, a simulated device or a replayed file becomes a recording.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::ArgGroup;

use crate::cli::args::evaluation;
use crate::cli::args::triggers::Triggers;
use crate::cli::args::values::{not_negative, pair, positive, setting};
use crate::cli::console::document::document;
use crate::cli::console::last_words::{LastWords, tell_first};
use crate::cli::console::live::Reporter;
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell};
use crate::cli::console::progress::progress_bar;
use crate::cli::console::stop::{STOP, stop_on_signals};
use crate::model::effects::{Chosen, parse_list};
use crate::record::devices::replay;
use crate::record::devices::source::Sources;
use crate::record::health::snapshot::Snapshot;
use crate::record::session::live_test as session;
use crate::record::session::live_test::{Options, SILENCE_S, live_devices};
use crate::record::session::output::{DeviceCount, Summary, check_path};
use crate::report::history::text::RunDocument;
use crate::results::history::{Run, State};
use crate::rig::Rig;
#[cfg(unix)]
use crate::simulate::playback::{Timing, of_scenario};
use crate::simulate::scenario::{Scenario, ValveForm};
#[cfg(unix)]
use crate::simulate::through_ports::{clipped, record_playbacks};
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
    /// Stop after this recorded time, in seconds.
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    duration: Option<f64>,
    /// Use this port for a device instead of the rig file's.
    #[arg(long, value_name = "NAME=PATH", value_parser = pair, conflicts_with = "paced")]
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
    /// Let the simulated devices misbehave, as in flip=0.01,drop=0.02,seed=7: probabilities per frame of flip, drop, duplicate, noise, cut,
    /// crc, stall, reset and late (Modbus answers), and drift_ppm of their clocks.
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
                output.display()
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
    let summary = summary?;
    let outcome = |failed: bool| match (summary.data_lost, failed) {
        (true, _) => Outcome::DataLost,
        (false, true) => Outcome::No,
        (false, false) => Outcome::Done,
    };
    let words = LastWords::before(outcome(false).code(), &STOP);
    tell!("{}: {}", summary.file, summary.ended);
    if !json {
        say_text!(table(&summary));
    }
    drop(words);
    let runs = if args.calibrate { calibrated(&summary, json)? } else { Vec::new() };
    let failed = runs.iter().any(|run| run.state == State::Failed);
    let _words = LastWords::before(outcome(failed).code(), &STOP);
    if json {
        let documents: Vec<RunDocument> = runs.iter().map(RunDocument::from).collect();
        let head = match &documents[..] {
            [] => serde_json::json!({}),
            [one] if summary.shots.is_empty() => serde_json::json!({ "calibration": one }),
            all => serde_json::json!({ "calibrations": all }),
        };
        say!("{}", document(head, &summary)?);
    }
    Ok(outcome(failed))
}

/// The run of a recording, its progress and warnings shown; none where a watch is at work in its folder, which will do it.
fn evaluated(path: &Path) -> Result<Option<Run>, AnyError> {
    let bar = progress_bar();
    let run = evaluate_new(path, &Settings::default(), &|notice| evaluation::show(&bar, notice));
    bar.finish_and_clear();
    run
}

/// The runs of the recordings that a session left, calibrated and diagnosed; each is told as it is done.
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

fn record(
    args: &Args,
    rig: Option<&Rig>,
    options: &Options,
    report: &mut dyn FnMut(Snapshot),
) -> Result<Summary, AnyError> {
    if let Some(path) = &args.replay {
        let recording = replay::load(path, rig, &args.without)?;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        let options = args.triggers.applied(options, &recording.rig)?;
        return Ok(replay::replay(&recording, &name, args.speed, &options, &STOP, report)?);
    }
    let rig = rig.ok_or("--rig is missing: it describes what is recorded")?;
    let options = &args.triggers.applied(options, rig)?;
    if args.simulate {
        return record_simulated(rig, args, options, report);
    }
    let devices = live_devices(rig, &args.port)?;
    let sources = Sources::open(rig, &devices, args.wait > 0.0)?;
    let listening = devices.iter().map(|device| format!("listening to device '{}' on {}", device.name, device.port));
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
    let timing = Timing { rate_hz: args.rate, lead_s: LEAD_S, after_s: (total_s - LEAD_S).max(0.0) };
    let faults = args.faults.as_deref().map(str::parse).transpose()?.unwrap_or_default();
    let mut played = Vec::new();
    for device in live_devices(rig, &[])? {
        let playback = of_scenario(&scenario, &device, &timing)?;
        played.push((device, playback));
    }
    clipped(rig, &played).iter().for_each(|warning| tell!("{warning}"));
    record_playbacks(rig, played, (args.speed, faults), options, &STOP, report)
}

#[cfg(not(unix))]
fn record_simulated(_: &Rig, _: &Args, _: &Options, _: &mut dyn FnMut(Snapshot)) -> Result<Summary, AnyError> {
    Err("--simulate needs pseudo-terminals, which this system does not have".into())
}

/// Steady time before the closure of a simulated test, s.
#[cfg(unix)]
const LEAD_S: f64 = 1.0;

/// What was recorded, for people.
fn table(summary: &Summary) -> String {
    let names = summary.sensors.iter().map(|s| &s.name).chain(summary.devices.iter().map(|d| &d.name));
    let width = names.map(|name| name.chars().count()).max().unwrap_or(0).max("sensor".len());
    let mut text = format!("{:.3} s recorded\n", summary.duration_s);
    let _ = writeln!(text, "{:width$}  {:>10}  {:>10}", "sensor", "samples", "gaps");
    for sensor in &summary.sensors {
        let _ = writeln!(text, "{:width$}  {:>10}  {:>10}", sensor.name, sensor.samples, sensor.gaps);
    }
    if !summary.devices.is_empty() {
        let _ =
            writeln!(text, "{:width$}  {:>10}  {:>10}  {:>10}  {:>10}", "device", "frames", "bad", "lost", "repeated");
    }
    for device in &summary.devices {
        let _ = writeln!(
            text,
            "{:width$}  {:>10}  {:>10}  {:>10}  {:>10}",
            device.name, device.frames, device.bad_frames, device.lost_frames, device.duplicated_frames
        );
    }
    for callout in &summary.callouts {
        let _ = writeln!(text, "{} {}", callout.sensor, callout.told(0));
    }
    for shot in &summary.shots {
        let _ = writeln!(text, "shot: {shot}");
    }
    for cut in &summary.cut_short {
        let (file, kept_s, asked_s) = (&cut.file, cut.kept_s, cut.asked_s);
        let _ = match kept_s {
            0.0 => writeln!(text, "cut short: {file} ends before the trigger fired"),
            kept_s => writeln!(text, "cut short: {file} has {kept_s:.3} of {asked_s} s after the trigger fired"),
        };
    }
    for absent in &summary.absent {
        let (file, sensors) = (&absent.file, absent.sensors.join(", "));
        let _ = writeln!(
            text,
            "absent: {file} has no samples of {sensors}, which had sent nothing when it ended: check that the device is on, and sends more often than --silence"
        );
    }
    for lost in &summary.lost_shots {
        let _ = writeln!(text, "{lost}");
    }
    if summary.unheeded_edges > 0 {
        let _ = writeln!(
            text,
            "The valve's command switched {} while the trigger waited for --pre seconds of quiet: no shot contains that.",
            if summary.unheeded_edges == 1 { "once".to_owned() } else { format!("{} times", summary.unheeded_edges) }
        );
    }
    for device in &summary.devices {
        let _ = describe(&mut text, device);
    }
    if summary.data_lost {
        let gaps: u64 = summary.sensors.iter().map(|sensor| sensor.gaps).sum();
        text.push_str(match gaps {
            0 => "Samples were lost before the first or after the last sample of their sensors: no gap marks them.\n",
            _ => "Samples were lost; each hole is recorded as a gap.\n",
        });
    }
    text
}

/// What is worth a word of a device.
fn describe(text: &mut String, device: &DeviceCount) -> std::fmt::Result {
    let name = &device.name;
    if let Some(clock) = &device.clock {
        writeln!(text, "clock of {name}: {clock}")?;
    }
    for warning in device.clock_warning.iter().chain(&device.poll_warning) {
        writeln!(text, "{name}: {warning}")?;
    }
    for (count, what) in [
        (device.late_answers, "answers came after their time-out and were discarded"),
        (device.reconnects, "times its port vanished and came back"),
        (device.restarts, "times it restarted"),
        (device.clock_steps, "times its clock was set; its samples stay in sequence"),
        (device.squeezed_frames, "frames began before the previous one ended; their samples are closer together"),
        (
            device.restamped_frames,
            "frames had a time that contradicts their neighbours; they were placed by their sequence number",
        ),
        (device.queue_waits, "times it waited because the disk did not keep up"),
    ] {
        if count > 0 {
            writeln!(text, "{name}: {count} {what}")?;
        }
    }
    if let Some(late_s) = device.began_late_s {
        writeln!(text, "{name}: its first sample came {late_s:.1} s after the recording began; a gap marks that")?;
    }
    if device.incomplete {
        let what =
            if device.frames == 0 { "it sent nothing that can be used" } else { "it stopped sending before the end" };
        writeln!(text, "{name}: {what}")?;
    }
    Ok(())
}
