//! The command line: types, dispatch, exit codes. One thin file a command.

pub mod args;
pub mod commands;
pub mod console;
pub(crate) mod examples;
pub(crate) mod help;

use std::ffi::OsString;
use std::path::Path;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::cli::console::last_words::LastWords;
use crate::cli::console::outcome::{CommandResult, FAILED};
use crate::cli::console::print::tell;
use crate::cli::console::refusal::in_words;
use crate::cli::console::stop::{STOP, outlive_file_limits};
use crate::rig::RigError;
use crate::shown::{Shown as _, controls};
use crate::storage::read::read_own_effects;

/// Record, model and calibrate water-hammer tests, and find the physics a model lacks.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true, disable_help_subcommand = true)]
struct Cli {
    /// Print one JSON document on standard output and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Import(commands::import::Args),
    Demo(commands::demo::Args),
    Open(commands::open::Args),
    Effects(commands::effects::Args),
    Calibrate(commands::calibrate::Args),
    Diagnose(commands::diagnose::Args),
    Creep(commands::creep::Args),
    Family(commands::family::Args),
    Explain(commands::explain::Args),
    Next(commands::next::Args),
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
    Export(commands::export::Args),
    Layout(commands::layout::Args),
    Inspect(commands::inspect::Args),
    Recover(commands::recover::Args),
    Rig(commands::rig::Args),
    Ports(commands::ports::Args),
    Record(commands::record::Args),
    Simulate(commands::simulate::Args),
    Replay(commands::replay::Args),
    Watch(commands::watch::Args),
    Campaign(commands::campaign::Args),
    Accept(commands::accept::Args),
    History(commands::history::Args),
    Completions(commands::completions::Args),
    Man(commands::man::Args),
    Help(help::Args),
}

/// The command line with its commands in groups.
fn command() -> clap::Command {
    help::grouped(examples::added(Cli::command()))
}

/// Ends with what is wrong with the arguments, which the parser quotes as they are.
fn refuse(error: &clap::Error, arguments: &[OsString]) -> ! {
    if !arguments.iter().any(|argument| argument.to_string_lossy().chars().any(controls)) {
        error.exit();
    }
    tell!("{}", error.render().to_string().trim_end().shown());
    std::process::exit(error.exit_code())
}

/// Reads the rigs among the arguments, and those of the recordings, so that effects of their own are known.
///
/// # Errors
/// An effect that cannot be read. What else is wrong, the command itself says.
fn read_rigs(arguments: &[OsString]) -> Result<(), RigError> {
    for argument in arguments.iter().skip(1) {
        let text = argument.to_string_lossy();
        let path = Path::new(text.split_once('=').map_or(&*text, |(_, value)| value));
        read_own_effects(path)?;
    }
    Ok(())
}

/// Runs the command of the arguments, the program's name first, and returns the exit code. Help, and arguments that are
/// refused, end the process.
pub fn run(arguments: &[OsString]) -> u8 {
    let parse = || command().try_get_matches_from(arguments).and_then(|matches| Cli::from_arg_matches(&matches));
    // A rig may have effects of its own: which, only the files that the command line names can say.
    let parsed = match parse() {
        Err(_) if arguments.len() > 1 => {
            if let Err(faulty) = read_rigs(arguments) {
                tell!("error: {}", in_words(&faulty));
                return FAILED;
            }
            parse()
        }
        parsed => parsed,
    };
    let cli = parsed.unwrap_or_else(|error| refuse(&error, arguments));
    // without it such a write ends the program, as it always did
    let _ = outlive_file_limits();
    let result: CommandResult = match cli.command {
        Command::Import(args) => commands::import::run(args, cli.json),
        Command::Demo(args) => commands::demo::run(args, cli.json),
        Command::Open(args) => commands::open::run(args, cli.json),
        Command::Effects(args) => commands::effects::run(args, cli.json),
        Command::Calibrate(args) => commands::calibrate::run(args, cli.json),
        Command::Diagnose(args) => commands::diagnose::run(args, cli.json),
        Command::Creep(args) => commands::creep::run(args, cli.json),
        Command::Family(args) => commands::family::run(args, cli.json),
        Command::Explain(args) => commands::explain::run(args, cli.json),
        Command::Next(args) => commands::next::run(args, cli.json),
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
        Command::Export(args) => commands::export::run(&args, cli.json),
        Command::Layout(args) => commands::layout::run(&args, cli.json),
        Command::Inspect(args) => commands::inspect::run(args, cli.json),
        Command::Recover(args) => commands::recover::run(args, cli.json),
        Command::Simulate(args) => commands::simulate::run(args, cli.json),
        Command::Rig(args) => commands::rig::run(args, cli.json),
        Command::Ports(args) => commands::ports::run(args, cli.json),
        Command::Record(args) => commands::record::run(args, cli.json),
        Command::Replay(args) => commands::replay::run(args, cli.json),
        Command::Watch(args) => commands::watch::run(args, cli.json),
        Command::Campaign(args) => commands::campaign::run(args, cli.json),
        Command::Accept(args) => commands::accept::run(args, cli.json),
        Command::History(args) => commands::history::run(args, cli.json),
        Command::Completions(args) => commands::completions::run(&args, Cli::command(), cli.json),
        Command::Man(args) => commands::man::run(&args, Cli::command(), cli.json),
        Command::Help(args) => help::run(&args, command()),
    };
    match result {
        Ok(outcome) => outcome.code(),
        Err(error) => {
            let _words = LastWords::before(FAILED, &STOP);
            tell!("error: {}", in_words(error.as_ref()));
            FAILED
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_in_exactly_one_group() {
        let command = Cli::command();
        let mut listed: Vec<&str> = help::GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        let mut known: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
        known.retain(|name| *name != "help");
        listed.sort_unstable();
        known.sort_unstable();
        assert_eq!(listed, known);
        assert_eq!(help::GROUPS[0].1.len(), 5, "five for a newcomer");
    }

    #[test]
    fn the_help_has_each_command_with_its_summary_on_one_line() {
        let text = command().render_help().to_string();
        for of in Cli::command().get_subcommands().filter(|c| c.get_name() != "help") {
            let about = of.get_about().map(ToString::to_string).unwrap_or_default();
            assert!(!about.is_empty() && about.chars().count() <= 80, "{}: {about}", of.get_name());
            let line = text.lines().find(|line| line.trim_start().starts_with(&format!("{} ", of.get_name())));
            assert!(line.is_some_and(|line| line.ends_with(&about)), "{}: {about}\n{text}", of.get_name());
        }
        assert!(text.contains("help recording") && text.contains("--json"), "{text}");
    }

    /// What the topics tell a person to type is what the program takes.
    #[test]
    fn topics_show_commands_that_exist() {
        for topic in help::TOPICS {
            let shown: Vec<&str> = topic.text.lines().filter_map(|line| line.strip_prefix("  surgescope ")).collect();
            assert!(shown.len() >= 2, "{}", topic.name);
            for line in shown {
                let words = line.split("  #").next().unwrap_or(line).split_whitespace();
                let parsed = command().try_get_matches_from(std::iter::once("surgescope").chain(words));
                assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
            }
            assert!(command().find_subcommand(topic.name).is_none(), "{} is a command", topic.name);
        }
    }
}
