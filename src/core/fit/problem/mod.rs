//! Calibration as a least-squares problem: variables, residuals, and what of a record is compared.

pub(crate) mod feature;
pub mod fit_problem;
pub mod method;
pub mod objective;
pub mod observed;
pub(crate) mod parameters;
pub(crate) mod rows;
#[cfg(test)]
pub(crate) mod test_record;
