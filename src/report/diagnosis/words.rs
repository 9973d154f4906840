//! Names and numbers that all pieces of a diagnosis write alike.

use crate::diagnose::{Candidate, Diagnosis, NEGLIGIBLE_EVIDENCE, RivalPair};
use crate::model::effects::name_of;
use crate::report::text::number::{grouped, probability};

/// The model that a diagnosis started from.
pub(crate) fn start_model(diagnosis: &Diagnosis) -> String {
    name_of(&diagnosis.start.effects)
}

/// The evidence for a candidate; what is not worth a model has none.
pub(crate) fn evidence(candidate: &Candidate) -> String {
    if candidate.evidence <= NEGLIGIBLE_EVIDENCE { "none".to_owned() } else { grouped(candidate.evidence) }
}

/// Other pairs that explain the records as well, with their probabilities.
pub(crate) fn rival_pairs(others: &[RivalPair]) -> String {
    let of = |other: &RivalPair| format!("{} ({})", other.labels.join(" and "), probability(other.probability));
    others.iter().map(of).collect::<Vec<_>>().join(", ")
}
