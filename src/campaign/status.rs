//! How far a campaign has come: counted from the marks, whatever the size of the results.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::campaign::error::{CampaignError, Result};
use crate::campaign::folder::Folder;
use crate::campaign::lines;
use crate::campaign::marks::Mark;
use crate::campaign::program::{OtherProgram, others};

/// See the module.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Tasks.
    pub tasks: usize,
    /// Those that have a result.
    pub done: usize,
    /// Those that have failed.
    pub failed: usize,
    /// Those that nobody has finished.
    pub missing: usize,
    /// Those of them that runners work on now.
    pub at_work: usize,
    /// Mean time that a finished task took, s; none where nothing is known.
    pub seconds_per_task: Option<f64>,
    /// Time left with as many tasks at work as now, s; of one core where none is at work.
    pub time_left_s: Option<f64>,
    /// Results of other programs than this one: their numbers may be others.
    pub other_programs: Vec<OtherProgram>,
    /// Why tasks failed, by name.
    pub failures: Vec<Failure>,
}

/// A task that failed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// Its name.
    pub task: String,
    /// What it was, in words.
    pub what: String,
    /// Why it failed.
    pub reason: String,
}

#[derive(Deserialize)]
struct Timed {
    seconds: f64,
}

/// The end of a file of results that times are read from, bytes.
const END: u64 = 1 << 16;
/// Files that times are read from: those of a few runners tell enough.
const FILES: usize = 32;

/// Looks at a campaign.
///
/// # Errors
/// Files that cannot be read.
pub fn status(folder: &Folder) -> Result<Status> {
    let place = folder.place("marks");
    let marks = folder.marks_to_read()?;
    let at_work = marks.at_work().map_err(CampaignError::io("read the locks of", &place))?;
    let all = marks.all().map_err(CampaignError::io("read", &place))?;
    let count = |mark| all.iter().filter(|m| **m == mark).count();
    let (done, failed, missing) = (count(Mark::Done), count(Mark::Failed), count(Mark::Missing));
    let seconds_per_task = seconds_per_task(folder)?;
    let time_left_s = match missing {
        0 => Some(0.0),
        _ => seconds_per_task.map(|seconds| seconds * missing as f64 / at_work.max(1) as f64),
    };
    let failures = if failed > 0 { failures(folder, &all)? } else { Vec::new() };
    let other_programs = others(folder)?;
    Ok(Status {
        tasks: all.len(),
        done,
        failed,
        missing,
        at_work,
        seconds_per_task,
        time_left_s,
        other_programs,
        failures,
    })
}

/// Why the tasks failed whose marks say so, in the order of their names. Of a task that failed before it was tried
/// again, the last reason.
pub(crate) fn failures(folder: &Folder, marks: &[Mark]) -> Result<Vec<Failure>> {
    let mut found: BTreeMap<String, Failure> = BTreeMap::new();
    let names = folder.names()?;
    let path = folder.failures();
    for file in lines::files(&path).map_err(CampaignError::io("list", &path))? {
        let read = lines::read(&file, |line| {
            let Ok(failure) = serde_json::from_str::<Failure>(line) else { return };
            if names.binary_search(&failure.task).is_ok_and(|at| marks[at] == Mark::Failed) {
                found.insert(failure.task.clone(), failure);
            }
        });
        read.map_err(CampaignError::io("read", &file))?;
    }
    Ok(found.into_values().collect())
}

fn seconds_per_task(folder: &Folder) -> Result<Option<f64>> {
    let path = folder.results();
    let files = lines::files(&path).map_err(CampaignError::io("list", &path))?;
    let mut seconds = Vec::new();
    for file in files.iter().rev().take(FILES) {
        let last = lines::last(file, END).map_err(CampaignError::io("read", file))?;
        seconds.extend(last.iter().filter_map(|line| serde_json::from_str::<Timed>(line).ok()).map(|t| t.seconds));
    }
    Ok((!seconds.is_empty()).then(|| seconds.iter().sum::<f64>() / seconds.len() as f64))
}

/// Takes the failures back, so that the next run tries these tasks again; returns how many.
///
/// # Errors
/// Files that cannot be read or written.
pub fn retry(folder: &Folder) -> Result<usize> {
    let place = folder.place("marks");
    let marks = folder.marks()?;
    let all = marks.all().map_err(CampaignError::io("read", &place))?;
    let failed = all.iter().enumerate().filter(|(_, mark)| **mark == Mark::Failed).map(|(task, _)| task);
    marks.clear(failed, Mark::Failed).map_err(CampaignError::unwritten(&place))
}
