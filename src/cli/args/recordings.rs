//! Recordings that a command is given: opened, with their doubts on standard error.

use std::path::{Path, PathBuf};

use crate::cli::tell;
use crate::study::open::{self, Loaded};

/// Opens recordings of one rig and says what in them should make a user look twice.
///
/// # Errors
/// As [`open::load`].
pub fn load(paths: &[PathBuf], rig: Option<&Path>) -> Result<Vec<Loaded>, Box<dyn std::error::Error + Send + Sync>> {
    let loaded = open::load(paths, rig)?;
    for Loaded { file, doubts, .. } in &loaded {
        for doubt in doubts {
            tell!("warning: {file}: {doubt}");
        }
    }
    Ok(loaded)
}
