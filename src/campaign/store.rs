//! What a runner finds: appended to a file of its own, a line a task, so that no two runners ever write to one file.
//!
//! A line is written in one piece. A task is marked, and given back, once its line is on the disk: what is marked is
//! there, whatever becomes of the machine. Disks are asked for that at most twice a second, for many tasks at once.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::campaign::child::Answer;
use crate::campaign::error::{CampaignError, Result};
use crate::campaign::folder::Folder;
use crate::campaign::lines::sealed;
use crate::campaign::marks::{Mark, Marks};
use crate::campaign::program::PROGRAM;
use crate::campaign::task::Task;

/// Time between two requests to the disk.
const EVERY: Duration = Duration::from_millis(500);

/// See the module.
pub struct Store<'a> {
    marks: &'a Marks,
    inner: Mutex<Inner>,
}

struct Inner {
    results: Appended,
    failures: Appended,
    /// Tasks whose lines are written and not yet known to be on the disk.
    pending: Vec<(usize, Mark)>,
    synced: Instant,
}

/// A file of a runner's own, made when it has its first line.
struct Appended {
    folder: PathBuf,
    stem: String,
    file: Option<(PathBuf, File)>,
    length: u64,
}

impl Store<'_> {
    /// A store for the runner of this shard.
    pub fn new<'a>(folder: &Folder, marks: &'a Marks, shard: &str) -> Store<'a> {
        let of = |folder| Appended { folder, stem: shard.to_owned(), file: None, length: 0 };
        let (results, failures) = (of(folder.results()), of(folder.failures()));
        Store { marks, inner: Mutex::new(Inner { results, failures, pending: Vec::new(), synced: Instant::now() }) }
    }

    /// Keeps what came out of a task.
    ///
    /// # Errors
    /// A full disk and the like: then nothing of it is kept, and the task stays missing.
    pub fn keep(&self, number: usize, task: &Task, seconds: f64, answer: &Answer) -> Result<()> {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let mark = match answer {
            Answer::Found(document) => {
                let (task, program) = (&task.task, Value::from(PROGRAM));
                let line = format!(
                    "{{\"task\":\"{task}\",\"program\":{program},\"seconds\":{seconds:.6},\"answer\":{document}}}"
                );
                inner.results.append(&sealed(&line))?;
                Mark::Done
            }
            Answer::Failed(reason) => {
                let line = json!({
                    "task": task.task, "program": PROGRAM, "seconds": seconds, "what": task.in_words(), "reason": reason,
                });
                inner.failures.append(&sealed(&line.to_string()))?;
                Mark::Failed
            }
        };
        inner.pending.push((number, mark));
        if inner.synced.elapsed() >= EVERY { inner.commit(self.marks) } else { Ok(()) }
    }

    /// Marks what was kept, unless that was done a moment ago.
    ///
    /// # Errors
    /// As [`Store::commit`].
    pub fn commit_if_due(&self) -> Result<()> {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        if inner.synced.elapsed() >= EVERY { inner.commit(self.marks) } else { Ok(()) }
    }

    /// Marks all that was kept.
    ///
    /// # Errors
    /// A disk that does not take it.
    pub fn commit(&self) -> Result<()> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).commit(self.marks)
    }
}

impl Inner {
    fn commit(&mut self, marks: &Marks) -> Result<()> {
        self.synced = Instant::now();
        if self.pending.is_empty() {
            return Ok(());
        }
        self.results.sync()?;
        self.failures.sync()?;
        let place = self.results.folder.with_file_name("marks");
        for (number, mark) in self.pending.drain(..) {
            marks.set(number, mark).map_err(CampaignError::unwritten(&place))?;
        }
        Ok(())
    }
}

impl Appended {
    fn append(&mut self, line: &str) -> Result<()> {
        let (path, file) = match &mut self.file {
            Some(open) => open,
            None => self.file.insert(created(&self.folder, &self.stem)?),
        };
        if let Err(source) = file.write_all(line.as_bytes()) {
            // what went out of it is no line; a reader would leave it out as well
            let _ = file.set_len(self.length);
            return Err(CampaignError::unwritten(path)(source));
        }
        self.length += line.len() as u64;
        Ok(())
    }

    fn sync(&self) -> Result<()> {
        let Some((path, file)) = &self.file else { return Ok(()) };
        file.sync_data().map_err(CampaignError::unwritten(path))
    }
}

/// A file that no other runner has, on any machine.
fn created(folder: &Path, stem: &str) -> Result<(PathBuf, File)> {
    fs::create_dir_all(folder).map_err(CampaignError::unwritten(folder))?;
    let mut run = 1;
    loop {
        let path = folder.join(format!("{stem}-run-{run}.jsonl"));
        match OpenOptions::new().append(true).create_new(true).open(&path) {
            Ok(file) => return Ok((path, file)),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => run += 1,
            Err(e) => return Err(CampaignError::unwritten(&path)(e)),
        }
    }
}
