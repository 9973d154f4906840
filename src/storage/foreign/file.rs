//! One file of any known kind becomes a recording on a rig: a plain time series exactly as it is, anything else mended.

use std::path::Path;

use crate::recording::Recording;
use crate::rig::Rig;
use crate::storage::foreign::csv::{START, start_in_comments};
use crate::storage::foreign::{ForeignOptions, Mended, bind, decode_foreign};
use crate::storage::import::{import_bytes, text_of};
use crate::storage::{CsvProblem, ImportOptions, LogError, disk};

/// A file on the sensors of a rig.
#[derive(Debug, Clone)]
pub struct Imported {
    /// Its samples.
    pub recording: Recording,
    /// What was mended.
    pub mended: Vec<Mended>,
    /// Value of the last digit of its start, s, where it gives one itself.
    pub start_digit_s: Option<f64>,
}

/// Reads a file onto the sensors of a rig; sensors that it lacks stay empty where it is not `alone`. A time series as the project writes it
/// is taken without any mending, and its export gives it back byte by byte. A start in the options goes before that of the file.
///
/// # Errors
/// Says what is wrong, where, and what to do.
pub fn import_file(
    path: &Path,
    rig: &Rig,
    options: &ImportOptions,
    foreign: &ForeignOptions,
    alone: bool,
) -> Result<Imported, LogError> {
    let bytes = disk::read_file(path)?;
    let plain = alone && foreign.map.is_empty() && foreign.ignore.is_empty();
    let strict = plain.then(|| import_bytes(&bytes, path, rig, options));
    let refused = match strict {
        Some(Ok(mut recording)) => {
            let mut mended = Vec::new();
            let mut start_digit_s = None;
            let said = text_of(&bytes).ok().and_then(|text| start_in_comments(text, foreign));
            if options.start_unix_ns == 0
                && let Some((start, how)) = said
            {
                recording.run.start_unix_ns = start.unix_ns;
                start_digit_s = Some(start.digit_s);
                mended.push(how);
            }
            let missing: u64 = recording.series.iter().flat_map(|s| &s.gaps).filter_map(|g| g.samples).sum();
            if missing > 0 {
                let text = format!("{missing} samples are missing from even grids of times: recorded as gaps");
                mended.push(Mended::new("missing-times", missing as usize, None, text));
            }
            return Ok(Imported { recording, mended, start_digit_s });
        }
        Some(Err(error)) => Some(error),
        None => None,
    };
    let mut mended = Vec::new();
    let mut start_digit_s = None;
    let read = decode_foreign(&bytes, path, foreign).and_then(|mut file| {
        mended.append(&mut file.mended);
        start_digit_s = file.start.map(|s| s.digit_s);
        let recording = bind(file, path, rig, foreign, &mut mended)?;
        if alone {
            crate::storage::foreign::require_sensors(&[&recording], rig, &options.without)?;
        }
        Ok(recording)
    });
    match (read, refused) {
        (Ok(mut recording), _) => {
            if options.start_unix_ns > 0 {
                recording.run.start_unix_ns = options.start_unix_ns;
                start_digit_s = None;
                mended.retain(|m| m.what != START);
            }
            Ok(Imported { recording, mended, start_digit_s })
        }
        // of a file that is plain but for one thing, that one thing
        (Err(error), Some(refused)) if is_plain(&bytes) && !says_more(&error) => Err(refused),
        (Err(error), _) => Err(error),
    }
}

/// Is this a time series as the project writes them, by its heading?
fn is_plain(bytes: &[u8]) -> bool {
    let heading =
        bytes.split(|b| *b == b'\n').find(|line| !line.is_empty() && !line.starts_with(b"#") && *line != b"\r");
    heading.is_some_and(|line| line.starts_with(b"time_s,") || line.trim_ascii() == b"time_s")
}

fn says_more(error: &LogError) -> bool {
    let LogError::Csv { problem, .. } = error else { return false };
    matches!(
        **problem,
        CsvProblem::TimesTooCoarse { .. }
            | CsvProblem::TimesMissing { .. }
            | CsvProblem::TwoDecimalMarks { .. }
            | CsvProblem::WrongUnit { .. }
    )
}
