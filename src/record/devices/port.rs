//! Serial ports: which there are, and opening one.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use serde::Serialize;
use serialport::{SerialPort, SerialPortType};

use crate::record::devices::poll::Line;
use crate::record::error::RecordError;
use crate::rig::{Framing, Parity, Serial};

/// How long a read waits before its thread looks whether it is still wanted.
pub(super) const READ_TIMEOUT: Duration = Duration::from_millis(100);

/// A port of this machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PortInfo {
    /// What to write in the rig file.
    pub path: String,
    /// A name that stays the same whatever else is plugged in, where the system has one.
    pub stable_path: Option<String>,
    /// `usb`, `pci`, `bluetooth` or `other`.
    pub kind: &'static str,
    /// Maker and product of a USB adapter.
    pub product: Option<String>,
    /// Its serial number.
    pub serial_number: Option<String>,
}

/// The serial ports that are there now, by path. Pseudo-terminals are not listed.
pub fn list() -> Vec<PortInfo> {
    // The library takes this folder for granted.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let mut ports: Vec<PortInfo> =
        serialport::available_ports().unwrap_or_default().into_iter().map(describe).collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    ports
}

fn describe(info: serialport::SerialPortInfo) -> PortInfo {
    let (kind, product, serial_number) = match info.port_type {
        SerialPortType::UsbPort(usb) => {
            let names: Vec<String> = usb.manufacturer.into_iter().chain(usb.product).collect();
            let ids = format!("{:04x}:{:04x}", usb.vid, usb.pid);
            (
                "usb",
                Some(if names.is_empty() { ids } else { format!("{} ({ids})", names.join(" ")) }),
                usb.serial_number,
            )
        }
        SerialPortType::PciPort => ("pci", None, None),
        SerialPortType::BluetoothPort => ("bluetooth", None, None),
        SerialPortType::Unknown => ("other", None, None),
    };
    PortInfo { stable_path: stable_path(&info.port_name), path: info.port_name, kind, product, serial_number }
}

/// The link that udev makes from maker and serial number.
fn stable_path(port: &str) -> Option<String> {
    let port = std::fs::canonicalize(port).ok()?;
    let links = std::fs::read_dir("/dev/serial/by-id").ok()?;
    let mut links = links.filter_map(|link| Some(link.ok()?.path()));
    links.find(|link| std::fs::canonicalize(link).is_ok_and(|to| to == port)).map(|link| link.display().to_string())
}

/// A serial port as the line to Modbus slaves.
pub struct SerialLine {
    port: Box<dyn SerialPort>,
    /// Slaves know a request by the silence before it.
    silence: Duration,
    last_byte: Option<Instant>,
}

impl SerialLine {
    /// The port that the device is on.
    pub fn open(device: &str, serial: &Serial) -> Result<SerialLine, RecordError> {
        Ok(SerialLine { port: open_port(device, serial)?, silence: silence(serial.baud), last_byte: None })
    }
}

/// Three and a half characters, of 11 bits each; above 19200 Bd the same for all speeds (Modbus over Serial Line V1.02,
/// sec. 2.5.1.1).
fn silence(baud: u32) -> Duration {
    Duration::from_secs_f64(if baud > 19_200 { 1.75e-3 } else { 3.5 * 11.0 / f64::from(baud.max(1)) })
}

impl Line for SerialLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let since = self.last_byte.map_or(self.silence, |at| at.elapsed());
        thread::sleep(self.silence.saturating_sub(since));
        self.port.set_timeout(READ_TIMEOUT.max(Duration::from_secs(1)))?;
        self.port.write_all(bytes)?;
        self.port.flush()
    }

    fn receive(&mut self, buffer: &mut [u8], within: Duration) -> io::Result<usize> {
        self.port.set_timeout(within)?;
        match self.port.read(buffer) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(length) => {
                self.last_byte = Some(Instant::now());
                Ok(length)
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => Ok(0),
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(0),
            Err(error) => Err(error),
        }
    }
}

/// Opens the port of the device of that name, a serial one or a pseudo-terminal.
pub fn open_port(device: &str, serial: &Serial) -> Result<Box<dyn SerialPort>, RecordError> {
    let Framing { data_bits, parity, stop_bits } = serial.framing;
    let data_bits = if data_bits == 7 { serialport::DataBits::Seven } else { serialport::DataBits::Eight };
    let stop_bits = if stop_bits == 2 { serialport::StopBits::Two } else { serialport::StopBits::One };
    let parity = match parity {
        Parity::None => serialport::Parity::None,
        Parity::Even => serialport::Parity::Even,
        Parity::Odd => serialport::Parity::Odd,
    };
    let open = |baud| {
        let port = serialport::new(&serial.path, baud).data_bits(data_bits).parity(parity).stop_bits(stop_bits);
        port.timeout(READ_TIMEOUT).open()
    };
    // It may be named by a link.
    let real = std::fs::canonicalize(&serial.path);
    let pseudoterminal = real.is_ok_and(|path| path.starts_with("/dev/pts/"));
    let opened = match open(serial.baud) {
        // A pseudo-terminal has no baud rate, and may refuse an odd one.
        Err(error) if pseudoterminal && !is_final(&error) => open(9600),
        opened => opened,
    };
    opened.map_err(|error| explain(device, serial, &error))
}

fn is_final(error: &serialport::Error) -> bool {
    use serialport::ErrorKind::{Io, NoDevice};
    matches!(error.kind, NoDevice | Io(ErrorKind::NotFound | ErrorKind::PermissionDenied))
}

fn explain(device: &str, serial: &Serial, error: &serialport::Error) -> RecordError {
    use serialport::ErrorKind::{Io, NoDevice};
    let (name, port) = (device.to_owned(), serial.path.clone());
    match error.kind {
        _ if !std::path::Path::new(&port).exists() => {
            let ports: Vec<_> = list().into_iter().map(|port| port.path).collect();
            let known = if ports.is_empty() {
                "there is no serial port now".into()
            } else {
                format!("there are {}", ports.join(", "))
            };
            RecordError::PortMissing { device: name, port, known }
        }
        Io(ErrorKind::PermissionDenied) => RecordError::PortForbidden { device: name, port },
        NoDevice => RecordError::PortBusy { device: name, port },
        _ => RecordError::PortUnusable { device: name, port, speed: serial.speed(), reason: error.description.clone() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn serial(path: &str) -> Serial {
        Serial { path: path.into(), baud: 921_600, framing: Framing::default() }
    }

    fn refusal(port: &str) -> String {
        open_port("daq", &serial(port)).map(drop).unwrap_err().to_string()
    }

    #[test]
    fn a_port_that_is_not_there_says_what_to_do() {
        let text = refusal("/dev/ttyNOWHERE");
        assert!(text.contains("/dev/ttyNOWHERE") && text.contains("option `port daq=PATH`"), "{text}");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_is_no_port() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let text = refusal(file.path().to_str().unwrap());
        assert!(text.contains("cannot be opened"), "{text}");
    }

    /// A pseudo-terminal keeps stop bits and the kind of parity, though it has neither.
    #[cfg(unix)]
    #[test]
    fn the_format_of_the_rig_file_reaches_the_port() {
        use nix::sys::termios::{ControlFlags, InputFlags, tcgetattr};
        let flags = |framing: Framing| {
            let line = crate::record::devices::simulated::SimulatedDevice::open().unwrap();
            let port = open_port("daq", &Serial { framing, ..serial(line.path().to_str().unwrap()) }).unwrap();
            let modes = tcgetattr(std::fs::File::open(line.path()).unwrap()).unwrap();
            drop(port);
            let has = |flag| modes.control_flags.contains(flag);
            (has(ControlFlags::CSTOPB), has(ControlFlags::PARODD), modes.input_flags.contains(InputFlags::INPCK))
        };
        assert_eq!(flags(Framing::default()), (false, false, false));
        assert_eq!(flags(Framing { stop_bits: 2, parity: Parity::Odd, data_bits: 8 }), (true, true, true));
        assert_eq!(flags(Framing { stop_bits: 1, parity: Parity::Even, data_bits: 7 }), (false, false, true));
    }

    #[test]
    fn listing_survives_any_machine() {
        let ports = list();
        assert!(ports.windows(2).all(|pair| pair[0].path <= pair[1].path));
    }
}
