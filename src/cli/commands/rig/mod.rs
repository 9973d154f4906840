//! `surgescope rig`: write a rig file, check it, look at it.

mod check;
mod new;
mod show;

use clap::Subcommand;

use crate::cli::console::outcome::CommandResult;

/// Write a rig file, check it, or draw the rig.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    New(Box<new::Args>),
    Check(check::Args),
    Show(show::Args),
}

/// Runs it.
///
/// # Errors
/// Those of each action.
pub fn run(args: Args, json: bool) -> CommandResult {
    match args.action {
        Action::New(args) => new::run(*args, json),
        Action::Check(args) => check::run(&args, json),
        Action::Show(args) => show::run(&args, json),
    }
}
