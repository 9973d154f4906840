//! What can be wrong with a rig file, each with its line.

use std::fmt;
use std::path::PathBuf;

use crate::shown::Shown as _;
use thiserror::Error;

fn remedy(error: &std::io::Error) -> &'static str {
    match error.kind() {
        std::io::ErrorKind::NotFound => "there is none at this path; `surgescope rig new` writes one",
        std::io::ErrorKind::InvalidData => "it is no text in UTF-8, as rig files are; `surgescope rig new` writes one",
        _ => "the system refused it",
    }
}

/// A rig file that cannot be used.
#[derive(Debug, Error)]
pub enum RigError {
    /// The file cannot be read.
    #[error("cannot read the rig file {}: {}", path.shown(), remedy(source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        #[source]
        source: std::io::Error,
    },
    /// An effect of one's own cannot be read.
    #[error("cannot read the effect {}: {said}", path.shown())]
    Effect {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong.
        said: String,
    },
    /// The file has errors.
    #[error("{}", list(file, problems))]
    Invalid {
        /// Name of the file, as the user gave it.
        file: String,
        /// Every problem found, in the order of the lines.
        problems: Vec<Problem>,
    },
}

/// One error in a rig file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Line from 1; `None` if something is missing from the whole file.
    pub line: Option<usize>,
    /// What is wrong and what is allowed, as a sentence.
    pub message: String,
    /// The text of that line.
    pub source_line: String,
}

impl Problem {
    /// The problem as shown to a user: `file:line: message` and the line itself.
    pub fn describe(&self, file: &str) -> String {
        match self.line {
            Some(line) => format!("{file}:{line}: {}\n{line:>5} | {}", self.message, self.source_line),
            None => format!("{file}: {}", self.message),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// Most problems that are shown: more tell a reader nothing new.
const MOST_SHOWN: usize = 10;

fn list(file: &str, problems: &[Problem]) -> String {
    let mut lines: Vec<String> = problems.iter().take(MOST_SHOWN).map(|p| p.describe(file)).collect();
    if problems.len() > MOST_SHOWN {
        lines.push(format!("… and {} more", problems.len() - MOST_SHOWN));
    }
    lines.join("\n")
}
