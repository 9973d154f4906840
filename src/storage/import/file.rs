//! One file of any known kind becomes a recording on a rig: a plain time series exactly as it is, anything else
//! repaired.

use std::path::Path;

use crate::recording::{Recording, RunInfo};
use crate::rig::{Rig, SensorKind};
use crate::storage::disk;
use crate::storage::error::{CsvProblem, LogError};
use crate::storage::import::bind::{Bound, bind, check_names, require_sensors};
use crate::storage::import::csv::comments::{comment_notes, start_in_comments};
use crate::storage::import::csv::plain::read_strict;
use crate::storage::import::csv::settings::START;
use crate::storage::import::csv::strays::has_strays;
use crate::storage::import::csv::text::text_of;
use crate::storage::import::decode::decode_source;
use crate::storage::import::source::{ImportOptions, Repair, SourceOptions};
use crate::storage::sink::program;

/// [`import_csv_with`] of no options.
///
/// # Errors
/// As there.
pub fn import_csv(csv: &Path, rig: &Rig) -> Result<Recording, LogError> {
    import_csv_with(csv, rig, &ImportOptions::default())
}

/// Reads a plain time series: the first column `time_s` in seconds, then one a sensor of the rig, by its name and in
/// its unit; an empty cell is no sample. `#` lines are comments, which become a note; a byte-order mark and CRLF line
/// ends are fine. Lines missing from an even grid of times become gaps.
///
/// # Errors
/// [`LogError::Csv`] with the line, the column and what to do: times that do not increase, cells that are not finite
/// numbers, lines of another length, sensors without a column, columns without a sensor, a pressure sensor without
/// a sample. Nothing is skipped or repaired.
pub fn import_csv_with(csv: &Path, rig: &Rig, options: &ImportOptions) -> Result<Recording, LogError> {
    import_plain(&disk::read_file(csv)?, csv, rig, options)
}

fn import_plain(bytes: &[u8], csv: &Path, rig: &Rig, options: &ImportOptions) -> Result<Recording, LogError> {
    let read = read_strict(bytes, rig, &options.without);
    let plain = read.map_err(|(line, problem)| LogError::Csv { path: csv.into(), line, problem })?;
    let name = csv.file_name().unwrap_or_default().to_string_lossy();
    let run = RunInfo {
        start_unix_ns: options.start_unix_ns,
        source: format!("import {name}"),
        program: program(),
        notes: comment_notes(plain.text),
        csv: Some(plain.format),
    };
    Ok(Recording { rig: rig.clone(), series: plain.series, run })
}

/// Sensors that the file has nothing of, where it has a pressure: a guess takes them as not recorded.
fn not_recorded(recording: &Recording, repairs: &mut Vec<Repair>) -> Vec<String> {
    let sensors = recording.rig.sensors.iter().zip(&recording.series);
    if sensors.clone().all(|(s, series)| s.kind != SensorKind::Pressure || series.time_s.is_empty()) {
        return Vec::new();
    }
    let lacking = sensors.filter(|(_, series)| series.time_s.is_empty());
    let names: Vec<String> = lacking.map(|(s, _)| s.name.clone()).collect();
    repairs.extend(names.iter().map(|name| Repair::guess("without", format!("'{name}' was not recorded"))));
    names
}

/// A file on the sensors of a rig.
#[derive(Debug, Clone)]
pub struct Imported {
    /// Its samples.
    pub recording: Recording,
    /// What was repaired.
    pub repairs: Vec<Repair>,
    /// Value of the last digit of its start, s, where it gives one itself.
    pub start_digit_s: Option<f64>,
    /// The column, channel or field of each sensor, where it has one.
    pub columns: Vec<Option<String>>,
    /// Of each sensor, whether somebody said what its numbers stand for.
    pub scaled: Vec<bool>,
    /// All columns, channels or fields.
    pub names: Vec<String>,
}

/// Reads a file onto the sensors of a rig; sensors that it lacks stay empty where it is not `alone`. A time series as
/// the project writes it is taken without any repair, and its export gives it back byte by byte. A start in the options
/// goes before that of the file.
///
/// # Errors
/// Says what is wrong, where, and what to do.
pub fn import_file(
    path: &Path,
    rig: &Rig,
    options: &ImportOptions,
    source: &SourceOptions,
    alone: bool,
) -> Result<Imported, LogError> {
    let bytes = disk::read_file(path)?;
    let plain = alone && source.is_plain();
    let strict = plain.then(|| import_plain(&bytes, path, rig, options));
    let has_strays = |recording: &Recording| recording.series.iter().any(|series| has_strays(&series.value));
    let refused = match strict {
        Some(Ok(mut recording)) if !has_strays(&recording) => {
            let mut repairs = Vec::new();
            let mut start_digit_s = None;
            let in_comments = text_of(&bytes).ok().and_then(|text| start_in_comments(text, source));
            if options.start_unix_ns == 0
                && let Some((start, remark)) = in_comments
            {
                recording.run.start_unix_ns = start.unix_ns;
                start_digit_s = Some(start.digit_s);
                repairs.push(remark);
            }
            let missing: u64 = recording.series.iter().flat_map(|s| &s.gaps).filter_map(|g| g.samples).sum();
            if missing > 0 {
                repairs.push(Repair::missing_times(missing));
            }
            let sensors = recording.rig.sensors.iter().zip(&recording.series);
            repairs.extend(sensors.filter_map(|(sensor, series)| Repair::uneven(&sensor.name, series)));
            let names: Vec<String> = rig.sensors.iter().map(|s| s.name.clone()).collect();
            let columns = names.iter().cloned().map(Some).collect();
            let scaled = vec![false; rig.sensors.len()];
            return Ok(Imported { recording, repairs, start_digit_s, columns, scaled, names });
        }
        Some(Err(error)) => Some(error),
        // what is no value is taken out below
        Some(Ok(_)) | None => None,
    };
    let mut repairs = Vec::new();
    let mut start_digit_s = None;
    let read = decode_source(&bytes, path, source).and_then(|mut file| {
        repairs.append(&mut file.repairs);
        start_digit_s = file.start.map(|s| s.digit_s);
        if alone {
            check_names(&file, path, Some(rig), source)?;
        }
        let names: Vec<String> = file.tracks.iter().map(|track| track.name.clone()).collect();
        let bound = bind(file, path, rig, source, &mut repairs)?;
        if alone {
            let mut without = options.without.clone();
            if source.guess {
                without.extend(not_recorded(&bound.recording, &mut repairs));
            }
            require_sensors(&[&bound.recording], rig, &without, &names)?;
        }
        if let Some(guess) = repairs.iter().find(|repair| repair.guessed && !source.guess) {
            let why = format!("the file does not say that {}", guess.text);
            return Err(LogError::SourceFile { path: path.into(), why });
        }
        Ok((bound, names))
    });
    match (read, refused) {
        (Ok((Bound { mut recording, columns, scaled }, names)), _) => {
            if options.start_unix_ns > 0 {
                recording.run.start_unix_ns = options.start_unix_ns;
                start_digit_s = None;
                repairs.retain(|m| m.what != START);
            }
            Ok(Imported { recording, repairs, start_digit_s, columns, scaled, names })
        }
        // of a file that is plain but for one thing, that one thing
        (Err(error), Some(refused)) if is_plain(&bytes) && !says_more(&error) && !tolerated(&refused, source) => {
            Err(refused)
        }
        (Err(error), _) => Err(error),
    }
}

/// Is this a time series as the project writes them, by its heading?
fn is_plain(bytes: &[u8]) -> bool {
    let heading =
        bytes.split(|b| *b == b'\n').find(|line| !line.is_empty() && !line.starts_with(b"#") && *line != b"\r");
    heading.is_some_and(|line| line.starts_with(b"time_s,") || line.trim_ascii() == b"time_s")
}

/// Whether a guess goes on where a plain time series must stop.
fn tolerated(refused: &LogError, source: &SourceOptions) -> bool {
    let lacks_column = |problem: &CsvProblem| matches!(problem, CsvProblem::MissingColumn { .. });
    source.guess && matches!(refused, LogError::Csv { problem, .. } if lacks_column(problem))
}

fn says_more(error: &LogError) -> bool {
    let LogError::Csv { problem, .. } = error else { return false };
    matches!(
        **problem,
        CsvProblem::TimesTooCoarse { .. }
            | CsvProblem::TimesMissing { .. }
            | CsvProblem::TwoDecimalMarks { .. }
            | CsvProblem::WrongUnit { .. }
            | CsvProblem::Absolute { .. }
    )
}
