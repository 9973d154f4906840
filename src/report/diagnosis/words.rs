//! Names and numbers that all pieces of a diagnosis write alike.

use crate::diagnose::{Candidate, Diagnosis, NEGLIGIBLE_EVIDENCE};
use crate::model::effects::name_of;
use crate::report::text::number::grouped;

/// The model that a diagnosis started from.
pub(crate) fn start_model(diagnosis: &Diagnosis) -> String {
    name_of(&diagnosis.start.effects)
}

/// A probability in words that do not claim more than it can.
pub(crate) fn probability(p: f64) -> String {
    match p {
        p if p > 0.995 => "> 0.99".into(),
        p if p < 0.005 => "< 0.01".into(),
        p => format!("{p:.2}"),
    }
}
/// The evidence for a candidate; what is not worth a model has none.
pub(crate) fn evidence(candidate: &Candidate) -> String {
    if candidate.evidence <= NEGLIGIBLE_EVIDENCE { "none".to_owned() } else { grouped(candidate.evidence) }
}
