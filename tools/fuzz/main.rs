//! Throws damaged input at everything that parses what others wrote, for a given time:
//!
//! ```sh
//! tools/fuzz/run csv 600          # one target, seconds; without arguments every target for ten minutes
//! ```
//!
//! A mutation fuzzer in the manner of AFL and libFuzzer that builds on stable Rust without a system package: the inputs
//! of `corpus/TARGET` and all that have led to new code are mutated again and again. `run` has the compiler count the
//! branches of this workspace; built without it (`cargo run -p surgescope-tools --bin fuzz -- csv 60`) the fuzzer
//! mutates blindly. The same seed gives the same run. What panics, takes more than a second or asks for more than 256
//! MiB at once is kept in `found/`; the exit code is then 1. A new target is one line in `targets.rs` and a folder in
//! `corpus/`.

mod allocation;
mod coverage;
mod frames;
mod lines;
mod modbus;
mod mutate;
mod poller;
mod slave;
mod targets;
mod wire;

use std::collections::HashSet;
use std::fs;
use std::panic;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use targets::{TARGETS, Target};

/// An input that takes longer than this is a finding.
const TOO_SLOW: Duration = Duration::from_secs(1);
/// An allocation above this is a finding: no input here is longer than `mutate::LONGEST`.
const TOO_BIG: usize = 256 << 20;
/// Findings of a target after which it stops.
const ENOUGH: usize = 20;
/// File and line of the last panic.
static PANICKED_AT: Mutex<String> = Mutex::new(String::new());

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let seconds = args.get(1).and_then(|s| s.parse().ok()).unwrap_or(600);
    let seed = args.get(2).and_then(|s| s.parse().ok()).unwrap_or(1);
    let wanted = args.first().filter(|name| *name != "all");
    let chosen: Vec<&Target> = TARGETS.iter().filter(|t| wanted.is_none_or(|name| name == t.name)).collect();
    if chosen.is_empty() {
        let known: Vec<&str> = TARGETS.iter().map(|t| t.name).collect();
        eprintln!("no such target; there are {}", known.join(", "));
        return ExitCode::from(2);
    }
    let findings: usize = chosen.iter().map(|target| fuzz(target, Duration::from_secs(seconds), seed)).sum();
    if findings == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs one target; the number of its findings.
fn fuzz(target: &Target, limit: Duration, seed: u64) -> usize {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let mut queue = corpus(&folder.join("corpus").join(target.name));
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut seen = coverage::Seen::default();
    let mut found = HashSet::new();
    let mut slowest = Duration::ZERO;
    panic::set_hook(Box::new(|panic| {
        let place = panic.location().map(|at| format!(" ({}:{})", at.file(), at.line()));
        *PANICKED_AT.lock().unwrap_or_else(PoisonError::into_inner) = place.unwrap_or_default();
    }));
    for input in &queue {
        run(target, input, &folder, &mut found, &mut slowest);
        seen.anything_new();
    }
    let (started, mut executions, mut said) = (Instant::now(), 0u64, Duration::ZERO);
    while started.elapsed() < limit && found.len() < ENOUGH {
        let input = mutate::mutated(&queue, &mut rng);
        run(target, &input, &folder, &mut found, &mut slowest);
        executions += 1;
        if seen.anything_new() {
            queue.push(input);
        }
        if started.elapsed() - said > Duration::from_secs(60) {
            said = started.elapsed();
            eprintln!("{}: {executions} inputs in {} s, {} lead to new code", target.name, said.as_secs(), queue.len());
        }
    }
    let _ = panic::take_hook();
    println!(
        "{}: {executions} inputs in {} s, {} kept for new code ({} branches), slowest {} ms, {} findings (seed {seed})",
        target.name,
        started.elapsed().as_secs(),
        queue.len(),
        seen.branches(),
        slowest.as_millis(),
        found.len()
    );
    found.len()
}

fn corpus(folder: &Path) -> Vec<Vec<u8>> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
    files.sort();
    let mut inputs: Vec<Vec<u8>> = files.iter().filter_map(|path| fs::read(path).ok()).collect();
    if inputs.is_empty() {
        inputs.push(Vec::new());
    }
    inputs
}

/// One input; keeps it in `found/` where something is wrong with how it was taken.
fn run(target: &Target, input: &[u8], folder: &Path, found: &mut HashSet<String>, slowest: &mut Duration) {
    allocation::reset();
    coverage::reset();
    let started = Instant::now();
    let outcome = panic::catch_unwind(|| (target.run)(input));
    let mut took = started.elapsed();
    if took > TOO_SLOW && outcome.is_ok() {
        // On a busy machine others may have had its time: an input that is slow is so again.
        let again = Instant::now();
        (target.run)(input);
        took = took.min(again.elapsed());
    }
    *slowest = took.max(*slowest);
    let wrong = match outcome {
        Err(cause) => {
            let text = cause.downcast_ref::<String>().cloned();
            let text = text.or(cause.downcast_ref::<&str>().map(|s| s.to_string())).unwrap_or("a panic".into());
            Some(text + &PANICKED_AT.lock().unwrap_or_else(PoisonError::into_inner))
        }
        Ok(()) if took > TOO_SLOW => Some("slow".to_string()),
        Ok(()) if allocation::largest() > TOO_BIG => Some("big".to_string()),
        Ok(()) => None,
    };
    let Some(wrong) = wrong else { return };
    // numbers differ from input to input, the fault behind them does not
    let kind: String = wrong.chars().filter(|c| !c.is_ascii_digit()).collect();
    if found.insert(kind) {
        let path = folder.join("found").join(format!("{}-{}", target.name, found.len()));
        let kept = fs::create_dir_all(folder.join("found")).and_then(|()| fs::write(&path, input));
        eprintln!("{}: {wrong}: {} {}", target.name, path.display(), if kept.is_ok() { "" } else { "(not kept)" });
    }
}
