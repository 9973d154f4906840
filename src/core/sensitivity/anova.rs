//! One-way analysis of variance: do groups of numbers share one mean?

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Result of an analysis of variance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OneWay {
    /// Mean square between groups over mean square within them; infinite where nothing varies within.
    pub f: f64,
    /// Probability of at least this F if all groups are normal with one mean and one variance.
    pub p: f64,
    /// Degrees of freedom between groups.
    pub df_between: usize,
    /// Degrees of freedom within groups.
    pub df_within: usize,
    /// Sum of squares between groups.
    pub ss_between: f64,
    /// Sum of squares within groups.
    pub ss_within: f64,
}

/// Compares groups of values; values that are not finite are left out. `None` if fewer than two groups have a value, or
/// none has two.
///
/// F is infinite and p is 0 if values differ between groups but never within, as in repeated runs of a deterministic
/// model. Both are NaN if no value differs at all.
pub fn one_way(groups: &[Vec<f64>]) -> Option<OneWay> {
    let finite = |g: &Vec<f64>| g.iter().copied().filter(|v| v.is_finite()).collect::<Vec<f64>>();
    let groups: Vec<Vec<f64>> = groups.iter().map(finite).filter(|g| !g.is_empty()).collect();
    let count: usize = groups.iter().map(Vec::len).sum();
    if groups.len() < 2 || count <= groups.len() {
        return None;
    }
    // About the overall mean, applied twice: a large common value costs no digits.
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let rough = mean(&groups.concat());
    let grand = rough + groups.iter().flatten().map(|v| v - rough).sum::<f64>() / count as f64;
    let (mut ss_between, mut ss_within) = (0.0, 0.0);
    for group in &groups {
        let shifted: Vec<f64> = group.iter().map(|v| v - grand).collect();
        // Equal values have exactly their own mean, whatever their sum rounds to.
        let alike = shifted.iter().all(|v| *v == shifted[0]);
        let own = if alike { shifted[0] } else { mean(&shifted) };
        ss_between += group.len() as f64 * own * own;
        ss_within += shifted.iter().map(|v| (v - own).powi(2)).sum::<f64>();
    }
    let (df_between, df_within) = (groups.len() - 1, count - groups.len());
    let all_alike = groups.iter().flatten().all(|v| *v == groups[0][0]);
    let (f, p) = if all_alike {
        (f64::NAN, f64::NAN)
    } else if ss_within == 0.0 {
        (f64::INFINITY, 0.0)
    } else {
        let f = ss_between / df_between as f64 / (ss_within / df_within as f64);
        (f, exceedance(f, df_between, df_within))
    };
    Some(OneWay { f, p, df_between, df_within, ss_between, ss_within })
}

/// Probability that F with these degrees of freedom exceeds a value.
fn exceedance(f: f64, df_between: usize, df_within: usize) -> f64 {
    FisherSnedecor::new(df_between as f64, df_within as f64).map_or(f64::NAN, |d| d.sf(f))
}

/// The F that is exceeded with a probability if all groups have one mean.
pub fn critical(p: f64, df_between: usize, df_within: usize) -> f64 {
    FisherSnedecor::new(df_between as f64, df_within as f64).map_or(f64::NAN, |d| d.inverse_cdf(1.0 - p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_critical_values_have_their_probabilities() {
        assert!((exceedance(7.591, 3, 8) - 0.01).abs() < 1e-5);
        assert!((exceedance(4.066, 3, 8) - 0.05).abs() < 1e-5);
        assert!((critical(0.01, 3, 8) - 7.591).abs() < 1e-3 && (critical(0.05, 3, 8) - 4.066).abs() < 1e-3);
    }

    #[test]
    fn repeats_that_do_not_vary_have_an_infinite_f() {
        let repeated = one_way(&[vec![0.1; 3], vec![0.2; 3], vec![0.3; 3], vec![0.4; 3]]).unwrap();
        assert_eq!((repeated.f, repeated.p, repeated.df_between, repeated.df_within), (f64::INFINITY, 0.0, 3, 8));
        let constant = one_way(&[vec![0.1; 3], vec![0.1; 3]]).unwrap();
        assert!(constant.f.is_nan() && constant.p.is_nan());
        assert!(one_way(&[vec![1.0], vec![2.0]]).is_none() && one_way(&[vec![1.0, 2.0]]).is_none());
    }

    #[test]
    fn what_is_not_a_number_is_left_out() {
        let with = one_way(&[vec![1.0, 2.0, f64::NAN], vec![2.0, 4.0], vec![f64::NAN]]);
        assert_eq!(with, one_way(&[vec![1.0, 2.0], vec![2.0, 4.0]]));
    }
}
