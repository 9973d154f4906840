//! What can go wrong while recording, as sentences for the one at the rig.

use std::io;
use std::path::PathBuf;

use crate::shown::Shown as _;
use crate::storage::LogError;

/// Why nothing was, or no more could be, recorded.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // every variant says in its sentence what its fields are
pub enum RecordError {
    #[error("{} exists already; recordings are never overwritten: choose another name", .0.shown())]
    Exists(PathBuf),
    #[error("the folder {} does not exist: create it, or write the recording elsewhere", .0.shown())]
    NoFolder(PathBuf),
    #[error("the folder {} of the shots cannot be made", .folder.shown())]
    Folder { folder: PathBuf, source: io::Error },
    #[error(
        "no sensor of rig '{rig}' is wired to a device: give its sensors `device` and `channel`, and describe the device in [[device]]"
    )]
    NothingWired { rig: String },
    #[error("option `port` names '{name}', but the devices that sensors are wired to are: {known}")]
    UnknownPort { name: String, known: String },
    #[error(
        "devices '{first}' and '{second}' are both on port {port}, which only Modbus slaves can share: give one of them its own with option `port {second}=PATH`"
    )]
    SamePort { first: String, second: String, port: String },
    #[error(
        "devices '{first}' and '{second}' are both on port {port} and have the same unit_id, {unit}: change one of them, on the device and in the rig file"
    )]
    SameUnit { first: String, second: String, port: String, unit: u8 },
    #[error(
        "devices '{first}' and '{second}' are both on port {port}, but one speaks at {one} and the other at {other}: a line has one speed and format"
    )]
    UnlikeLine { first: String, second: String, port: String, one: String, other: String },
    #[error("no sample arrived, so there is nothing to write")]
    NotBegun,
    #[error(
        "port {port} of device '{device}' does not exist: is it plugged in? Choose another one with option `port {device}=PATH` ({known})"
    )]
    PortMissing { device: String, port: String, known: String },
    #[error(
        "no permission to open port {port} of device '{device}': join the group that owns it (often `dialout`), then log in again"
    )]
    PortForbidden { device: String, port: String },
    #[error("port {port} of device '{device}' is in use by another program: close that one first")]
    PortBusy { device: String, port: String },
    #[error("port {port} of device '{device}' cannot be opened at {speed}: {reason}")]
    PortUnusable { device: String, port: String, speed: String, reason: String },
    #[error(
        "device '{device}' starts `{command}`, but its rig did not come from a rig file of this computer, and such a rig starts no program: open the rig file itself"
    )]
    Homeless { device: String, command: String },
    #[error(
        "program '{program}' of device '{device}' is not found: it is neither on the PATH nor in the rig file's folder, {folder}"
    )]
    CommandMissing { device: String, program: String, folder: String },
    #[error(
        "program '{program}' of device '{device}' is not on the PATH; the one in the rig file's folder, {folder}, is called \"./{program}\""
    )]
    CommandElsewhere { device: String, program: String, folder: String },
    #[error(
        "program '{program}' of device '{device}' is not executable: `chmod +x` makes it so, or write its interpreter before it, as in [\"python3\", \"daq.py\"]"
    )]
    CommandForbidden { device: String, program: String },
    #[error("program '{program}' of device '{device}' cannot be started: {reason}")]
    CommandUnusable { device: String, program: String, reason: String },
    #[error(
        "host '{host}' of device '{device}' is not found ({reason}): check its spelling, or write its address in numbers"
    )]
    Unresolved { device: String, host: String, reason: String },
    #[error("device '{device}' cannot be reached on tcp://{address}: {reason}")]
    Unreachable { device: String, address: String, reason: String },
    #[error("device '{device}' speaks modbus-rtu, which needs a serial port; {port} is none")]
    NotSerial { device: String, port: String },
    #[error(
        "device '{device}' has no serial port in the rig file, so the speed of {path} is not known: give it `port` and `baud` there"
    )]
    NoBaud { device: String, path: String },
    #[error("{0}")]
    BadAddress(String),
    #[error("the thread that reads device '{device}' cannot be started")]
    Thread { device: String, source: io::Error },
    #[error("device '{device}' sent nothing ({ended}): {advice}")]
    Silent { device: String, ended: String, advice: String },
    #[error(
        "device '{device}' sent {bytes} bytes but nothing valid ({ended}): check {what} and that it speaks `{speaks}`"
    )]
    NoFrame { device: String, bytes: u64, what: String, speaks: &'static str, ended: String },
    #[error("device '{device}' sent no line that can be read: {what}")]
    DecimalTimes { device: String, what: String },
    #[error(
        "device '{device}' never answered ({ended}): is it switched on, and are its port ({port}), baud rate and format ({speed}) and unit_id right?"
    )]
    NoAnswer { device: String, port: String, speed: String, ended: String },
    #[error("device '{device}' refuses the request: {why}")]
    Refused { device: String, why: &'static str },
    #[error("sensor '{sensor}' is wired to channel {channel} of device '{device}', which sends {channels} channels (0 to {})", channels.saturating_sub(1))]
    NoChannel { sensor: String, channel: usize, device: String, channels: usize },
    #[error("{0} has no samples to play")]
    NothingToPlay(String),
    #[error("{0} does not describe its columns: name the rig with option `rig`")]
    CsvWithoutRig(String),
    #[error("{recording} cannot be played on rig '{rig}': {reason}")]
    OtherRig { recording: String, rig: String, reason: String },
    #[error("the simulated device cannot play this: {0}")]
    Playback(String),
    #[error("no pseudo-terminal can be made for the simulated device")]
    Pseudoterminal(#[source] io::Error),
    #[error("the recording cannot be started")]
    Start(#[source] LogError),
    #[error("writing the recording failed; what was recorded until then is in {}: repair it with `surgescope recover {} -o WHOLE.mcap`", .file.shown(), .file.shown())]
    Write { file: PathBuf, source: Box<LogError> },
    #[error(transparent)]
    Read(LogError),
}
