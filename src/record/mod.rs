//! Live recording: bytes from devices become a recording whose sample times are the devices' own.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`frames`], [`lines`], [`modbus`] | the wire codecs, without I/O |
//! | [`registers`], [`poll`], [`polling`] | Modbus: what is asked for together, how never to take a late answer for the next one, the thread that asks |
//! | [`port`] | serial ports: which there are, opening one |
//! | [`source`] | one thread a port, all into one bounded queue |
//! | [`fit`], [`align`] | a device's clock against the host's; several devices on one clock |
//! | [`clock`] | device time to recording time; where samples are missing |
//! | [`stream`] | one device of a session |
//! | [`live`] | the log of a session, from the first valid sample on |
//! | [`session`] | one live test from the first sample to the finished file |
//! | [`replay`] | a recording or a CSV played as if it were live |
//! | [`simulated`] | devices on pseudo-terminals that play given data, with faults where asked for |
//! | [`pace`] | playing recorded time against the wall clock |
//! | [`output`] | what sessions write to, and count |
//! | [`trigger`] | when a shot begins and is over, without I/O |
//! | [`shots`] | a recording a shot, with what came before it |
//! | [`recorder`] | all into one recording, or a recording a shot; watched either way |
//! | [`vitals`], [`callout`], [`monitor`] | how a sensor does, what is wrong with it and what to do, all sensors of a session |
//! | [`snapshot`] | where a session stands, for a view of it |

pub mod clock;
pub mod devices;
pub(crate) mod error;
pub mod health;
pub mod session;
pub mod wire;

pub use crate::record::error::RecordError;
