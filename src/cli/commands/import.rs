//! `surgescope import`: time series, be they plain or of other programs, become a recording.

use std::io::{IsTerminal as _, stderr, stdin};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Value, json};

use crate::align::{Clock, Method, Part};
use crate::cli::args::import_options::{ForeignArgs, start};
use crate::cli::console::ask;
use crate::cli::console::document::{document, say_document};
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::{say, tell, tell_warning};
use crate::cli::console::progress::busy;
use crate::cli::console::understood;
use crate::recording::Recording;
use crate::report::advice::quoted;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::signal::doubts::doubts;
use crate::signal::faults::{Fault, SensorFault, examine, in_words};
use crate::signal::window::{Passing, used};
use crate::signal::{Features, SignalError};
use crate::storage::import::{Imported, LongImport, Pass, Repair, SourceOptions, unit_warnings};
use crate::storage::together::{Together, recorded, together};
use crate::storage::{ImportOptions, Summary, write};
use crate::study;
use crate::study::import::{ImportError, misread_in};

/// Turn time series (CSV, Excel, TDMS, MCAP of other programs) into a recording.
///
/// What a file does not say, such as the unit of its times or which column is which sensor, is guessed and shown before
/// anything is written.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Time series: `time_s`, then one column per sensor, under its name and in its unit. Also tables written in other
    /// ways, TDMS, and MCAP of other programs. Several files of one closure are aligned to the clock of the first and
    /// merged.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The rig of the test; it is stored in the recording. `surgescope rig new FILE` writes one for a file.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Recording to write; must not exist [default: the first file's name with .mcap, in this folder].
    #[arg(short, long, value_name = "MCAP")]
    output: Option<PathBuf>,
    /// Wall-clock time of time 0, such as 2026-03-14T09:26:53Z [default: unknown]. For one of several files: FILE=TIME.
    #[arg(long, value_name = "RFC3339", value_parser = start)]
    start: Vec<(Option<String>, u64)>,
    /// Accept what is guessed, without asking.
    #[arg(short, long)]
    yes: bool,
    /// Sensors of the rig that were not recorded.
    #[arg(long, value_name = "SENSOR", value_delimiter = ',')]
    without: Vec<String>,
    /// How to align several files [default: the most reliable way that all of them allow].
    #[arg(long, value_enum, value_name = "BY")]
    align: Option<AlignBy>,
    #[command(flatten)]
    foreign: ForeignArgs,
}

/// Names of the methods.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum AlignBy {
    /// Edges of a trigger that every file contains.
    Trigger,
    /// Absolute time: date-times, a start in the comments, --start.
    Time,
    /// The pressure front, from the sensors' positions and the wave speed.
    Front,
}

impl AlignBy {
    fn method(self) -> Method {
        match self {
            AlignBy::Trigger => Method::Trigger,
            AlignBy::Time => Method::Time,
            AlignBy::Front => Method::Front,
        }
    }
}

/// What was repaired in one file.
#[derive(Serialize)]
struct Report {
    file: PathBuf,
    #[serde(flatten)]
    repair: Repair,
}

/// Runs it.
///
/// # Errors
/// See [`import`](study::import::import), [`align`] and [`write`].
pub fn run(args: Args, json: bool) -> CommandResult {
    let Some(rig) = &args.rig else {
        let file = quoted(&args.files[0].shown());
        return Err(format!(
            "the rig is missing, which says what each column measures and where: give it with --rig; `surgescope rig new {file}` writes one, and `surgescope open {file}` asks for it in the browser"
        )
        .into());
    };
    let rig = Rig::load(rig)?;
    let output = args
        .output
        .clone()
        .unwrap_or_else(|| Path::new(args.files[0].file_name().unwrap_or_default()).with_extension("mcap"));
    check_starts(&args)?;
    let foreign = args.foreign.clone().options();
    let alone = args.files.len() == 1;
    if let [file] = &args.files[..] {
        let options = ImportOptions { start_unix_ns: start_of(file, &args.start), without: args.without.clone() };
        let mut passing = Passing::new(&rig);
        let mut on_sample = |pass, sensor, time_s, value| match pass {
            Pass::First => passing.first(sensor, time_s, value),
            Pass::Second => passing.second(sensor, time_s, value),
        };
        let long = LongImport { csv: file, rig: &rig, options: &options, source: &foreign, out: &output };
        if let Some(long) = busy(file, || long.run(&mut on_sample))? {
            let used = passing.finish(long.gaps, long.run);
            let scaled = vec![false; rig.sensors.len()];
            if let Some(misread) = misread_in(&used, &scaled, true) {
                std::fs::remove_file(&output)?;
                return Err(format!("{}: {misread}", file.shown()).into());
            }
            let reports = long.repairs.into_iter().map(|repair| Report { file: file.clone(), repair }).collect();
            let done = Done {
                used,
                summary: long.summary,
                reports,
                joined: Vec::new(),
                clocks: Vec::new(),
                left_out: Vec::new(),
                understood: Vec::new(),
            };
            return done.tell(&args, &output, json);
        }
    }
    let mut reports = Vec::new();
    let mut parts = Vec::new();
    let mut understood = Vec::new();
    let mut columns = Vec::new();
    for (i, path) in args.files.iter().enumerate() {
        // a flow by hand is one reading, not one a file
        let elsewhere = recorded(&parts, &rig);
        let foreign = SourceOptions { flow: foreign.flow.filter(|_| i == 0), elsewhere, ..foreign.clone() };
        let options = ImportOptions { start_unix_ns: start_of(path, &args.start), without: args.without.clone() };
        let read = busy(path, || study::import::import(path, &rig, &options, &foreign, alone));
        let imported = read.or_else(|error| guessed(path, error, &args, json))?;
        understood.extend(json.then(|| imported.understood(path)));
        let Imported { recording, repairs, start_digit_s, names, .. } = imported;
        columns.extend(names);
        reports.extend(repairs.into_iter().map(|repair| Report { file: path.clone(), repair }));
        parts.push(Part { file: path.shown().into_owned(), recording, start_digit_s });
    }
    let whole = together(parts, &rig, &args.without, &columns, args.align.map(AlignBy::method))?;
    let joined = whole.said();
    let Together { recording, clocks, left_out } = whole;
    busy(&output, || write(&output, &recording))?;
    let summary = Summary::of(&recording);
    let (used, _) = used(recording);
    Done { used, summary, reports, joined, clocks, left_out, understood }.tell(&args, &output, json)
}

/// The file with guesses that the user has accepted; otherwise the error that it gave without them.
fn guessed(path: &Path, error: ImportError, args: &Args, json: bool) -> Result<Imported, AnyError> {
    let asks = !json && stdin().is_terminal() && stderr().is_terminal();
    let ImportError::Guessed { imported, .. } = &error else {
        // With guesses it came further.
        return if args.yes || asks { Ok(error.accepted()?) } else { Err(error.told()) };
    };
    tell!("{}", understood::text(path, imported));
    if args.yes {
        return Ok(error.accepted()?);
    }
    if !asks {
        return Err(error.told());
    }
    if ask::agreed("Import it so?")? {
        return Ok(error.accepted()?);
    }
    Err("nothing was imported: say what is different with --time-unit, --rate, --map, --scale or --ignore".into())
}

/// What was written, and what there is to say about it.
struct Done {
    /// The recording, of a long one the part that is used.
    used: Recording,
    summary: Summary,
    reports: Vec<Report>,
    /// What became of each file but the first, in words.
    joined: Vec<String>,
    clocks: Vec<Clock>,
    left_out: Vec<String>,
    /// Each file, as it was understood.
    understood: Vec<Value>,
}

impl Done {
    fn tell(self, args: &Args, output: &Path, json: bool) -> CommandResult {
        let Done { used, summary, reports, joined, clocks, left_out, understood } = self;
        let alone = args.files.len() == 1;
        for report in reports.iter().filter(|r| !r.repair.guessed) {
            let line = report.repair.line.map(|l| format!(":{l}")).unwrap_or_default();
            tell!("{}{line}: {}", report.file.shown(), report.repair.text);
        }
        joined.iter().for_each(|text| tell!("{text}"));
        // What contradicts the rig is cheapest to mend here.
        let (features, faults) = examine(&used);
        let lacks = |found: &Features| found.sensors.iter().any(|s| s.missing_at_front_s.is_some());
        // what a sensor did not show, or cut off, is lost as well
        let is_cut = |fault: &SensorFault| matches!(fault.fault, Fault::Stuck | Fault::Clipped);
        let is_lost = features.as_ref().is_ok_and(lacks) || faults.iter().any(is_cut);
        let doubts = match features {
            Ok(features) => doubts(&used.rig, &features),
            // a part of a run, or the wrong one; of a few readings nobody expects a closure
            Err(error @ (SignalError::NoClosure { .. } | SignalError::TooShort { .. })) => vec![error.to_string()],
            Err(_) => Vec::new(),
        };
        let of_clock = |clock: &Clock| {
            let file = clock.file.shown().into_owned();
            clock.warnings.iter().map(move |text| format!("{file}: {text}")).collect::<Vec<_>>()
        };
        let mut warnings: Vec<Value> = unit_warnings(&used).iter().map(|warning| json!(warning)).collect();
        let others = clocks.iter().flat_map(of_clock).chain(doubts.iter().cloned());
        let others = others.chain((!faults.is_empty()).then(|| in_words(&faults)));
        warnings.extend(others.map(|text| json!({ "text": text })));
        warnings.iter().filter_map(|warning| warning["text"].as_str()).for_each(|text| tell_warning!("{text}"));
        if json {
            let sources: Vec<&PathBuf> = args.files.iter().collect();
            let head = json!({
                "file": output, "source": args.files[0], "sources": sources, "mended": reports, "warnings": warnings,
                "alignment": if alone { None } else { Some(&clocks) }, "left_out": left_out, "doubts": doubts, "sensor_faults": faults, "understood": understood,
            });
            say_document(document(head, &summary)?)?;
        } else {
            say!("{}: {summary}", output.shown());
            tell!("next: surgescope open {}", quoted(&output.shown()));
        }
        Ok(if is_lost || reports.iter().any(|r| r.repair.lost) { Outcome::DataLost } else { Outcome::Done })
    }
}

/// The start given for a file, by its path or its name.
fn start_of(path: &Path, starts: &[(Option<String>, u64)]) -> u64 {
    let own = starts.iter().find(|(file, _)| file.as_ref().is_some_and(|f| is_file(path, f)));
    own.or_else(|| starts.iter().find(|(file, _)| file.is_none())).map_or(0, |(_, ns)| *ns)
}

fn is_file(path: &Path, name: &str) -> bool {
    path == Path::new(name) || path.file_name().is_some_and(|f| f == name)
}

fn check_starts(args: &Args) -> Result<(), String> {
    let strange = args
        .start
        .iter()
        .filter_map(|(file, _)| file.as_ref())
        .find(|name| !args.files.iter().any(|p| is_file(p, name)));
    match strange {
        Some(name) => Err(format!("--start {name}=…: no imported file has this name")),
        None if args.files.len() > 1 && args.start.iter().any(|(file, _)| file.is_none()) => {
            Err("--start must name its file: write --start FILE=2026-03-14T09:26:53Z, once per file".into())
        }
        None => Ok(()),
    }
}
