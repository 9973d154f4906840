//! The folder of a campaign: where its files are, its tasks and their marks.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::campaign::error::{CampaignError, Result};
use crate::campaign::lines;
use crate::campaign::marks::{self, Mark, Marks};
use crate::campaign::task::Task;

/// See the module.
#[derive(Debug, Clone)]
pub struct Folder {
    root: PathBuf,
}

/// The beginning of a line of results, of failures, or of tasks.
#[derive(Deserialize)]
struct Named {
    task: String,
}

/// The number of the task that a line of results or failures is about.
pub(crate) fn place_of(line: &str, names: &[String]) -> Option<usize> {
    names.binary_search(&serde_json::from_str::<Named>(line).ok()?.task).ok()
}

impl Folder {
    /// The folder of a campaign that is planned.
    ///
    /// # Errors
    /// Any other folder.
    pub fn open(root: &Path) -> Result<Folder> {
        let folder = Folder::at(root);
        if !folder.tasks_file().is_file() {
            return Err(CampaignError::NoCampaign(root.to_owned()));
        }
        Ok(folder)
    }

    /// Whether there is a campaign in it or not.
    pub(crate) fn at(root: &Path) -> Folder {
        Folder { root: root.to_owned() }
    }

    /// Its path.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// A file or folder in it.
    pub(crate) fn place(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// The tasks.
    pub fn tasks_file(&self) -> PathBuf {
        self.place("tasks.jsonl")
    }

    /// The results of runners.
    pub fn results(&self) -> PathBuf {
        self.place("results")
    }

    /// The failures that runners have met.
    pub fn failures(&self) -> PathBuf {
        self.place("failures")
    }

    /// How many tasks there are.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn count(&self) -> Result<usize> {
        let path = self.tasks_file();
        let failed = CampaignError::io("read", &path);
        let count = || {
            let (mut file, mut buffer, mut lines) = (File::open(&path)?, vec![0; 1 << 18], 0);
            loop {
                match file.read(&mut buffer)? {
                    0 => return Ok(lines),
                    n => lines += buffer[..n].iter().filter(|byte| **byte == b'\n').count(),
                }
            }
        };
        count().map_err(failed)
    }

    /// The tasks whose number is `wanted`, with their numbers; only their lines are parsed.
    ///
    /// # Errors
    /// A file that cannot be read, a line that is no task.
    pub fn tasks(&self, wanted: impl Fn(usize) -> bool) -> Result<Vec<(usize, Task)>> {
        self.parsed(wanted)
    }

    /// The names of all tasks.
    ///
    /// # Errors
    /// As [`Folder::tasks`].
    pub fn names(&self) -> Result<Vec<String>> {
        Ok(self.parsed::<Named>(|_| true)?.into_iter().map(|(_, named)| named.task).collect())
    }

    fn parsed<T: serde::de::DeserializeOwned>(&self, wanted: impl Fn(usize) -> bool) -> Result<Vec<(usize, T)>> {
        let path = self.tasks_file();
        let file = File::open(&path).map_err(CampaignError::io("read", &path))?;
        let mut reader = BufReader::with_capacity(1 << 18, file);
        let (mut found, mut line) = (Vec::new(), Vec::new());
        for number in 0.. {
            line.clear();
            if reader.read_until(b'\n', &mut line).map_err(CampaignError::io("read", &path))? == 0 {
                break;
            }
            if wanted(number) {
                let damaged = |e: serde_json::Error| CampaignError::DamagedTask {
                    file: path.clone(),
                    line: number + 1,
                    why: e.to_string(),
                };
                found.push((number, serde_json::from_slice(&line).map_err(damaged)?));
            }
        }
        Ok(found)
    }

    /// The marks of its tasks, to work on them; a file that is missing is made from the results.
    ///
    /// # Errors
    /// Marks of another campaign, files that cannot be read or written.
    pub fn marks(&self) -> Result<Marks> {
        let path = self.place("marks");
        if !path.exists() {
            marks::write(&path, &self.marks_of_results()?)?;
        }
        Marks::open(&path, self.count()?)
    }

    /// The same, to look at: of a folder that belongs to somebody else, too.
    ///
    /// # Errors
    /// As [`Folder::marks`].
    pub fn marks_to_read(&self) -> Result<Marks> {
        let path = self.place("marks");
        match path.exists() {
            true => Marks::open_to_read(&path, self.count()?),
            false => Marks::elsewhere(&self.marks_of_results()?),
        }
    }

    fn marks_of_results(&self) -> Result<Vec<Mark>> {
        let names = self.names()?;
        let mut found = vec![Mark::Missing; names.len()];
        // a result counts more than a failure before or after it
        for (folder, mark) in [(self.failures(), Mark::Failed), (self.results(), Mark::Done)] {
            for path in lines::files(&folder).map_err(CampaignError::io("list", &folder))? {
                let read = lines::read(&path, |line| {
                    if let Some(at) = place_of(line, &names) {
                        found[at] = mark;
                    }
                });
                read.map_err(CampaignError::io("read", &path))?;
            }
        }
        Ok(found)
    }
}
