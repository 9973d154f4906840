//! A file of a test on a rig: as it stands, or with what it does not say guessed.

use std::error::Error;
use std::path::Path;

use crate::draft::{Misread, misread};
use crate::recording::Recording;
use crate::rig::Rig;
use crate::rig::check::return_time_s;
use crate::signal::faults::examine;
use crate::signal::window::Window;
use crate::storage::LogError;
use crate::storage::import::{ImportOptions, Imported, SourceOptions, import_file};

/// A file that cannot be taken as it stands.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum ImportError {
    /// Not with guesses either; with them it may come further.
    #[error("{as_it_stands}")]
    Refused { as_it_stands: LogError, with_guesses: LogError },
    /// With these guesses it can.
    #[error(
        "nothing was imported yet: add option `yes` to import it as understood above, or mend this: {as_it_stands}"
    )]
    Guessed { imported: Box<Imported>, as_it_stands: LogError },
}

impl ImportError {
    /// The file with its guesses, where somebody accepts them.
    ///
    /// # Errors
    /// What stands against it even then.
    pub fn accepted(self) -> Result<Imported, LogError> {
        match self {
            ImportError::Guessed { imported, .. } => Ok(*imported),
            ImportError::Refused { with_guesses, .. } => Err(with_guesses),
        }
    }

    /// What to tell who accepts no guesses.
    pub fn told(self) -> Box<dyn Error + Send + Sync> {
        match self {
            ImportError::Refused { as_it_stands, .. } => as_it_stands.into(),
            guessed => guessed.into(),
        }
    }
}

/// What stands against a recording that was read onto its rig: pressures that cannot be what the file says. Of those
/// that are `scaled` somebody said what they stand for. Where a file is not `alone`, what contradicts a sensor in
/// another one may be its clock.
pub fn misread_in(recording: &Recording, scaled: &[bool], alone: bool) -> Option<Misread> {
    let cut = Window::of(recording).map(|window| window.cut(recording));
    let used = cut.as_ref().unwrap_or(recording);
    let faults = if alone { examine(used).1 } else { Vec::new() };
    misread(used, &faults, scaled)
}

/// Reads a file onto the sensors of a rig; sensors that it lacks stay empty where it is not `alone`.
///
/// # Errors
/// A file that does not say all that is asked: with what would be guessed, where that is enough. Pressures that cannot
/// be what it says.
pub fn import(
    path: &Path,
    rig: &Rig,
    options: &ImportOptions,
    source: &SourceOptions,
    alone: bool,
) -> Result<Imported, ImportError> {
    let read = |source: &SourceOptions| {
        let imported = import_file(path, rig, options, source, alone)?;
        match misread_in(&imported.recording, &imported.scaled, alone) {
            Some(misread) => Err(LogError::SourceFile { path: path.into(), why: misread.to_string() }),
            None => Ok(imported),
        }
    };
    read(source).map_err(|as_it_stands| {
        let period_s = 2.0 * return_time_s(rig, &rig.fluid.properties(rig.fluid.temperature_degc));
        match read(&SourceOptions { guess: true, period_s: Some(period_s), ..source.clone() }) {
            Ok(imported) => ImportError::Guessed { imported: Box::new(imported), as_it_stands },
            Err(with_guesses) => ImportError::Refused { as_it_stands, with_guesses },
        }
    })
}
