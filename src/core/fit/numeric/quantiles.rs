//! Quantiles of the distributions that intervals are made of.

/// Half a 95% interval of the normal distribution, in standard deviations.
pub const Z_95: f64 = 1.959_964;

/// Half a 95% interval of Student's distribution in standard errors, by Cornish and Fisher's expansion in the inverse
/// of its degrees of freedom (Abramowitz & Stegun 26.7.5); those below 1 count as 1.
pub fn student_95(freedom: f64) -> f64 {
    let (z, v) = (Z_95, freedom.max(1.0));
    let [z3, z5, z7] = [3, 5, 7].map(|n| z.powi(n));
    z + (z3 + z) / (4.0 * v)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * v.powi(2))
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * v.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn students_interval_is_that_of_the_tables() {
        for (freedom, table) in [(5.0, 2.5706), (10.0, 2.2281), (30.0, 2.0423), (1e9, 1.9600)] {
            assert!((student_95(freedom) - table).abs() < 5e-3, "{freedom}: {}", student_95(freedom));
        }
    }
}
