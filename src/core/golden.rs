//! The minimum of a function of one variable.

/// Where a function that falls and then rises is least between two values (golden section, Kiefer 1953, Proc. AMS 4,
/// 502).
pub(crate) fn least_between(of: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    for _ in 0..40 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if of(a) < of(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}
