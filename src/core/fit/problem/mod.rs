//! Calibration as a least-squares problem: variables, residuals, and what of a record is compared.

pub mod compare;
pub(crate) mod elements;
pub mod error;
pub(crate) mod feature;
pub mod fit_problem;
pub(crate) mod groups;
pub mod hum;
pub(crate) mod latest;
pub mod method;
pub mod objective;
pub mod observed;
pub mod parameters;
pub mod rows;
#[cfg(test)]
pub(crate) mod test_record;
pub(crate) mod thresholds;
pub mod valve_curve;
