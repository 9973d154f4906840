//! Why a sensitivity cannot be computed, in sentences.

use crate::model::ModelError;

/// Errors of a sensitivity study.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum SensitivityError {
    #[error("unknown parameter '{name}'; did you mean '{nearest}'? This model has {known}")]
    UnknownParameter { name: String, nearest: String, known: String },
    #[error("the range of '{name}' is given twice")]
    RangeTwice { name: String },
    #[error("{name} = {low}:{high} is not a range: the first number must be less than the second")]
    Order { name: String, low: f64, high: f64 },
    #[error(
        "the range of {name}, {low} to {high}, reaches beyond what the parameter can be, {lower} to {upper} {unit}; narrow it"
    )]
    Beyond { name: String, low: f64, high: f64, lower: f64, upper: f64, unit: &'static str },
    #[error(
        "{name} = {value} is outside the bounds of its catalogue entry, {lower} to {upper} {unit}, so no range lies around it; \
         give it one with option `range {name}=LOW:HIGH`"
    )]
    NoRange { name: String, value: f64, lower: f64, upper: f64, unit: &'static str },
    #[error("no parameter varies: name at least one")]
    NothingVaries,
    #[error("'{what}' = {value}: it must be from {low} to {high}")]
    Count { what: &'static str, value: usize, low: usize, high: usize },
    #[error(
        "{parameters} parameters are more than the {most} that this sequence has dimensions for; choose some with option `only`"
    )]
    TooManyParameters { parameters: usize, most: usize },
    #[error("the rig has no pressure sensor to read")]
    NoSensor,
    #[error("there is no pressure sensor '{name}'; the rig has {known}")]
    UnknownSensor { name: String, known: String },
    #[error("all {runs} simulations failed, the first because: {why}; narrow the ranges or set other values")]
    AllFailed { runs: usize, why: ModelError },
    #[error(
        "this needs the effect 'viscoelastic-wall:2', and the model has {effects}: add option `effects viscoelastic-wall:2`"
    )]
    NeedsTwoElements { effects: String },
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// Refuses a number that is too small or too large.
///
/// # Errors
/// [`SensitivityError::Count`].
pub fn check_count(
    what: &'static str,
    value: usize,
    range: std::ops::RangeInclusive<usize>,
) -> Result<(), SensitivityError> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(SensitivityError::Count { what, value, low: *range.start(), high: *range.end() })
}
