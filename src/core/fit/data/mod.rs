//! What a fit sees of a run.

pub mod prepare;
pub mod run_data;
pub(crate) mod thresholds;
