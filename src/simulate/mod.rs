//! A run that is only simulated: a rig, effects and settings by name.

pub mod as_recorded;
pub mod cavities;
pub(crate) mod memory;
pub mod playback;
pub mod profiles;
pub(crate) mod sampled;
pub mod scenario;
pub mod synthetic;
#[cfg(unix)]
pub mod through_ports;
pub mod values_file;
pub mod wiring;
