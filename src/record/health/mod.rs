//! The health of the sensors of a session, and their faults.

pub mod alert;
pub mod disk;
pub mod monitor;
pub mod sensor_health;
pub mod snapshot;
