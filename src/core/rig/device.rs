//! Acquisition devices and the wiring of sensors to their channels.

use std::path::PathBuf;

/// Which channel of which device carries a sensor, and its calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Wiring {
    /// Device name.
    pub device: String,
    /// Column from 0 (`frames`, `lines`) or register address (`modbus-rtu`).
    pub channel: u16,
    /// Sensor units per count.
    pub scale: f64,
    /// Sensor units at count 0.
    pub offset: f64,
    /// Register layout, for `modbus-rtu`.
    pub register: Option<Register>,
}

/// Layout of a Modbus value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Register {
    /// Input registers (function 4) rather than holding registers (function 3).
    pub input: bool,
    /// Number format.
    pub encoding: Encoding,
    /// Most significant word first.
    pub big_word_order: bool,
}

/// Number format of a Modbus value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Encoding {
    U16,
    I16,
    U32,
    I32,
    F32,
}

impl Encoding {
    /// Number of 16-bit registers that a value takes.
    pub fn words(self) -> u64 {
        match self {
            Encoding::U16 | Encoding::I16 => 1,
            Encoding::U32 | Encoding::I32 | Encoding::F32 => 2,
        }
    }
}

/// An acquisition device: a source of bytes, and what they say.
#[derive(Debug, Clone, PartialEq)]
pub struct Device {
    /// Its name.
    pub name: String,
    /// Where its bytes come from.
    pub port: Port,
    /// Its wire protocol.
    pub protocol: Protocol,
}

impl Device {
    /// The device on a pseudo-terminal instead. That has no speed of its own: any will do where the port has none.
    pub fn on_pseudoterminal(self, path: &str) -> Device {
        let any = || Port::Serial(Serial { path: path.to_owned(), baud: 921_600, framing: Framing::default() });
        Device { port: self.port.at_path(path).unwrap_or_else(any), ..self }
    }
}

/// Where a device's bytes come from. Shown as a person would name it: `/dev/ttyUSB0`, `tcp://10.0.0.5:5025`,
/// `python3 daq.py`.
#[derive(Debug, Clone, PartialEq)]
pub enum Port {
    /// A serial port, or a pseudo-terminal.
    Serial(Serial),
    /// A socket: `HOST:PORT`.
    Tcp(String),
    /// The standard output of a process.
    Command(Command),
}

/// What stands before the address of a socket.
const TCP: &str = "tcp://";

impl Port {
    /// The socket that a text such as `tcp://10.0.0.5:5025` names; `None` for any other text.
    ///
    /// # Errors
    /// What the address lacks.
    pub fn tcp(text: &str) -> Option<Result<Port, String>> {
        let address = text.strip_prefix(TCP)?;
        let parts = address.rsplit_once(':').filter(|(host, _)| {
            let numeric = host.starts_with('[') && host.ends_with(']') && host.len() > 2;
            numeric || !(host.is_empty() || host.contains(['/', ':', ' ', '[', ']']))
        });
        let is_whole = parts.is_some_and(|(_, port)| port.parse::<u16>().is_ok_and(|port| port > 0));
        let wrong =
            || format!("\"{text}\" is no address of a socket: write tcp://HOST:PORT, such as tcp://10.0.0.5:5025");
        Some(is_whole.then(|| Port::Tcp(address.to_owned())).ok_or_else(wrong))
    }

    /// A serial port at this path, with the speed and format of this one; `None` where this one has none.
    pub fn at_path(&self, path: &str) -> Option<Port> {
        let Port::Serial(serial) = self else { return None };
        Some(Port::Serial(Serial { path: path.to_owned(), ..serial.clone() }))
    }

    /// The command, of a device that is a process.
    pub fn command(&self) -> Option<&Command> {
        if let Port::Command(command) = self { Some(command) } else { None }
    }
}

impl std::fmt::Display for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Port::Serial(serial) => f.write_str(&serial.path),
            Port::Tcp(address) => write!(f, "{TCP}{address}"),
            Port::Command(command) => write!(f, "`{command}`"),
        }
    }
}

/// A serial port.
#[derive(Debug, Clone, PartialEq)]
pub struct Serial {
    /// Its path.
    pub path: String,
    /// Baud rate.
    pub baud: u32,
    /// Format of a character on the line.
    pub framing: Framing,
}

impl Serial {
    /// Baud rate and format of the line, as in `115200 baud 8N1`.
    pub fn speed(&self) -> String {
        format!("{} baud {}", self.baud, self.framing)
    }
}

/// A program and its arguments; shown as a shell would take it.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// The program, then its arguments; at least one.
    pub words: Vec<String>,
    /// The folder of the rig file, in which it is started. A rig that did not come from a file of this computer, such
    /// as that of a recording, has none: its commands are never started.
    pub folder: Option<PathBuf>,
}

impl std::fmt::Display for Command {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%".contains(c);
        let quoted = |word: &String| match word.is_empty() || !word.chars().all(plain) {
            true => format!("'{}'", word.replace('\'', "'\\''")),
            false => word.clone(),
        };
        f.write_str(&self.words.iter().map(quoted).collect::<Vec<_>>().join(" "))
    }
}

/// Format of a character on a serial line; 8N1 unless the file says otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Framing {
    /// 7 or 8.
    pub data_bits: u8,
    /// Parity bit, if any.
    pub parity: Parity,
    /// 1 or 2.
    pub stop_bits: u8,
}

impl Default for Framing {
    fn default() -> Framing {
        Framing { data_bits: 8, parity: Parity::None, stop_bits: 1 }
    }
}

impl std::fmt::Display for Framing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parity = match self.parity {
            Parity::None => 'N',
            Parity::Even => 'E',
            Parity::Odd => 'O',
        };
        write!(f, "{}{parity}{}", self.data_bits, self.stop_bits)
    }
}

/// Parity of a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Parity {
    None,
    Even,
    Odd,
}

/// Unit of the times that a device sends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum TimeUnit {
    Seconds,
    Milliseconds,
    #[default]
    Microseconds,
    Nanoseconds,
}

impl TimeUnit {
    /// All of them, the longest first.
    pub const ALL: [TimeUnit; 4] =
        [TimeUnit::Seconds, TimeUnit::Milliseconds, TimeUnit::Microseconds, TimeUnit::Nanoseconds];

    /// As the rig file has it.
    pub fn symbol(self) -> &'static str {
        match self {
            TimeUnit::Seconds => "s",
            TimeUnit::Milliseconds => "ms",
            TimeUnit::Microseconds => "us",
            TimeUnit::Nanoseconds => "ns",
        }
    }

    /// Its length, s.
    pub fn seconds(self) -> f64 {
        match self {
            TimeUnit::Seconds => 1.0,
            TimeUnit::Milliseconds => 1e-3,
            TimeUnit::Microseconds => 1e-6,
            TimeUnit::Nanoseconds => 1e-9,
        }
    }
}

/// Wire protocol of a device.
#[derive(Debug, Clone, PartialEq)]
pub enum Protocol {
    /// COBS frames of samples.
    Frames,
    /// Text lines.
    Lines {
        /// What their times are in.
        time_unit: TimeUnit,
    },
    /// Polled Modbus RTU.
    ModbusRtu {
        /// Slave address.
        unit_id: u8,
        /// Time between polls, s.
        poll_interval_s: f64,
        /// Time to wait for an answer, s.
        timeout_s: f64,
    },
}
