//! What a rule is: a question to the simulations of one closure, and its answer.

use crate::designs::Designs;
use crate::judge::Verdict;
use crate::sweep::Sweeps;

/// What one closure says of a rule.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// By what measure, and whether the rule holds by it.
    pub verdicts: Vec<(String, Verdict)>,
    /// The numbers.
    pub numbers: String,
}

/// A rule as a question to one closure.
pub struct Claim {
    /// What the paper says, shortened.
    pub says: &'static str,
    /// Where it says so.
    pub place: &'static str,
    /// How it is tested.
    pub test: &'static str,
    /// The test.
    pub ask: fn(&Evidence) -> Finding,
}

/// All that is simulated of one closure.
pub struct Evidence {
    /// One compliance raised at many retardation times.
    pub sweeps: Sweeps,
    /// Analyses of variance and the other designs.
    pub designs: Designs,
}
