//! The command line: types, dispatch, exit codes. One thin file a command.

pub mod args;
pub mod commands;
pub mod console;

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
    Import(crate::cli::commands::import::Args),
    /// The whole story on a recording that ships with the program.
    Demo(crate::cli::commands::demo::Args),
    /// List the effects that a model can have.
    Effects(crate::cli::commands::effects::Args),
    /// Fit a model to one recording, or to several of one rig at once.
    Calibrate(crate::cli::commands::calibrate::Args),
    Diagnose(crate::cli::commands::diagnose::Args),
    Creep(crate::cli::commands::creep::Args),
    Family(crate::cli::commands::family::Args),
    Predict(crate::cli::commands::predict::Args),
    CrossValidate(crate::cli::commands::cross_validate::Args),
    Frequency(crate::cli::commands::frequency::Args),
    Add(crate::cli::commands::add::Args),
    Refit(crate::cli::commands::refit::Args),
    Undo(crate::cli::commands::undo::Args),
    Results(crate::cli::commands::results::Args),
    Pest(crate::cli::commands::pest::Args),
    Model(crate::cli::commands::model::Args),
    Valve(crate::cli::commands::valve::Args),
    Sensitivity(crate::cli::commands::sensitivity::Args),
    /// Turn a recording into a time series (CSV).
    Export(crate::cli::commands::export::Args),
    /// Show what a recording tells without a model: steady heads, extrema, period, wave speed, closure, noise.
    Inspect(crate::cli::commands::inspect::Args),
    /// Make a whole recording of one that a crash cut off.
    Recover(crate::cli::commands::recover::Args),
    /// Say where a rig file contradicts itself, or a recording made on it.
    Rig(crate::cli::commands::rig::Args),
    Ports(crate::cli::commands::ports::Args),
    /// Record a live, simulated or replayed test.
    Record(crate::cli::commands::record::Args),
    /// Simulate a closure on a rig, no recording needed.
    Simulate(crate::cli::commands::simulate::Args),
    /// Say whether recordings still give the results kept beside them.
    Replay(crate::cli::commands::replay::Args),
    Watch(crate::cli::commands::watch::Args),
    Accept(crate::cli::commands::accept::Args),
    History(crate::cli::commands::history::Args),
}

/// Parses the arguments, runs the command and turns its outcome into the exit code.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result: CommandResult = match cli.command {
        Command::Import(args) => crate::cli::commands::import::run(args, cli.json),
        Command::Demo(args) => crate::cli::commands::demo::run(args, cli.json),
        Command::Effects(args) => crate::cli::commands::effects::run(args, cli.json),
        Command::Calibrate(args) => crate::cli::commands::calibrate::run(args, cli.json),
        Command::Diagnose(args) => crate::cli::commands::diagnose::run(args, cli.json),
        Command::Creep(args) => crate::cli::commands::creep::run(args, cli.json),
        Command::Family(args) => crate::cli::commands::family::run(args, cli.json),
        Command::Predict(args) => crate::cli::commands::predict::run(args, cli.json),
        Command::CrossValidate(args) => crate::cli::commands::cross_validate::run(args, cli.json),
        Command::Frequency(args) => crate::cli::commands::frequency::run(args, cli.json),
        Command::Add(args) => crate::cli::commands::add::run(args, cli.json),
        Command::Refit(args) => crate::cli::commands::refit::run(args, cli.json),
        Command::Results(args) => crate::cli::commands::results::run(args, cli.json),
        Command::Pest(args) => crate::cli::commands::pest::run(args, cli.json),
        Command::Undo(args) => crate::cli::commands::undo::run(args, cli.json),
        Command::Model(args) => crate::cli::commands::model::run(args, cli.json),
        Command::Valve(args) => crate::cli::commands::valve::run(args, cli.json),
        Command::Sensitivity(args) => crate::cli::commands::sensitivity::run(args, cli.json),
        Command::Export(args) => crate::cli::commands::export::run(args, cli.json),
        Command::Inspect(args) => crate::cli::commands::inspect::run(args, cli.json),
        Command::Recover(args) => crate::cli::commands::recover::run(args, cli.json),
        Command::Simulate(args) => crate::cli::commands::simulate::run(args, cli.json),
        Command::Rig(args) => crate::cli::commands::rig::run(args, cli.json),
        Command::Ports(args) => crate::cli::commands::ports::run(args, cli.json),
        Command::Record(args) => crate::cli::commands::record::run(args, cli.json),
        Command::Replay(args) => crate::cli::commands::replay::run(args, cli.json),
        Command::Watch(args) => crate::cli::commands::watch::run(args, cli.json),
        Command::Accept(args) => crate::cli::commands::accept::run(args, cli.json),
        Command::History(args) => crate::cli::commands::history::run(args, cli.json),
    };
    match result {
        Ok(outcome) => ExitCode::from(outcome.code()),
        Err(error) => {
            let _words =
                crate::cli::console::last_words::LastWords::before(FAILED, &crate::cli::commands::record::STOP);
            tell!("error: {error}");
            let mut cause = error.source();
            while let Some(inner) = cause {
                tell!("  because: {inner}");
                cause = inner.source();
            }
            if let Some(hint) = crate::cli::console::hints::hint(error.as_ref()) {
                tell!("  try: {hint}");
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
pub(crate) fn write_err(line: std::fmt::Arguments) {
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
