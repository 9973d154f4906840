//! How the sensors of a session do, and what is wrong with them.

pub mod alert;
pub mod monitor;
pub mod sensor_health;
pub mod snapshot;
