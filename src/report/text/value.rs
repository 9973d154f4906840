//! Fitted values as people read them.

use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::model::parameter::Scale;
use crate::report::text::number::{significant, with_error};

/// A fitted value with its error, `395.1(4)`; in words where the error says less: a value that the data leave open on
/// both sides is `0.1136 (undetermined)`, a positive one that is known to less than itself `0.0284 (±220%)`. Without an
/// error where the fit ended at no optimum.
pub fn fitted(fit: &Fit, p: &FittedParameter) -> String {
    if fit.converged { of_an_optimum(p) } else { significant(p.value, 5) }
}

fn of_an_optimum(p: &FittedParameter) -> String {
    let (low, high) = p.interval_95;
    let open = low == f64::NEG_INFINITY && high == f64::INFINITY;
    match (p.scale, p.standard_error()) {
        (Scale::Log, _) if open && !p.held => with_error(p.value, f64::INFINITY),
        (Scale::Log, error) if error.is_finite() && error > p.value => {
            format!("{} (±{}%)", significant(p.value, 3), significant(100.0 * error / p.value, 2))
        }
        (_, error) => with_error(p.value, error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::uncertainty::Uncertainty;

    #[test]
    fn errors_that_drown_a_positive_value_are_said_otherwise() {
        let of = |value, standard_error, interval_95, scale| {
            of_an_optimum(&FittedParameter {
                value,
                uncertainty: Uncertainty::of(standard_error),
                interval_95,
                scale,
                ..FittedParameter::default()
            })
        };
        let open = (f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(of(0.113_62, 10017.0, open, Scale::Log), "0.1136 (undetermined)");
        assert_eq!(of(0.028_351, 0.063, (3.5e-4, 2.3), Scale::Log), "0.0284 (±220%)");
        assert_eq!(of(0.028_351, 0.063, (f64::NEG_INFINITY, 2.3), Scale::Log), "0.0284 (±220%)");
        assert_eq!(of(1.26, 0.7, (0.4, 3.7), Scale::Log), "1.3(7)");
        // What may be negative is known by its own size.
        assert_eq!(of(0.003, 0.025, (-0.046, 0.052), Scale::Linear), "0.003(25)");
        assert_eq!(of(0.003, 0.025, open, Scale::Linear), "0.003(25)");
    }
}
