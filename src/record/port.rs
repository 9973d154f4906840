//! Bytes from a serial port: one thread a port reads them, stamps their arrival and passes them on.
//!
//! A blocking thread hands bytes on in 0.1 ms where an async serial port on a busy runtime needs 8 ms. The channel is bounded: when
//! the disk stalls for long, the kernel's buffer overflows and the sequence numbers show what was lost; memory does not grow.

use std::io::{ErrorKind, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime};

use super::RecordError;
use crate::rig::Device;

/// How long a read waits before the thread looks whether it is still wanted.
const READ_TIMEOUT: Duration = Duration::from_millis(100);
const READ_BYTES: usize = 16 * 1024;
/// Reads that may wait for the session: at 20 kHz × 3 channels more than ten seconds of them.
const CHANNEL_READS: usize = 4096;

/// What a source passes on.
#[derive(Debug)]
pub enum Input {
    /// The next bytes and when they arrived.
    Bytes {
        /// Wall clock of their arrival.
        at: SystemTime,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// No more will come, and why.
    Ended(String),
}

/// A stream of bytes, read by a thread that ends with this value.
#[derive(Debug)]
pub struct Source {
    /// What was read.
    pub inputs: Receiver<Input>,
    wanted: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Source {
    /// Opens the device's serial port (a pseudo-terminal will do) and starts to read it.
    pub fn open(device: &Device) -> Result<Source, RecordError> {
        let port = open_port(device)?;
        Source::spawn(&device.name, port)
    }

    /// Reads from anything whose reads return within a moment: a timeout is no end of the stream.
    pub fn spawn(device: &str, reader: impl Read + Send + 'static) -> Result<Source, RecordError> {
        let (sender, inputs) = sync_channel(CHANNEL_READS);
        let wanted = Arc::new(AtomicBool::new(true));
        let flag = Arc::clone(&wanted);
        let thread = thread::Builder::new()
            .name(format!("port {device}"))
            .spawn(move || pump(reader, &sender, &flag))
            .map_err(|source| RecordError::Thread { device: device.to_owned(), source })?;
        Ok(Source { inputs, wanted, thread: Some(thread) })
    }
}

impl Drop for Source {
    fn drop(&mut self) {
        self.wanted.store(false, Ordering::Relaxed);
        // The thread may wait for room in the channel: closing our end of it wakes it.
        let (_, closed) = sync_channel(0);
        drop(std::mem::replace(&mut self.inputs, closed));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn pump(mut reader: impl Read, sender: &SyncSender<Input>, wanted: &AtomicBool) {
    let mut buffer = vec![0; READ_BYTES];
    let ended = loop {
        if !wanted.load(Ordering::Relaxed) {
            return;
        }
        match reader.read(&mut buffer) {
            Ok(0) => break "the stream ended".to_owned(),
            Ok(length) => {
                let bytes = buffer.get(..length).unwrap_or_default().to_vec();
                if sender.send(Input::Bytes { at: SystemTime::now(), bytes }).is_err() {
                    return;
                }
            }
            Err(error) => match error.kind() {
                ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock => {}
                ErrorKind::BrokenPipe | ErrorKind::UnexpectedEof => break "the device hung up".to_owned(),
                _ => break format!("the port vanished: {error}"),
            },
        }
    };
    // The session may have gone meanwhile; then nobody asks.
    let _ = sender.send(Input::Ended(ended));
}

fn open_port(device: &Device) -> Result<Box<dyn serialport::SerialPort>, RecordError> {
    let open = |baud| serialport::new(&device.port, baud).timeout(READ_TIMEOUT).open();
    let pseudoterminal = device.port.starts_with("/dev/pts/");
    let opened = match open(device.baud) {
        // A pseudo-terminal has no baud rate, and may refuse an odd one.
        Err(error) if pseudoterminal && !is_final(&error) => open(9600),
        opened => opened,
    };
    opened.map_err(|error| explain(device, &error))
}

fn is_final(error: &serialport::Error) -> bool {
    use serialport::ErrorKind::{Io, NoDevice};
    matches!(error.kind, NoDevice | Io(ErrorKind::NotFound | ErrorKind::PermissionDenied))
}

fn explain(device: &Device, error: &serialport::Error) -> RecordError {
    use serialport::ErrorKind::{Io, NoDevice};
    let (name, port) = (device.name.clone(), device.port.clone());
    match error.kind {
        _ if !std::path::Path::new(&port).exists() => {
            let ports: Vec<_> =
                serialport::available_ports().unwrap_or_default().into_iter().map(|info| info.port_name).collect();
            let known = if ports.is_empty() {
                "no serial port is there now".into()
            } else {
                format!("there are {}", ports.join(", "))
            };
            RecordError::PortMissing { device: name, port, known }
        }
        Io(ErrorKind::PermissionDenied) => RecordError::PortForbidden { device: name, port },
        NoDevice => RecordError::PortBusy { device: name, port },
        _ => RecordError::PortUnusable { device: name, port, baud: device.baud, reason: error.description.clone() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Protocol;

    fn device(port: &str) -> Device {
        Device { name: "daq".into(), port: port.into(), baud: 921_600, protocol: Protocol::Frames }
    }

    #[test]
    fn a_port_that_is_not_there_says_what_to_do() {
        let text = Source::open(&device("/dev/ttyNOWHERE")).unwrap_err().to_string();
        assert!(text.contains("/dev/ttyNOWHERE") && text.contains("--port daq=PATH"), "{text}");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_is_no_port() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let text = Source::open(&device(file.path().to_str().unwrap())).unwrap_err().to_string();
        assert!(text.contains("cannot be opened"), "{text}");
    }

    #[test]
    fn bytes_arrive_in_order_and_then_the_end() {
        let bytes: Vec<u8> = (0..100_000u32).map(|i| i as u8).collect();
        let source = Source::spawn("daq", std::io::Cursor::new(bytes.clone())).unwrap();
        let mut received = Vec::new();
        loop {
            match source.inputs.recv().unwrap() {
                Input::Bytes { bytes, .. } => received.extend(bytes),
                Input::Ended(why) => break assert_eq!(why, "the stream ended"),
            }
        }
        assert_eq!(received, bytes);
    }

    #[test]
    fn a_source_nobody_reads_ends_when_dropped() {
        let source = Source::spawn("daq", std::io::repeat(7)).unwrap();
        drop(source); // hangs if the thread does not notice
    }
}
