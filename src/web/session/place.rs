//! Where the runs of a workbench lie: some recordings, a model file, or a folder; and the tables in it that may become
//! runs.

use std::collections::HashMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use crate::report::advice::quoted;
use crate::results::history::Index;
use crate::results::history::schema::FILE;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::check_recording;
use crate::study::models;
use crate::watch::folder::list;

type AnyError = Box<dyn Error + Send + Sync>;

/// A run that was asked for by a number that none has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("there is no such run")]
pub struct NoSuchRun;

/// One recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Run {
    /// Its number in this session, as the page names it.
    pub id: usize,
    /// Its path.
    pub path: PathBuf,
    /// What a folder's index knows of it.
    pub known: Option<Known>,
}

/// What a folder's index knows of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Known {
    /// Its rig.
    pub rig: String,
    /// When it was recorded, RFC 3339.
    pub when: Option<String>,
    /// What was found in it.
    pub finding: Option<crate::results::history::Finding>,
}

impl Run {
    /// The file's name.
    pub fn name(&self) -> String {
        Path::new(self.path.file_name().unwrap_or(self.path.as_os_str())).shown().into_owned()
    }
}

/// See the module.
#[derive(Default)]
pub struct Place {
    folder: Option<PathBuf>,
    model_file: Option<PathBuf>,
    rig: Option<Rig>,
    table: Option<PathBuf>,
    listed: Mutex<Listed>,
    told: Mutex<Told>,
}

/// What was last told of a folder: when it and its index had been written to, its runs and its tables.
type Told = ([Option<SystemTime>; 2], Vec<Run>, Vec<PathBuf>);

/// How files of loggers end that become recordings.
const TABLES: [&str; 12] = ["csv", "txt", "tsv", "dat", "lvm", "tdms", "xlsx", "xls", "ods", "mat", "h5", "hdf5"];

fn is_table(path: &Path) -> bool {
    path.extension().is_some_and(|own| TABLES.iter().any(|ending| own.eq_ignore_ascii_case(ending)))
}

/// The folder that a file lies in.
fn folder_of(file: &Path) -> PathBuf {
    let folder = file.parent().unwrap_or(Path::new(""));
    if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() }
}

#[derive(Default)]
struct Listed {
    runs: Vec<Run>,
    /// Of all that were ever listed: a number stays with its file, also while that is away.
    numbers: HashMap<PathBuf, usize>,
}

impl Listed {
    fn number(&mut self, path: &Path) -> usize {
        let next = self.numbers.len();
        *self.numbers.entry(path.to_owned()).or_insert(next)
    }
}

impl Place {
    /// What paths name: recordings of one rig, one model file, one rig file, one table of a logger, or one folder.
    ///
    /// # Errors
    /// None of these, a mixture of them, a file or folder that cannot be read.
    pub fn of(paths: &[PathBuf]) -> Result<Place, AnyError> {
        let is_model = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        match paths {
            [folder] if folder.is_dir() => {
                let place = Place { folder: Some(folder.clone()), model_file: None, ..Place::default() };
                place.look()?;
                Ok(place)
            }
            [file] if is_table(file) && file.is_file() => {
                Ok(Place { folder: Some(folder_of(file)), table: Some(file.clone()), ..Place::default() })
            }
            [file] if is_model(file) => {
                if let Ok(rig) = Rig::load(file) {
                    return Ok(Place { folder: Some(folder_of(file)), rig: Some(rig), ..Place::default() });
                }
                let folder = file.parent().unwrap_or(Path::new(""));
                let recordings = models::load(file)?.recordings.into_iter().map(|path| folder.join(path));
                Ok(Place { model_file: Some(file.clone()), ..Place::default() }.with(recordings))
            }
            [first, _, ..] if paths.iter().all(|path| is_table(path)) => {
                let files: Vec<String> = paths.iter().map(|path| quoted(&path.shown()).to_string()).collect();
                let (files, folder) = (files.join(" "), folder_of(first));
                Err(format!(
                    "several tables are opened as one recording: `surgescope rig new {files}` writes the rig, `surgescope import {files} --rig rig.toml` joins them; or `surgescope open {}` takes one after the other",
                    quoted(&folder.shown())
                )
                .into())
            }
            _ => match paths.iter().find(|path| path.is_dir() || is_model(path) || (paths.len() > 1 && is_table(path)))
            {
                Some(odd) => Err(format!(
                    "{}: open recordings, or one folder, or one model file, or one table, but not a mixture of them",
                    odd.shown().into_owned()
                )
                .into()),
                None => {
                    paths.iter().try_for_each(|path| check_recording(path))?;
                    Ok(Place::default().with(paths.iter().cloned()))
                }
            },
        }
    }

    /// It in words.
    pub fn words(&self) -> String {
        match (&self.folder, &self.model_file) {
            // `.` says nothing on a page
            (Some(folder), _) => std::path::absolute(folder).unwrap_or_else(|_| folder.clone()).shown().into_owned(),
            (None, Some(file)) => file.shown().into_owned(),
            (None, None) => self.runs().iter().map(Run::name).collect::<Vec<_>>().join(", "),
        }
    }

    /// The folder, where one is open.
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// The model file that was named.
    pub fn model_file(&self) -> Option<&Path> {
        self.model_file.as_deref()
    }

    /// The rig whose file was named.
    pub fn rig(&self) -> Option<&Rig> {
        self.rig.as_ref()
    }

    /// The table that was named.
    pub fn table(&self) -> Option<&Path> {
        self.table.as_deref()
    }

    /// The tables in the folder, by name.
    pub fn tables(&self) -> Vec<PathBuf> {
        let entries = self.folder.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().flatten();
        let is_hidden = |path: &Path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        let paths = entries.map(|entry| entry.path());
        let mut found: Vec<PathBuf> =
            paths.filter(|path| is_table(path) && !is_hidden(path) && path.is_file()).collect();
        found.sort();
        found
    }

    /// The run of a recording, which is listed from now on.
    pub fn add(&self, path: PathBuf) -> Run {
        let mut listed = self.lock();
        if let Some(run) = listed.runs.iter().find(|run| run.path == path) {
            return run.clone();
        }
        let run = Run { id: listed.number(&path), path, known: None };
        listed.runs.push(run.clone());
        run
    }

    /// The runs that are opened first: all that were named, or the newest of a folder; none beside a rig file or a
    /// table.
    pub fn first(&self) -> Vec<Run> {
        let runs = if self.rig.is_some() || self.table.is_some() { Vec::new() } else { self.runs() };
        if self.folder.is_none() {
            return runs;
        }
        let age = |run: &Run| std::fs::metadata(&run.path).and_then(|about| about.modified()).ok();
        runs.into_iter().rev().max_by_key(age).into_iter().collect()
    }

    /// All runs, a folder's as they are now.
    pub fn runs(&self) -> Vec<Run> {
        // a folder that cannot be read at the moment keeps what it had
        let _ = self.look();
        self.lock().runs.clone()
    }

    /// Whether a folder's runs or tables, or what its index knows of them, have changed since this was last asked.
    pub fn has_changed(&self) -> bool {
        let Some(folder) = &self.folder else { return false };
        let written = |path: &Path| std::fs::metadata(path).and_then(|about| about.modified()).ok();
        let now = [written(folder), written(&folder.join(FILE))];
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if told.0 == now {
            return false;
        }
        let (runs, tables) = (self.runs(), self.tables());
        let changed = runs != told.1 || tables != told.2;
        *told = (now, runs, tables);
        changed
    }

    /// The runs of these numbers.
    ///
    /// # Errors
    /// A run that does not exist.
    pub fn named(&self, ids: &[usize]) -> Result<Vec<Run>, NoSuchRun> {
        let runs = self.runs();
        ids.iter().map(|&id| runs.iter().find(|run| run.id == id).cloned().ok_or(NoSuchRun)).collect()
    }

    fn look(&self) -> Result<(), AnyError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        // held from here, so that no older list follows a newer one
        let mut listed = self.lock();
        let files = list(folder)?.0;
        let index = Index::read(folder).and_then(|index| index.all()).unwrap_or_default();
        let index: HashMap<&str, _> = index.iter().map(|run| (&run.file[..], run)).collect();
        let mut runs = Vec::with_capacity(files.len());
        for file in files {
            let known = index.get(&file.name.file[..]).map(|run| Known {
                rig: run.rig.clone(),
                when: crate::results::fit_record::recorded_at(run.recorded_unix_ns.max(0) as u64),
                finding: run.finding.clone(),
            });
            runs.push(Run { id: listed.number(&file.path), path: file.path, known });
        }
        listed.runs = runs;
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, Listed> {
        self.listed.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place {
    fn with(self, paths: impl Iterator<Item = PathBuf>) -> Place {
        paths.for_each(|path| drop(self.add(path)));
        self
    }
}
