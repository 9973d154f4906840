//! What sends: ports, buses, polled slaves, simulated devices, files played as if live.

pub(crate) mod bus;
pub mod poll;
pub mod polling;
pub mod port;
pub mod replay;
#[cfg(unix)]
pub mod simulated;
pub mod source;
pub mod stream;
