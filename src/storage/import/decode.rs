//! Picks the reader of a file by its first bytes.

use std::path::Path;

use crate::storage::disk;
use crate::storage::error::LogError;
use crate::storage::import::arrays::table::tables_of_arrays;
use crate::storage::import::arrays::{hdf5, mat};
use crate::storage::import::csv::strays::take_from;
use crate::storage::import::source::{SourceFile, SourceOptions};
use crate::storage::import::tables::{self, Tables};
use crate::storage::import::{csv, json, mcap, sheet, tdms};
use crate::storage::read::check_start;

/// Reads a file of another program, whichever of the known kinds it is.
///
/// # Errors
/// Says what is wrong, where, and what to do.
pub fn read_source(path: &Path, options: &SourceOptions) -> Result<SourceFile, LogError> {
    decode_source(&disk::read_file(path)?, path, options)
}

/// [`read_source`] of the bytes of a file.
///
/// # Errors
/// As there.
pub fn decode_source(bytes: &[u8], path: &Path, options: &SourceOptions) -> Result<SourceFile, LogError> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mcap")) {
        check_start(bytes, path)?;
    }
    if bytes.starts_with(::mcap::MAGIC) {
        mcap::read(bytes, path, options).map(take_from)
    } else if bytes.starts_with(b"TDSm") {
        let read = tdms::read(bytes, options).map(take_from);
        read.map_err(|why| LogError::SourceFile { path: path.into(), why })
    } else if bytes.starts_with(b"TDSh") {
        let why = "this is the index of a TDMS file: name the .tdms file beside it".into();
        Err(LogError::SourceFile { path: path.into(), why })
    } else if let Some(found) = tables_of(bytes) {
        let found = found.map_err(|why| LogError::SourceFile { path: path.into(), why })?;
        tables::read(found, path, options)
    } else {
        csv::read(bytes, options).map_err(|(line, problem)| LogError::Csv { path: path.into(), line, problem })
    }
}

/// The tables of a file that holds some, but not in text.
fn tables_of(bytes: &[u8]) -> Option<Result<Tables, String>> {
    let contents = match bytes {
        _ if json::is_json(bytes) => return Some(json::tables_of_json(bytes)),
        _ if sheet::is_workbook(bytes) => return Some(sheet::tables_of_book(bytes)),
        _ if mat::is_mat(bytes) => mat::read(bytes),
        _ if hdf5::is_hdf5(bytes) => hdf5::read(bytes),
        _ => return None,
    };
    Some(contents.and_then(tables_of_arrays))
}
