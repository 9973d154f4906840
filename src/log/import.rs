//! A time series becomes a recording.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

use super::layout::{kind_name, to_ns};
use super::sink::program;
use super::{CsvProblem, LogError, disk, nearest};
use crate::recording::{CsvFormat, Recording, RunInfo, Series};
use crate::rig::{Rig, SensorKind};

/// What the file itself does not say.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ImportOptions {
    /// Wall-clock time of time 0, ns since 1970 UTC; 0 if unknown.
    pub start_unix_ns: u64,
    /// Sensors of the rig that were not recorded: they need no column.
    pub without: Vec<String>,
}

/// [`import_csv_with`] of no options.
///
/// # Errors
/// As there.
pub fn import_csv(csv: &Path, rig: &Rig) -> Result<Recording, LogError> {
    import_csv_with(csv, rig, &ImportOptions::default())
}

/// Reads a time series: the first column `time_s` in seconds, then one a sensor of the rig, by its name and in its
/// unit; an empty cell is no sample. `#` lines are comments; a byte-order mark and CRLF line ends are fine.
///
/// # Errors
/// [`LogError::Csv`] with the line, the column and what to do: times that do not increase, cells that are not finite
/// numbers, lines of another length, sensors without a column, columns without a sensor, a pressure sensor without
/// a sample. Nothing is skipped or mended.
pub fn import_csv_with(csv: &Path, rig: &Rig, options: &ImportOptions) -> Result<Recording, LogError> {
    let bytes = disk::read_file(csv)?;
    let fail = |(line, problem): Fault| LogError::Csv { path: csv.into(), line, problem };
    let text = text_of(&bytes).map_err(fail)?;
    let (series, format) = parse(text, rig, &options.without).map_err(fail)?;
    let name = csv.file_name().unwrap_or_default().to_string_lossy();
    let run = RunInfo {
        start_unix_ns: options.start_unix_ns,
        source: format!("import {name}"),
        program: program(),
        notes: Vec::new(),
        csv: Some(format),
    };
    Ok(Recording { rig: rig.clone(), series, run })
}

/// Line from 1 where there is one, and what is wrong.
type Fault = (Option<usize>, Box<CsvProblem>);

fn text_of(bytes: &[u8]) -> Result<&str, Fault> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let utf16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        let hint = if utf16 { " (UTF-16, by its first bytes)" } else { "" };
        (Some(line), CsvProblem::NotUtf8 { hint }.into())
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

fn parse(text: &str, rig: &Rig, without: &[String]) -> Result<(Vec<Series>, CsvFormat), Fault> {
    let mut lines = (1..).zip(text.lines()).filter(|(_, l)| !l.trim().is_empty() && !l.starts_with('#'));
    let (header_line, header) = lines.next().ok_or((None, CsvProblem::Empty.into()))?;
    let mut row = Vec::new();
    split(header, &mut row);
    let header: Vec<String> = row.iter().map(|c| c.to_string()).collect();
    let mut columns = columns(&header, rig, without).map_err(|p| (Some(header_line), p.into()))?;

    let mut times = Numbers::default();
    let mut previous: Option<(usize, Cow<str>, f64)> = None;
    for (line, text) in lines {
        let fault = |problem: CsvProblem| (Some(line), problem.into());
        split(text, &mut row);
        if row.len() != header.len() {
            return Err(fault(CsvProblem::Ragged { found: row.len(), expected: header.len() }));
        }
        let Some(time_s) = times.read(&row[0], &header[0]).map_err(fault)? else {
            return Err(fault(CsvProblem::NoTime));
        };
        if to_ns(time_s).is_none() {
            return Err(fault(CsvProblem::TimeOutOfRange(row[0].to_string())));
        }
        if let Some((previous_line, previous, before_s)) = previous
            && time_s <= before_s
        {
            let (time, previous) = (row[0].to_string(), previous.into_owned());
            return Err(fault(CsvProblem::TimeNotIncreasing { time, previous, previous_line }));
        }
        previous = Some((line, row[0].clone(), time_s));
        for ((column, cell), name) in columns.iter_mut().zip(&row[1..]).zip(&header[1..]) {
            if let Some(value) = column.numbers.read(cell, name).map_err(fault)? {
                column.series.time_s.push(time_s);
                column.series.value.push(value);
            }
        }
    }
    if previous.is_none() {
        return Err((Some(header_line), CsvProblem::HeaderOnly.into()));
    }

    let mut series = vec![Series::default(); rig.sensors.len()];
    let mut format = CsvFormat { time_decimals: times.decimals(), columns: Vec::new() };
    for column in columns {
        let sensor = &rig.sensors[column.sensor];
        if column.series.time_s.is_empty() && sensor.kind == SensorKind::Pressure {
            return Err((Some(header_line), CsvProblem::NoSamples { column: sensor.name.clone() }.into()));
        }
        format.columns.push((column.sensor, column.numbers.decimals()));
        series[column.sensor] = column.series;
    }
    Ok((series, format))
}

/// The cells of a line.
fn split<'a>(line: &'a str, row: &mut Vec<Cow<'a, str>>) {
    row.clear();
    if !line.contains('"') {
        row.extend(line.split(',').map(|cell| Cow::Borrowed(cell.trim())));
        return;
    }
    let mut quoted = csv::ReaderBuilder::new().has_headers(false).from_reader(line.as_bytes());
    let record = quoted.records().next().and_then(Result::ok).unwrap_or_default();
    row.extend(record.iter().map(|cell| Cow::Owned(cell.trim().to_string())));
}

/// A column on its way into a series.
struct Column {
    sensor: usize,
    series: Series,
    numbers: Numbers,
}

/// Finds the sensor of each column after the first.
fn columns(header: &[String], rig: &Rig, without: &[String]) -> Result<Vec<Column>, CsvProblem> {
    let first = header.first().map(String::as_str).unwrap_or_default();
    if first != "time_s" {
        let separator = first.chars().find(|c| matches!(c, ';' | '\t')).filter(|_| header.len() == 1);
        let hint = match separator {
            Some(_) => ": separate the columns by commas, and write decimals with a point".to_string(),
            None if header.len() > 1 && first.parse::<f64>().is_ok() => ": the header line is missing".to_string(),
            None => String::new(),
        };
        return Err(CsvProblem::NoTimeColumn { found: first.into(), hint });
    }
    let names = &header[1..];
    let question = |n: Option<&str>| n.map(|n| format!("; did you mean '{n}'?")).unwrap_or_default();
    let sensors = || rig.sensors.iter().map(|s| s.name.as_str());
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) || name == first {
            return Err(CsvProblem::DuplicateColumn(name.clone()));
        }
    }
    for sensor in without {
        let bad = |why: String| CsvProblem::BadWithout { sensor: sensor.clone(), why };
        if !sensors().any(|s| s == sensor) {
            return Err(bad(format!("rig '{}' has no such sensor{}", rig.name, question(nearest(sensor, sensors())))));
        }
        if names.contains(sensor) {
            return Err(bad("the file has a column for it".into()));
        }
    }
    for sensor in &rig.sensors {
        if !names.contains(&sensor.name) && !without.contains(&sensor.name) {
            let spare = names.iter().map(String::as_str).filter(|n| !sensors().any(|s| s == *n));
            return Err(CsvProblem::MissingColumn {
                sensor: sensor.name.clone(),
                kind: kind_name(sensor.kind),
                rig: rig.name.clone(),
                found: header.join(", "),
                hint: question(nearest(&sensor.name, spare)),
            });
        }
    }
    if !rig.pressure_sensors().any(|(_, s)| names.contains(&s.name)) {
        return Err(CsvProblem::NoPressure);
    }
    let column = |name: &String| match sensors().position(|s| s == name) {
        Some(sensor) => Ok(Column { sensor, series: Series::default(), numbers: Numbers::default() }),
        None => Err(CsvProblem::UnknownColumn {
            column: name.clone(),
            rig: rig.name.clone(),
            known: sensors().collect::<Vec<_>>().join(", "),
            hint: question(nearest(name, sensors())),
        }),
    };
    names.iter().map(column).collect()
}

/// Reads the numbers of a column and watches how they are written.
#[derive(Default)]
struct Numbers {
    written: Written,
    scratch: String,
}

#[derive(Default, Clone, Copy, PartialEq)]
enum Written {
    #[default]
    Nothing,
    Decimals(u8),
    Mixed,
}

impl Numbers {
    fn read(&mut self, cell: &str, column: &str) -> Result<Option<f64>, CsvProblem> {
        if cell.is_empty() {
            return Ok(None);
        }
        let named = || (column.to_string(), cell.to_string());
        let value: f64 = cell.parse().map_err(|_| {
            let (column, cell) = named();
            CsvProblem::NotANumber { column, cell }
        })?;
        if !value.is_finite() {
            let (column, cell) = named();
            return Err(CsvProblem::NotFinite { column, cell });
        }
        self.watch(cell, value);
        Ok(Some(value))
    }

    /// Keeps the number of decimals as long as writing each value with it gives the cell's text again.
    fn watch(&mut self, cell: &str, value: f64) {
        if self.written == Written::Mixed {
            return;
        }
        let decimals = cell.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        self.scratch.clear();
        let again = write!(self.scratch, "{value:.decimals$}").is_ok() && self.scratch == cell;
        self.written = match (self.written, u8::try_from(decimals)) {
            (Written::Nothing, Ok(d)) if again => Written::Decimals(d),
            (Written::Decimals(same), Ok(d)) if again && d == same => Written::Decimals(d),
            _ => Written::Mixed,
        };
    }

    fn decimals(&self) -> Option<u8> {
        match self.written {
            Written::Decimals(d) => Some(d),
            _ => None,
        }
    }
}
