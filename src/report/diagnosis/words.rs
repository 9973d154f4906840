//! Names and numbers that all pieces of a diagnosis write alike.

use crate::diagnose::Diagnosis;
use crate::model::effects::name_of;

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
