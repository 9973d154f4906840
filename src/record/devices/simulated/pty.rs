//! A pseudo-terminal as a serial line.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};

/// The device's end of the line.
pub struct Wire {
    pub(crate) master: PtyMaster,
    pub(crate) slave: File,
    pub(crate) wanted: Arc<AtomicBool>,
}

impl Wire {
    /// False when the device is to stop.
    pub fn wanted(&self) -> bool {
        self.wanted.load(Ordering::Relaxed)
    }

    /// Writes as fast as the line takes it; false where nobody wants more.
    pub fn write_all(&mut self, mut bytes: &[u8]) -> io::Result<bool> {
        while !bytes.is_empty() {
            if !self.wanted() {
                return Ok(false);
            }
            match self.master.write(bytes) {
                Ok(length) => bytes = bytes.get(length..).unwrap_or_default(),
                Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(Duration::from_millis(1)),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    /// Waits for bytes from the other end; 0 where none came in time.
    pub fn read(&mut self, buffer: &mut [u8], within: Duration) -> io::Result<usize> {
        let timeout = PollTimeout::try_from(within).unwrap_or(PollTimeout::MAX);
        let mut ready = [PollFd::new(self.master.as_fd(), PollFlags::POLLIN)];
        if poll(&mut ready, timeout)? == 0 {
            return Ok(0);
        }
        match self.master.read(buffer) {
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
            other => other,
        }
    }

    /// Hanging up throws away what was not read: waits until it was (or nobody wants it).
    pub fn drain(&self) {
        let mut quiet = 0;
        while quiet < 3 && self.wanted() {
            let mut unread = [PollFd::new(self.slave.as_fd(), PollFlags::POLLIN)];
            let empty = poll(&mut unread, PollTimeout::ZERO) == Ok(0);
            quiet = if empty { quiet + 1 } else { 0 };
            thread::sleep(Duration::from_millis(10));
        }
    }
}

/// A pseudo-terminal in raw mode, so that no byte is changed or echoed: the device's side, the port and its path.
pub fn raw_pty() -> io::Result<(PtyMaster, File, PathBuf)> {
    let master = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let path = PathBuf::from(ptsname_r(&master)?);
    // Kept open: the terminal stays raw, and unread bytes can be seen.
    let slave = OpenOptions::new().read(true).write(true).open(&path)?;
    let mut modes = tcgetattr(&slave)?;
    cfmakeraw(&mut modes);
    tcsetattr(&slave, SetArg::TCSANOW, &modes)?;
    Ok((master, slave, path))
}
