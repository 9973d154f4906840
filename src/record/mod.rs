//! Live recording: bytes from a device become a recording whose sample times are the device's own.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`frames`] | the wire codec, without I/O |
//! | [`port`] | a serial port, read by a thread of its own into a bounded channel |
//! | [`clock`] | device time to recording time; where samples are missing |
//! | [`session`] | one live test from the first frame to the finished file |
//! | [`replay`] | a recording or a CSV played as if it were live |
//! | [`simulated`] | a device on a pseudo-terminal that plays given data, with faults where asked for |
//! | [`pace`] | playing recorded time against the wall clock |
//! | [`output`] | what sessions write to, and count |
//! | [`trigger`] | when a shot begins and is over, without I/O |
//! | [`shots`] | a recording a shot, with what came before it |

pub mod clock;
mod error;
pub mod frames;
pub mod output;
pub mod pace;
pub mod port;
pub mod replay;
pub mod session;
pub mod shots;
#[cfg(unix)]
pub mod simulated;
pub mod trigger;

pub use error::RecordError;
