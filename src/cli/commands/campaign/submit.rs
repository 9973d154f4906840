//! `surgescope campaign submit`: writes the job of an engine that schedules, and starts it.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::ValueEnum;
use serde_json::json;

use crate::campaign::engine::{self, Job, quoted};
use crate::campaign::folder::Folder;
use crate::cli::args::values::positive;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::own_program::own_program;
use crate::cli::console::print::{say, tell};
use crate::shown::Shown as _;

/// Write the job of HyperQueue, Slurm or Snakemake for a campaign, and start it.
///
/// The job is a short text in DIR/jobs: read it, and add what your site asks for. Each shard is one task of the engine.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The campaign's folder; all machines must find it, and the inputs, at the same place.
    dir: PathBuf,
    /// The engine.
    #[arg(long, value_enum)]
    to: Engine,
    /// Start it.
    #[arg(long)]
    go: bool,
    /// Shards [default: one for each task, at most 200].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_negative_numbers = true)]
    shards: Option<u32>,
    /// Cores of each shard.
    #[arg(long, value_name = "T", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=4096), allow_negative_numbers = true)]
    threads: u32,
    /// Most time of a task, s; one that takes longer fails.
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    time_limit: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Engine {
    /// HyperQueue.
    Hq,
    /// Slurm.
    Slurm,
    /// Snakemake.
    Snakemake,
}

impl Engine {
    fn engine(self) -> engine::Engine {
        match self {
            Engine::Hq => engine::Engine::HyperQueue,
            Engine::Slurm => engine::Engine::Slurm,
            Engine::Snakemake => engine::Engine::Snakemake,
        }
    }

    /// What starts a job, and how one gets it.
    fn starts(self) -> (&'static [&'static str], &'static str) {
        match self {
            Engine::Hq => (&["hq", "submit"], "HyperQueue's releases have it; the package of PyPI has only a library"),
            Engine::Slurm => (&["sbatch"], "Slurm has it"),
            Engine::Snakemake => (&["snakemake", "--cores", "all", "--snakefile"], "`pip install snakemake` has it"),
        }
    }
}

/// Shards unless they are given.
const MOST: usize = 200;

/// Runs it.
///
/// # Errors
/// A folder without a campaign, an engine that is not there or refuses the job.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let folder = Folder::open(&args.dir)?;
    let shards = args.shards.map_or_else(|| Ok(folder.count()?.clamp(1, MOST)), |n| Ok::<_, AnyError>(n as usize))?;
    let more = args.time_limit.map_or(String::new(), |limit| format!(" --time-limit {limit}"));
    let program = own_program()?;
    let job = Job { engine: args.to.engine(), shards, threads: args.threads as usize, more: &more, program: &program };
    let file = engine::write(&folder, &job)?;
    let (words, source) = args.to.starts();
    let name = file.to_string_lossy();
    if args.go {
        start(words, source, &file)?;
    }
    if json {
        let command: Vec<&str> = words.iter().copied().chain([name.as_ref()]).collect();
        say_document(json!({ "file": file, "shards": shards, "command": command, "started": args.go }))?;
    } else {
        say!("{}: {shards} shards", file.shown());
        if !args.go {
            tell!("start it with: {} {}", words.join(" "), quoted(&name));
        }
    }
    Ok(Outcome::Done)
}

/// Starts a job; what the engine says goes to standard error.
fn start(words: &[&str], source: &str, file: &Path) -> Result<(), AnyError> {
    let output = Stdio::from(std::io::stderr());
    let started = Command::new(words[0]).args(&words[1..]).arg(file).stdout(output).status();
    match started {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{} refused the job {}: {status}", words[0], file.shown()).into()),
        Err(e) if e.kind() == ErrorKind::NotFound => {
            Err(format!("there is no program '{}' to start {}: {source}", words[0], file.shown()).into())
        }
        Err(e) => Err(format!("'{}' cannot be started: {e}", words[0]).into()),
    }
}
