//! What sends: ports, buses, polled slaves, simulated devices.

pub(crate) mod bus;
pub(crate) mod device_count;
pub(crate) mod loopback;
pub mod poll;
pub mod polling;
pub mod port;
pub(crate) mod queue;
#[cfg(unix)]
pub mod simulated;
pub mod source;
