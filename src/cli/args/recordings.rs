//! Recordings that a command is given: opened, with their warnings on standard error.

use std::path::{Path, PathBuf};

use crate::cli::console::outcome::AnyError;
use crate::cli::console::print::tell_warning;
use crate::cli::console::progress::busy;
use crate::study::Study;
use crate::study::error::Error;

/// Opens recordings of one rig and prints what in them should make a user look twice.
///
/// # Errors
/// As [`Study::open_on`].
pub fn open(paths: &[PathBuf], rig: Option<&Path>) -> Result<Study, AnyError> {
    open_without(paths, rig, &[])
}

/// The same without some sensors.
///
/// # Errors
/// As [`Study::open_without`].
pub fn open_without(paths: &[PathBuf], rig: Option<&Path>, ignored: &[String]) -> Result<Study, AnyError> {
    let first = paths.first().map(PathBuf::as_path).unwrap_or(Path::new(""));
    let study = busy(first, || Study::open_without(rig, paths, ignored)).map_err(|error| match error {
        Error::SeveralRigs { .. } => format!("{error} with --rig").into(),
        other => AnyError::from(other),
    })?;
    warn_of(&study);
    Ok(study)
}

/// Prints what in a study's recordings should make a user look twice.
pub fn warn_of(study: &Study) {
    for warning in study.warnings() {
        tell_warning!("{warning}");
    }
}
