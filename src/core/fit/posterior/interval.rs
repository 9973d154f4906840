//! The 95% interval of draws: an end that a bound cuts off where the density is high is open, as in a linear interval
//! or a profile.

use crate::fit::posterior::thresholds::{BOUND_DENSITY, DENSITY_WINDOW};

/// The interval of draws in ascending order, within bounds; open ends are infinite.
pub(crate) fn of(sorted: &[f64], (lower, upper): (f64, f64)) -> (f64, f64) {
    let at = |share: f64| {
        let place = share * (sorted.len() - 1) as f64;
        let (below, part) = (place as usize, place.fract());
        sorted[below] + part * (sorted[(below + 1).min(sorted.len() - 1)] - sorted[below])
    };
    // The density is compared over stretches as wide as the narrowest one that holds a few percent of the draws.
    let few = ((DENSITY_WINDOW * sorted.len() as f64) as usize).max(1);
    let width = sorted.windows(few + 1).map(|w| w[few] - w[0]).fold(f64::INFINITY, f64::min);
    let open = |near: &dyn Fn(f64) -> bool| {
        let count = sorted.iter().filter(|v| near(**v)).count() as f64;
        count >= BOUND_DENSITY * few as f64
    };
    match [open(&|v| v - lower <= width), open(&|v| upper - v <= width)] {
        [true, true] => (f64::NEG_INFINITY, f64::INFINITY),
        [true, false] => (f64::NEG_INFINITY, at(0.95)),
        [false, true] => (at(0.05), f64::INFINITY),
        [false, false] => (at(0.025), at(0.975)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, Normal};

    /// Exact quantiles of a normal density, standard, cut off below `least`.
    fn cut_off(least: f64) -> Vec<f64> {
        let normal = Normal::standard();
        let below = normal.cdf(least);
        let n = 4000;
        (0..n).map(|i| normal.inverse_cdf(below + (1.0 - below) * (f64::from(i) + 0.5) / f64::from(n))).collect()
    }

    #[test]
    fn a_bound_that_cuts_the_density_off_opens_the_interval() {
        let (low, high) = of(&cut_off(0.5), (0.5, 100.0));
        // the quantile of 95% of what lies above 0.5: Φ⁻¹(1 - 0.05 (1 - Φ(0.5)))
        assert!(low == f64::NEG_INFINITY && (high - 2.1595).abs() < 0.01, "{low} {high}");
        let mirrored: Vec<f64> = cut_off(0.5).into_iter().rev().map(|v| -v).collect();
        let (low, upper) = of(&mirrored, (-100.0, -0.5));
        assert!((low + high).abs() < 1e-9 && upper == f64::INFINITY, "{low} {upper}");
    }

    /// Where the density at the bound is less than a seventh of its highest, the bound is no part of the interval.
    #[test]
    fn a_bound_far_out_leaves_it_as_it_is() {
        let (low, high) = of(&cut_off(-2.5), (-2.5, 100.0));
        // the quantile of 2.5% of what lies above -2.5: Φ⁻¹(Φ(-2.5) + 0.025 (1 - Φ(-2.5)))
        assert!((low + 1.8649).abs() < 0.01 && (high - 1.9604).abs() < 0.01, "{low} {high}");
        assert_eq!(of(&cut_off(-1.0), (-1.0, 100.0)).0, f64::NEG_INFINITY);
    }

    #[test]
    fn what_may_be_anything_is_open_on_both_sides() {
        let even: Vec<f64> = (0..1000).map(|i| f64::from(i) / 999.0).collect();
        assert_eq!(of(&even, (0.0, 1.0)), (f64::NEG_INFINITY, f64::INFINITY));
    }
}
