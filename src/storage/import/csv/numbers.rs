//! The numbers of a table, and how they are written.

use std::fmt::Write as _;

use crate::storage::error::CsvProblem;
use crate::storage::import::source::Repair;

/// Reads cells, and holds the file to one decimal mark.
pub(crate) struct Numbers {
    separator: char,
    /// Decimal points only, and nothing between the thousands.
    strict: bool,
    mark: Option<char>,
    grouped: usize,
    scratch: String,
}

impl Numbers {
    pub(crate) fn new(separator: char, strict: bool) -> Numbers {
        Numbers { separator, strict, mark: None, grouped: 0, scratch: String::new() }
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
        let last = cell.rfind(['.', ',']).filter(|_| !self.strict);
        let Some(last) = last else { return cell.parse().map_err(|_| no_number()) };
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

    /// How the numbers are written, where that is not the plain way.
    pub(crate) fn repairs(&self) -> Vec<Repair> {
        let mut repairs = Vec::new();
        if self.mark == Some(',') {
            let quoted = if self.separator == ',' { " in quotes" } else { "" };
            repairs.push(Repair::new("decimal-comma", 1, None, format!("numbers have decimal commas{quoted}")));
        }
        if self.grouped > 0 {
            let text = format!("{} numbers have separators between their thousands", self.grouped);
            repairs.push(Repair::new("thousands", self.grouped, None, text));
        }
        repairs
    }
}

/// True for a decimal number as it would be printed, of so few digits that it survives the way through a binary number.
fn is_plain_decimal(cell: &str) -> bool {
    let cell = cell.as_bytes();
    let digits = |part: &[u8]| part.iter().all(u8::is_ascii_digit);
    let point = cell.iter().position(|b| *b == b'.').unwrap_or(cell.len());
    let (whole, fraction) = cell.split_at(point);
    let one_zero = whole == b"0" || whole.first().is_some_and(|b| *b != b'0');
    let fraction = fraction.get(1..).unwrap_or(b"0");
    cell.len() <= 16 && one_zero && digits(whole) && !fraction.is_empty() && digits(fraction)
}

/// Groups of three digits, the first one shorter at most.
fn is_grouped(whole: &str, mark: char) -> bool {
    let whole = whole.strip_prefix(['-', '+']).unwrap_or(whole);
    let mut groups = whole.split(mark);
    let digits = |g: &str| g.bytes().all(|b| b.is_ascii_digit());
    groups.next().is_some_and(|g| (1..=3).contains(&g.len()) && digits(g)) && groups.all(|g| g.len() == 3 && digits(g))
}

/// How the numbers of a column are written: with how many decimals.
#[derive(Default, Clone, Copy, PartialEq)]
pub(crate) enum Written {
    #[default]
    Nothing,
    Decimals(u8),
    Mixed,
}

impl Written {
    /// Takes one more cell. The number of decimals holds as long as writing each value with it gives the cell's text again.
    pub(crate) fn watch(&mut self, cell: &str, value: f64, scratch: &mut String) {
        if cell.is_empty() || *self == Written::Mixed {
            return;
        }
        let decimals = cell.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        let again = is_plain_decimal(cell) || {
            scratch.clear();
            write!(scratch, "{value:.decimals$}").is_ok() && *scratch == cell
        };
        *self = match (*self, u8::try_from(decimals)) {
            (Written::Nothing, Ok(d)) if again => Written::Decimals(d),
            (Written::Decimals(same), Ok(d)) if again && d == same => Written::Decimals(d),
            _ => Written::Mixed,
        };
    }

    pub(crate) fn decimals(self) -> Option<u8> {
        match self {
            Written::Decimals(d) => Some(d),
            Written::Nothing | Written::Mixed => None,
        }
    }
}
