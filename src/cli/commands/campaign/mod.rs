//! `surgescope campaign`: plan, run, submit, look.

mod child;
mod others;
mod plan;
mod run;
mod status;
mod submit;

use clap::Subcommand;

use crate::cli::console::outcome::CommandResult;

/// Plan thousands of fits or simulations, and run them on a cluster.
///
/// A plan becomes a folder with one task a line. Any number of runners, on one machine or many, work on shards of it.
/// Finished tasks are kept and skipped, so a runner that was killed is simply started again. `results` turns the folder
/// into one table.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Plan(plan::Args),
    Run(run::Args),
    Submit(submit::Args),
    Status(status::Args),
    #[command(hide = true)]
    Child(child::Args),
}

/// Runs it.
///
/// # Errors
/// Those of each action.
pub fn run(args: Args, json: bool) -> CommandResult {
    match args.action {
        Action::Plan(args) => plan::run(&args, json),
        Action::Run(args) => run::run(&args, json),
        Action::Submit(args) => submit::run(&args, json),
        Action::Status(args) => status::run(&args, json),
        Action::Child(args) => child::run(&args),
    }
}
