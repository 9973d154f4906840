//! What can go wrong with a campaign, in sentences for users.

use std::io;
use std::path::{Path, PathBuf};

use crate::shown::Shown as _;

/// Any error of a campaign as a whole; that of a task is a reason in its folder.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum CampaignError {
    #[error("{file}:{line}: {message}\n{line:>5} | {source_line}")]
    Plan { file: String, line: usize, message: String, source_line: String },
    #[error("{file}: {message}")]
    PlanAsWhole { file: String, message: String },
    #[error("cannot {action} {}", path.shown())]
    Io { action: &'static str, path: PathBuf, source: io::Error },
    #[error("{} holds another campaign of {tasks} tasks, {finished} of them finished: choose another folder", .folder.shown())]
    OtherPlan { folder: PathBuf, tasks: usize, finished: usize },
    #[error("{} holds files and no campaign: choose a new folder", .0.shown())]
    NotEmpty(PathBuf),
    #[error("{} is no folder of a campaign (it has no tasks.jsonl): `surgescope campaign plan PLAN.toml -o DIR` makes one", .0.shown())]
    NoCampaign(PathBuf),
    #[error("line {line} of {} is damaged ({why}): plan the campaign again, in a new folder", file.shown())]
    DamagedTask { file: PathBuf, line: usize, why: String },
    #[error("{} has {bytes} marks for {tasks} tasks: it is not this campaign's; remove it, and the next run makes it from the results", file.shown())]
    Marks { file: PathBuf, bytes: usize, tasks: usize },
    #[error("the results cannot be written to {}. What was finished before is kept: make room, and run the same command again", path.shown())]
    Unwritten { path: PathBuf, source: io::Error },
    #[error("{}: the name is no text in UTF-8, so no job can name it: rename it", .0.shown())]
    Name(PathBuf),
    #[error("the marks of the tasks cannot be used")]
    Claim { source: io::Error },
    #[error("the program cannot start itself as {}", program.shown())]
    NoChild { program: PathBuf, source: io::Error },
}

/// Results of a campaign's functions.
pub type Result<T> = std::result::Result<T, CampaignError>;

impl CampaignError {
    /// What the system refused to do with a file.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> CampaignError {
        let path = path.to_owned();
        move |source| CampaignError::Io { action, path, source }
    }
}

/// An error with its causes, in one sentence.
pub(crate) fn sentence(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let words = inner.to_string();
        if !text.contains(&words) {
            text += &format!(": {words}");
        }
        cause = inner.source();
    }
    text
}
