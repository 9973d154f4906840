//! Numbers with a decimal point or a decimal comma, the same throughout a file.

use crate::storage::CsvProblem;
use crate::storage::foreign::Mended;

/// Reads cells, and holds the file to one decimal mark.
pub(crate) struct Decimals {
    separator: char,
    mark: Option<char>,
    grouped: usize,
    scratch: String,
}

impl Decimals {
    pub(crate) fn new(separator: char) -> Decimals {
        Decimals { separator, mark: None, grouped: 0, scratch: String::new() }
    }

    /// The number of a cell; NaN where it is empty.
    pub(crate) fn read(&mut self, cell: &str, column: &str) -> Result<f64, CsvProblem> {
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let value = self.number(cell, column)?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(CsvProblem::NotFinite { column: column.into(), cell: cell.into() })
    }

    fn number(&mut self, cell: &str, column: &str) -> Result<f64, CsvProblem> {
        let no_number = || CsvProblem::NotANumber { column: column.into(), cell: cell.into() };
        let Some(last) = cell.rfind(['.', ',']) else { return cell.parse().map_err(|_| no_number()) };
        let mark = if cell.as_bytes()[last] == b',' { ',' } else { '.' };
        let other = if mark == ',' { '.' } else { ',' };
        let both = cell[..last].contains(other);
        // a comma between columns separated by commas can only have been quoted, and then it is a decimal one
        if *self.mark.get_or_insert(mark) != mark {
            return Err(CsvProblem::TwoDecimalMarks { column: column.into(), cell: cell.into() });
        }
        if mark == '.' && !both {
            return cell.parse().map_err(|_| no_number());
        }
        if both && !is_grouped(&cell[..last], other) {
            return Err(no_number());
        }
        self.grouped += usize::from(both);
        self.scratch.clear();
        self.scratch.extend(cell[..last].chars().filter(|c| *c != other));
        self.scratch.push('.');
        self.scratch.push_str(&cell[last + 1..]);
        self.scratch.parse().map_err(|_| no_number())
    }

    pub(crate) fn said(&self) -> Vec<Mended> {
        let mut said = Vec::new();
        if self.mark == Some(',') {
            let quoted = if self.separator == ',' { " in quotes" } else { "" };
            said.push(Mended::new("decimal-comma", 1, None, format!("numbers have decimal commas{quoted}")));
        }
        if self.grouped > 0 {
            said.push(Mended::new(
                "thousands",
                self.grouped,
                None,
                format!("{} numbers have their thousands set apart", self.grouped),
            ));
        }
        said
    }
}

/// Groups of three digits, the first one shorter at most.
fn is_grouped(whole: &str, mark: char) -> bool {
    let whole = whole.strip_prefix(['-', '+']).unwrap_or(whole);
    let mut groups = whole.split(mark);
    let digits = |g: &str| g.bytes().all(|b| b.is_ascii_digit());
    groups.next().is_some_and(|g| (1..=3).contains(&g.len()) && digits(g)) && groups.all(|g| g.len() == 3 && digits(g))
}
