//! What can go wrong with an index, in sentences for users.

use crate::shown::Shown as _;
use std::io;
use std::path::PathBuf;

/// An index could not be read or written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum HistoryError {
    #[error("{} has no index of runs ({}): `surgescope watch {}` makes one", .0.shown(), crate::results::history::schema::FILE, .0.shown())]
    NoIndex(PathBuf),
    #[error("{} is not an index of runs: move it away, then `surgescope watch` makes a new one", .0.shown())]
    NotOurs(PathBuf),
    #[error("{} was written by a newer version of the program: update surgescope", .0.shown())]
    Newer(PathBuf),
    #[error(
        "another surgescope is working on the recordings in {} ({who}): stop it first, or let it do the work", .folder.shown()
    )]
    Busy { folder: PathBuf, who: String },
    #[error("cannot {action} {}", .path.shown())]
    Io { action: &'static str, path: PathBuf, source: io::Error },
    #[error("the index holds no run of rig '{rig}'; it knows {}", list(.known))]
    UnknownRig { rig: String, known: Vec<String> },
    #[error(
        "the index does not know the recording {0}: `surgescope watch` or `surgescope record --calibrate` fits it first"
    )]
    UnknownRun(String),
    #[error("the index of runs cannot be used")]
    Sqlite(#[from] rusqlite::Error),
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "no rig".into() } else { names.join(", ") }
}
