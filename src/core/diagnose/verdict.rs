//! The verdict that follows from the evidence, and how probable it is.

use crate::diagnose::evidence::tempered;
use crate::diagnose::limits::{STEEPNESS, STEEPNESS_UNEXPLAINED, UNEXPLAINED_SHARE};
use crate::diagnose::outcome::{Candidate, Pair, Verdict};
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::search::thresholds::{DOUBTFUL_ABOVE, NOISE_LIKE};

/// The verdict, and the probability that something outside the catalogue is missing. `start` is the start model's error
/// over noise; `candidates` come most probable first; a `pair` is the answer instead of the first. A record that shows
/// the first one by itself (`shown`) has it, whatever it leaves unexplained.
pub(crate) fn verdict(start: f64, candidates: &[Candidate], pair: Option<&Pair>, shown: bool) -> (Verdict, f64) {
    // Alone, an effect of a pair may explain nothing.
    let Some(best) = candidates.first().filter(|c| pair.is_some() || tempered(c.evidence) >= STRONG_EVIDENCE) else {
        // An error that instruments within their class explain still counts as noise.
        let within_class = candidates.iter().filter(|c| c.within_class && c.fit.is_some()).map(|c| c.over_noise);
        let left = within_class.fold(start, f64::min);
        let verdict = if left <= NOISE_LIKE { Verdict::NothingMissing } else { Verdict::UnknownEffect };
        return (verdict, something_else(left, None));
    };
    if shown {
        return (Verdict::MissingEffect, 0.0);
    }
    let after = pair.map_or(best.over_noise, |pair| pair.over_noise);
    let unexplained = left_share(start, after) > UNEXPLAINED_SHARE && after > DOUBTFUL_ABOVE;
    let verdict = if unexplained { Verdict::UnknownEffect } else { Verdict::MissingEffect };
    (verdict, something_else(start, Some(after)))
}

/// Share of an error's square that is left, both counted over the noise and beyond it.
fn left_share(before: f64, after: f64) -> f64 {
    let excess = |over_noise: f64| (over_noise.powi(2) - 1.0).max(0.0);
    excess(after) / excess(before).max(f64::MIN_POSITIVE)
}

/// The probability that something outside the catalogue is missing. The start model's error over noise is `before`; an
/// effect worth having brings it down to `after`. The more is left, the more probable it is that something else is
/// missing, unless the effect explains most of it.
fn something_else(before: f64, after: Option<f64>) -> f64 {
    let rises =
        |over_noise: f64, even: f64, steepness: f64| 1.0 / (1.0 + (even / over_noise.max(0.01)).powf(steepness));
    match after {
        None => rises(before, NOISE_LIKE, STEEPNESS_UNEXPLAINED),
        Some(after) => {
            rises(after, DOUBTFUL_ABOVE, STEEPNESS) * (left_share(before, after) / UNEXPLAINED_SHARE).min(1.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_more_is_left_the_more_is_missing() {
        assert!(something_else(3.0, Some(1.0)) < 1e-12);
        assert!((something_else(DOUBTFUL_ABOVE, Some(DOUBTFUL_ABOVE)) - 0.5).abs() < 1e-12);
        assert!(something_else(20.0, Some(19.0)) > 0.99);
        assert!(something_else(100.0, Some(10.0)) < 0.05);
        assert!(something_else(1.0, None) < 0.05);
        assert!(something_else(1.6, None) > 0.9);
    }
}
