//! Files that appear whole or not at all, and never in the place of another.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::NamedTempFile;

use crate::storage::error::LogError;

/// A pipe may hold no more than this, bytes: nothing says where it ends.
const LONGEST_PIPE: u64 = 4 << 30;

/// Opens a file or a pipe to read.
///
/// # Errors
/// A folder, a device, or what cannot be opened.
pub fn open_file(path: &Path) -> Result<File, LogError> {
    let io = |e| LogError::io("read", path, e);
    let about = fs::metadata(path).map_err(io)?;
    if about.is_dir() {
        return Err(LogError::Folder(path.into()));
    }
    #[cfg(unix)]
    let is_pipe = std::os::unix::fs::FileTypeExt::is_fifo(&about.file_type());
    #[cfg(not(unix))]
    let is_pipe = false;
    if !about.is_file() && !is_pipe {
        return Err(LogError::NoFile(path.into()));
    }
    File::open(path).map_err(io)
}

/// The whole content of a file or a pipe.
///
/// # Errors
/// As [`open_file`]; a file larger than memory, a pipe that does not end.
pub fn read_file(path: &Path) -> Result<Vec<u8>, LogError> {
    let io = |e| LogError::io("read", path, e);
    let file = open_file(path)?;
    let about = file.metadata().map_err(io)?;
    let (length, limit) = if about.is_file() { (about.len(), u64::MAX) } else { (0, LONGEST_PIPE) };
    let too_large = |bytes| LogError::TooLarge { path: path.into(), gib: bytes as f64 / f64::from(1 << 30) };
    let mut bytes = Vec::new();
    let room = usize::try_from(length).ok().and_then(|length| bytes.try_reserve_exact(length).ok());
    room.ok_or_else(|| too_large(length))?;
    file.take(limit).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 == limit {
        return Err(too_large(limit));
    }
    Ok(bytes)
}

/// Fails when something stands at `path` already, a dangling link included.
pub fn refuse_existing(path: &Path) -> Result<(), LogError> {
    match path.symlink_metadata() {
        Ok(meta) if meta.is_dir() => Err(LogError::Folder(path.into())),
        Ok(_) => Err(LogError::Exists(path.into())),
        Err(_) => Ok(()),
    }
}

/// Fails when the folder of `path` is not there.
pub fn require_folder(path: &Path) -> Result<(), LogError> {
    let folder = folder(path);
    if folder.is_dir() { Ok(()) } else { Err(LogError::NoFolder(folder)) }
}

/// A temporary file in the folder of `path`, so that a rename puts it there in one step. What a killed run for the same
/// `path` has left is removed first.
pub fn temporary_beside(path: &Path) -> Result<NamedTempFile, LogError> {
    require_folder(path)?;
    let prefix = temporary_prefix(path);
    remove_orphans(&folder(path), &prefix);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(TEMPORARY);
    // Temporary files are private by default; a recording gets the permissions of any other file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    // the system's reason alone: the name of a temporary file would only puzzle
    let temporary = builder.tempfile_in(folder(path)).map_err(|e| LogError::Io {
        action: "make a file in",
        path: folder(path),
        source: e.kind().into(),
    })?;
    // Held until it is published or dropped: the sign that it is no orphan. Where a system has no locks, orphans stay.
    let _ = temporary.as_file().try_lock();
    Ok(temporary)
}

/// How the names of temporary files end.
const TEMPORARY: &str = ".tmp";
/// An unlocked temporary file may be one that was made a moment ago; none is removed before this age.
const ORPHAN_AGE: Duration = Duration::from_secs(10);

/// How the names of temporary files for `path` begin: short, however long its own name is.
fn temporary_prefix(path: &Path) -> String {
    const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let name = path.file_name().unwrap_or_default();
    format!(".surgescope-{:08x}-", CRC.checksum(name.as_encoded_bytes()))
}

/// Removes temporary files that no process holds any more.
fn remove_orphans(folder: &Path, prefix: &str) {
    let names = fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in names.filter(|e| {
        let name = e.file_name();
        name.to_str().is_some_and(|n| n.starts_with(prefix) && n.ends_with(TEMPORARY))
    }) {
        let old = entry.metadata().and_then(|m| m.modified()).ok().and_then(|t| t.elapsed().ok());
        let orphan = || File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok());
        if old.is_some_and(|age| age >= ORPHAN_AGE) && orphan() {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Runs `work` while no other process runs any under the lock of the same folder. A folder cannot be locked everywhere
/// (some network shares, other systems than Unix); there `work` runs all the same.
pub fn alone_in_folder<T>(path: &Path, work: impl FnOnce() -> T) -> T {
    let lock = File::open(folder(path)).ok().filter(|folder| folder.lock().is_ok());
    let done = work();
    drop(lock);
    done
}

/// Puts a temporary file at `path` unless something stands there.
pub fn publish_new(temporary: NamedTempFile, path: &Path) -> Result<(), LogError> {
    sync(temporary.as_file(), path)?;
    temporary.persist_noclobber(path).map_err(|e| LogError::io("write", path, e.error))?;
    sync_folder(path);
    Ok(())
}

/// Puts a temporary file in the place of the file at `path`.
pub fn publish_over(temporary: NamedTempFile, path: &Path) -> Result<(), LogError> {
    sync(temporary.as_file(), path)?;
    temporary.persist(path).map_err(|e| LogError::io("write", path, e.error))?;
    sync_folder(path);
    Ok(())
}

/// True if `path` still leads to the open file.
#[cfg(unix)]
pub fn is_same_file(path: &Path, open: &File) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (fs::metadata(path), open.metadata()) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

/// Elsewhere an open file can be neither replaced nor moved by others.
#[cfg(not(unix))]
pub fn is_same_file(path: &Path, _open: &File) -> bool {
    path.exists()
}

/// On the disk, not only with the system.
pub fn sync(file: &File, path: &Path) -> Result<(), LogError> {
    file.sync_all().map_err(|e| LogError::io("write", path, e))
}

/// Makes a new name last through a power cut, where the system lets folders be synced; the file itself is safe.
fn sync_folder(path: &Path) {
    if let Ok(folder) = File::open(folder(path)) {
        let _ = folder.sync_all();
    }
}

fn folder(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.into(),
        _ => ".".into(),
    }
}
