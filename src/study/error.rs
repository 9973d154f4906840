//! What can go wrong between a file and a diagnosis.

use std::path::PathBuf;

use crate::fit::outcome::fit::UnknownParameter;
use crate::fit::problem::error::FitError;
use crate::model::ModelError;
use crate::recording::RigMismatch;
use crate::results::model_file::ModelFileError;
use crate::rig::RigError;
use crate::shown::Shown as _;
use crate::signal::SignalError;
use crate::signal::faults::{SensorFault, in_words};
use crate::simulate::as_recorded::AsRecordedError;
use crate::storage::LogError;

/// Any error of a [`Study`](crate::Study). The cause, where there is one, is its `source()`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the sentences say it
pub enum Error {
    #[error(transparent)]
    Storage(#[from] LogError),
    #[error(transparent)]
    Rig(#[from] RigError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(transparent)]
    ModelFile(#[from] ModelFileError),
    #[error("the model has no effect '{0}'")]
    NoSuchEffect(String),
    #[error("there is no recording")]
    NoRecording,
    #[error("{file} cannot be used")]
    Unusable { file: String, source: SignalError },
    #[error("{file}: {}", in_words(faults))]
    Faulty { file: String, faults: Vec<SensorFault>, source: Option<SignalError> },
    #[error("{file} cannot be read with that rig")]
    Mismatch { file: String, source: RigMismatch },
    #[error("{} is given twice: a recording counts once", .0.shown())]
    Twice(PathBuf),
    #[error("{} and {} are one recording: it counts once", one.shown(), other.shown())]
    SameFile { one: PathBuf, other: PathBuf },
    #[error("{} is a copy of {}: a recording counts once", copy.shown(), original.shown())]
    Copy { copy: PathBuf, original: PathBuf },
    #[error(
        "{first} was made on rig '{first_rig}' and {other} on rig '{other_rig}', or on another state of it: fit them separately, or choose one \
         rig file for all"
    )]
    SeveralRigs { first: String, first_rig: String, other: String, other_rig: String },
    #[error("the recordings that {} names cannot be used", file.shown())]
    Named { file: PathBuf, source: Box<Error> },
    #[error("{} has changed while this ran: nothing was written; run it again", .0.shown())]
    Changed(PathBuf),
    #[error("{} may not be written to: it is read-only", .0.shown())]
    ReadOnly(PathBuf),
    #[error("{} holds the models of {recordings}: choose another file for other recordings", file.shown())]
    OtherRecordings { file: PathBuf, recordings: String },
    #[error("{} holds models of the rig {}: choose another file", file.shown(), rig.shown())]
    OtherRigFile { file: PathBuf, rig: PathBuf },
    #[error(
        "these recordings are of another pipeline than the model's ({0}): its wave speed and creep do not carry over"
    )]
    OtherPipeline(String),
    #[error("the recordings that {} was fitted to cannot be read, so nobody knows whether its pipeline is this one", .0.shown())]
    UnknownPipeline(PathBuf),
    #[error("{name} is the model's, not the run's: to change it, edit {}", file.shown())]
    NotOfARun { name: String, file: PathBuf },
    #[error("the models cannot be written to {}: {why}", file.shown())]
    Unwritable { file: PathBuf, why: String },
    #[error(transparent)]
    Unshown(AsRecordedError),
    #[error("{name} is a run's own value, read from each record anew, so no test narrows it: choose one of {others}")]
    OfARun { name: String, others: String },
    #[error("{name} is held, so no test narrows it: choose one of {others}")]
    Held { name: String, others: String },
    #[error("the records show no more elements than {0} has")]
    NoMoreElements(String),
    #[error("name one effect")]
    NotOneEffect,
    #[error(transparent)]
    UnknownParameter(#[from] UnknownParameter),
}

/// Results of a [`Study`](crate::Study).
pub type Result<T> = std::result::Result<T, Error>;
