//! Devices that are not there: each plays given data by its real protocol through a real pseudo-terminal, with faults
//! where asked for.

pub(crate) mod faults;
pub(crate) mod pty;
pub(crate) mod script;
pub(crate) mod sender;
pub(crate) mod slave;

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use nix::pty::PtyMaster;

pub use crate::record::devices::simulated::faults::{Faults, Sent};
pub use crate::record::devices::simulated::script::{Playback, Script};

use crate::record::error::RecordError;

/// A device on a pseudo-terminal. Dropped, it stops and hangs up.
#[derive(Debug)]
pub struct SimulatedDevice {
    path: PathBuf,
    wanted: Arc<AtomicBool>,
    line: Option<(PtyMaster, File)>,
    thread: Option<JoinHandle<io::Result<Sent>>>,
}

impl SimulatedDevice {
    /// Makes the pseudo-terminal; nothing is sent before [`SimulatedDevice::start`].
    pub fn open() -> Result<SimulatedDevice, RecordError> {
        let (master, slave, path) =
            crate::record::devices::simulated::pty::raw_pty().map_err(RecordError::Pseudoterminal)?;
        Ok(SimulatedDevice { path, wanted: Arc::new(AtomicBool::new(true)), line: Some((master, slave)), thread: None })
    }

    /// The port to record from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Starts to play, `speed` times as fast as real time (0: as fast as the line takes it), then hangs up.
    pub fn start(&mut self, script: Script, speed: f64, faults: Faults) -> Result<(), RecordError> {
        self.start_line(vec![script], speed, faults)
    }

    /// The same of Modbus slaves that share a line; of other devices there is one on it.
    pub fn start_line(&mut self, scripts: Vec<Script>, speed: f64, faults: Faults) -> Result<(), RecordError> {
        let Some((master, slave)) = self.line.take() else { return Ok(()) };
        let wanted = Arc::clone(&self.wanted);
        let line = crate::record::devices::simulated::pty::Wire { master, slave, wanted };
        let thread = thread::Builder::new()
            .name("simulated device".into())
            .spawn(move || match &scripts[..] {
                [script]
                    if !matches!(script.form, crate::record::devices::simulated::script::Form::Registers { .. }) =>
                {
                    crate::record::devices::simulated::sender::run(line, script, speed, faults)
                }
                slaves => crate::record::devices::simulated::slave::run(line, slaves, speed, faults),
            })
            .map_err(RecordError::Pseudoterminal)?;
        self.thread = Some(thread);
        Ok(())
    }

    /// Stops the device, if it still plays, and says what it did.
    pub fn stop(mut self) -> io::Result<Sent> {
        self.wanted.store(false, Ordering::Relaxed);
        self.join()
    }

    /// Waits until everything was played and read, and says what the device did.
    pub fn join(&mut self) -> io::Result<Sent> {
        let Some(thread) = self.thread.take() else { return Ok(Sent::default()) };
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the simulated device broke down")))
    }
}

impl Drop for SimulatedDevice {
    fn drop(&mut self) {
        self.wanted.store(false, Ordering::Relaxed);
        let _ = self.join();
    }
}
