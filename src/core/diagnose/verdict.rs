//! What follows from the evidence: the verdict, and how probable it is.

use crate::diagnose::Candidate;

/// Evidence below which an effect is not worth having: the largest of sixteen searches by chance stays below.
pub(crate) const LEAST_EVIDENCE: f64 = 12.0;
/// What an effect must take away of the error, in quadrature, over the noise: less is not worth a model.
pub(crate) const LEAST_FALL: f64 = 0.25;
/// Error over noise up to which a residual may be noise.
const NOISE: f64 = 1.3;
/// An effect that leaves more than this share of what the start model's error has beyond the noise, and more than
/// [`LEFT_OVER_NOISE`] times the noise, does not explain it.
const LEFT_SHARE: f64 = 0.35;
const LEFT_OVER_NOISE: f64 = 2.5;
/// How quickly the probability of something else changes with the error's logarithm around [`NOISE`] where nothing explains any of it,
/// and around [`LEFT_OVER_NOISE`] where an effect explains some: chosen on recordings of `tools/hidden` of one seed, to be counted on those
/// of others by `tools/reliability.py`.
const STEEPNESS_UNEXPLAINED: f64 = 12.0;
const STEEPNESS: f64 = 4.0;

/// What a diagnosis says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// An effect of the catalogue is missing.
    MissingEffect,
    /// The residual is noise.
    NothingMissing,
    /// Something is missing that no effect of the catalogue explains.
    UnknownEffect,
}

impl Verdict {
    /// As the contract names it.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::MissingEffect => "missing-effect",
            Verdict::NothingMissing => "nothing-missing",
            Verdict::UnknownEffect => "unknown-effect",
        }
    }

    /// The verdict over candidates, the most probable first, of a start model that leaves `start` times the noise, and the probability
    /// that something outside the catalogue is missing. One that is at work for `certain` is missing whatever it leaves unexplained.
    pub(crate) fn over(start: f64, candidates: &[Candidate], certain: bool) -> (Verdict, f64) {
        let Some(best) = candidates.first().filter(|c| c.evidence >= LEAST_EVIDENCE) else {
            // Within what instruments of their class may be off by, it is still noise.
            let within_class = candidates.iter().filter(|c| c.within_class).map(|c| c.over_noise);
            let left = within_class.fold(start, f64::min);
            let verdict = if left <= NOISE { Verdict::NothingMissing } else { Verdict::UnknownEffect };
            return (verdict, something_else(left, None));
        };
        if certain {
            return (Verdict::MissingEffect, 0.0);
        }
        let unexplained = left_share(start, best.over_noise) > LEFT_SHARE && best.over_noise > LEFT_OVER_NOISE;
        let verdict = if unexplained { Verdict::UnknownEffect } else { Verdict::MissingEffect };
        (verdict, something_else(start, Some(best.over_noise)))
    }
}

/// What an error leaves of another, both over the noise and beyond it, as a share of its square.
fn left_share(before: f64, after: f64) -> f64 {
    let excess = |over_noise: f64| (over_noise.powi(2) - 1.0).max(0.0);
    excess(after) / excess(before).max(f64::MIN_POSITIVE)
}

/// The probability that it is something outside the catalogue that is missing, of a start model that leaves `before` times the noise.
/// Where an effect is worth having it brings that down to `after`: the more that is left, the more is something else, unless most is
/// explained and only more is missing besides.
fn something_else(before: f64, after: Option<f64>) -> f64 {
    let rises =
        |over_noise: f64, even: f64, steepness: f64| 1.0 / (1.0 + (even / over_noise.max(0.01)).powf(steepness));
    match after {
        None => rises(before, NOISE, STEEPNESS_UNEXPLAINED),
        Some(after) => rises(after, LEFT_OVER_NOISE, STEEPNESS) * (left_share(before, after) / LEFT_SHARE).min(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_more_is_left_the_more_is_missing() {
        assert!(something_else(3.0, Some(1.0)) < 1e-12);
        assert!((something_else(LEFT_OVER_NOISE, Some(LEFT_OVER_NOISE)) - 0.5).abs() < 1e-12);
        assert!(something_else(20.0, Some(19.0)) > 0.99);
        assert!(something_else(100.0, Some(10.0)) < 0.05);
        assert!(something_else(1.0, None) < 0.05);
        assert!(something_else(1.6, None) > 0.9);
    }
}
