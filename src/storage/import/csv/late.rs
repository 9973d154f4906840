//! What the columns of a table hold in the second half of a file, which is rows: by it the reader tells settings,
//! headings and rows apart.

use std::borrow::Cow;

use crate::storage::import::csv::cell::Cell;
use crate::storage::import::csv::heading::{header_unit, is_date_name, is_known_unit, is_time_name};

/// Words are at home in a column where more than one in so many cells is one.
const WORDED: usize = 10;

/// What the columns hold in the second half of a file, which is rows.
pub(crate) struct Late {
    /// Words and others, for each column.
    pub(crate) counts: Vec<(usize, usize)>,
}

impl Late {
    pub(crate) fn of<'c>(rows: impl Iterator<Item = Vec<Cow<'c, str>>>) -> Late {
        let mut counts: Vec<(usize, usize)> = Vec::new();
        let mut all = 0;
        for row in rows {
            all += 1;
            counts.resize(counts.len().max(row.len()), (0, 0));
            for ((words, others), cell) in counts.iter_mut().zip(&row) {
                match Cell::of(cell) {
                    Cell::Empty => {}
                    Cell::Word => *words += 1,
                    _ => *others += 1,
                }
            }
        }
        // In a file of a few rows the settings may reach its second half: names, but not in every row, and an empty
        // column behind their values.
        let gap = counts.iter().position(|c| *c == (0, 0)).unwrap_or(0);
        if gap > 0 && counts[0].1 == 0 && counts[0].0 < all {
            counts[..gap].fill((0, 0));
        }
        Late { counts }
    }

    /// Columns up to the last that holds anything.
    pub(crate) fn least(&self, width: usize) -> usize {
        (0..width).rev().find(|&i| !self.is_empty(i)).map_or(width, |last| last + 1)
    }

    /// Whether the first column numbers the rows, or names them.
    pub(crate) fn is_numbering(&self, rows: &[Vec<Cow<'_, str>>]) -> bool {
        let first: Vec<f64> = rows.iter().filter_map(|row| row.first()).map(|c| Cell::of(c).value()).collect();
        let counts = first.windows(2).filter(|w| w[1] - w[0] == 1.0).count();
        !self.is_numeric(0) || 10 * counts > 9 * first.len().saturating_sub(1)
    }

    /// Whether a column holds numbers.
    pub(crate) fn is_numeric(&self, column: usize) -> bool {
        self.counts.get(column).is_some_and(|(words, others)| others > words)
    }

    /// Whether a line holds the units of half of the numbers or more.
    pub(crate) fn is_units(&self, cells: &[Cow<'_, str>]) -> bool {
        let numeric = || cells.iter().enumerate().filter(|(i, _)| self.is_numeric(*i));
        let units =
            numeric().filter(|(_, cell)| is_known_unit(without_brackets(cell)) || is_clock_format(cell)).count();
        units > 0 && 2 * units >= numeric().count()
    }

    pub(crate) fn is_empty(&self, column: usize) -> bool {
        self.counts.get(column).is_none_or(|c| *c == (0, 0))
    }

    /// Whether a line is a row: numbers, and words only where words stand. What is empty later on does not count:
    /// oscilloscopes write their settings beside the first rows.
    pub(crate) fn is_data(&self, row: &[Cow<'_, str>]) -> bool {
        let cells = row.iter().enumerate().filter(|(i, _)| !self.is_empty(*i)).map(|(i, c)| (i, Cell::of(c)));
        let (places, cells): (Vec<usize>, Vec<Cell>) = cells.unzip();
        let at_home = |(i, cell): (&usize, &Cell)| !cell.is_word() || WORDED * self.counts[*i].0 > self.counts[*i].1;
        is_numbers(&cells) && places.iter().zip(&cells).all(at_home)
    }

    /// Takes the settings of an oscilloscope out of a row: what stands in columns that are empty later on, beside the
    /// rows.
    pub(crate) fn take_beside<'c>(&self, row: &mut [Cow<'c, str>]) -> Vec<Cow<'c, str>> {
        let beside = row.iter().enumerate().take_while(|(i, _)| self.is_empty(*i)).count();
        row[..beside].iter_mut().map(std::mem::take).collect()
    }

    /// Whether a line may head the columns: words, or whole numbers as names, and other numbers only over nothing.
    pub(crate) fn is_heading(&self, row: &[Cow<'_, str>], width: usize) -> bool {
        let filled = row.iter().rposition(|c| !c.is_empty()).map_or(0, |last| last + 1);
        let least = self.least(width);
        let names = |(i, cell): (usize, &Cow<'_, str>)| match Cell::of(cell) {
            Cell::Empty | Cell::Word | Cell::Missing => true,
            Cell::Number(_) => self.is_empty(i) || cell.bytes().all(|b| b.is_ascii_digit()),
            Cell::Stamp(_) => false,
        };
        // R names one column less than there are where the first numbers the rows; the names of channels may stand in
        // lines of their own
        let begins = row.first().is_some_and(|c| is_time_name(c) || is_date_name(c));
        let fits = filled >= least
            || (least > 2 && filled + 1 == least && filled == row.len())
            || (begins && row.len() >= least);
        let worded = row.iter().any(|c| Cell::of(c).is_word() && !is_setting(c));
        fits && worded && row.iter().enumerate().all(names)
    }
}

/// Numbers and times, at least one number, and as many as words, as in columns of channels and remarks.
pub(crate) fn is_numbers(cells: &[Cell]) -> bool {
    let words = cells.iter().filter(|c| c.is_word()).count();
    let filled = cells.iter().filter(|c| **c != Cell::Empty).count();
    cells.iter().any(|c| c.is_number()) && 2 * words <= filled
}

/// `Operator: Kim` heads no column; `Latest: Time (s)` does.
fn is_setting(cell: &str) -> bool {
    let has_unit = || header_unit(cell).is_some_and(|(_, unit)| is_known_unit(&unit));
    cell.split_once(": ").is_some_and(|(key, _)| !key.contains(['(', '['])) && !has_unit()
}

pub(crate) fn without_brackets(cell: &str) -> &str {
    cell.trim_matches(|c| matches!(c, '(' | ')' | '[' | ']')).trim()
}

/// `hh:mm:ss,000` stands for the unit of a time of day.
fn is_clock_format(cell: &str) -> bool {
    let lower = cell.to_lowercase();
    lower.contains("mm:ss") || lower.contains("hh:mm") || lower == "ts"
}
