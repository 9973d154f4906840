//! Which recordings lie in a folder, and whether each has its end.
//!
//! The folder is polled: that works on network shares and in containers, where notices of the system do not arrive, and
//! a file that grows says no more than its size does. One look is one directory listing with sizes and times; a file is
//! read only where those are new.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crate::results::history::content::identity;
use crate::results::history::index::Name;
use crate::storage::{LogError, decode, has_end};

/// A recording's file as the folder lists it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Name, size and time.
    pub name: Name,
    /// Its path.
    pub path: PathBuf,
    /// For how long it has not been written to, as far as clocks agree.
    pub quiet: Duration,
}

/// What is in a file.
#[derive(Debug)]
pub enum Content {
    /// A recording.
    Recording {
        /// What it is known by.
        identity: String,
        /// Its rig's name.
        rig: String,
        /// Its start, ns since 1970 UTC.
        recorded_unix_ns: i64,
    },
    /// A file with an end that cannot be read as a recording.
    Unreadable {
        /// What it is known by.
        identity: String,
        /// Why.
        error: LogError,
    },
    /// It has no end (yet): it is being written, or was cut off.
    Unfinished,
}

/// The files in a folder that end with `.mcap`, by name; and those whose name is no UTF-8. Hidden ones are left out,
/// and folders.
///
/// # Errors
/// A folder that cannot be listed; a file that vanishes meanwhile is none.
pub fn list(folder: &Path) -> io::Result<(Vec<Listed>, Vec<PathBuf>)> {
    let now = SystemTime::now();
    let (mut all, mut unnamed) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let mcap = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"));
        let hidden = path.file_name().is_none_or(|name| name.as_encoded_bytes().starts_with(b"."));
        if !mcap || hidden {
            continue;
        }
        // through links, as a reader would
        let Ok(meta) = fs::metadata(&path) else { continue };
        if !meta.is_file() {
            continue;
        }
        let Some(file) = path.file_name().and_then(|name| name.to_str()).map(str::to_owned) else {
            unnamed.push(path);
            continue;
        };
        let modified = meta.modified().unwrap_or(UNIX_EPOCH);
        let modified_ns = modified.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as i64);
        let quiet = now.duration_since(modified).unwrap_or_default();
        all.push(Listed { name: Name { file, size: meta.len() as i64, modified_ns }, path, quiet });
    }
    all.sort_by(|a, b| a.name.file.cmp(&b.name.file));
    Ok((all, unnamed))
}

/// Reads a file.
///
/// # Errors
/// Only if it cannot be read at all.
pub fn look_into(path: &Path) -> io::Result<Content> {
    let bytes = fs::read(path)?;
    let head = &bytes[..bytes.len().min(mcap::MAGIC.len())];
    // Nothing is in a file that somebody has just begun, and zeros where who copies it has set its place aside.
    let written = head.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    if mcap::MAGIC.starts_with(&head[..written]) && !has_end(&bytes) {
        return Ok(Content::Unfinished);
    }
    let identity = identity(&bytes);
    Ok(match decode(&bytes, path) {
        Ok(recording) => Content::Recording {
            identity,
            rig: recording.rig.name,
            recorded_unix_ns: i64::try_from(recording.run.start_unix_ns).unwrap_or(i64::MAX),
        },
        Err(error) => Content::Unreadable { identity, error },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_finished_when_its_last_byte_is_there() {
        let whole = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/copper-leak.mcap")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        for cut in [0, 4, 8, 1000, whole.len() / 2, whole.len() - 1] {
            fs::write(&path, &whole[..cut]).unwrap();
            assert!(matches!(look_into(&path).unwrap(), Content::Unfinished), "{cut} of {} bytes", whole.len());
        }
        fs::write(&path, &whole).unwrap();
        assert!(matches!(look_into(&path).unwrap(), Content::Recording { .. }));
        let mut damaged = whole.clone();
        damaged[whole.len() / 2] ^= 1;
        fs::write(&path, &damaged).unwrap();
        assert!(matches!(look_into(&path).unwrap(), Content::Unreadable { .. }));
        // what a copy that sets its place aside first leaves when it is looked at in its midst
        let zeros = vec![0; whole.len()];
        for copied in [0, 4, 1000] {
            fs::write(&path, [&whole[..copied], &zeros[copied..]].concat()).unwrap();
            assert!(matches!(look_into(&path).unwrap(), Content::Unfinished), "{copied} bytes, then zeros");
        }
        fs::write(&path, "no MCAP at all").unwrap();
        assert!(matches!(look_into(&path).unwrap(), Content::Unreadable { .. }));
    }

    #[test]
    fn only_recordings_are_listed() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.mcap", "a.MCAP", ".hidden.mcap", ".surgescope-x.tmp", "a.html", "mcap"] {
            fs::write(folder.path().join(name), "x").unwrap();
        }
        fs::create_dir(folder.path().join("folder.mcap")).unwrap();
        let names: Vec<String> = list(folder.path()).unwrap().0.into_iter().map(|l| l.name.file).collect();
        assert_eq!(names, ["a.MCAP", "b.mcap"]);
    }
}
