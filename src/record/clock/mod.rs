//! From the clocks of devices to one clock of the recording, and whether they run at the right pace.

pub mod align;
pub mod clock_line;
pub mod device_clock;
pub(crate) mod host_clock;
pub mod pace;
pub(crate) mod summary;
pub(crate) mod time_unit;
