//! One live test: from what devices send to finished files.

pub mod feed;
pub mod live_test;
pub(crate) mod options;
pub mod output;
pub mod recorder;
pub mod replay;
pub mod session_log;
pub(crate) mod shot;
pub mod shots;
pub(crate) mod stream;
pub mod trigger;
