//! Where errors are not normal: the joint posterior of a fit's values, by sampling, and a test that says where that is
//! needed.

pub mod doubt;
mod interval;
pub(crate) mod likelihood;
pub mod sample;
pub(crate) mod thresholds;
