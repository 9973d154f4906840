//! Numerical methods that know nothing of pipes: least squares, global searches, linear algebra of errors.

pub(crate) mod bounded_step;
pub(crate) mod cma;
pub(crate) mod convergence;
pub(crate) mod evolution;
pub mod least_squares;
pub(crate) mod micro_ga;
pub(crate) mod population;
pub mod quantiles;
pub(crate) mod randomised;
#[cfg(test)]
pub(crate) mod test_problem;
pub(crate) mod thresholds;
pub mod uncertainty;
