//! What a device's bytes are read from: a serial port, a socket or a process, whichever the rig file names. All can be
//! opened again.

use std::io::Read;

use crate::record::devices::port::open_port;
#[cfg(unix)]
use crate::record::devices::process::{self, Process};
use crate::record::devices::queue::Queue;
use crate::record::devices::socket::Socket;
use crate::record::error::RecordError;
use crate::rig::{Command, Device, Port};

/// Reads return within a moment: a timeout is no end. At the end comes an error that says why, or 0 where the device is
/// done for good.
pub(crate) type Reader = Box<dyn Read + Send>;

/// Opens what a device is read from; its messages for people go to the queue.
///
/// # Errors
/// A sentence for the one at the rig: what cannot be opened, why, and what to do.
pub(crate) fn open(device: &Device, queue: &Queue) -> Result<Reader, RecordError> {
    let name = &device.name;
    Ok(match &device.port {
        Port::Serial(serial) => Box::new(open_port(name, serial)?),
        Port::Tcp(address) => Box::new(Socket::connect(name, address)?),
        Port::Command(command) => start(name, command, queue)?,
    })
}

/// Looks whether what a device is read from can be opened. A command is not started for that.
///
/// # Errors
/// As a recording would say.
pub fn check(device: &Device) -> Result<(), RecordError> {
    let name = &device.name;
    match &device.port {
        Port::Serial(serial) => open_port(name, serial).map(drop),
        Port::Tcp(address) => Socket::connect(name, address).map(drop),
        Port::Command(command) => check_command(name, command),
    }
}

#[cfg(unix)]
fn start(device: &str, command: &Command, queue: &Queue) -> Result<Reader, RecordError> {
    Ok(Box::new(Process::start(device, command, queue)?))
}

#[cfg(unix)]
fn check_command(device: &str, command: &Command) -> Result<(), RecordError> {
    process::check(device, command)
}

#[cfg(not(unix))]
fn start(device: &str, command: &Command, _: &Queue) -> Result<Reader, RecordError> {
    Err(no_commands(device, command))
}

#[cfg(not(unix))]
fn check_command(device: &str, command: &Command) -> Result<(), RecordError> {
    Err(no_commands(device, command))
}

/// How a process is ended with all that it started is known for Unix alone.
#[cfg(not(unix))]
fn no_commands(device: &str, command: &Command) -> RecordError {
    let program = command.words.first().cloned().unwrap_or_default();
    let reason = "this system cannot run a device's command; let the program serve a socket, and name it with port = \"tcp://…\"";
    RecordError::CommandUnusable { device: device.to_owned(), program, reason: reason.into() }
}
