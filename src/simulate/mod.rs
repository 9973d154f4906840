//! A run that is only simulated: a rig, effects and settings by name.

pub(crate) mod memory;
pub mod playback;
pub mod scenario;
