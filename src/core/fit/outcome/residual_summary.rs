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

    /// Fall of the Bayesian information criterion from `before` to this richer model, with its effective number of
    /// samples.
    pub(crate) fn evidence_over(&self, before: &ResidualSummary) -> f64 {
        let effective = self.n / self.inflation;
        effective * (before.mean_square / self.mean_square).ln()
            - (self.parameters - before.parameters) * effective.ln()
    }
}
