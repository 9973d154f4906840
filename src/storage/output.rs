//! What may stand where a command is asked to write: a page replaces only an older page, a time series only one like
//! it.

use std::error::Error;
use std::fs::{self, File};
use std::io::{BufWriter, Read, Write};
use std::path::Path;

use crate::shown::Shown as _;
use crate::storage::disk::{publish_new, publish_over, temporary_beside};
use crate::storage::error::LogError;

type AnyError = Box<dyn Error + Send + Sync>;

/// First bytes of an MCAP file.
const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Refuses a place for a report page that holds anything but an older page of this program, so that no recording or rig
/// is lost to a slip of the tongue.
///
/// # Errors
/// A folder, a folder that does not exist, a file that is no such page.
pub fn check_report(path: &Path) -> Result<(), AnyError> {
    if !holds_a_file(path)? {
        return Ok(());
    }
    // the generator stands before anything that a user's text could write
    let start = beginning(path, 1024)?;
    let start = String::from_utf8_lossy(&start);
    if start.starts_with("<!doctype html>") && start.contains("<meta name=\"generator\" content=\"surgescope ") {
        return Ok(());
    }
    Err(format!(
        "{} exists and is not a surgescope report, so it is not overwritten: choose another name for the report",
        path.shown()
    )
    .into())
}

/// How a picture that this program draws begins.
const PICTURE: &str = "<svg ";

/// Refuses a place for a picture that holds anything but an empty file or an older picture.
///
/// # Errors
/// As [`check_result`].
pub fn check_picture(path: &Path) -> Result<(), AnyError> {
    check_result(path, PICTURE)
}

/// Refuses a place for a result that holds anything but an empty file or an older result, one that begins with
/// `heading`.
///
/// # Errors
/// A folder, a folder that does not exist, any other file.
pub fn check_result(path: &Path, heading: &str) -> Result<(), AnyError> {
    if !holds_a_file(path)? {
        return Ok(());
    }
    let start = beginning(path, heading.len())?;
    if start.is_empty() || start == heading.as_bytes() {
        return Ok(());
    }
    Err(format!(
        "{} exists and does not begin with '{heading}', so it is not overwritten: choose another name",
        path.shown()
    )
    .into())
}

/// Refuses a place for a time series that holds anything but an empty file or one that begins with `header`. With
/// `overwrite` any file may go, but neither `rig` nor a recording.
///
/// # Errors
/// A folder, a folder that does not exist, a file that must stay.
pub fn check_series(path: &Path, header: &str, overwrite: bool, rig: &Path) -> Result<(), AnyError> {
    if !holds_a_file(path)? {
        return Ok(());
    }
    let name = path.shown();
    if same_file(path, rig) {
        return Err(format!("{name} is the rig file: choose another name for the time series").into());
    }
    let start = beginning(path, header.len() + 2)?;
    if start.starts_with(MCAP_MAGIC) {
        return Err(format!("{name} is a recording, and recordings are never overwritten: choose another name").into());
    }
    let rest = start.strip_prefix(header.as_bytes());
    let alike = rest.is_some_and(|r| r.is_empty() || r.starts_with(b"\n") || r == b"\r\n");
    if overwrite || start.is_empty() || alike {
        return Ok(());
    }
    Err(format!(
        "{name} exists and does not begin with '{header}', as this time series will: choose another name, or replace it with option `overwrite`"
    )
    .into())
}

/// Refuses a place for a file where one stands. With `overwrite` any file may go, but no recording.
///
/// # Errors
/// A folder, a folder that does not exist, a file that must stay.
pub fn check_new(path: &Path, overwrite: bool) -> Result<(), AnyError> {
    if !holds_a_file(path)? {
        return Ok(());
    }
    let name = path.shown();
    if beginning(path, MCAP_MAGIC.len())? == MCAP_MAGIC {
        return Err(format!("{name} is a recording, and recordings are never overwritten: choose another name").into());
    }
    if overwrite {
        return Ok(());
    }
    Err(format!("{name} exists: choose another name, or replace it with option `overwrite`").into())
}

/// Writes a whole file where none stands, or in the place of one with `overwrite`; at once or not at all.
///
/// # Errors
/// As [`check_new`]; if it cannot be written.
pub fn write_new(path: &Path, content: impl AsRef<[u8]>, overwrite: bool) -> Result<(), AnyError> {
    check_new(path, overwrite)?;
    if overwrite || path.exists() {
        return Ok(write_with(path, |out| out.write_all(content.as_ref()))?);
    }
    let mut beside = temporary_beside(path)?;
    beside.write_all(content.as_ref()).map_err(|e| LogError::io("write", path, e))?;
    Ok(publish_new(beside, path)?)
}

/// Do two paths lead to one file? False where one of them leads nowhere.
pub fn same_file(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Refuses one place for two of a command's outputs; `outputs` are options and where they write.
///
/// # Errors
/// The first two that would write to one file.
pub fn check_apart(outputs: &[(&str, Option<&Path>)]) -> Result<(), String> {
    // What does not exist yet is known by its folder and name.
    let place = |path: &Path| {
        let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let named = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
        path.canonicalize().ok().or_else(named).unwrap_or_else(|| path.to_owned())
    };
    let all: Vec<_> = outputs.iter().filter_map(|(option, path)| Some((option, (*path)?))).collect();
    for (i, (option, path)) in all.iter().enumerate() {
        if let Some((other, _)) = all[..i].iter().find(|(_, p)| place(p) == place(path)) {
            return Err(format!("{other} and {option} both write to {}: name two files", path.shown()));
        }
    }
    Ok(())
}

/// Do two files hold the same bytes? False where one of them cannot be read.
pub fn same_content(a: &Path, b: &Path) -> bool {
    let size = |p: &Path| p.metadata().ok().map(|m| m.len());
    size(a).is_some() && size(a) == size(b) && matches!((fs::read(a), fs::read(b)), (Ok(a), Ok(b)) if a == b)
}

/// Whether there is a file whose content could be lost; devices and pipes have none.
fn holds_a_file(path: &Path) -> Result<bool, AnyError> {
    let name = path.shown();
    match path.metadata() {
        Ok(meta) if meta.is_dir() => Err(format!("{name} is a folder: name a file in it").into()),
        Ok(meta) => Ok(meta.is_file()),
        Err(_) => match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
                Err(format!("the folder {} does not exist: create it, or write elsewhere", folder.shown()).into())
            }
            _ => Ok(false),
        },
    }
}

fn beginning(path: &Path, bytes: usize) -> Result<Vec<u8>, AnyError> {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(bytes as u64).read_to_end(&mut start));
    read.map_err(|e| format!("{} exists and cannot be read, so it is not overwritten: {e}", path.shown()))?;
    Ok(start)
}

/// Writes a whole file, in the place of one that may stand there: the old one stays whole until the new one is.
///
/// # Errors
/// If it cannot be written; the file is named. A pipe that nobody reads.
pub fn write(path: &Path, content: &str) -> Result<(), LogError> {
    write_with(path, |out| out.write_all(content.as_bytes()))
}

/// As [`write`], with what `content` writes.
///
/// # Errors
/// As [`write`].
pub fn write_with(path: &Path, content: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<(), LogError> {
    let failed = |e| LogError::io("write", path, e);
    let filled = |file: &File| {
        let mut out = BufWriter::new(file);
        content(&mut out).and_then(|()| out.flush()).map_err(failed)
    };
    if path.exists() && !path.is_file() {
        require_reader(path)?;
        return filled(&File::create(path).map_err(failed)?); // a device or a pipe
    }
    // Through a link to what it names.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let beside = temporary_beside(&target)?;
    filled(beside.as_file())?;
    if let Ok(old) = fs::metadata(&target) {
        beside.as_file().set_permissions(old.permissions()).map_err(failed)?;
    }
    publish_over(beside, &target)
}

/// Refuses a named pipe that no process has open for reading: writing to it would wait for ever.
fn require_reader(path: &Path) -> Result<(), LogError> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::{FileTypeExt as _, OpenOptionsExt as _};
        let pipe = path.metadata().is_ok_and(|m| m.file_type().is_fifo());
        let without_waiting = || fs::OpenOptions::new().write(true).custom_flags(nix::libc::O_NONBLOCK).open(path);
        if pipe && without_waiting().is_err_and(|e| e.raw_os_error() == Some(nix::libc::ENXIO)) {
            let why = "nobody reads this pipe: name a file, or start its reader first".to_owned();
            return Err(LogError::SourceFile { path: path.to_owned(), why });
        }
    }
    #[cfg(not(unix))]
    let _ = path;
    Ok(())
}

/// What to say of a file that is not there.
pub fn missing(path: &Path) -> String {
    format!("{} does not exist: check the path", path.shown())
}

/// What to say where `what` a file should hold cannot be read.
pub fn unread(what: &str, path: &Path, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => missing(path),
        _ => format!("cannot read {what} {}: {error}", path.shown()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn place(content: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("it");
        fs::write(&path, content).unwrap();
        (folder, path)
    }

    #[test]
    fn a_report_replaces_only_a_report() {
        let page = "<!doctype html>\n<html><head><meta name=\"generator\" content=\"surgescope 0.0.1\">";
        for (content, may) in [
            (page.as_bytes(), true),
            (b"<!doctype html>\n<title>my notes</title>", false),
            (MCAP_MAGIC, false),
            (b"name = \"rig\"\n", false),
            (b"time_s,P1\n", false),
        ] {
            let (folder, path) = place(content);
            assert_eq!(check_report(&path).is_ok(), may, "{}", String::from_utf8_lossy(content));
            assert!(check_report(&folder.path().join("new.html")).is_ok());
            assert!(check_report(folder.path()).unwrap_err().to_string().contains("is a folder"));
            let lost = check_report(&folder.path().join("no/new.html")).unwrap_err().to_string();
            assert!(lost.contains("the folder") && lost.contains("does not exist"), "{lost}");
        }
        // a title cannot pass for the generator: it comes later
        let (_folder, path) = place(format!("<!doctype html>{}{page}", " ".repeat(2000)).as_bytes());
        assert!(check_report(&path).is_err());
    }

    #[test]
    fn two_outputs_want_two_files() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.toml", "./a.toml"].map(|name| folder.path().join(name));
        let said = check_apart(&[("-o", Some(&a)), ("--report", None), ("--save", Some(&b))]).unwrap_err();
        assert!(said.starts_with("-o and --save both write to"), "{said}");
        assert!(check_apart(&[("-o", Some(&a)), ("--save", Some(&folder.path().join("b.toml")))]).is_ok());
    }

    #[test]
    fn a_time_series_replaces_only_one_like_it() {
        let rig = Path::new("no/such/rig.toml");
        for (content, may, may_overwrite) in [
            (&b""[..], true, true),
            (b"time_s,P1,P2\n0,1,2\n", true, true),
            (b"time_s,P1,P2\r\n0,1,2\r\n", true, true),
            (b"time_s,P1,P2", true, true),
            (b"time_s,P1,P2,Q1\n0,1,2,3\n", false, true),
            (b"time_s,P1\n", false, true),
            (b"name = \"rig\"\n", false, true),
            (b"\x89MCAP0\r\n...", false, false),
        ] {
            let (_folder, path) = place(content);
            assert_eq!(check_series(&path, "time_s,P1,P2", false, rig).is_ok(), may, "{content:?}");
            assert_eq!(check_series(&path, "time_s,P1,P2", true, rig).is_ok(), may_overwrite, "{content:?}");
            assert!(
                check_series(&path, "time_s,P1,P2", true, &path).unwrap_err().to_string().contains("is the rig file")
            );
        }
    }

    #[test]
    fn a_file_that_is_not_there_is_said_so() {
        use std::io::{Error, ErrorKind};
        let path = Path::new("x.toml");
        let said = |kind: ErrorKind| unread("the models in", path, &Error::from(kind));
        assert_eq!(said(ErrorKind::NotFound), "x.toml does not exist: check the path");
        assert!(said(ErrorKind::PermissionDenied).starts_with("cannot read the models in x.toml: "));
    }
}
