//! The errors of a fit.

use crate::model::ModelError;

/// Why a fit fails.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum FitError {
    #[error("no run was given to fit")]
    NoRun,
    #[error("{file}: no pressure sample lies after the start of the closure; check the time of the closure")]
    NoSample { file: String },
    #[error(
        "{name} cannot lie between {lower} and {upper}: bounds must be finite, in order, and above zero unless the parameter may be negative"
    )]
    Bounds { name: String, lower: f64, upper: f64 },
    #[error("the model has no parameter '{name}'{of} to hold or to bound; it has {known}")]
    NoSuchParameter { name: String, of: String, known: String },
    #[error(
        "{file}: no pressure sensor stands at the valve (within {within_m:.2} m of the pipe's end) to show how it closed"
    )]
    NoValveSensor { file: String, within_m: f64 },
    #[error(
        "{file}: {sensor} records less than three periods of the pipe after the closure: too short to compare frequencies"
    )]
    NoRinging { file: String, sensor: String },
    #[error(transparent)]
    Model(#[from] ModelError),
}
