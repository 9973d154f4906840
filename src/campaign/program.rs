//! Which program found a result. A task's name holds what goes into it, but not the physics that the program had: a
//! build of other sources may find other numbers.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::campaign::error::{CampaignError, Result};
use crate::campaign::folder::{Folder, place_of};
use crate::campaign::lines;
use crate::campaign::marks::Mark;

/// This program: its version, and a hash of its sources.
pub const PROGRAM: &str =
    concat!("surgescope ", env!("CARGO_PKG_VERSION"), " (sources ", env!("SURGESCOPE_SOURCES"), ")");

/// Results of a program that is not this one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OtherProgram {
    /// As [`PROGRAM`].
    pub program: String,
    /// How many.
    pub results: usize,
}

/// The program that a line of results names.
#[derive(Deserialize)]
struct Found {
    #[serde(default = "unnamed")]
    program: String,
}

/// What wrote results that name no program.
pub(crate) fn unnamed() -> String {
    "an older surgescope, which did not say which".to_owned()
}

/// The program of a file of results: one runner wrote it, so its first line speaks for all. None where no line is
/// whole.
fn program_of(file: &Path) -> Result<Option<String>> {
    let first = lines::first(file).map_err(CampaignError::io("read", file))?;
    Ok(first.and_then(|line| serde_json::from_str::<Found>(&line).ok()).map(|found| found.program))
}

/// Results of other programs, by program.
///
/// # Errors
/// Files that cannot be read.
pub fn others(folder: &Folder) -> Result<Vec<OtherProgram>> {
    let path = folder.results();
    let mut found: BTreeMap<String, usize> = BTreeMap::new();
    for file in lines::files(&path).map_err(CampaignError::io("list", &path))? {
        if let Some(program) = program_of(&file)?.filter(|program| program != PROGRAM) {
            let count = found.entry(program).or_default();
            lines::read(&file, |_| *count += 1).map_err(CampaignError::io("read", &file))?;
        }
    }
    Ok(found.into_iter().map(|(program, results)| OtherProgram { program, results }).collect())
}

/// Puts the results of other programs into a folder beside the rest, so that the next run does their tasks again;
/// returns how many tasks.
///
/// # Errors
/// Runners at work; files that cannot be read or moved.
pub fn put_aside(folder: &Folder) -> Result<usize> {
    let (place, results) = (folder.place("marks"), folder.results());
    let marks = folder.marks()?;
    let at_work = marks.at_work().map_err(CampaignError::io("read the locks of", &place))?;
    if at_work > 0 {
        return Err(CampaignError::AtWork { folder: folder.root().to_owned(), at_work });
    }
    let names = folder.names()?;
    let (mut files, mut tasks) = (Vec::new(), BTreeSet::new());
    for file in lines::files(&results).map_err(CampaignError::io("list", &results))? {
        if program_of(&file)?.is_some_and(|program| program != PROGRAM) {
            let read = lines::read(&file, |line| tasks.extend(place_of(line, &names)));
            read.map_err(CampaignError::io("read", &file))?;
            files.push(file);
        }
    }
    // in this order: one that is cut off between them loses nothing
    let cleared = marks.clear(tasks, Mark::Done).map_err(CampaignError::unwritten(&place))?;
    let aside = results.join("aside");
    for file in files {
        fs::create_dir_all(&aside).map_err(CampaignError::unwritten(&aside))?;
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        let free = (1..).map(|n| aside.join(format!("{name}-{n}.jsonl"))).find(|path| !path.exists());
        fs::rename(&file, free.unwrap_or_default()).map_err(CampaignError::unwritten(&file))?;
    }
    Ok(cleared)
}
