//! A plain time series: `time_s,P1,…`, decimal points, increasing times. Nothing is repaired: what would need it is
//! refused, with its line.

use crate::recording::{CsvFormat, Series};
use crate::rig::{Rig, SensorKind};
use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::csv::columns::sensors_of;
use crate::storage::import::csv::cut::is_cut_off;
use crate::storage::import::csv::grid::even_holes;
use crate::storage::import::csv::numbers::{Numbers, Written};
use crate::storage::import::csv::row::{Row, is_line};
use crate::storage::import::csv::table::{Table, column_series};
use crate::storage::import::csv::text::{check_lines, text_of};
use crate::storage::layout::to_ns;

/// A plain time series on the sensors of a rig.
pub(crate) struct PlainSeries<'t> {
    /// Its text, without a byte-order mark.
    pub(crate) text: &'t str,
    /// Samples and gaps of each sensor of the rig.
    pub(crate) series: Vec<Series>,
    /// How its numbers are written.
    pub(crate) format: CsvFormat,
}

/// Reads a plain time series.
///
/// # Errors
/// The line from 1, where there is one, and what is wrong.
pub(crate) fn read_strict<'t>(bytes: &'t [u8], rig: &Rig, without: &[String]) -> Result<PlainSeries<'t>, CsvFault> {
    check_lines(bytes)?;
    let text = text_of(bytes)?;
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| is_line(line));
    let mut row = Row::default();
    let mut next = |row: &mut Row<'t>| {
        let (at, line) = lines.next()?;
        row.read(line, ',');
        Some(at)
    };
    let header_at = next(&mut row).ok_or((None, Box::new(CsvProblem::Empty)))?;
    let header: Vec<String> = row.iter().map(str::to_string).collect();
    let sensors = sensors_of(&header, rig, without).map_err(|p| (Some(header_at), p.into()))?;
    let (table, written) = rows(&header, next)?;
    if table.time_s.is_empty() {
        return Err((Some(header_at), CsvProblem::HeaderOnly.into()));
    }
    if is_cut_off(text, ',') {
        return Err((table.line.last().copied(), CsvProblem::CutOff.into()));
    }
    let holes = even_holes(&table.time_s);
    let mut format = CsvFormat { time_decimals: written[0].decimals(), columns: Vec::new() };
    let mut series = vec![Series::default(); rig.sensors.len()];
    for ((values, &sensor), written) in table.columns.iter().zip(&sensors).zip(&written[1..]) {
        series[sensor] = column_series(&table.time_s, values, &holes);
        let described = &rig.sensors[sensor];
        if series[sensor].time_s.is_empty() && described.kind == SensorKind::Pressure {
            return Err((Some(header_at), CsvProblem::NoSamples { column: described.name.clone() }.into()));
        }
        format.columns.push((sensor, written.decimals()));
    }
    Ok(PlainSeries { text, series, format })
}

/// The numbers of all rows, and how those of each column are written, the times' first.
fn rows<'t>(
    header: &[String],
    mut next: impl FnMut(&mut Row<'t>) -> Option<usize>,
) -> Result<(Table, Vec<Written>), CsvFault> {
    let mut numbers = Numbers::strict();
    let mut table = Table { columns: vec![Vec::new(); header.len() - 1], ..Table::default() };
    let mut written = vec![Written::default(); header.len()];
    let (mut previous, mut scratch) = (String::new(), String::new());
    let mut row = Row::default();
    while let Some(line) = next(&mut row) {
        let fault = |problem: CsvProblem| (Some(line), Box::new(problem));
        if let Some(found) = row.ragged(header.len(), header.len()) {
            return Err(fault(CsvProblem::Ragged { found, expected: header.len() }));
        }
        let cell = row.get(0).unwrap_or_default();
        let time_s = numbers.read(cell, &header[0]).map_err(fault)?;
        if time_s.is_nan() {
            return Err(fault(CsvProblem::NoTime));
        }
        if to_ns(time_s).is_none() {
            return Err(fault(CsvProblem::TimeOutOfRange(cell.into())));
        }
        if let (Some(&before_s), Some(&previous_line)) = (table.time_s.last(), table.line.last())
            && time_s <= before_s
        {
            return Err(fault(CsvProblem::TimeNotIncreasing { time: cell.to_string(), previous, previous_line }));
        }
        previous.clear();
        previous.push_str(cell);
        written[0].watch(cell, time_s, &mut scratch);
        table.time_s.push(time_s);
        table.line.push(line);
        for (i, column) in table.columns.iter_mut().enumerate() {
            let cell = row.get(i + 1).unwrap_or_default();
            let value = numbers.read(cell, &header[i + 1]).map_err(fault)?;
            written[i + 1].watch(cell, value, &mut scratch);
            column.push(value);
        }
    }
    Ok((table, written))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Recording, RunInfo};
    use crate::storage::fixtures::{place, rig};
    use crate::storage::{export_csv, read, write};
    use proptest::prelude::*;

    fn recording(text: &str) -> Result<Recording, CsvFault> {
        let PlainSeries { series, format, .. } = read_strict(text.as_bytes(), &rig(), &[])?;
        Ok(Recording { rig: rig(), series, run: RunInfo { csv: Some(format), ..RunInfo::default() } })
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
            ("time_s,P1,P2,P1,Q1,T1\n0,1,1,1,,\n".into(), Some(1), "column 'P1' appears twice in the header"),
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
            ("P1,time_s,P2,Q1,T1\n0,1,1,,\n".into(), Some(1), "times come first"),
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
            read_strict(text.as_bytes(), &rig(), &names.iter().map(|n| n.to_string()).collect::<Vec<_>>())
                .map_err(|(_, p)| p.to_string())
        };
        let PlainSeries { series, format, .. } = without(&["P2", "Q1"]).unwrap();
        assert_eq!(format.columns, [(0, Some(0)), (3, Some(0))]);
        assert!(series[1].time_s.is_empty() && series[0].value == [1.0]);
        assert!(without(&["P2", "Q1", "Q7"]).err().unwrap().contains("no such sensor; did you mean 'Q1'?"));
        assert!(without(&["P1", "P2", "Q1"]).err().unwrap().contains("has a column"));
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
