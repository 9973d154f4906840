//! The command line: types, dispatch, exit codes. One thin file a command.

/// A line on standard output. Where nobody reads it any more (`| head`) that is no error: `println!` would panic.
macro_rules! say {
    ($($arg:tt)*) => { $crate::cli::write_out(format_args!("{}\n", format_args!($($arg)*)))? };
}
/// Text on standard output as it stands, likewise.
macro_rules! say_text {
    ($text:expr) => {
        $crate::cli::write_out(format_args!("{}", $text))?
    };
}
/// A line on standard error: progress, notes, warnings. Where nobody reads it any more, or its disk is full, the work goes on
/// and the exit code stays: `eprintln!` would panic.
macro_rules! tell {
    ($($arg:tt)*) => { $crate::cli::write_err(format_args!($($arg)*)) };
}
pub(crate) use {say, say_text, tell};

pub mod accept;
pub mod add;
pub mod as_recorded;
pub mod calibrate;
pub mod creep;
mod creep_prior;
pub mod cross_validate;
pub mod demo;
pub mod diagnose;
pub mod effects;
pub mod energy;
pub mod evaluate;
pub mod export;
pub mod family;
mod fit_output;
pub mod frequency;
pub mod history;
mod hold;
pub mod import;
mod import_options;
pub mod inspect;
mod last_words;
mod live;
pub mod load;
mod memory;
mod misfit;
pub mod model;
pub mod models;
pub mod output;
pub mod pest;
pub mod playback;
pub mod ports;
pub mod predict;
pub mod profile;
pub mod record;
pub mod recover;
pub mod refit;
pub mod replay;
pub mod results;
pub mod rig;
mod run_models;
pub mod scenario;
mod search;
pub mod sensitivity;
pub mod simulate;
mod triggers;
pub mod undo;
pub mod values;
pub mod values_file;
pub mod valve;
pub mod watch;

use std::error::Error;
use std::io::Write as _;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// How a command ended, when it did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done: exit 0.
    Done,
    /// The answer is 'no' (a check failed): exit 1.
    No,
    /// Done, but data was lost on the way: exit 3.
    DataLost,
}

impl Outcome {
    /// The exit code.
    fn code(self) -> u8 {
        match self {
            Outcome::Done => 0,
            Outcome::No => 1,
            Outcome::DataLost => 3,
        }
    }
}

/// Exit code of an error.
const FAILED: u8 = 2;

/// What a command returns; an error is bad input or usage: exit 2.
pub type CommandResult = Result<Outcome, Box<dyn Error + Send + Sync>>;

/// Record, model and calibrate water-hammer tests, and find the physics a model lacks.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Cli {
    /// Print one JSON document on standard output and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Turn time series (CSV, TDMS, MCAP of other programs) into a recording.
    Import(import::Args),
    /// The whole story on a recording that ships with the program.
    Demo(demo::Args),
    /// List the effects that a model can have.
    Effects(effects::Args),
    /// Fit a model to one recording, or to several of one rig at once.
    Calibrate(calibrate::Args),
    Diagnose(diagnose::Args),
    Creep(creep::Args),
    Family(family::Args),
    Predict(predict::Args),
    CrossValidate(cross_validate::Args),
    Frequency(frequency::Args),
    Add(add::Args),
    Refit(refit::Args),
    Undo(undo::Args),
    Results(results::Args),
    Pest(pest::Args),
    Model(model::Args),
    Valve(valve::Args),
    Sensitivity(sensitivity::Args),
    /// Turn a recording into a time series (CSV).
    Export(export::Args),
    /// Show what a recording tells without a model: steady heads, extrema, period, wave speed, closure, noise.
    Inspect(inspect::Args),
    /// Make a whole recording of one that a crash cut off.
    Recover(recover::Args),
    /// Say where a rig file contradicts itself, or a recording made on it.
    Rig(rig::Args),
    Ports(ports::Args),
    /// Record a live, simulated or replayed test.
    Record(record::Args),
    /// Simulate a closure on a rig, no recording needed.
    Simulate(simulate::Args),
    /// Say whether recordings still give the results kept beside them.
    Replay(replay::Args),
    Watch(watch::Args),
    Accept(accept::Args),
    History(history::Args),
}

/// Parses the arguments, runs the command and turns its outcome into the exit code.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result: CommandResult = match cli.command {
        Command::Import(args) => import::run(args, cli.json),
        Command::Demo(args) => demo::run(args, cli.json),
        Command::Effects(args) => effects::run(args, cli.json),
        Command::Calibrate(args) => calibrate::run(args, cli.json),
        Command::Diagnose(args) => diagnose::run(args, cli.json),
        Command::Creep(args) => creep::run(args, cli.json),
        Command::Family(args) => family::run(args, cli.json),
        Command::Predict(args) => predict::run(args, cli.json),
        Command::CrossValidate(args) => cross_validate::run(args, cli.json),
        Command::Frequency(args) => frequency::run(args, cli.json),
        Command::Add(args) => add::run(args, cli.json),
        Command::Refit(args) => refit::run(args, cli.json),
        Command::Results(args) => results::run(args, cli.json),
        Command::Pest(args) => pest::run(args, cli.json),
        Command::Undo(args) => undo::run(args, cli.json),
        Command::Model(args) => model::run(args, cli.json),
        Command::Valve(args) => valve::run(args, cli.json),
        Command::Sensitivity(args) => sensitivity::run(args, cli.json),
        Command::Export(args) => export::run(args, cli.json),
        Command::Inspect(args) => inspect::run(args, cli.json),
        Command::Recover(args) => recover::run(args, cli.json),
        Command::Simulate(args) => simulate::run(args, cli.json),
        Command::Rig(args) => rig::run(args, cli.json),
        Command::Ports(args) => ports::run(args, cli.json),
        Command::Record(args) => record::run(args, cli.json),
        Command::Replay(args) => replay::run(args, cli.json),
        Command::Watch(args) => watch::run(args, cli.json),
        Command::Accept(args) => accept::run(args, cli.json),
        Command::History(args) => history::run(args, cli.json),
    };
    match result {
        Ok(outcome) => ExitCode::from(outcome.code()),
        Err(error) => {
            let _words = last_words::LastWords::before(FAILED, &record::STOP);
            tell!("error: {error}");
            let mut cause = error.source();
            while let Some(inner) = cause {
                tell!("  because: {inner}");
                cause = inner.source();
            }
            ExitCode::from(FAILED)
        }
    }
}

/// Writes to standard output; a closed pipe is not an error, nor is a terminal that has hung up.
fn write_out(text: std::fmt::Arguments) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_fmt(text).and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        #[cfg(unix)]
        Err(error) if error.raw_os_error() == Some(nix::errno::Errno::EIO as i32) => Ok(()),
        other => other,
    }
}

/// Writes a line to standard error, whatever has become of it.
fn write_err(line: std::fmt::Arguments) {
    // in one piece, so that lines of two threads do not mix
    let _ = std::io::stderr().lock().write_all(format!("{line}\n").as_bytes());
}

/// One JSON document of the entries of two objects.
fn document(mut head: serde_json::Value, body: &impl serde::Serialize) -> Result<serde_json::Value, serde_json::Error> {
    if let (Some(head), serde_json::Value::Object(body)) = (head.as_object_mut(), serde_json::to_value(body)?) {
        head.extend(body);
    }
    Ok(head)
}
