//! What sends: ports, sockets, processes, buses, polled slaves, simulated devices.

pub(crate) mod backoff;
pub(crate) mod bus;
pub(crate) mod device_count;
pub(crate) mod loopback;
pub mod poll;
pub mod polling;
pub mod port;
#[cfg(unix)]
pub(crate) mod process;
pub(crate) mod queue;
pub mod reader;
#[cfg(unix)]
pub mod simulated;
pub(crate) mod socket;
pub mod source;
