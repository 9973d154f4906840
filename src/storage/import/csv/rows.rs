//! The rows of a table, read onto its clocks.

use std::collections::BTreeSet;

use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::csv::cell::Cell;
use crate::storage::import::csv::clock::Clock;
use crate::storage::import::csv::layout::{Layout, cells};
use crate::storage::import::csv::lines::Line;
use crate::storage::import::csv::missing::{Spellings, is_missing, missing};
use crate::storage::import::csv::numbers::Numbers;
use crate::storage::import::csv::row::{Row, is_row};
use crate::storage::import::csv::settings::Settings;
use crate::storage::import::csv::states::{States, is_bad};
use crate::storage::import::csv::table::Table;
use crate::storage::import::csv::timeless::{Timeless, is_no_time};
use crate::storage::import::source::{Repair, SourceOptions, counted};

/// What lines under a table sum up, in lower case.
const SUMMARIES: [&str; 19] = [
    "min",
    "minimum",
    "max",
    "maximum",
    "mean",
    "avg",
    "average",
    "std",
    "stdev",
    "std dev",
    "rms",
    "sum",
    "total",
    "count",
    "median",
    "peak",
    "mittelwert",
    "p-p",
    "pk-pk",
];

/// A clock, and the columns of values that it times.
pub(crate) struct Timed {
    pub(crate) clock: Clock,
    pub(crate) table: Table,
    pub(crate) timeless: Timeless,
    pub(crate) values: Vec<usize>,
    /// Readers of those that have a mark between their thousands.
    pub(crate) grouped: Vec<Option<Numbers>>,
    /// Columns that say in each row whether a value is one.
    pub(crate) states: Vec<Option<usize>>,
}

impl Timed {
    pub(crate) fn new(clock: Clock, values: Vec<usize>, grouped: Vec<Option<Numbers>>, states: &States) -> Timed {
        let table = Table { columns: vec![Vec::new(); values.len()], ..Table::default() };
        let states = values.iter().map(|value| states.of(*value)).collect();
        Timed { clock, table, timeless: Timeless::default(), values, grouped, states }
    }
}

/// The rows among the lines of a file.
pub(crate) struct Rows<'a, 't> {
    pub(crate) layout: &'a Layout<'t>,
    pub(crate) lines: &'a [Line<'t>],
    /// The line within which the file ends.
    pub(crate) cut: Option<usize>,
}

impl<'t> Rows<'_, 't> {
    /// Reads all of them; what was left out, and why.
    ///
    /// # Errors
    /// The line, and what is wrong in it.
    pub(crate) fn read(
        mut self,
        timed: &mut [Timed],
        numbers: &mut Numbers,
        spellings: &mut Spellings,
    ) -> Result<Vec<Repair>, CsvFault> {
        let mut repairs = Vec::new();
        let mut left = Left::default();
        let mut row = Row::default();
        let rows: Vec<Line<'t>> = self.lines[self.layout.first..].iter().copied().filter(|l| is_row(l.text)).collect();
        let segments = self.segments(&rows);
        let mut ahead = segments.iter().peekable();
        for (i, line) in rows.iter().enumerate() {
            if self.cut == Some(line.at) {
                break;
            }
            while ahead.next_if(|segment| segment.names < i).is_some() {}
            if let Some(segment) = ahead.peek().filter(|segment| segment.from <= i) {
                if segment.names == i {
                    left.headings.push(line.at);
                    timed.iter_mut().for_each(|t| t.clock.begin_segment(segment.late_s));
                }
                continue;
            }
            row.read(line.text, self.layout.separator);
            self.layout
                .columns
                .iter()
                .enumerate()
                .filter_map(|(i, c)| Some((i, c.suffix.as_ref()?)))
                .try_for_each(|(i, unit)| self.without_unit(&mut row, i, unit))
                .map_err(|problem| (Some(line.at), Box::new(problem)))?;
            if self.is_remark(&row, timed) {
                if self.layout.is_heading(line.text) {
                    return Err((Some(line.at), Box::new(CsvProblem::AnotherTable)));
                }
                left.remarks.push(line.at);
                continue;
            }
            if let Some(found) = row.ragged(self.layout.expected, self.layout.widest) {
                // a logger that was switched off in the middle of a line, to which an editor may have given an end
                let is_last = i + 1 == rows.len();
                let is_first = timed.iter().all(|t| t.table.time_s.is_empty());
                if !is_last || is_first || found > self.layout.expected {
                    return Err((
                        Some(line.at),
                        Box::new(CsvProblem::Ragged { found, expected: self.layout.expected }),
                    ));
                }
                self.cut = Some(line.at);
                break;
            }
            for timed in &mut *timed {
                self.take(timed, &row, line.at, numbers, spellings)
                    .map_err(|problem| (Some(line.at), Box::new(problem)))?;
            }
        }
        if let Some(line) = self.cut {
            let text = "the file ends within this line, which was left out";
            repairs.push(Repair { lost: true, ..Repair::new("cut-off", 1, Some(line), text) });
        }
        repairs.extend(left.repairs());
        Ok(repairs)
    }

    /// Reads what a clock gives the time of.
    fn take(
        &self,
        timed: &mut Timed,
        row: &Row<'t>,
        line: usize,
        numbers: &mut Numbers,
        spellings: &mut Spellings,
    ) -> Result<(), CsvProblem> {
        let columns = &self.layout.columns;
        let holds = |i: &usize| row.get(*i).is_some_and(|c| !c.is_empty());
        let is_timeless = timed.clock.is_timeless(row, is_no_time);
        if is_timeless && !timed.values.iter().any(holds) {
            return Ok(());
        }
        if is_timeless {
            timed.timeless.take(line, timed.table.time_s.last().copied());
        } else {
            let time_s = timed.clock.seconds(row, numbers)?;
            timed.table.time_s.push(time_s);
            timed.table.line.push(line);
        }
        let columns_of = timed.values.iter().zip(&mut timed.table.columns).zip(&mut timed.grouped);
        for (((&i, column), grouped), state) in columns_of.zip(&timed.states) {
            let mut cell = row.get(i).unwrap_or_default();
            // what has no time must be numbers all the same: a row of units is no line of samples
            let mut value = grouped.as_mut().unwrap_or(numbers).read_marked(cell, &columns[i].heading)?;
            if let Some(state) = state.and_then(|at| row.get(at)).filter(|state| is_bad(state)) {
                (cell, value) = (state, missing());
            }
            if is_missing(value) {
                spellings.count(cell, line);
            }
            if !is_timeless {
                column.push(value);
            }
        }
        Ok(())
    }

    /// Takes the unit off that stands behind each number of a column; a number without it is in an unknown one.
    fn without_unit(&self, row: &mut Row<'_>, place: usize, unit: &str) -> Result<(), CsvProblem> {
        let cell = row.get(place).unwrap_or_default();
        if Cell::of(cell).is_number() && !cell.ends_with(unit) {
            let column = self.layout.columns[place].heading.clone();
            return Err(CsvProblem::NoUnit { column, cell: cell.to_owned(), unit: unit.to_owned() });
        }
        row.take_suffix(place, unit);
        Ok(())
    }

    /// Some loggers write their headings anew with every block, and above them when it began.
    fn segments(&self, rows: &[Line<'t>]) -> Vec<Segment> {
        let headings = &self.layout.headings;
        let again: BTreeSet<usize> =
            (0..rows.len()).filter(|&i| headings.iter().any(|&at| self.lines[at].text == rows[i].text)).collect();
        let options = SourceOptions::default();
        let began = |settings: &Settings| settings.start(&options).map(|(start, _)| start.unix_ns);
        let first_ns = began(&self.layout.settings);
        let names = again.iter().copied().filter(|i| !again.contains(&(i + 1)));
        names
            .map(|names| {
                let from = (0..names)
                    .rev()
                    .find(|&i| !again.contains(&i) && self.layout.is_row(rows[i].text))
                    .map_or(0, |row| row + 1);
                let mut settings = Settings::default();
                rows[from..names].iter().for_each(|line| settings.take(&cells(line.text, self.layout.separator)));
                let late_s = began(&settings)
                    .zip(first_ns)
                    .map(|(ns, first)| (i128::from(ns) - i128::from(first)) as f64 * 1e-9);
                Segment { from, names, late_s }
            })
            .collect()
    }

    /// A line of words alone, or one that sums up a column.
    fn is_remark(&self, row: &Row<'_>, timed: &[Timed]) -> bool {
        let cell = |i: usize| row.get(i).map_or(Cell::Empty, Cell::of);
        let filled = || timed.iter().flat_map(|t| &t.values).map(|&i| cell(i)).filter(|c| *c != Cell::Empty);
        let first = row.iter().find(|c| !c.is_empty()).unwrap_or_default();
        let summary = SUMMARIES.contains(&first.trim_end_matches([':', '.']).to_lowercase().as_str());
        let has_time = timed.iter().any(|t| t.clock.is_timed(row));
        !has_time && Cell::of(first).is_word() && (summary || filled().all(Cell::is_word))
    }
}

/// Lines that begin a new block of rows.
struct Segment {
    /// The first, as an index into the rows.
    from: usize,
    /// The last, which holds the headings.
    names: usize,
    /// How much later it began than the first block, s, where both say when.
    late_s: Option<f64>,
}

/// Lines that are no rows.
#[derive(Default)]
struct Left {
    headings: Vec<usize>,
    remarks: Vec<usize>,
}

impl Left {
    fn repairs(&self) -> Vec<Repair> {
        let of = |what, lines: &[usize], one: &str, several: &str| {
            let first = *lines.first()?;
            Some(Repair::new(what, lines.len(), Some(first), counted(lines.len(), one, several)))
        };
        let again = of("headings-again", &self.headings, "line repeats the headings", "lines repeat the headings");
        let remarks = of(
            "remarks",
            &self.remarks,
            "line among or under the rows is a remark or a sum",
            "lines among or under the rows are remarks or sums",
        );
        again.into_iter().chain(remarks).collect()
    }
}
