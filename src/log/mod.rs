//! Recordings on disk: MCAP files that Foxglove and PlotJuggler open as they are, and CSV in and out.
//!
//! A *finished* file holds zstd chunks with CRCs and an index. A *live* file, as [`Writer`] keeps it while a test
//! runs, holds small uncompressed chunks, each with its CRC and handed to the system within [`FLUSH_EVERY`], so that a crash
//! costs milliseconds; [`Writer::finish`] turns it into a finished one, [`recover`] does the same for one that a crash
//! left behind. What is in the files is described in [`layout`] and [`schema`].

mod assemble;
mod compress;
pub(crate) mod disk;
mod end;
mod error;
mod export;
#[cfg(test)]
mod fixtures;
pub mod foreign;
mod import;
pub mod layout;
mod lengths;
mod read;
mod recover;
mod retime;
pub mod schema;
mod sink;
mod summary;
mod write;
mod writer;

pub use error::{CsvProblem, LogError};
pub use export::{export_csv, export_csv_file};
pub use import::{ImportOptions, import_csv, import_csv_with};
pub use read::{decode, has_end, read};
pub use recover::{Loss, Recovery, recover, salvaged};
pub use retime::{ClockFix, Retimer, SensorClock};
pub use summary::{SensorSummary, Summary};
pub use write::write;
pub use writer::{Ending, FLUSH_EVERY, Writer};

/// The name among `known` that `name` was probably meant to be.
fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = name.to_lowercase();
    known
        .into_iter()
        .map(|k| (strsim::damerau_levenshtein(&lower, &k.to_lowercase()), k))
        .filter(|(distance, k)| *distance <= 1.max(name.len().max(k.len()) / 3))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, k)| k)
}
