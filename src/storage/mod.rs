//! Recordings on disk: MCAP files that Foxglove and PlotJuggler open as they are, and CSV in and out.
//!
//! A *finished* file holds zstd chunks with CRCs and an index. A *live* file, as [`Writer`] keeps it while a test
//! runs, holds small uncompressed chunks, each with its CRC and handed to the system within [`FLUSH_EVERY`], so that a
//! crash costs milliseconds; [`Writer::finish`] turns it into a finished one, [`recover`] does the same for one that a
//! crash left behind. What is in the files is described in [`layout`] and [`schema`].

pub(crate) mod assemble;
pub(crate) mod compress;
pub(crate) mod disk;
pub(crate) mod end;
pub(crate) mod error;
pub(crate) mod export;
#[cfg(test)]
pub(crate) mod fixtures;
pub mod import;
pub mod layout;
pub(crate) mod lengths;
pub(crate) mod nearest;
pub mod output;
pub(crate) mod read;
pub(crate) mod recover;
pub(crate) mod retime;
pub mod schema;
pub(crate) mod sink;
pub(crate) mod summary;
pub mod together;
pub mod viewer;
pub mod with_model;
pub(crate) mod write;
pub(crate) mod writer;

pub use crate::storage::error::{CsvProblem, LogError};
pub use crate::storage::export::{export_csv, export_csv_file};
pub use crate::storage::import::file::{import_csv, import_csv_with};
pub use crate::storage::import::source::ImportOptions;
pub use crate::storage::read::{check_recording, decode, file_has_end, has_end, read};
pub use crate::storage::recover::{Loss, Recovery, recover, salvaged};
pub use crate::storage::retime::{ClockFix, Retimer, SensorClock};
pub use crate::storage::summary::{SensorSummary, Summary};
pub use crate::storage::write::{keep, write};
pub use crate::storage::writer::{Ending, FLUSH_EVERY, Writer};
