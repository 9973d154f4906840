//! A file of a test on a rig: as it stands, or with what it does not say guessed.

use std::error::Error;
use std::path::Path;

use crate::rig::Rig;
use crate::rig::check::return_time_s;
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

/// Reads a file onto the sensors of a rig; sensors that it lacks stay empty where it is not `alone`.
///
/// # Errors
/// A file that does not say all that is asked: with what would be guessed, where that is enough.
pub fn import(
    path: &Path,
    rig: &Rig,
    options: &ImportOptions,
    source: &SourceOptions,
    alone: bool,
) -> Result<Imported, ImportError> {
    let read = |source: &SourceOptions| import_file(path, rig, options, source, alone);
    read(source).map_err(|as_it_stands| {
        let period_s = 2.0 * return_time_s(rig, &rig.fluid.properties(rig.fluid.temperature_degc));
        match read(&SourceOptions { guess: true, period_s: Some(period_s), ..source.clone() }) {
            Ok(imported) => ImportError::Guessed { imported: Box::new(imported), as_it_stands },
            Err(with_guesses) => ImportError::Refused { as_it_stands, with_guesses },
        }
    })
}
