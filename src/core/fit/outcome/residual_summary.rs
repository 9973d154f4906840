//! The residuals of a fit, in the few numbers by which models are compared.

use crate::fit::numeric::uncertainty::correlation_inflation;

/// The residuals of a fit in a few numbers.
pub(crate) struct ResidualSummary {
    /// Samples.
    n: f64,
    /// Mean square of the weighted residuals: 1 is the noise.
    mean_square: f64,
    /// See [`correlation_inflation`].
    inflation: f64,
    /// Shared parameters of the model.
    parameters: f64,
}

impl ResidualSummary {
    /// Of the weighted residuals of a model with this number of shared parameters.
    pub(crate) fn of(samples: &[f64], parameters: usize) -> Self {
        let n = samples.len().max(1) as f64;
        let mean_square = samples.iter().map(|r| r * r).sum::<f64>() / n;
        ResidualSummary { n, mean_square, inflation: correlation_inflation(samples), parameters: parameters as f64 }
    }

    /// Evidence for this richer model over the one `before`, natural logarithm of odds: half the fall of the Bayesian
    /// information criterion, with its effective number of samples.
    pub(crate) fn evidence_over(&self, before: &ResidualSummary) -> f64 {
        let effective = self.n / self.inflation;
        0.5 * effective * (before.mean_square / self.mean_square).ln()
            - 0.5 * (self.parameters - before.parameters) * effective.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half the error by one parameter more, of a hundred samples alike but for their sign: odds of 2^50 over 10.
    #[test]
    fn evidence_is_a_logarithm_of_odds() {
        let signs: Vec<f64> = (0..100).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let before: Vec<f64> = signs.iter().map(|r| std::f64::consts::SQRT_2 * r).collect();
        let evidence = ResidualSummary::of(&signs, 2).evidence_over(&ResidualSummary::of(&before, 1));
        let expected = 50.0 * 2f64.ln() - 10f64.ln();
        assert!((evidence - expected).abs() < 1e-9, "{evidence} {expected}");
    }
}
