//! The one parser of tables in text.
//!
//! It reads a table either strictly or repairing. A plain time series (`time_s,P1,…`, decimal points, increasing times) needs no repair:
//! [`read_strict`] takes nothing else, and refuses the first thing that would need one, with its line. [`read`] takes tables however they
//! are written: separators, decimal commas, date-times, units in headings, lines that repeat or stand out of order. It repairs what can be
//! repaired safely and reports each repair; the rest it refuses with its line.

pub(crate) mod clock;
pub(crate) mod columns;
pub(crate) mod comments;
pub(crate) mod cut;
pub(crate) mod grid;
pub(crate) mod heading;
pub(crate) mod numbers;
pub(crate) mod order;
pub(crate) mod row;
pub(crate) mod stamp;
pub(crate) mod table;
pub(crate) mod text;
pub(crate) mod timeless;
pub(crate) mod understand;

use std::borrow::Cow;

use crate::recording::{CsvFormat, Series};
use crate::rig::{Rig, SensorKind};
use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::csv::clock::Clock;
use crate::storage::import::csv::columns::sensors_of;
use crate::storage::import::csv::comments::{comment_notes, start_in_comments};
use crate::storage::import::csv::cut::is_cut_off;
use crate::storage::import::csv::grid::{Hole, even_holes};
use crate::storage::import::csv::heading::{header_unit, time_unit};
use crate::storage::import::csv::numbers::{Numbers, Written};
use crate::storage::import::csv::order::put_in_order;
use crate::storage::import::csv::row::{Row, is_line, is_row, separator};
use crate::storage::import::csv::table::Table;
use crate::storage::import::csv::text::{check_lines, decode, text_of};
use crate::storage::import::csv::timeless::Timeless;
use crate::storage::import::csv::understand::understand;
use crate::storage::import::kinds::{is_electric, is_unit, kind_of_name};
use crate::storage::import::source::{Repair, SourceFile, SourceOptions, Track};
use crate::units::{Quantity, Unit};

/// A plain time series on the sensors of a rig.
pub(crate) struct PlainSeries<'t> {
    /// Its text, without a byte-order mark.
    pub(crate) text: &'t str,
    /// Samples and gaps of each sensor of the rig.
    pub(crate) series: Vec<Series>,
    /// How its numbers are written.
    pub(crate) format: CsvFormat,
}

/// Reads a plain time series. Nothing is repaired: what would need it is refused.
///
/// # Errors
/// The line from 1, where there is one, and what is wrong.
pub(crate) fn read_strict<'t>(bytes: &'t [u8], rig: &Rig, without: &[String]) -> Result<PlainSeries<'t>, CsvFault> {
    check_lines(bytes)?;
    let text = text_of(bytes)?;
    let reader = Reader::strict(text)?;
    let header_at = reader.header_at;
    let sensors = sensors_of(&reader.header, rig, without).map_err(|p| (Some(header_at), p.into()))?;
    let mut read = reader.rows(&SourceOptions::default())?;
    if is_cut_off(text, ',') {
        return Err((read.table.line.last().copied(), CsvProblem::CutOff.into()));
    }
    let holes = even_holes(&read.table.time_s);
    let mut format = CsvFormat { time_decimals: read.written[0].decimals(), columns: Vec::new() };
    let mut series = vec![Series::default(); rig.sensors.len()];
    for (column, (&sensor, written)) in sensors.iter().zip(&read.written[1..]).enumerate() {
        let values = std::mem::take(&mut read.table.columns[column]);
        series[sensor] = column_series(&read.table.time_s, &values, &holes);
        let described = &rig.sensors[sensor];
        if series[sensor].time_s.is_empty() && described.kind == SensorKind::Pressure {
            return Err((Some(header_at), CsvProblem::NoSamples { column: described.name.clone() }.into()));
        }
        format.columns.push((sensor, written.decimals()));
    }
    Ok(PlainSeries { text, series, format })
}

/// Reads a table however it is written.
///
/// # Errors
/// The line from 1, where there is one, and what is wrong.
pub(crate) fn read(bytes: &[u8], options: &SourceOptions) -> Result<SourceFile, CsvFault> {
    check_lines(bytes)?;
    let mut repairs = Vec::new();
    let text = decode(bytes, &mut repairs)?;
    let anew = if options.guess { understand(&text, options, &mut repairs)? } else { None };
    // What the table is written like anew is no news.
    let (understood, is_anew) = (repairs.len(), anew.is_some());
    let text = anew.map_or(text, Cow::Owned);
    let reader = Reader::repairing(&text, repairs)?;
    let whole_text = reader.text;
    let Read { mut table, header, units, mut repairs, clock, timeless, .. } = reader.rows(options)?;
    let mut later = repairs.split_off(understood);
    later.retain(|r| !is_anew || !["separator", "time-unit", "time-column"].contains(&r.what));
    repairs.extend(later);
    let mut holes = put_in_order(&mut table, &mut repairs, clock.is_local())?;
    timeless.add_gaps(&table.time_s, &mut holes);
    let first = clock.columns();
    let mut tracks = tracks(table, &holes, &header[first..], units.as_deref().map(|u| &u[first.min(u.len())..]));
    if options.guess {
        tracks.iter_mut().for_each(take_unit_suffix);
    }
    let start = clock.start().or_else(|| {
        let (start, remark) = start_in_comments(whole_text, options)?;
        repairs.push(remark);
        Some(start)
    });
    Ok(SourceFile { tracks, start, notes: comment_notes(whole_text), repairs, spare_tracks: false })
}

/// A table whose headings were read.
struct Reader<'t> {
    text: &'t str,
    /// Nothing may be repaired.
    strict: bool,
    separator: char,
    header: Vec<String>,
    header_at: usize,
    /// Columns of the header with the empty ones at its end.
    widest: usize,
    /// The line within which the file ends.
    cut: Option<usize>,
    repairs: Vec<Repair>,
}

/// What the rows hold.
struct Read {
    table: Table,
    header: Vec<String>,
    units: Option<Vec<String>>,
    repairs: Vec<Repair>,
    clock: Clock,
    timeless: Timeless,
    /// How the numbers of each column are written, the times' first; only where the reading was strict.
    written: Vec<Written>,
}

impl<'t> Reader<'t> {
    fn strict(text: &'t str) -> Result<Reader<'t>, CsvFault> {
        Reader { text, ..Reader::new(true, ',') }.with_header()
    }

    fn repairing(text: &'t str, mut repairs: Vec<Repair>) -> Result<Reader<'t>, CsvFault> {
        let header = text.lines().find(|l| is_row(l)).ok_or((None, Box::new(CsvProblem::Empty)))?;
        let separator = separator(header);
        if separator != ',' {
            let name = if separator == ';' { "semicolons" } else { "tabs" };
            repairs.push(Repair::new("separator", 1, None, format!("columns are separated by {name}")));
        }
        let whole_lines = text.rfind('\n').filter(|_| is_cut_off(text, separator));
        let cut = whole_lines.map(|_| text.lines().count());
        let text = whole_lines.map_or(text, |end| &text[..=end]);
        let mut reader = Reader { text, cut, repairs, ..Reader::new(false, separator) }.with_header()?;
        // separators behind the last heading stand behind the rows as well
        while reader.header.len() > 1 && reader.header.last().is_some_and(String::is_empty) {
            reader.header.pop();
        }
        Ok(reader)
    }

    fn new(strict: bool, separator: char) -> Reader<'t> {
        let (header, repairs) = (Vec::new(), Vec::new());
        Reader { text: "", strict, separator, header, header_at: 0, widest: 0, cut: None, repairs }
    }

    fn with_header(mut self) -> Result<Self, CsvFault> {
        let (at, line) = self.lines_from(1).next().ok_or((None, Box::new(CsvProblem::Empty)))?;
        let mut row = Row::default();
        row.read(line, self.separator);
        self.header = row.iter().map(str::to_string).collect();
        self.header_at = at;
        self.widest = self.header.len();
        Ok(self)
    }

    /// Lines with their numbers from 1, without those that hold nothing.
    fn lines_from(&self, first: usize) -> impl Iterator<Item = (usize, &'t str)> + use<'t> {
        let holds_something = if self.strict { is_line } else { is_row };
        (1..).zip(self.text.lines()).skip(first - 1).filter(move |(_, line)| holds_something(line))
    }

    fn rows(mut self, options: &SourceOptions) -> Result<Read, CsvFault> {
        let mut lines = self.lines_from(self.header_at + 1);
        let separator = self.separator;
        let mut next = |row: &mut Row<'t>| {
            let (at, line) = lines.next()?;
            row.read(line, separator);
            Some(at)
        };
        let none = || (Some(self.header_at), Box::new(CsvProblem::HeaderOnly));
        let mut row = Row::default();
        let mut line = next(&mut row).ok_or_else(none)?;
        let units = units_row(&row, &self.header).filter(|_| !self.strict);
        if units.is_some() {
            self.repairs.push(Repair::new("units", 1, Some(line), "the line under the header holds units"));
            line = next(&mut row).ok_or_else(none)?;
        }
        let mut clock = self.clock(line, units.as_deref(), options)?;
        let first = clock.columns();
        let mut numbers = Numbers::new(separator, self.strict);
        let mut timeless = Timeless::default();
        let columns = self.header.len().saturating_sub(first);
        let mut table = Table { columns: vec![Vec::new(); columns], ..Table::default() };
        let mut written = vec![Written::default(); self.header.len()];
        let (mut previous, mut scratch) = (String::new(), String::new());
        loop {
            let fault = |problem: CsvProblem| (Some(line), Box::new(problem));
            if let Some(found) = row.ragged(self.header.len(), self.widest) {
                // a logger that was switched off in the middle of a line, to which an editor may have given an end
                let whole = self.strict || found > self.header.len() || table.time_s.is_empty();
                let last_line = line;
                if whole || next(&mut row).is_some() {
                    let problem = CsvProblem::Ragged { found, expected: self.header.len() };
                    return Err((Some(last_line), Box::new(problem)));
                }
                self.cut = Some(last_line);
                break;
            }
            let is_timeless = !self.strict && Timeless::is(&row, first);
            if is_timeless {
                timeless.take(line, table.time_s.last().copied());
            } else {
                let time_s = clock.seconds(&row, &mut numbers, &self.header).map_err(fault)?;
                if self.strict {
                    let cell = row.get(0).unwrap_or_default();
                    if let (Some(&before_s), Some(&previous_line)) = (table.time_s.last(), table.line.last())
                        && time_s <= before_s
                    {
                        let time = cell.to_string();
                        return Err(fault(CsvProblem::TimeNotIncreasing { time, previous, previous_line }));
                    }
                    written[0].watch(cell, time_s, &mut scratch);
                    previous.clear();
                    previous.push_str(cell);
                }
                table.time_s.push(time_s);
                table.line.push(line);
            }
            for (i, column) in table.columns.iter_mut().enumerate() {
                let cell = row.get(first + i).unwrap_or_default();
                // what has no time must be numbers all the same: a row of units is no line of samples
                let value = numbers.read(cell, &self.header[first + i]).map_err(fault)?;
                if self.strict {
                    written[first + i].watch(cell, value, &mut scratch);
                }
                if !is_timeless {
                    column.push(value);
                }
            }
            match next(&mut row) {
                Some(at) => line = at,
                None => break,
            }
        }
        if table.time_s.is_empty() {
            return Err(none());
        }
        if !self.strict {
            if let Some(line) = self.cut {
                let text = "the file ends within this line, which was left out";
                self.repairs.push(Repair { lost: true, ..Repair::new("cut-off", 1, Some(line), text) });
            }
            self.repairs.extend(numbers.repairs());
            self.repairs.extend(clock.repairs());
            self.repairs.extend(timeless.repair(table.time_s.len())?);
        }
        let Reader { header, repairs, .. } = self;
        Ok(Read { table, header, units, repairs, clock, timeless, written })
    }

    /// What the first column says of times, from a line on.
    fn clock(&self, line: usize, units: Option<&[String]>, options: &SourceOptions) -> Result<Clock, CsvFault> {
        if self.strict {
            return Ok(Clock::of_seconds(&self.header[0]));
        }
        let mut row = Row::default();
        let mut lines = self.lines_from(line);
        let timed = lines.find(|(_, text)| {
            row.read(text, self.separator);
            !Timeless::is(&row, 1)
        });
        let (timed_at, _) = timed.ok_or((Some(line), Box::new(CsvProblem::NoTime)))?;
        Clock::find(&self.header, units, &row, self.text, self.separator, options).map_err(|p| {
            let at = if matches!(p, CsvProblem::NotANumber { .. }) { timed_at } else { self.header_at };
            (Some(at), Box::new(p))
        })
    }
}

/// `P1_kPa` is `P1` in kPa, and so is `P1, kPa (logger 7)`.
fn take_unit_suffix(track: &mut Track) {
    if track.unit.as_deref().is_some_and(|unit| is_unit(&track.short, unit)) {
        return;
    }
    let behind_comma = track.short.rsplit_once(", ").filter(|(name, unit)| is_unit(name, unit));
    let last_word = track.short.rsplit_once(['_', ' ']);
    let exact = |unit: &str| unit.parse::<Unit>().is_ok_and(|u| u.quantity != Quantity::Ratio);
    // `ch0_V` is in volts; `P_V` may as well stand at the valve.
    let electric = |name: &str, unit: &str| is_electric(unit) && (unit != "V" || kind_of_name(name).is_none());
    let Some((name, unit)) = behind_comma.or(last_word.filter(|(name, unit)| exact(unit) || electric(name, unit)))
    else {
        return;
    };
    if !name.is_empty() {
        (track.short, track.unit) = (name.to_owned(), Some(unit.to_owned()));
    }
}

/// The units, if the row under the header holds them: words everywhere, the first one of time.
fn units_row(row: &Row<'_>, header: &[String]) -> Option<Vec<String>> {
    let bare = |cell: &str| cell.trim_matches(|c| matches!(c, '(' | ')' | '[' | ']')).trim().to_string();
    let units: Vec<String> = row.iter().take(header.len()).map(bare).collect();
    let words = units.iter().all(|u| !u.chars().next().is_some_and(|c| c.is_ascii_digit() || matches!(c, '-' | '+')));
    (units.len() == header.len() && words && time_unit(units.first()?).is_some()).then_some(units)
}

fn tracks(table: Table, holes: &[Hole], header: &[String], units: Option<&[String]>) -> Vec<Track> {
    let named = header.iter().enumerate().zip(table.columns);
    named
        .map(|((i, name), values)| {
            let series = column_series(&table.time_s, &values, holes);
            let (short, unit) = match header_unit(name) {
                Some((short, unit)) => (short, Some(unit)),
                None => (name.clone(), None),
            };
            let unit = unit.or_else(|| units.and_then(|u| u.get(i)).filter(|u| !u.is_empty()).cloned());
            Track { name: name.clone(), short, unit, series, repairs: Vec::new() }
        })
        .collect()
}

/// The samples of a column, and the gaps in it: only one that is sampled on both sides of a hole has lost something in it.
fn column_series(time_s: &[f64], values: &[f64], holes: &[Hole]) -> Series {
    let present = || time_s.iter().zip(values).filter(|(_, v)| !v.is_nan());
    let lost = holes.iter().filter(|h| !values[h.before].is_nan() && !values[h.before + 1].is_nan());
    Series {
        time_s: present().map(|(t, _)| *t).collect(),
        value: present().map(|(_, v)| *v).collect(),
        gaps: lost.map(|h| h.gap).collect(),
    }
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
