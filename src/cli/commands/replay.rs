//! `surgescope replay`: do recordings still give the results that are kept beside them?

use std::error::Error;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::cli::args::recordings::open;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell};
use crate::cli::console::progress::shown;
use crate::model::effects::{Chosen, parse_list};
use crate::replay::compare::{Comparison, compare, moved, table};
use crate::replay::expected::{Expected, ExpectedError, path_beside, to_toml, write_beside};
use crate::replay::found::{Found, found};
use crate::shown::Shown as _;

/// Check that recordings still give their expected results.
///
/// Beside `NAME.mcap` stands `NAME.expected.toml` with the quantities to compare, each with a value and a tolerance.
/// Exit 1 where one moved, 2 where a recording or its expected results cannot be read.
///
/// With `--json`: `compared`, `moved` and `recordings` [{`file`, `effects`, `moved`, `comparisons` [{`quantity`,
/// `expected`, `tolerance`, `found`, `verdict` ("held", "moved" or "gone")}], `accepted` (the file written)}], or
/// {`file`, `error`} for one that could not be compared.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings, or folders that contain them (*.mcap).
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Save the present results as the expected ones, with tolerances from the standard errors.
    #[arg(long)]
    accept: bool,
    /// Effects to calibrate with from now on; `none` for the base model alone [default: those of the old expected
    /// results, or no calibration].
    #[arg(long, value_name = "A,B", value_parser = parse_list, requires = "accept")]
    effects: Option<::std::vec::Vec<Chosen>>,
    /// Show all quantities, not only those that moved.
    #[arg(short, long)]
    verbose: bool,
}

type Failure = Box<dyn Error + Send + Sync>;

/// One recording, replayed.
struct Replayed {
    effects: Option<Vec<Chosen>>,
    comparisons: Vec<Comparison>,
    found: Vec<Found>,
}

/// Runs it. One recording that cannot be compared does not keep the others from it.
///
/// # Errors
/// No recording in a folder; a recording or expected results that cannot be read, after all others are done.
pub fn run(args: Args, json: bool) -> CommandResult {
    let recordings = recordings(&args.paths)?;
    let (mut entries, mut compared, mut moved_in_all, mut failed) = (Vec::new(), 0, 0, 0);
    for (i, path) in recordings.iter().enumerate() {
        tell!("[{}/{}] {}", i + 1, recordings.len(), path.shown());
        let outcome = replay(path, &args).and_then(|done| Ok((accept(path, &done, &args)?, done)));
        match outcome {
            Ok((accepted, done)) => {
                compared += done.comparisons.len();
                moved_in_all += moved(&done.comparisons);
                if !json {
                    say_text!(text(path, &done, args.verbose));
                    if let Some(file) = &accepted {
                        say!("  now expected: {}", file.shown());
                    }
                }
                entries.push(entry(path, &done, accepted.as_deref()));
            }
            Err(error) => {
                failed += 1;
                let sentence = with_causes(error.as_ref());
                tell!("error: {sentence}");
                entries.push(json!({ "file": path, "error": sentence }));
            }
        }
    }
    if json {
        say_document(json!({ "compared": compared, "moved": moved_in_all, "recordings": entries }))?;
    } else {
        let verdict = match moved_in_all {
            _ if compared == 0 => "nothing to compare".to_owned(),
            0 => "all held".to_owned(),
            n => format!("{n} moved"),
        };
        say!("{compared} quantities of {} recordings compared: {verdict}", recordings.len() - failed);
    }
    match (failed, moved_in_all) {
        (1.., _) => Err(format!("{failed} of {} recordings could not be compared", recordings.len()).into()),
        (0, 1..) if !args.accept => Ok(Outcome::No),
        _ => Ok(Outcome::Done),
    }
}

fn replay(path: &Path, args: &Args) -> Result<Replayed, Failure> {
    let old = match Expected::beside(path) {
        Err(ExpectedError::Missing { .. }) if args.accept => Expected::default(),
        read => read?,
    };
    if old.quantities.is_empty() && !args.accept {
        let file = path_beside(path);
        return Err(
            format!("{} contains no quantity to compare; `surgescope replay --accept` fills it", file.shown()).into()
        );
    }
    let effects = args.effects.clone().or_else(|| old.effects.clone());
    let mut study = open(&[path.to_owned()], None)?;
    let fit = match &effects {
        Some(effects) => Some(shown(&mut study, "", |study| study.calibrate(effects).run())?),
        None => None,
    };
    let found = found(&study.recordings()[0].features, fit.as_ref());
    Ok(Replayed { effects, comparisons: compare(&old, &found), found })
}

/// Writes the new expected results where that is asked for.
fn accept(path: &Path, done: &Replayed, args: &Args) -> Result<Option<PathBuf>, ExpectedError> {
    if !args.accept {
        return Ok(None);
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    write_beside(path, &to_toml(&name, done.effects.as_deref(), &done.found)).map(Some)
}

/// The recordings that are named, and those in folders that are, each folder in the order of its paths.
fn recordings(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut all = Vec::new();
    for path in paths {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let mut inside = Vec::new();
        search(path, &mut inside).map_err(|e| format!("cannot look for recordings in {}: {e}", path.shown()))?;
        if inside.is_empty() {
            return Err(format!("{} and its folders contain no recording (*.mcap)", path.shown()).into());
        }
        inside.sort();
        all.append(&mut inside);
    }
    Ok(all)
}

fn search(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        // a link to a folder is not followed: it may lead back up
        if entry.file_type()?.is_dir() {
            search(&entry.path(), found)?;
        } else if entry.path().extension().is_some_and(|e| e == "mcap") {
            found.push(entry.path());
        }
    }
    Ok(())
}

fn text(path: &Path, done: &Replayed, all: bool) -> String {
    let (moved, compared) = (moved(&done.comparisons), done.comparisons.len());
    let model = match labels(done) {
        None => "inspected".to_owned(),
        Some(labels) if labels.is_empty() => "base model".to_owned(),
        Some(labels) => labels.join(" + "),
    };
    let verdict = match moved {
        _ if compared == 0 => "nothing expected so far".to_owned(),
        0 => format!("{compared} held"),
        _ => format!("{moved} of {compared} MOVED"),
    };
    format!("{}: {verdict} ({model})\n{}", path.shown(), table(&done.comparisons, all))
}

fn labels(done: &Replayed) -> Option<Vec<String>> {
    done.effects.as_ref().map(|effects| effects.iter().map(Chosen::label).collect())
}

fn entry(path: &Path, done: &Replayed, accepted: Option<&Path>) -> Value {
    let comparisons: Vec<Value> = done
        .comparisons
        .iter()
        .map(|c| {
            json!({ "quantity": c.expected.quantity.to_string(), "expected": c.expected.value,
                    "tolerance": c.expected.tolerance, "found": c.found, "verdict": c.verdict() })
        })
        .collect();
    json!({ "file": path, "effects": labels(done), "moved": moved(&done.comparisons), "comparisons": comparisons,
            "accepted": accepted })
}

/// An error with its causes in one text.
fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        text += &format!("\n  because: {inner}");
        cause = inner.source();
    }
    text
}
