//! `surgescope recover`: a recording cut off by a crash becomes a whole one.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use crate::cli::console::document::{document, say_document};
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::{say, tell};
use crate::cli::console::progress::busy;
use crate::shown::Shown as _;
use crate::storage::{Recovery, file_has_end, recover};
use crate::watch::folder::list;

/// A file that grows within this time is being recorded.
const GROWS_WITHIN: Duration = Duration::from_secs(1);

/// Save what is in a recording that was cut off, or in all of a folder.
///
/// Of a folder, each recording without an end becomes NAME-recovered.mcap, and its torn file NAME.mcap.torn. A file
/// that is still being recorded stays as it is. Killed at any moment, it loses nothing: run it again.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recording that was cut off or damaged, which stays as it is; or a folder.
    torn: PathBuf,
    /// Recording to write; must not exist.
    #[arg(short, long, value_name = "MCAP")]
    output: Option<PathBuf>,
}

/// Runs it; [`Outcome::DataLost`] if something was lost.
///
/// # Errors
/// See [`recover`](crate::storage::recover).
pub fn run(args: Args, json: bool) -> CommandResult {
    match (&args.output, args.torn.is_dir()) {
        (Some(output), false) => {
            let recovery = one(&args.torn, output, json)?;
            if json {
                say_document(entry(&args.torn, output, &recovery)?)?;
            }
            Ok(if recovery.whole { Outcome::Done } else { Outcome::DataLost })
        }
        (None, true) => all(&args.torn, json),
        (None, false) => Err("--output is missing: name the recording to write".into()),
        (Some(_), true) => {
            Err("--output is for one recording; those of a folder are written beside the torn ones".into())
        }
    }
}

/// Recovers one recording, and says so.
fn one(torn: &Path, output: &Path, json: bool) -> Result<Recovery, AnyError> {
    let recovery = busy(torn, || recover(torn, output))?;
    if !json {
        say!("{}: {}", output.shown(), recovery.kept);
        match recovery.last_good_time_s {
            _ if recovery.whole => say!("nothing was lost"),
            Some(time) => say!("last good sample: {time} s"),
            None => say!("no sample was saved"),
        }
    }
    for loss in &recovery.lost {
        tell!("lost: {loss}");
    }
    Ok(recovery)
}

fn entry(torn: &Path, output: &Path, recovery: &Recovery) -> Result<Value, serde_json::Error> {
    document(json!({ "file": output, "source": torn }), recovery)
}

/// Recovers the recordings of a folder that have no end and do not grow.
fn all(folder: &Path, json: bool) -> CommandResult {
    let before = without_end(folder)?;
    if !before.is_empty() {
        sleep(GROWS_WITHIN);
    }
    let now = without_end(folder)?;
    let (mut recovered, mut failed, mut lost) = (Vec::new(), Vec::new(), false);
    for (torn, size) in &before {
        if now.get(torn) != Some(size) {
            tell!("{}: is being recorded", torn.shown());
            continue;
        }
        let output = torn.with_file_name(suffixed(torn.file_stem().unwrap_or_default(), "-recovered.mcap"));
        // one that was killed before it could put the torn file aside has left a whole one
        if !file_has_end(&output).unwrap_or(false) {
            match one(torn, &output, json) {
                Ok(recovery) => {
                    lost |= !recovery.whole;
                    recovered.push(entry(torn, &output, &recovery)?);
                }
                Err(error) => {
                    lost = true;
                    tell!("{}: {error}", torn.shown());
                    failed.push(json!({ "source": torn, "error": error.to_string() }));
                    // one that is not empty is tried again
                    if *size > 0 {
                        continue;
                    }
                }
            }
        }
        fs::rename(torn, suffixed(torn.as_os_str(), ".torn"))?;
    }
    if json {
        say_document(json!({ "folder": folder, "recovered": recovered, "failed": failed }))?;
    } else if before.is_empty() {
        say!("{}: every recording has its end", folder.shown());
    }
    Ok(if lost { Outcome::DataLost } else { Outcome::Done })
}

/// Recordings of a folder that have no end, and their sizes.
fn without_end(folder: &Path) -> Result<BTreeMap<PathBuf, i64>, AnyError> {
    let (listed, _) = list(folder)?;
    let torn = listed.into_iter().filter(|file| !file_has_end(&file.path).unwrap_or(true));
    Ok(torn.map(|file| (file.path, file.name.size)).collect())
}

fn suffixed(name: &std::ffi::OsStr, suffix: &str) -> OsString {
    let mut name = name.to_owned();
    name.push(suffix);
    name
}
