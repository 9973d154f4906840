//! The profile of one parameter: how the fit gets worse along it.

use crate::fit::outcome::thresholds::PROFILE_DIFFERS;

/// The profile of one parameter, in its own unit.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Profile {
    /// The 95% interval; an end that is open or not known is infinite.
    pub interval_95: (f64, f64),
    /// Where an end is not known: the last value at which an optimum was found, below and above.
    pub unknown_beyond: [Option<f64>; 2],
    /// Number of points at which no optimum was found; they are not among `points`.
    pub unresolved: usize,
    /// The linear one.
    pub linear_95: (f64, f64),
    /// Value and rise of the sum of squares, ascending by value; 3.84 is the threshold.
    pub points: Vec<(f64, f64)>,
    /// By how much the sum of squares fell below that of the centre: more than 0 where the fit was not the best.
    pub fell_by: f64,
    /// Where it is centred: the optimum that a descent from the fit leads to.
    pub best: f64,
}

impl Profile {
    /// Whether it differs from the linear interval about its centre; false where there is no linear one.
    pub fn disagrees(&self) -> bool {
        let value = self.best;
        if self.linear_95.0.is_nan() || self.linear_95.1.is_nan() {
            return false;
        }
        let sides = [(self.interval_95.0, self.linear_95.0), (self.interval_95.1, self.linear_95.1)];
        sides.into_iter().any(|(own, linear)| match (own.is_finite(), linear.is_finite()) {
            (true, true) => {
                let ratio = (own - value) / (linear - value);
                ratio.is_finite() && !(1.0 / (1.0 + PROFILE_DIFFERS)..=1.0 + PROFILE_DIFFERS).contains(&ratio)
            }
            (own, linear) => own != linear,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disagreement_is_said() {
        let of = |interval_95, linear_95| Profile {
            interval_95,
            unknown_beyond: [None; 2],
            unresolved: 0,
            linear_95,
            points: vec![],
            fell_by: 0.0,
            best: 1.0,
        };
        assert!(!of((0.8, 1.25), (0.78, 1.22)).disagrees());
        assert!(of((0.8, 1.6), (0.78, 1.22)).disagrees());
        assert!(of((0.8, f64::INFINITY), (0.78, 1.22)).disagrees());
        assert!(!of((0.8, f64::INFINITY), (0.8, f64::INFINITY)).disagrees());
        assert!(!of((0.8, 1.6), (f64::NAN, f64::NAN)).disagrees());
    }
}
