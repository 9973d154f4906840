//! A recording becomes a time series.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::recording::{CsvFormat, Recording};
use crate::storage::disk;
use crate::storage::error::LogError;

/// Writes a recording as CSV: `time_s`, then a column a sensor in its unit; a line for each time at which any sensor
/// has a sample. Numbers keep every digit; those of an imported series are written as they were. Gaps leave no mark in
/// a CSV but the lines that are not there.
///
/// # Errors
/// Those of `out`.
pub fn export_csv(recording: &Recording, out: impl Write) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 16, out);
    let columns = columns(recording);
    let time_decimals = recording.run.csv.as_ref().and_then(|c: &CsvFormat| c.time_decimals);

    let names = columns.iter().map(|&(sensor, _)| recording.rig.sensors[sensor].name.as_str());
    csv::Writer::from_writer(&mut out).write_record(std::iter::once("time_s").chain(names))?;

    let mut next = vec![0; columns.len()];
    let mut line = String::new();
    loop {
        let upcoming = columns.iter().zip(&next).filter_map(|(&(s, _), &i)| recording.series[s].time_s.get(i).copied());
        let Some(time_s) = upcoming.reduce(f64::min) else { break };
        line.clear();
        number(&mut line, time_s, time_decimals);
        for (&(sensor, decimals), next) in columns.iter().zip(&mut next) {
            line.push(',');
            let series = &recording.series[sensor];
            if series.time_s.get(*next) == Some(&time_s) {
                number(&mut line, series.value[*next], decimals);
                *next += 1;
            }
        }
        line.push('\n');
        out.write_all(line.as_bytes())?;
    }
    out.flush()
}

/// [`export_csv`] into a new file, which appears whole or not at all.
///
/// # Errors
/// [`LogError::Exists`] when there is a file at `path`.
pub fn export_csv_file(recording: &Recording, path: &Path) -> Result<(), LogError> {
    disk::refuse_existing(path)?;
    let temporary = disk::temporary_beside(path)?;
    let file: &File = temporary.as_file();
    export_csv(recording, file).map_err(|e| LogError::io("write", path, e))?;
    disk::publish_new(temporary, path)
}

/// Sensors and decimals in the order of their columns: that of the imported file first, then the rig's.
fn columns(recording: &Recording) -> Vec<(usize, Option<u8>)> {
    let sensors = recording.series.len().min(recording.rig.sensors.len());
    let mut columns: Vec<_> = recording.run.csv.iter().flat_map(|c| c.columns.iter().copied()).collect();
    columns.retain(|(sensor, _)| *sensor < sensors);
    // A sensor that the import left out (`--without`) has no sample and had no column.
    let imported = recording.run.csv.is_some();
    for (sensor, series) in recording.series.iter().enumerate().take(sensors) {
        let left_out = imported && series.time_s.is_empty();
        if !left_out && columns.iter().all(|(s, _)| *s != sensor) {
            columns.push((sensor, None));
        }
    }
    columns
}

/// With so many decimals, or as the shortest text that parses to the same number.
fn number(line: &mut String, value: f64, decimals: Option<u8>) {
    // Writing to a string cannot fail.
    let _ = match decimals {
        Some(decimals) => write!(line, "{value:.*}", usize::from(decimals)),
        None => write!(line, "{value}"),
    };
}
