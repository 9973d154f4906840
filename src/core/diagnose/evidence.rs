//! Evidence for one model against another, and the probabilities that follow.
//!
//! The evidence of a candidate is half the fall of the weighted square, in units of what the best model leaves, minus
//! half `ln n` for each parameter that it adds (Schwarz 1978, Ann. Statist. 6, 461). `n` is the effective number of
//! samples: neighbours with the same error count once. If no model brings the residual down to the noise, all evidence
//! shrinks.

use crate::diagnose::limits::{PRIOR_ODDS_OF_NOTHING, TEMPERATURE};
use crate::fit::numeric::uncertainty::correlation_inflation;

/// Turns squares into evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvidenceScale {
    /// Effective number of samples.
    pub effective: f64,
    /// Sum of squares that counts as one unit: the variance that the best model leaves (at least the noise's) times the
    /// correlation.
    pub unit: f64,
}

impl EvidenceScale {
    /// From the residuals of the best model, in units of the samples' noise. The part that is not noise has causes that
    /// repeat: where it is nearly all, the samples count as no more than the `features`.
    pub fn of(samples: &[f64], features: f64) -> Self {
        let n = samples.len().max(1) as f64;
        let variance = samples.iter().map(|r| r * r).sum::<f64>() / n;
        let systematic = (1.0 - 1.0 / variance.max(1.0)).powi(2) * n / features;
        let inflation = correlation_inflation(samples).max(systematic);
        EvidenceScale { effective: n / inflation, unit: variance.max(1.0) * inflation }
    }

    /// Evidence of a model that leaves `other` and has `added` more free parameters, against one that leaves `square`.
    pub fn evidence(&self, square: f64, other: f64, added: usize) -> f64 {
        0.5 * (square - other) / self.unit - 0.5 * added as f64 * self.effective.ln()
    }
}

/// Probabilities of candidates from their evidence and prior odds. "None of them" has evidence zero and odds
/// [`PRIOR_ODDS_OF_NOTHING`]; its probability is what the others leave of 1.
pub fn probabilities(candidate_fits: &[(f64, f64)]) -> Vec<f64> {
    let logs: Vec<f64> = candidate_fits.iter().map(|(evidence, odds)| tempered(*evidence) + odds.ln()).collect();
    let top = logs.iter().copied().fold(PRIOR_ODDS_OF_NOTHING.ln(), f64::max);
    let total: f64 = logs.iter().map(|l| (l - top).exp()).sum::<f64>() + (PRIOR_ODDS_OF_NOTHING.ln() - top).exp();
    logs.iter().map(|l| (l - top).exp() / total).collect()
}

/// Evidence as a logarithm of odds.
pub fn tempered(evidence: f64) -> f64 {
    evidence / TEMPERATURE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_sum_to_less_than_one_and_follow_the_evidence() {
        let p = probabilities(&[(40.0, 1.0), (40.0, 1.0), (0.0, 1.0)]);
        assert!((p[0] - p[1]).abs() < 1e-12 && p[0] > 0.49 && p[0] < 0.5 && p[2] < 1e-4, "{p:?}");
        let none = probabilities(&[(-30.0, 1.0)]);
        assert!(none[0] < 1e-3);
        assert!(probabilities(&[(1e6, 1.0), (0.0, 1.0)]).iter().all(|p| p.is_finite()));
    }

    #[test]
    fn white_noise_is_worth_what_it_counts() {
        let residuals: Vec<f64> = (0..1000).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let worth = EvidenceScale::of(&residuals, 1000.0);
        assert!((worth.effective - 1000.0).abs() < 1e-9 && (worth.unit - 1.0).abs() < 1e-9);
        let slow: Vec<f64> = (0..1000).map(|i| (f64::from(i) / 50.0).sin() * 3.0).collect();
        let worth = EvidenceScale::of(&slow, 1000.0);
        assert!(worth.effective < 20.0 && worth.unit > 100.0, "{worth:?}");
    }

    #[test]
    fn what_is_no_noise_counts_as_its_features() {
        let misfit: Vec<f64> = (0..1000).map(|i| if i % 2 == 0 { 10.0 } else { -10.0 }).collect();
        let worth = EvidenceScale::of(&misfit, 20.0);
        assert!((worth.effective - 20.0).abs() < 0.5, "{worth:?}");
        let noise: Vec<f64> = misfit.iter().map(|r| 0.1 * r).collect();
        assert!((EvidenceScale::of(&noise, 20.0).effective - 1000.0).abs() < 1e-9);
    }
}
