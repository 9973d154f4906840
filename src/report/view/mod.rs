//! What is worth showing of a fit, whatever shows it.

pub mod curves;
pub mod decimate;
pub(crate) mod panel;
pub mod summary;
