//! One writer a folder: a lock of the operating system, which ends with the process, however that ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::results::history::error::HistoryError;

/// Name of the lock file in the folder.
pub const FILE: &str = ".surgescope.lock";

/// The right to work on a folder's recordings, held while this value lives.
#[derive(Debug)]
pub struct Lock(#[allow(dead_code)] File);

impl Lock {
    /// Takes it.
    ///
    /// # Errors
    /// [`HistoryError::Busy`] where another process has it; a file that cannot be made.
    pub fn take(folder: &Path) -> Result<Lock, HistoryError> {
        let path: PathBuf = folder.join(FILE);
        let failed = |source| HistoryError::Io { action: "lock", path: path.clone(), source };
        let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = open.map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut who = String::new();
                // only for the message; some systems do not let a locked file be read
                let _ = file.read_to_string(&mut who);
                let who = if who.trim().is_empty() { "its process is not known".into() } else { who.trim().to_owned() };
                return Err(HistoryError::Busy { folder: folder.to_owned(), who });
            }
            Err(TryLockError::Error(source)) => return Err(failed(source)),
        }
        let said = format!("process {}\n", std::process::id());
        let written =
            file.set_len(0).and_then(|()| file.seek(SeekFrom::Start(0))).and_then(|_| file.write_all(said.as_bytes()));
        written.map_err(failed)?;
        Ok(Lock(file))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_is_told_who_is_first_and_may_come_when_it_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let first = Lock::take(folder.path()).unwrap();
        let refused = Lock::take(folder.path()).unwrap_err().to_string();
        assert!(refused.contains(&format!("process {}", std::process::id())), "{refused}");
        drop(first);
        Lock::take(folder.path()).unwrap();
    }
}
