//! Numerical methods that know nothing of pipes: least squares, global searches, linear algebra of errors.

pub(crate) mod cma;
pub(crate) mod evolution;
pub mod least_squares;
pub(crate) mod micro_ga;
#[cfg(test)]
pub(crate) mod test_problem;
pub mod uncertainty;
