//! Tables of a file that is no text: each becomes text and is read as any table is; together they are one source.

use std::path::Path;

use crate::storage::error::LogError;
use crate::storage::import::arrays::times::short;
use crate::storage::import::csv;
use crate::storage::import::source::{Repair, SourceFile, SourceOptions, counted};
use crate::storage::nearest::listed;

/// What was found in such a file.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Tables {
    /// Name and text of each table, its columns separated by tabs. Each has times of its own.
    pub texts: Vec<(String, String)>,
    /// What the reader repaired or left out.
    pub repairs: Vec<Repair>,
    /// What is no table that can be read: its name, and why.
    pub left_out: Vec<(String, String)>,
    /// A `/` in a name stands between that of a group and what is in it.
    pub paths: bool,
}

/// The tracks of all tables, on one clock: that of the earliest where they tell the date, else the file's own.
///
/// # Errors
/// No table can be read: what is wrong with the first one.
pub(crate) fn read(tables: Tables, path: &Path, options: &SourceOptions) -> Result<SourceFile, LogError> {
    let Tables { texts, repairs, mut left_out, paths } = tables;
    let mut files = Vec::new();
    let mut first_fault = None;
    for (name, text) in texts {
        match csv::read(text.as_bytes(), options) {
            Ok(file) => files.push((name, file)),
            Err((line, problem)) => {
                left_out.push((name, problem.to_string()));
                first_fault.get_or_insert(LogError::Csv { path: path.into(), line, problem });
            }
        }
    }
    // Where some tell the date and others do not, nothing says how they belong together.
    let dated = files.iter().filter(|(_, file)| file.start.is_some()).count();
    if dated > 0 && dated < files.len() {
        let (kept, others): (Vec<_>, Vec<_>) = files.into_iter().partition(|(_, file)| file.start.is_some());
        left_out
            .extend(others.into_iter().map(|(name, _)| (name, "its times have no date, those of others do".into())));
        files = kept;
    }
    for file in files.iter_mut().map(|(_, file)| file) {
        // the tabs are ours
        file.repairs.retain(|repair| repair.what != "separator");
        // what has one name in several groups is one sensor, until somebody says which
        for track in file.tracks.iter_mut().filter(|track| paths && track.short.contains('/')) {
            file.spare_tracks = true;
            track.name = std::mem::take(&mut track.short);
            track.short = short(&track.name).to_owned();
        }
    }
    let mut whole = SourceFile::joined(files.into_iter().map(|(_, file)| file).collect(), repairs);
    if whole.tracks.is_empty() {
        let nothing = || LogError::SourceFile { path: path.into(), why: nothing_in(&left_out) };
        return Err(first_fault.unwrap_or_else(nothing));
    }
    let is_ignored = |name: &str| options.ignore.iter().any(|other| other == name || other == "*");
    let lost: Vec<String> =
        left_out.iter().filter(|(name, _)| !is_ignored(name)).map(|(name, why)| format!("'{name}' ({why})")).collect();
    if !lost.is_empty() {
        let text = format!("not read: {}; option `ignore` says that it is not needed", listed(&lost));
        whole.repairs.push(Repair { lost: true, ..Repair::new("not-read", lost.len(), None, text) });
    }
    whole.others.extend(left_out.into_iter().map(|(name, _)| name));
    Ok(whole)
}

fn nothing_in(left_out: &[(String, String)]) -> String {
    let all: Vec<String> = left_out.iter().map(|(name, why)| format!("'{name}' ({why})")).collect();
    match all.len() {
        0 => "it holds no table of numbers".into(),
        n => format!(
            "it holds no table of numbers that can be read, but {}: {}",
            counted(n, "other thing", "others"),
            listed(&all)
        ),
    }
}
