//! What follows from the evidence: the verdict, and how probable it is.

use super::Candidate;
use crate::fit::outcome::Fit;

/// Evidence below which an effect is not worth having: the largest of sixteen searches by chance stays below.
pub(super) const LEAST_EVIDENCE: f64 = 10.0;
/// What an effect must take away of the error, in quadrature, over the noise: less is not worth a model.
pub(super) const LEAST_FALL: f64 = 0.25;
/// Error over noise up to which a residual may be noise.
const NOISE: f64 = 1.3;
/// An effect that leaves more than this share of what the start model's error has beyond the noise, and more than
/// [`LEFT_OVER_NOISE`] times the noise, does not explain it.
const LEFT_SHARE: f64 = 0.35;
const LEFT_OVER_NOISE: f64 = 2.5;
/// The error over noise at which it is as probable that the best model still lacks something as that it does not, and how quickly that
/// changes with the error's logarithm: fitted to the table of reliability (tools/reliability.md).
const EVEN: f64 = 2.5;
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

    /// The verdict over candidates, the most probable first. One that is at work for `certain` is missing whatever it leaves unexplained.
    pub(super) fn over(start: &Fit, noise_m: f64, candidates: &[Candidate], certain: bool) -> Verdict {
        let (rmse_m, _) = start.pooled();
        let Some(best) = candidates.first().filter(|c| c.evidence >= LEAST_EVIDENCE) else {
            return if rmse_m <= NOISE * noise_m { Verdict::NothingMissing } else { Verdict::UnknownEffect };
        };
        let left = left_share(rmse_m, best.rmse_m, noise_m);
        if !certain && left > LEFT_SHARE && best.rmse_m > LEFT_OVER_NOISE * noise_m {
            Verdict::UnknownEffect
        } else {
            Verdict::MissingEffect
        }
    }
}

/// What an error leaves of another, both beyond the noise, as a share of its square.
fn left_share(before_m: f64, after_m: f64, noise_m: f64) -> f64 {
    let excess = |rmse_m: f64| (rmse_m.powi(2) - noise_m.powi(2)).max(0.0);
    excess(after_m) / excess(before_m).max(f64::MIN_POSITIVE)
}

/// The probability that it is something else that is missing than what brings the error from `before_m` to `after_m`: the more that
/// is left, the more, unless most is explained and only more is missing besides.
pub(super) fn something_else(before_m: f64, after_m: f64, noise_m: f64) -> f64 {
    let poor = 1.0 / (1.0 + (EVEN * noise_m / after_m.max(f64::MIN_POSITIVE)).powf(STEEPNESS));
    poor * (left_share(before_m, after_m, noise_m) / LEFT_SHARE).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_more_is_left_the_more_is_missing() {
        assert!(something_else(3.0, 1.0, 1.0) < 1e-12);
        assert!((something_else(EVEN, EVEN, 1.0) - 0.5).abs() < 1e-12);
        assert!(something_else(20.0, 19.0, 1.0) > 0.99);
        assert!(something_else(100.0, 10.0, 1.0) < 0.05);
    }
}
