//! How a valve closed, read back from the record.

pub mod curve;
pub mod shift;
pub(crate) mod thresholds;
