//! Do the laws describe the runs? The fit under them against the fits apart, of which it is a special case.

use crate::temperature::thresholds::LAWS_SIGNIFICANCE;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// The verdict of the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The laws leave no more than the separate fits but noise.
    Describe,
    /// They leave more than noise, but too little to justify parameters of each run's own.
    Nearly,
    /// The runs need parameters of their own.
    Fail,
}

/// A chance in words that do not claim more digits than it has.
pub fn chance(p: f64) -> String {
    if p < 1e-12 { "below 1e-12".to_owned() } else { format!("{p:.1e}") }
}

impl Verdict {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Describe => "describe",
            Verdict::Nearly => "nearly",
            Verdict::Fail => "fail",
        }
    }
}

/// F-test (Draper & Smith 1998, ch. 6) and Bayesian information criterion, both with the number of samples that would
/// be as informative in white noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Mean square a parameter saved, over that of the fits apart.
    pub f: f64,
    /// Parameters that the laws save, and effective samples that the fits apart leave.
    pub freedom: (f64, f64),
    /// Chance of an `f` as large if the laws hold.
    pub chance: f64,
    /// Criterion of the fit together minus that of the fits apart: below zero the laws are preferred.
    pub bic_difference: f64,
    /// The verdict.
    pub verdict: Verdict,
}

/// Sums of squared residuals, in units of the noise's, and how many parameters they took.
pub(crate) struct Sums {
    /// Of the fits apart.
    pub apart: f64,
    /// Of the fit together.
    pub together: f64,
    /// Samples.
    pub samples: usize,
    /// What noise makes the laws leave more, a parameter that they save: 1 where it is white and as large as believed.
    pub noise_per_parameter: f64,
    /// Parameters of the fits apart.
    pub apart_parameters: usize,
    /// Parameters that the laws save.
    pub saved: usize,
}

/// None where the laws save no parameter.
pub(crate) fn compare(sums: &Sums) -> Option<Comparison> {
    // The number of samples that would be as informative if their noise were white.
    // The believed noise is a lower limit.
    let square = sums.apart.max(sums.samples as f64);
    let effective = square / sums.noise_per_parameter;
    let (q, left) = (sums.saved as f64, effective - sums.apart_parameters as f64);
    let more = (sums.together - sums.apart).max(0.0);
    let law = FisherSnedecor::new(q, left).ok()?;
    let f = more / q / (square / left);
    let chance = law.sf(f);
    let bic_difference = effective * (more / square).ln_1p() - q * effective.ln();
    let verdict = match (chance < LAWS_SIGNIFICANCE, bic_difference < 0.0) {
        (false, _) => Verdict::Describe,
        (true, true) => Verdict::Nearly,
        (true, false) => Verdict::Fail,
    };
    Some(Comparison { f, freedom: (q, left), chance, bic_difference, verdict })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(more: f64, noise_per_parameter: f64, saved: usize) -> Sums {
        Sums { apart: 1020.0, together: 1020.0 + more, samples: 1020, noise_per_parameter, apart_parameters: 20, saved }
    }

    /// F0.01(4, 1000) is 3.338 (scipy 1.17, `f.isf(0.01, 4, 1000)` = 3.3380): more squares than 4 · 3.338 are more than
    /// noise.
    #[test]
    fn the_test_is_fishers() {
        let just = compare(&sums(1.02 * 4.0 * 3.33, 1.0, 4)).unwrap();
        assert!((just.f - 3.33).abs() < 1e-9 && just.verdict == Verdict::Describe && (just.chance - 0.01).abs() < 3e-4);
        let over = compare(&sums(1.02 * 4.0 * 3.35, 1.0, 4)).unwrap();
        assert!(over.verdict == Verdict::Nearly && over.bic_difference < 0.0, "{over:?}");
        // 1020 ln(1.04) = 40 is more than 4 ln 1020 = 27.7.
        assert_eq!(compare(&sums(1.02 * 40.0, 1.0, 4)).unwrap().verdict, Verdict::Fail);
        // Where noise alone makes ten a parameter the same squares are a tenth of the evidence.
        let tenth = compare(&sums(1.02 * 40.0, 10.0, 4)).unwrap();
        assert!(tenth.verdict == Verdict::Describe && (tenth.f - 1.0).abs() < 0.25, "{tenth:?}");
        assert_eq!(compare(&sums(-10.0, 1.0, 4)).unwrap().f, 0.0);
        assert!(compare(&sums(1.02 * 40.0, 1.0, 0)).is_none());
        // A record quieter than believed is as noisy as that.
        let quiet = compare(&Sums { apart: 1e-3, together: 3.0, ..sums(0.0, 1.0, 4) }).unwrap();
        assert!(quiet.verdict == Verdict::Describe && quiet.f < 1.0, "{quiet:?}");
    }
}
