//! Tables in text, however they are written: separators, decimal commas, date-times, comments, units in headings, lines
//! that repeat or stand out of order. What can be put right safely is, and is said; the rest is refused with its line.

pub(crate) mod clock;
pub(crate) mod comments;
pub(crate) mod decimals;
pub(crate) mod mend;
pub(crate) mod stamp;
pub(crate) mod text;
pub(crate) mod timeless;

use crate::storage::foreign::csv::clock::Clock;
pub use crate::storage::foreign::csv::clock::time_unit;
pub(crate) use crate::storage::foreign::csv::comments::START;
use crate::storage::foreign::csv::decimals::Decimals;
use crate::storage::foreign::csv::mend::Hole;
pub use crate::storage::foreign::csv::mend::even_holes;
pub use crate::storage::foreign::csv::stamp::zone_seconds;
use crate::storage::foreign::csv::timeless::Timeless;

use crate::storage::CsvProblem;
use crate::storage::foreign::{Foreign, ForeignOptions, Mended, Start, Track};
use crate::storage::import::{Fault, is_cut_off, split};

/// A table on its way: times, lines and columns of one length; NaN where a cell is empty.
#[derive(Default)]
pub(crate) struct Table {
    time_s: Vec<f64>,
    line: Vec<usize>,
    columns: Vec<Vec<f64>>,
}

/// The cells of a line.
#[derive(Default)]
pub(crate) struct Row {
    cells: Vec<String>,
    count: usize,
}

impl Row {
    fn read(&mut self, line: &str, separator: char) {
        let mut cells = Vec::with_capacity(self.count);
        split(line, separator, &mut cells);
        self.count = cells.len();
        // the texts of the line before are written over, not set aside anew
        self.cells.resize(self.cells.len().max(self.count), String::new());
        for (own, cell) in self.cells.iter_mut().zip(&cells) {
            own.clear();
            own.push_str(cell);
        }
    }

    fn len(&self) -> usize {
        self.count
    }

    fn iter(&self) -> impl Iterator<Item = &str> {
        self.cells[..self.count].iter().map(String::as_str)
    }

    fn get(&self, place: usize) -> Option<&str> {
        self.cells[..self.count].get(place).map(String::as_str)
    }
}

/// Reads a table. `Err` holds the line from 1, where there is one, and what is wrong.
pub(crate) fn read(bytes: &[u8], options: &ForeignOptions) -> Result<Foreign, Fault> {
    let mut mended = Vec::new();
    let text = crate::storage::foreign::csv::text::decode(bytes, &mut mended)?;
    let header_line = text.lines().find(|l| is_row(l)).ok_or((None, Box::new(CsvProblem::Empty)))?;
    let separator = separator(header_line);
    if separator != ',' {
        let name = if separator == ';' { "semicolons" } else { "tabs" };
        mended.push(Mended::new("separator", 1, None, format!("columns are separated by {name}")));
    }
    let mut cut = None;
    let whole_lines = text.rfind('\n').filter(|_| is_cut_off(&text, separator));
    let text = match whole_lines {
        Some(end) => {
            cut = Some(text.lines().count());
            &text[..=end]
        }
        None => &text[..],
    };
    let mut lines = (1..).zip(text.lines()).filter(|(_, l)| is_row(l));
    let mut row = Row::default();
    let mut next = |row: &mut Row| {
        let (at, line) = lines.next()?;
        row.read(line, separator);
        Some(at)
    };
    let header_at = next(&mut row).ok_or((None, Box::new(CsvProblem::Empty)))?;
    let mut header: Vec<String> = row.iter().map(str::to_string).collect();
    // separators behind the last heading stand behind the rows as well
    let widest = header.len();
    while header.len() > 1 && header.last().is_some_and(String::is_empty) {
        header.pop();
    }
    let none = || (Some(header_at), Box::new(CsvProblem::HeaderOnly));
    let mut line = next(&mut row).ok_or_else(none)?;
    let units = units_row(&row, &header);
    if units.is_some() {
        mended.push(Mended::new("units", 1, Some(line), "the line under the header holds units"));
        line = next(&mut row).ok_or_else(none)?;
    }

    let mut decimals = Decimals::new(separator);
    let (timed_at, timed) = first_timed(text, line, separator).ok_or((Some(line), Box::new(CsvProblem::NoTime)))?;
    let mut clock = Clock::find(&header, units.as_deref(), &timed, text, separator, options).map_err(|p| {
        (Some(if matches!(p, CsvProblem::NotANumber { .. }) { timed_at } else { header_at }), Box::new(p))
    })?;
    let first = clock.columns();
    let mut timeless = Timeless::default();
    let mut table = Table { columns: vec![Vec::new(); header.len().saturating_sub(first)], ..Table::default() };
    loop {
        let fault = |problem: CsvProblem| (Some(line), Box::new(problem));
        if let Some(found) = ragged(&row, header.len(), widest) {
            // a logger that was switched off in the middle of a line, to which an editor may have given an end
            let whole = found > header.len() || table.time_s.is_empty();
            let last_line = line;
            if whole || next(&mut row).is_some() {
                return Err((Some(last_line), Box::new(CsvProblem::Ragged { found, expected: header.len() })));
            }
            cut = Some(last_line);
            break;
        }
        let is_timeless = Timeless::is(&row, first);
        if is_timeless {
            timeless.take(line, table.time_s.last().copied());
        } else {
            table.time_s.push(clock.seconds(&row, &mut decimals, &header).map_err(fault)?);
            table.line.push(line);
        }
        for (i, column) in table.columns.iter_mut().enumerate() {
            let cell = row.get(first + i).unwrap_or_default();
            // what has no time must be numbers all the same: a row of units is no line of samples
            let value = decimals.read(cell, &header[first + i]).map_err(fault)?;
            if !is_timeless {
                column.push(value);
            }
        }
        match next(&mut row) {
            Some(at) => line = at,
            None => break,
        }
    }
    if let Some(line) = cut {
        let text = "the file ends within this line, which was left out";
        mended.push(Mended { lost: true, ..Mended::new("cut-off", 1, Some(line), text) });
    }
    if table.time_s.is_empty() {
        return Err(none());
    }
    mended.extend(decimals.said());
    mended.extend(clock.said());
    mended.extend(timeless.said(table.time_s.len())?);
    let mut gaps = crate::storage::foreign::csv::mend::mend(&mut table, &mut mended, clock.is_local())?;
    timeless.add_gaps(&table.time_s, &mut gaps);
    let tracks = tracks(table, &gaps, &header[first..], units.as_deref().map(|u| &u[first.min(u.len())..]));
    let start = clock.start().or_else(|| {
        let (start, said) = start_in_comments(text, options)?;
        mended.push(said);
        Some(start)
    });
    Ok(Foreign { tracks, start, notes: comment_notes(text), mended, spare_tracks: false })
}

/// The start that the comments give, if they do, and how that is said.
pub fn start_in_comments(text: &str, options: &ForeignOptions) -> Option<(Start, Mended)> {
    crate::storage::foreign::csv::comments::start(&crate::storage::foreign::csv::comments::comments(text), options)
}

/// The block of comments as a note, if there is one.
pub fn comment_notes(text: &str) -> Vec<(String, String)> {
    let comments = crate::storage::foreign::csv::comments::comments(text);
    if comments.is_empty() { Vec::new() } else { vec![("comment".into(), comments.join("\n"))] }
}

fn is_row(line: &str) -> bool {
    // Excel's word on what stands between the columns, which the headings show anyway
    let separator = line.trim_end_matches(['\r', '\n']).strip_prefix("sep=").is_some_and(|s| s.chars().count() <= 1);
    !separator && !line.starts_with('#') && line.chars().any(|c| !c.is_whitespace() && !matches!(c, ',' | ';'))
}

/// What stands between the headings, outside of quotes.
fn separator(header: &str) -> char {
    let mut quoted = false;
    let mut seen = [false; 2];
    for c in header.chars() {
        quoted ^= c == '"';
        seen[0] |= c == ';' && !quoted;
        seen[1] |= c == '\t' && !quoted;
    }
    match seen {
        [true, _] => ';',
        [_, true] => '\t',
        _ => ',',
    }
}

/// Number of cells of a line that has too few or too many; empty ones at its end do not count as far as the header has them too.
/// Elsewhere a surplus cell is a decimal comma.
fn ragged(row: &Row, expected: usize, widest: usize) -> Option<usize> {
    let found = row.len();
    let fits = (expected..=widest).contains(&found) && row.iter().skip(expected).all(str::is_empty);
    (!fits).then_some(found)
}

/// The first row from a line on that says its time, and its line.
fn first_timed(text: &str, from_line: usize, separator: char) -> Option<(usize, Row)> {
    let mut row = Row::default();
    let mut lines = (1..).zip(text.lines()).skip(from_line - 1).filter(|(_, l)| is_row(l));
    let (line, _) = lines.find(|(_, text)| {
        row.read(text, separator);
        !Timeless::is(&row, 1)
    })?;
    Some((line, row))
}

/// The units, if the row under the header holds them: words everywhere, the first one of time.
fn units_row(row: &Row, header: &[String]) -> Option<Vec<String>> {
    let bare = |cell: &str| cell.trim_matches(|c| matches!(c, '(' | ')' | '[' | ']')).trim().to_string();
    let units: Vec<String> = row.iter().take(header.len()).map(bare).collect();
    let words = units.iter().all(|u| !u.chars().next().is_some_and(|c| c.is_ascii_digit() || matches!(c, '-' | '+')));
    (units.len() == header.len() && words && crate::storage::foreign::csv::clock::time_unit(units.first()?).is_some())
        .then_some(units)
}

fn tracks(table: Table, gaps: &[Hole], header: &[String], units: Option<&[String]>) -> Vec<Track> {
    let named = header.iter().enumerate().zip(table.columns);
    named
        .map(|((i, name), values)| {
            let present: Vec<usize> = (0..values.len()).filter(|&r| !values[r].is_nan()).collect();
            let mut series = crate::recording::Series {
                time_s: present.iter().map(|&r| table.time_s[r]).collect(),
                value: present.iter().map(|&r| values[r]).collect(),
                gaps: Vec::new(),
            };
            // only a column that is sampled on both sides of a hole has lost something in it
            let lost = gaps.iter().filter(|g| !values[g.before].is_nan() && !values[g.before + 1].is_nan());
            series.gaps = lost.map(|g| g.gap).collect();
            let (short, unit) = match header_unit(name) {
                Some((short, unit)) => (short, Some(unit)),
                None => (name.clone(), None),
            };
            let unit = unit.or_else(|| units.and_then(|u| u.get(i)).filter(|u| !u.is_empty()).cloned());
            Track { name: name.clone(), short, unit, series, mended: Vec::new() }
        })
        .collect()
}

/// Name and unit of a heading such as `P1 (bar)`, `P1 [kPa]` or `P1 / kPa`.
fn header_unit(heading: &str) -> Option<(String, String)> {
    for (open, close) in [(" (", ")"), ("(", ")"), ("[", "]"), (" / ", "")] {
        if let Some((name, unit)) = heading.strip_suffix(close).and_then(|rest| rest.rsplit_once(open))
            && !name.trim().is_empty()
            && !unit.trim().is_empty()
        {
            // m(H2O) has brackets of its own
            let unit = if unit == "H2O" && heading.ends_with("m(H2O)") { "m(H2O)" } else { unit };
            let name = name.trim().strip_suffix(" m").filter(|_| unit == "m(H2O)").unwrap_or(name.trim());
            return Some((name.to_string(), unit.trim().to_string()));
        }
    }
    None
}
