//! Live recording: bytes from devices become a recording whose sample times are the devices' own.
//!
//! Five floors; each uses only those above it in this table.
//!
//! | floor | what it holds |
//! | --- | --- |
//! | [`wire`] | the wire codecs: bytes to values and back, without I/O |
//! | [`clock`] | the clocks of devices against the host's and against each other; playing recorded time |
//! | [`devices`] | serial ports, sockets, processes, polled slaves, simulated devices; a thread a port, all into one bounded queue |
//! | [`health`] | how a sensor does, what is wrong with it and what to do; where a session stands |
//! | [`session`] | one live test: its devices, its log, triggered shots, replays |

pub mod clock;
pub mod devices;
pub(crate) mod error;
pub mod health;
pub mod session;
pub mod wire;

pub use crate::record::error::RecordError;
