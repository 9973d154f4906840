//! The command line: types, dispatch, exit codes. One thin file a command.

pub mod args;
pub mod commands;
pub mod console;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::cli::console::last_words::LastWords;
use crate::cli::console::outcome::{CommandResult, FAILED};
use crate::cli::console::print::tell;
use crate::cli::console::stop::STOP;

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
    Import(commands::import::Args),
    /// The whole story on a recording that ships with the program.
    Demo(commands::demo::Args),
    /// List the effects that a model can have.
    Effects(commands::effects::Args),
    /// Fit a model to one recording, or to several of one rig at once.
    Calibrate(commands::calibrate::Args),
    Diagnose(commands::diagnose::Args),
    Creep(commands::creep::Args),
    Family(commands::family::Args),
    Predict(commands::predict::Args),
    CrossValidate(commands::cross_validate::Args),
    Frequency(commands::frequency::Args),
    Add(commands::add::Args),
    Refit(commands::refit::Args),
    Undo(commands::undo::Args),
    Results(commands::results::Args),
    Pest(commands::pest::Args),
    Model(commands::model::Args),
    Valve(commands::valve::Args),
    Sensitivity(commands::sensitivity::Args),
    /// Turn a recording into a time series (CSV).
    Export(commands::export::Args),
    /// Show what a recording tells without a model: steady heads, extrema, period, wave speed, closure, noise.
    Inspect(commands::inspect::Args),
    /// Make a whole recording of one that a crash cut off.
    Recover(commands::recover::Args),
    /// Say where a rig file contradicts itself, or a recording made on it.
    Rig(commands::rig::Args),
    Ports(commands::ports::Args),
    /// Record a live, simulated or replayed test.
    Record(commands::record::Args),
    /// Simulate a closure on a rig, no recording needed.
    Simulate(commands::simulate::Args),
    /// Say whether recordings still give the results kept beside them.
    Replay(commands::replay::Args),
    Watch(commands::watch::Args),
    Accept(commands::accept::Args),
    History(commands::history::Args),
}

/// Parses the arguments, runs the command and turns its outcome into the exit code.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result: CommandResult = match cli.command {
        Command::Import(args) => commands::import::run(args, cli.json),
        Command::Demo(args) => commands::demo::run(args, cli.json),
        Command::Effects(args) => commands::effects::run(args, cli.json),
        Command::Calibrate(args) => commands::calibrate::run(args, cli.json),
        Command::Diagnose(args) => commands::diagnose::run(args, cli.json),
        Command::Creep(args) => commands::creep::run(args, cli.json),
        Command::Family(args) => commands::family::run(args, cli.json),
        Command::Predict(args) => commands::predict::run(args, cli.json),
        Command::CrossValidate(args) => commands::cross_validate::run(args, cli.json),
        Command::Frequency(args) => commands::frequency::run(args, cli.json),
        Command::Add(args) => commands::add::run(args, cli.json),
        Command::Refit(args) => commands::refit::run(args, cli.json),
        Command::Results(args) => commands::results::run(args, cli.json),
        Command::Pest(args) => commands::pest::run(args, cli.json),
        Command::Undo(args) => commands::undo::run(args, cli.json),
        Command::Model(args) => commands::model::run(args, cli.json),
        Command::Valve(args) => commands::valve::run(args, cli.json),
        Command::Sensitivity(args) => commands::sensitivity::run(args, cli.json),
        Command::Export(args) => commands::export::run(args, cli.json),
        Command::Inspect(args) => commands::inspect::run(args, cli.json),
        Command::Recover(args) => commands::recover::run(args, cli.json),
        Command::Simulate(args) => commands::simulate::run(args, cli.json),
        Command::Rig(args) => commands::rig::run(args, cli.json),
        Command::Ports(args) => commands::ports::run(args, cli.json),
        Command::Record(args) => commands::record::run(args, cli.json),
        Command::Replay(args) => commands::replay::run(args, cli.json),
        Command::Watch(args) => commands::watch::run(args, cli.json),
        Command::Accept(args) => commands::accept::run(args, cli.json),
        Command::History(args) => commands::history::run(args, cli.json),
    };
    match result {
        Ok(outcome) => ExitCode::from(outcome.code()),
        Err(error) => {
            let _words = LastWords::before(FAILED, &STOP);
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
