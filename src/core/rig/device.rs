//! Acquisition devices and the wiring of sensors to their channels.

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

/// An acquisition device on a serial port.
#[derive(Debug, Clone, PartialEq)]
pub struct Device {
    /// Its name.
    pub name: String,
    /// Port path.
    pub port: String,
    /// Baud rate.
    pub baud: u32,
    /// Format of a character on the line.
    pub framing: Framing,
    /// Its wire protocol.
    pub protocol: Protocol,
}

impl Device {
    /// Baud rate and format of its line, as in `115200 baud 8N1`.
    pub fn speed(&self) -> String {
        format!("{} baud {}", self.baud, self.framing)
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
