//! One live test: from what devices send to finished files.

pub mod live_test;
pub mod output;
pub mod recorder;
pub mod session_log;
pub(crate) mod shot;
pub mod shots;
pub mod trigger;
