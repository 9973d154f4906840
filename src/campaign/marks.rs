//! The state of each task in one byte, and who works on it: a runner holds the lock of the byte while it does.
//!
//! The system gives a lock back when its process ends, however it ends, so no claim outlives a killed runner. Where a
//! file system has no locks, all claims are granted: two runners may then do the same task, and find the same. The
//! marks say nothing that the results do not: where the file is missing, it is made from them.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;

use crate::campaign::error::{CampaignError, Result};
use crate::storage::output;

/// State of a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Nobody has finished it.
    Missing,
    /// It has a result.
    Done,
    /// It has failed, for a reason that is kept.
    Failed,
}

impl Mark {
    fn byte(self) -> u8 {
        match self {
            Mark::Missing => b'.',
            Mark::Done => b'd',
            Mark::Failed => b'f',
        }
    }

    fn of(byte: u8) -> Mark {
        match byte {
            b'd' => Mark::Done,
            b'f' => Mark::Failed,
            _ => Mark::Missing,
        }
    }
}

/// What became of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Claim {
    /// It is ours until it is released, or this process ends.
    Ours,
    /// Another runner works on it.
    Others,
    /// It is finished.
    Finished,
}

/// The marks of a campaign, open. A process must not open them twice: closing one gives back the locks of both.
pub struct Marks {
    file: File,
    tasks: usize,
}

/// Writes the file, all at once.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, marks: &[Mark]) -> Result<()> {
    let bytes: Vec<u8> = marks.iter().map(|mark| mark.byte()).collect();
    output::write_with(path, |out| out.write_all(&bytes)).map_err(CampaignError::not_whole(path))
}

impl Marks {
    /// Opens the marks of so many tasks, to claim and set them.
    ///
    /// # Errors
    /// A file that may not be written to, or that is of other tasks.
    pub fn open(path: &Path, tasks: usize) -> Result<Marks> {
        let file = OpenOptions::new().read(true).write(true).open(path).map_err(CampaignError::unwritten(path))?;
        Marks::of(file, path, tasks)
    }

    /// Opens the marks of so many tasks, to look at.
    ///
    /// # Errors
    /// A file that cannot be read, or that is of other tasks.
    pub fn open_to_read(path: &Path, tasks: usize) -> Result<Marks> {
        let file = File::open(path).map_err(CampaignError::io("read", path))?;
        Marks::of(file, path, tasks)
    }

    /// Marks to look at that have no file of their own.
    ///
    /// # Errors
    /// A full disk.
    pub fn elsewhere(marks: &[Mark]) -> Result<Marks> {
        let bytes: Vec<u8> = marks.iter().map(|mark| mark.byte()).collect();
        let place = std::env::temp_dir();
        let written = tempfile::tempfile().and_then(|file| write_at(&file, &bytes, 0).map(|()| file));
        Ok(Marks { file: written.map_err(CampaignError::unwritten(&place))?, tasks: marks.len() })
    }

    fn of(file: File, path: &Path, tasks: usize) -> Result<Marks> {
        let bytes = file.metadata().map_err(CampaignError::io("read", path))?.len() as usize;
        if bytes != tasks {
            return Err(CampaignError::Marks { file: path.to_owned(), bytes, tasks });
        }
        Ok(Marks { file, tasks })
    }

    /// All marks, in the order of the tasks.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn all(&self) -> io::Result<Vec<Mark>> {
        let mut bytes = vec![0; self.tasks];
        read_at(&self.file, &mut bytes, 0)?;
        Ok(bytes.into_iter().map(Mark::of).collect())
    }

    fn one(&self, task: usize) -> io::Result<Mark> {
        let mut byte = [0];
        read_at(&self.file, &mut byte, task as u64)?;
        Ok(Mark::of(byte[0]))
    }

    /// Claims a task whose mark is `asked`.
    ///
    /// # Errors
    /// A file that cannot be read or locked.
    pub fn claim(&self, task: usize, asked: Mark) -> io::Result<Claim> {
        if !lock::take(&self.file, task as u64)? {
            return Ok(Claim::Others);
        }
        // read under the lock: another runner may have finished it since all marks were read
        if self.one(task)? != asked {
            self.release(task)?;
            return Ok(Claim::Finished);
        }
        Ok(Claim::Ours)
    }

    /// Sets the mark of a task that is ours, and releases it.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn set(&self, task: usize, mark: Mark) -> io::Result<()> {
        write_at(&self.file, &[mark.byte()], task as u64)?;
        self.release(task)
    }

    /// Makes those of these tasks missing whose mark is `asked` and that nobody works on; returns how many.
    ///
    /// # Errors
    /// A file that cannot be locked or written.
    pub fn clear(&self, tasks: impl IntoIterator<Item = usize>, asked: Mark) -> io::Result<usize> {
        let mut cleared = 0;
        for task in tasks {
            if self.claim(task, asked)? == Claim::Ours {
                self.set(task, Mark::Missing)?;
                cleared += 1;
            }
        }
        Ok(cleared)
    }

    /// Gives back a task that is ours, as it was.
    ///
    /// # Errors
    /// A file that cannot be unlocked.
    pub fn release(&self, task: usize) -> io::Result<()> {
        lock::give(&self.file, task as u64)
    }

    /// Tasks that other processes hold.
    ///
    /// # Errors
    /// A file whose locks cannot be asked for.
    pub fn at_work(&self) -> io::Result<usize> {
        lock::held_by_others(&self.file, self.tasks as u64)
    }
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], place: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, place)
}

#[cfg(unix)]
fn write_at(file: &File, bytes: &[u8], place: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, place)
}

#[cfg(not(unix))]
fn read_at(mut file: &File, bytes: &mut [u8], place: u64) -> io::Result<()> {
    use std::io::{Read as _, Seek as _};
    file.seek(io::SeekFrom::Start(place))?;
    file.read_exact(bytes)
}

#[cfg(not(unix))]
fn write_at(mut file: &File, bytes: &[u8], place: u64) -> io::Result<()> {
    use std::io::Seek as _;
    file.seek(io::SeekFrom::Start(place))?;
    file.write_all(bytes)
}

/// Locks of single bytes, as POSIX has them: of a process, also over a network.
#[cfg(unix)]
mod lock {
    use std::fs::File;
    use std::io;

    use nix::errno::Errno;
    use nix::fcntl::{FcntlArg, fcntl};
    use nix::libc;

    fn of(kind: i32, start: u64, length: u64) -> libc::flock {
        libc::flock {
            l_type: kind as _,
            l_whence: libc::SEEK_SET as _,
            l_start: start as _,
            l_len: length as _,
            l_pid: 0,
        }
    }

    /// File systems without locks.
    fn has_none(error: Errno) -> bool {
        matches!(error, Errno::ENOLCK | Errno::ENOSYS | Errno::EOPNOTSUPP | Errno::EINVAL)
    }

    pub(super) fn take(file: &File, byte: u64) -> io::Result<bool> {
        match fcntl(file, FcntlArg::F_SETLK(&of(libc::F_WRLCK, byte, 1))) {
            Ok(_) => Ok(true),
            Err(Errno::EACCES | Errno::EAGAIN) => Ok(false),
            Err(error) if has_none(error) => Ok(true),
            Err(error) => Err(error.into()),
        }
    }

    pub(super) fn give(file: &File, byte: u64) -> io::Result<()> {
        match fcntl(file, FcntlArg::F_SETLK(&of(libc::F_UNLCK, byte, 1))) {
            Err(error) if !has_none(error) => Err(error.into()),
            _ => Ok(()),
        }
    }

    pub(super) fn held_by_others(file: &File, bytes: u64) -> io::Result<usize> {
        let (mut held, mut from) = (0, 0);
        while from < bytes {
            let mut first = of(libc::F_WRLCK, from, bytes - from);
            match fcntl(file, FcntlArg::F_GETLK(&mut first)) {
                Err(error) if has_none(error) => return Ok(0),
                Err(error) => return Err(error.into()),
                Ok(_) if i32::from(first.l_type) == libc::F_UNLCK => return Ok(held),
                Ok(_) => {}
            }
            let start = (first.l_start as u64).max(from);
            let end = if first.l_len == 0 { bytes } else { first.l_start as u64 + first.l_len as u64 };
            held += (end - start) as usize;
            from = end.max(from + 1);
        }
        Ok(held)
    }
}

/// Elsewhere all claims are granted.
#[cfg(not(unix))]
mod lock {
    use std::fs::File;
    use std::io;

    pub(super) fn take(_: &File, _: u64) -> io::Result<bool> {
        Ok(true)
    }

    pub(super) fn give(_: &File, _: u64) -> io::Result<()> {
        Ok(())
    }

    pub(super) fn held_by_others(_: &File, _: u64) -> io::Result<usize> {
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_set_under_a_claim_and_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("marks");
        write(&path, &[Mark::Missing, Mark::Failed, Mark::Missing]).unwrap();
        let marks = Marks::open(&path, 3).unwrap();
        assert_eq!(marks.claim(1, Mark::Missing).unwrap(), Claim::Finished);
        assert_eq!(marks.clear([0, 1], Mark::Failed).unwrap(), 1);
        assert_eq!(marks.claim(2, Mark::Missing).unwrap(), Claim::Ours);
        marks.set(2, Mark::Done).unwrap();
        assert_eq!(marks.all().unwrap(), [Mark::Missing, Mark::Missing, Mark::Done]);
        assert_eq!(marks.claim(2, Mark::Missing).unwrap(), Claim::Finished);
        assert!(matches!(Marks::open(&path, 4), Err(CampaignError::Marks { bytes: 3, tasks: 4, .. })));
    }
}
