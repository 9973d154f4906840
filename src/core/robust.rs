//! Robust location and spread: a few wild values do not move them.

/// Factor from the median absolute deviation to the standard deviation of a normal distribution.
pub(crate) const MEDIAN_TO_SD: f64 = 1.4826;

/// Odds (natural logarithm) against a run of equal values by chance from which it is none: one in a million.
pub const NOT_BY_CHANCE: f64 = 14.0;

/// Median (the upper of the two middle values); reorders its argument; 0 for an empty slice.
pub fn median(values: &mut [f64]) -> f64 {
    at(values, values.len() / 2)
}

/// Quantile: the value that a share of the others does not exceed; reorders its argument; 0 for an empty slice.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    at(values, (values.len().saturating_sub(1) as f64 * share) as usize)
}

/// Standard deviation about `middle` from the median distance to it; 0 for an empty slice.
pub fn sd_about(middle: f64, values: &[f64]) -> f64 {
    MEDIAN_TO_SD * median(&mut values.iter().map(|value| (value - middle).abs()).collect::<Vec<_>>())
}

/// The value at an index in ascending order.
fn at(values: &mut [f64], place: usize) -> f64 {
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(place, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wild_values_move_neither_middle_nor_spread() {
        let mut dice = fastrand::Rng::with_seed(1);
        // the sum of twelve uniform numbers: normal, with a variance of one
        let mut values: Vec<f64> = (0..10_000).map(|_| 3.0 + (0..12).map(|_| dice.f64() - 0.5).sum::<f64>()).collect();
        values[..20].fill(1e9);
        assert!((median(&mut values) - 3.0).abs() < 0.05);
        assert!((sd_about(3.0, &values) - 1.0).abs() < 0.05);
        assert!((quantile(&mut values, 0.975) - 4.96).abs() < 0.15);
        assert_eq!((median(&mut [4.0, 1.0, 3.0, 2.0]), quantile(&mut [4.0, 1.0, 3.0, 2.0], 0.5)), (3.0, 2.0));
        assert_eq!((median(&mut []), quantile(&mut [], 0.9), sd_about(0.0, &[])), (0.0, 0.0, 0.0));
    }
}
