//! The front door: recordings opened, inspected and prepared, ready to be calibrated and diagnosed.

pub mod models;
pub mod open;
