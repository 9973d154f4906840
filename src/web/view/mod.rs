//! What a page or a script sees of a session.

pub mod curves;
pub mod model;
pub mod packed;
pub mod runs;
pub mod simulated_test;
pub mod state;
pub mod take_away;
pub mod words;
