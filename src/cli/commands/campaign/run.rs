//! `surgescope campaign run`: does the tasks of one shard.

use std::path::PathBuf;
use std::time::Duration;

use serde_json::json;

use crate::campaign::child::Kind;
use crate::campaign::folder::Folder;
use crate::campaign::program;
use crate::campaign::run::{Progress, Run, run as run_shard};
use crate::campaign::shard::Shard;
use crate::cli::args::values::positive;
use crate::cli::commands::campaign::others::warn_of_others;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::own_program::own_program;
use crate::cli::console::print::{say, tell, tell_warning};
use crate::cli::console::progress::progress_bar;
use crate::cli::console::stop::{STOP, STOP_AT_ONCE, stop_on_signals};
use crate::shown::Shown as _;

/// Do the tasks of a shard that nobody has finished.
///
/// It may be killed and started again at any time, and any number of runners may work on one shard. Ctrl-C and SIGTERM
/// end it when the tasks at work are done, a second time at once. A task that fails is kept with its reason, and the
/// rest goes on. Exit code 1: it was ended before all tasks were done.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The campaign's folder.
    dir: PathBuf,
    /// Which tasks: shard I of N [default: all].
    #[arg(long, value_name = "I/N", default_value = "1/1", hide_default_value = true)]
    shard: Shard,
    /// Tasks at a time, each on one core [default: the cores that it may use].
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u32).range(1..=4096), allow_negative_numbers = true)]
    threads: Option<u32>,
    /// Most time of a task, s; one that takes longer fails.
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    time_limit: Option<f64>,
}

/// Runs it.
///
/// # Errors
/// A folder without a campaign, a full disk.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let folder = Folder::open(&args.dir)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let program = own_program()?;
    let child =
        [String::from("campaign"), "child".into(), args.dir.to_str().ok_or("the folder's name is no UTF-8")?.into()];
    stop_on_signals()?;
    let bar = progress_bar();
    let show = |p: Progress| {
        let failed = if p.failed > 0 { format!(", {} failed", p.failed) } else { String::new() };
        bar.set_message(format!("{} of {} tasks{failed}", p.before + p.done + p.failed, p.tasks));
    };
    let children = Kind {
        program: &program,
        arguments: &child,
        time_limit: args.time_limit.map(Duration::from_secs_f64),
        at_once: &STOP_AT_ONCE,
    };
    let threads = args.threads.map_or(cores, |n| n as usize);
    let ended = run_shard(&folder, &Run { shard: args.shard, threads, children, stop: &STOP, on_progress: &show });
    bar.finish_and_clear();
    let Progress { tasks, before, done, failed, others, left } = ended?;
    if before > 0 {
        warn_of_others(&folder, &program::others(&folder)?);
    }
    if failed > 0 {
        tell_warning!("{failed} tasks failed: `surgescope campaign status {}` says why", args.dir.shown());
    }
    if others > 0 {
        tell!("{others} tasks of this shard are at work in another runner");
    }
    if left > 0 {
        tell!("ended before {left} tasks were done: the same command goes on");
    }
    if json {
        say_document(json!({
            "tasks": tasks, "finished_before": before, "done": done, "failed": failed, "others": others, "left": left,
        }))?;
    } else {
        let before = if before > 0 { format!(", {before} finished before") } else { String::new() };
        say!("{done} of {tasks} tasks done{before}");
    }
    Ok(if left > 0 { Outcome::No } else { Outcome::Done })
}
