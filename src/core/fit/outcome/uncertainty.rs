//! How well a fit knows a value.

/// How well a fit knows a value. [`standard_error`](Uncertainty::standard_error) is the same as a number, for tables
/// and files.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum Uncertainty {
    /// It has this standard error, in the value's unit.
    Known(f64),
    /// The data leave it open.
    Open,
    /// It lies at one of its bounds, where no standard error describes it.
    AtBound,
    /// The fit ended at no optimum, so nothing is known.
    NotAtOptimum,
    /// It was held.
    #[default]
    Held,
}

impl Uncertainty {
    /// Of a standard error; an infinite one stands for a value that the data leave open, one that is not a number for a
    /// value at a bound.
    pub fn of(standard_error: f64) -> Self {
        if standard_error.is_nan() {
            Uncertainty::AtBound
        } else if standard_error.is_infinite() {
            Uncertainty::Open
        } else {
            Uncertainty::Known(standard_error)
        }
    }

    /// The standard error: infinite where the data leave the value open, not a number at a bound or where the fit ended
    /// at no optimum, 0 for a value that was held.
    pub fn standard_error(self) -> f64 {
        match self {
            Uncertainty::Known(error) => error,
            Uncertainty::Open => f64::INFINITY,
            Uncertainty::AtBound | Uncertainty::NotAtOptimum => f64::NAN,
            Uncertainty::Held => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standard_error_survives_the_way_there_and_back() {
        assert_eq!(Uncertainty::of(0.3).standard_error(), 0.3);
        assert_eq!(Uncertainty::of(f64::INFINITY), Uncertainty::Open);
        assert_eq!(Uncertainty::Open.standard_error(), f64::INFINITY);
        assert!(
            Uncertainty::of(f64::NAN).standard_error().is_nan() && Uncertainty::NotAtOptimum.standard_error().is_nan()
        );
        assert_eq!(Uncertainty::default().standard_error(), 0.0);
    }
}
