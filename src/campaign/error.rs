//! What can go wrong with a campaign, in sentences for users.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::shown::Shown as _;
use crate::storage::error::LogError;

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
    #[error("cannot write {}. {}", path.shown(), remedy(source))]
    Unwritten { path: PathBuf, source: io::Error },
    #[error("{}: the name is no text in UTF-8, so no job can name it: rename it", .0.shown())]
    Name(PathBuf),
    #[error("{at_work} tasks of {} are at work: let their runners end, and try again", folder.shown())]
    AtWork { folder: PathBuf, at_work: usize },
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

    /// What the system refused to write.
    pub(crate) fn unwritten(path: &Path) -> impl FnOnce(io::Error) -> CampaignError {
        let path = path.to_owned();
        move |source| CampaignError::Unwritten { path, source }
    }

    /// The same of a file that was to be written whole.
    pub(crate) fn not_whole(path: &Path) -> impl FnOnce(LogError) -> CampaignError {
        let path = path.to_owned();
        move |error| match error {
            LogError::Io { source, .. } => CampaignError::Unwritten { path, source },
            other => CampaignError::Unwritten { path, source: io::Error::other(other) },
        }
    }
}

/// What to do where something cannot be written.
fn remedy(source: &io::Error) -> &'static str {
    match source.kind() {
        ErrorKind::ReadOnlyFilesystem | ErrorKind::PermissionDenied => {
            "Campaigns are planned and run in a folder that you may write to: name another, or copy the campaign there (cp -r) and work on the \
             copy; `campaign status` and `results` only read"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "What was finished before is kept: make room, and run the same command again"
        }
        _ => "What was finished before is kept: run the same command again when it can be written",
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_written_says_what_to_do() {
        let said = |kind: ErrorKind| CampaignError::unwritten(Path::new("study/marks"))(kind.into()).to_string();
        for (kind, words) in [
            (ErrorKind::ReadOnlyFilesystem, "copy the campaign"),
            (ErrorKind::PermissionDenied, "copy the campaign"),
            (ErrorKind::StorageFull, "make room"),
        ] {
            let said = said(kind);
            assert!(said.starts_with("cannot write study/marks. ") && said.contains(words), "{said}");
        }
    }
}
