//! A time series becomes a recording.

pub(crate) mod columns;
pub(crate) mod cut;
pub(crate) mod numbers;

use std::borrow::Cow;
use std::path::Path;

pub(crate) use crate::storage::import::columns::hint_on_time;
pub(crate) use crate::storage::import::cut::is_cut_off;

use crate::storage::import::columns::columns;
use crate::storage::import::numbers::Numbers;

use crate::recording::{CsvFormat, Recording, RunInfo, Series};
use crate::rig::{Rig, SensorKind};
use crate::storage::layout::to_ns;
use crate::storage::sink::program;
use crate::storage::{CsvProblem, LogError, disk, foreign};

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
/// unit; an empty cell is no sample. `#` lines are comments, which become a note; a byte-order mark and CRLF line ends are
/// fine. Lines missing from an even grid of times become gaps.
///
/// # Errors
/// [`LogError::Csv`] with the line, the column and what to do: times that do not increase, cells that are not finite
/// numbers, lines of another length, sensors without a column, columns without a sensor, a pressure sensor without
/// a sample. Nothing is skipped or mended.
pub fn import_csv_with(csv: &Path, rig: &Rig, options: &ImportOptions) -> Result<Recording, LogError> {
    import_bytes(&disk::read_file(csv)?, csv, rig, options)
}

/// [`import_csv_with`] of the bytes of a file.
pub(crate) fn import_bytes(
    bytes: &[u8],
    csv: &Path,
    rig: &Rig,
    options: &ImportOptions,
) -> Result<Recording, LogError> {
    let fail = |(line, problem): Fault| LogError::Csv { path: csv.into(), line, problem };
    let text = text_of(bytes).map_err(fail)?;
    let (series, format) = parse(text, rig, &options.without).map_err(fail)?;
    let name = csv.file_name().unwrap_or_default().to_string_lossy();
    let run = RunInfo {
        start_unix_ns: options.start_unix_ns,
        source: format!("import {name}"),
        program: program(),
        notes: foreign::comment_notes(text),
        csv: Some(format),
    };
    Ok(Recording { rig: rig.clone(), series, run })
}

/// Line from 1 where there is one, and what is wrong.
pub(crate) type Fault = (Option<usize>, Box<CsvProblem>);

pub(crate) fn text_of(bytes: &[u8]) -> Result<&str, Fault> {
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
    split(header, ',', &mut row);
    let header: Vec<String> = row.iter().map(|c| c.to_string()).collect();
    let mut columns = columns(&header, rig, without).map_err(|p| (Some(header_line), p.into()))?;

    let mut times = Numbers::default();
    let mut previous: Option<(usize, Cow<str>, f64)> = None;
    let mut rows_s = Vec::new();
    for (line, text) in lines {
        let fault = |problem: CsvProblem| (Some(line), problem.into());
        split(text, ',', &mut row);
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
        rows_s.push(time_s);
        for ((column, cell), name) in columns.iter_mut().zip(&row[1..]).zip(&header[1..]) {
            if let Some(value) = column.numbers.read(cell, name).map_err(fault)? {
                column.series.time_s.push(time_s);
                column.series.value.push(value);
            }
        }
    }
    let Some((last_line, ..)) = previous else {
        return Err((Some(header_line), CsvProblem::HeaderOnly.into()));
    };
    if is_cut_off(text, ',') {
        return Err((Some(last_line), CsvProblem::CutOff.into()));
    }

    let holes = foreign::even_holes(&rows_s);
    let mut series = vec![Series::default(); rig.sensors.len()];
    let mut format = CsvFormat { time_decimals: times.decimals(), columns: Vec::new() };
    for column in columns {
        let sensor = &rig.sensors[column.sensor];
        if column.series.time_s.is_empty() && sensor.kind == SensorKind::Pressure {
            return Err((Some(header_line), CsvProblem::NoSamples { column: sensor.name.clone() }.into()));
        }
        format.columns.push((column.sensor, column.numbers.decimals()));
        series[column.sensor] = column.series;
        // only a sensor that is sampled on both sides of a hole has lost something in it
        let sampled = |series: &Series, t: f64| series.time_s.binary_search_by(|x| x.total_cmp(&t)).is_ok();
        let own = &series[column.sensor];
        let gaps = holes.iter().map(|h| h.gap).filter(|g| sampled(own, g.from_s) && sampled(own, g.to_s)).collect();
        series[column.sensor].gaps = gaps;
    }
    Ok((series, format))
}

/// The cells of a line.
pub(crate) fn split<'a>(line: &'a str, separator: char, row: &mut Vec<Cow<'a, str>>) {
    row.clear();
    if !line.contains('"') {
        row.extend(line.split(separator).map(|cell| Cow::Borrowed(cell.trim())));
        return;
    }
    let delimiter = u8::try_from(separator).unwrap_or(b',');
    let mut quoted = csv::ReaderBuilder::new().has_headers(false).delimiter(delimiter).from_reader(line.as_bytes());
    let record = quoted.records().next().and_then(Result::ok).unwrap_or_default();
    row.extend(record.iter().map(|cell| Cow::Owned(cell.trim().to_string())));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::export_csv;
    use crate::storage::fixtures::{place, rig};
    use crate::storage::{read, write};
    use proptest::prelude::*;

    fn recording(text: &str) -> Result<Recording, Fault> {
        let (series, csv) = parse(text_of(text.as_bytes())?, &rig(), &[])?;
        Ok(Recording { rig: rig(), series, run: RunInfo { csv: Some(csv), ..RunInfo::default() } })
    }

    /// Out again, by way of a file.
    fn again(text: &str) -> String {
        let (_folder, path) = place("run.mcap");
        write(&path, &recording(text).unwrap()).unwrap();
        let mut out = Vec::new();
        export_csv(&read(&path).unwrap(), &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    fn problem(text: &str) -> (Option<usize>, String) {
        let (line, problem) = recording(text).unwrap_err();
        (line, problem.to_string())
    }

    #[test]
    fn a_time_series_comes_back_as_it_was_written() {
        let text = "time_s,P2,P1,Q1,T1\n-0.50,1.0,-0.00,,20\n0.00,,100.25,0.1,\n0.01,1.5,99.75,,21\n";
        assert_eq!(again(text), text);
        // Every number is kept where a column is not written in one way.
        let mixed = "time_s,P1,P2,Q1,T1\n0,1.50,1e-3,,\n0.5,1.5,0.1234567890123456,,\n";
        assert_eq!(again(mixed), "time_s,P1,P2,Q1,T1\n0,1.5,0.001,,\n0.5,1.5,0.1234567890123456,,\n");
    }

    #[test]
    fn comments_a_byte_order_mark_and_windows_line_ends_are_fine() {
        let plain = "time_s,P1,P2,Q1,T1\n0.0,1,2,3,4\n0.1,1,2,,\n";
        let other = format!("\u{feff}# a comment\n\n{}", plain.replace('\n', "\r\n").replace("P1", "\"P1\""));
        assert_eq!(again(&other), plain);
    }

    #[test]
    fn times_between_two_nanoseconds_are_kept() {
        let text = "time_s,P1,P2,Q1,T1\n0.0000000001,1,1,,\n0.0000000002,2,2,,\n";
        assert_eq!(again(text), text);
    }

    #[test]
    fn every_fault_is_told_with_its_line_and_what_to_do() {
        let head = "time_s,P1,P2,Q1,T1\n";
        let cases = [
            ("".to_string(), None, "the file is empty"),
            ("# only a comment\n\n".to_string(), None, "the file is empty"),
            (head.to_string(), Some(1), "no line of samples under it"),
            (format!("# c\n{head}0,1,1,,\n\n0.1,x,1,,\n"), Some(5), "column 'P1': 'x' is not a number"),
            (format!("{head}0,1,1,,\n0.1,1,NaN,,\n"), Some(3), "column 'P2': 'NaN' is not a finite number"),
            (format!("{head}0,1,1,,\n0.1,1,-inf,,\n"), Some(3), "column 'P2': '-inf' is not a finite"),
            (format!("{head}0,1,1,,\n0.1,1,1,\n"), Some(3), "4 cells where the header has 5"),
            (format!("{head}0,1,1,,\n0,1,1,,\n"), Some(3), "0 does not come after 0 of line 2"),
            (format!("{head}0.2,1,1,,\n0.10,1,1,,\n"), Some(3), "0.10 does not come after 0.2 of line 2"),
            (format!("{head}0,1,1,,\n,1,1,,\n"), Some(3), "column 'time_s' is empty"),
            (format!("{head}1e300,1,1,,\n"), Some(2), "'time_s': 1e300 s is out of range"),
            (format!("{head}nan,1,1,,\n"), Some(2), "column 'time_s': 'nan' is not a finite number"),
            (format!("{head}0,1,,,\n"), Some(1), "column 'P2': the pressure sensor has no sample"),
            (
                "time_s,P1,p2,Q1,T1\n0,1,1,,\n".into(),
                Some(1),
                "no column for the pressure sensor 'P2' of rig 'bench'; the columns are time_s, P1, p2, Q1, T1; did you mean 'p2'?",
            ),
            ("time_s,P1,P2,T1\n0,1,1,\n".into(), Some(1), "no column for the flow sensor 'Q1'"),
            (
                "time_s,P1,P2,P3,Q1,T1\n0,1,1,1,,\n".into(),
                Some(1),
                "column 'P3' is no sensor of rig 'bench', which has P1, P2, Q1, T1; did you mean 'P1'?",
            ),
            ("time_s,P1,P2,P1,Q1,T1\n0,1,1,1,,\n".into(), Some(1), "column 'P1' stands in the header twice"),
            (
                "time_ms,P1,P2,Q1,T1\n0,1,1,,\n".into(),
                Some(1),
                "must be time_s (times in seconds), but it is 'time_ms': times must be in seconds, these look like milliseconds",
            ),
            (
                "t,P1,P2,Q1,T1\n0,1,1,,\n".into(),
                Some(1),
                "it is 't': if these times are in seconds, name the column time_s",
            ),
            ("Time (s),P1,P2,Q1,T1\n0,1,1,,\n".into(), Some(1), "name the column time_s"),
            ("Time [ms],P1,P2,Q1,T1\n0,1,1,,\n".into(), Some(1), "divide them by 1000"),
            ("P1,time_s,P2,Q1,T1\n0,1,1,,\n".into(), Some(1), "it stands first"),
            ("time_s;P1;P2;Q1;T1\n0;1;1;;\n".into(), Some(1), "separate the columns by commas"),
            ("0.0,1,1,1,1\n0.1,1,1,,\n".into(), Some(1), "the header line is missing"),
        ];
        for (text, line, message) in cases {
            let (got_line, got) = problem(&text);
            assert_eq!(got_line, line, "{text:?}: {got}");
            assert!(got.contains(message), "{text:?}: {got}");
        }
        let (line, problem) = text_of(b"time_s,P1\n0,\xb0\n").unwrap_err();
        assert_eq!((line, problem), (Some(2), CsvProblem::NotUtf8 { hint: "" }.into()));
        assert!(text_of(b"\xff\xfet\0").unwrap_err().1.to_string().contains("UTF-16"));
    }

    #[test]
    fn a_sensor_said_not_to_be_recorded_needs_no_column() {
        let text = "time_s,P1,T1\n0,1,20\n";
        let without = |names: &[&str]| {
            parse(text, &rig(), &names.iter().map(|n| n.to_string()).collect::<Vec<_>>())
                .map_err(|(_, p)| p.to_string())
        };
        let (series, csv) = without(&["P2", "Q1"]).unwrap();
        assert_eq!(csv.columns, [(0, Some(0)), (3, Some(0))]);
        assert!(series[1].time_s.is_empty() && series[0].value == [1.0]);
        assert!(without(&["P2", "Q1", "Q7"]).unwrap_err().contains("no such sensor; did you mean 'Q1'?"));
        assert!(without(&["P1", "P2", "Q1"]).unwrap_err().contains("has a column"));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn any_well_formed_time_series_comes_back_byte_by_byte(
            start in -1_000_000i64..1_000_000,
            rows in prop::collection::vec((1i64..100_000, prop::array::uniform4(0u8..4), prop::array::uniform4(-9_999_999i64..9_999_999)), 1..40),
            decimals in prop::array::uniform5(0usize..7),
        ) {
            // Cells are made from integers: a sign, digits, and a point before the last `decimals`.
            let cell = |n: i64, d: usize| {
                let digits = format!("{:0>1$}", n.unsigned_abs(), d + 1);
                let (whole, fraction) = digits.split_at(digits.len() - d);
                let sign = if n < 0 { "-" } else { "" };
                if d == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") }
            };
            let mut text = "time_s,P1,P2,Q1,T1\n".to_string();
            let mut time = start;
            for (i, (step, blank, values)) in rows.iter().enumerate() {
                time += step;
                text += &cell(time, decimals[4]);
                for column in 0..4 {
                    // The first row is full, so that no pressure sensor is without a sample.
                    let blank = i > 0 && blank[column] == 0 && column > 0;
                    text += &if blank { ",".to_string() } else { format!(",{}", cell(values[column], decimals[column])) };
                }
                text.push('\n');
            }
            prop_assert_eq!(again(&text), text);
        }
    }
}
