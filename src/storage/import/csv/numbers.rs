//! The numbers of a table, and how they are written.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::storage::error::CsvProblem;
use crate::storage::import::csv::heading::time_unit;
use crate::storage::import::csv::missing::{missing, says_missing};
use crate::storage::import::kinds::{is_electric, is_unit};
use crate::storage::import::source::Repair;

/// Reads cells, and holds the file to one decimal mark.
pub(crate) struct Numbers {
    separator: char,
    /// Decimal points only, and nothing between the thousands.
    strict: bool,
    /// A mark that stands between thousands, as the columns show.
    thousands: Option<char>,
    mark: Option<char>,
    /// A mark that stood between thousands beside the decimal one.
    seen: Option<char>,
    grouped: usize,
    /// Marks behind numbers, and how often each stands.
    flags: BTreeMap<String, usize>,
    scratch: String,
}

impl Numbers {
    /// Of a plain time series.
    pub(crate) fn strict() -> Numbers {
        Numbers { strict: true, ..Numbers::new(',', None) }
    }

    /// Of a table whose thousands may be separated by a mark that would otherwise be a decimal one.
    pub(crate) fn new(separator: char, thousands: Option<char>) -> Numbers {
        Numbers {
            separator,
            strict: false,
            thousands,
            mark: None,
            seen: None,
            grouped: 0,
            flags: BTreeMap::new(),
            scratch: String::new(),
        }
    }

    /// The number of a cell; NaN where it is empty, [`missing`] where it says that it has none.
    pub(crate) fn read(&mut self, cell: &str, column: &str) -> Result<f64, CsvProblem> {
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let found = self.number(cell, column);
        match found {
            Ok(value) if value.is_finite() => Ok(value),
            _ if !self.strict && says_missing(cell) => Ok(missing()),
            Ok(_) => Err(CsvProblem::NotFinite { column: column.into(), cell: cell.into() }),
            Err(problem) => Err(problem),
        }
    }

    /// [`read`](Self::read) in a column of numbers, where a mark may stand behind one: `10.09H`, `10.1*`.
    pub(crate) fn read_marked(&mut self, cell: &str, column: &str) -> Result<f64, CsvProblem> {
        self.read(cell, column).or_else(|problem| {
            let (number, flag) = flagged(cell).ok_or_else(|| problem.clone())?;
            let value = self.number(number, column).map_err(|_| problem)?;
            *self.flags.entry(flag.to_owned()).or_default() += 1;
            Ok(value)
        })
    }

    fn number(&mut self, cell: &str, column: &str) -> Result<f64, CsvProblem> {
        let no_number = || CsvProblem::NotANumber { column: column.into(), cell: cell.into() };
        if self.strict {
            return cell.parse().map_err(|_| no_number());
        }
        if let Some(rest) = cell.strip_prefix(['+', '-']).filter(|rest| rest.starts_with(' ')) {
            let value = self.number(rest.trim_start(), column)?;
            return Ok(if cell.starts_with('-') { -value } else { value });
        }
        if !cell.is_ascii() || cell.contains(['\'', ' ']) {
            let plain = without_grouping(cell).ok_or_else(no_number)?;
            self.grouped += usize::from(plain.grouped);
            return self.number(&plain.text, column).map_err(|_| no_number());
        }
        let between = self.thousands.or(self.seen.filter(|mark| is_grouped(cell, *mark)));
        let marked = cell.rfind(['.', ',']).filter(|at| between != Some(char::from(cell.as_bytes()[*at])));
        let Some(last) = marked else {
            let Some(mark) = between.filter(|mark| cell.contains(*mark)) else {
                return cell.parse().or_else(|_| fortran(cell)).map_err(|_| no_number());
            };
            self.grouped += 1;
            return if is_grouped(cell, mark) {
                cell.replace(mark, "").parse().map_err(|_| no_number())
            } else {
                Err(no_number())
            };
        };
        let mark = if cell.as_bytes()[last] == b',' { ',' } else { '.' };
        let other = if mark == ',' { '.' } else { ',' };
        let both = cell[..last].contains(other);
        // a comma between columns separated by commas can only have been quoted, and then it is a decimal one
        if *self.mark.get_or_insert(mark) != mark {
            return Err(CsvProblem::TwoDecimalMarks { column: column.into(), cell: cell.into() });
        }
        if mark == '.' && !both {
            return cell.parse().or_else(|_| fortran(cell)).map_err(|_| no_number());
        }
        if both && !is_grouped(&cell[..last], other) {
            return Err(no_number());
        }
        if both {
            (self.grouped, self.seen) = (self.grouped + 1, Some(other));
        }
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
            // where only the size of the numbers shows it, the file does not say so
            repairs.push(Repair {
                guessed: self.thousands.is_some(),
                ..Repair::new("thousands", self.grouped, None, text)
            });
        }
        let listed: Vec<String> = self.flags.iter().map(|(flag, count)| format!("'{flag}' {count} ×")).collect();
        if !listed.is_empty() {
            let count = self.flags.values().sum();
            let text = format!("marks stand behind numbers ({}), which hold as they are", listed.join(", "));
            repairs.push(Repair { guessed: true, ..Repair::new("marks", count, None, text) });
        }
        repairs
    }
}

/// Letters behind a number that are a part of it, or a factor.
const NO_FLAGS: &str = "eEdDxXkKMGTmunpf";

/// A number and the mark behind it: a letter that is no unit, or up to three signs.
fn flagged(cell: &str) -> Option<(&str, &str)> {
    let at = cell.rfind(|c: char| c.is_ascii_digit())? + 1;
    let (number, flag) = (&cell[..at], cell[at..].trim());
    let is_letter = flag.len() == 1 && flag.chars().all(|c| c.is_ascii_alphabetic()) && !NO_FLAGS.contains(flag);
    let is_unit = is_electric(flag) || is_unit("", flag) || (flag == flag.to_lowercase() && time_unit(flag).is_some());
    let is_sign = (1..=3).contains(&flag.len()) && flag.chars().all(|c| "*#!?~^&$".contains(c));
    ((is_letter && !is_unit) || is_sign).then_some((number, flag))
}

/// Fortran writes `2.80D+00`.
fn fortran(cell: &str) -> Result<f64, std::num::ParseFloatError> {
    cell.replacen(['D', 'd'], "e", 1).parse()
}

/// A number in plain characters.
struct Plain {
    text: String,
    grouped: bool,
}

/// The minus sign U+2212 becomes a hyphen; apostrophes and blanks between groups of three digits vanish. None where
/// they stand elsewhere.
fn without_grouping(cell: &str) -> Option<Plain> {
    let signed = cell.replace('\u{2212}', "-");
    let is_gap = |c: char| matches!(c, '\'' | '\u{2019}' | ' ' | '\u{a0}' | '\u{2009}' | '\u{202f}');
    let whole = signed.find(['.', ',', 'e', 'E']).unwrap_or(signed.len());
    let (whole, rest) = signed.split_at(whole);
    let grouped = whole.contains(is_gap);
    let text = whole.replace(is_gap, "_") + rest;
    if !text.is_ascii() || text == cell || (grouped && !is_grouped(&text[..text.len() - rest.len()], '_')) {
        return None;
    }
    Some(Plain { text: text.replace('_', ""), grouped })
}

/// The mark between the thousands of a column that looks like a decimal one: behind it stand three digits wherever it
/// stands, and the numbers that lack it are mostly larger than all with it, as 998 is larger than 1.002; or the numbers
/// rise, one with another, if it stands between thousands, and not if it is a decimal one.
pub(crate) fn thousands<'c>(cells: impl Iterator<Item = &'c str>) -> Option<char> {
    let (mut marked, mut plain, mut mark, mut whole) = (Vec::new(), Vec::new(), None, Vec::new());
    for cell in cells {
        let digits = cell.trim_start_matches(['+', '-']);
        match digits.find(['.', ',']) {
            Some(at) => {
                let own = char::from(digits.as_bytes()[at]);
                if *mark.get_or_insert(own) != own || digits.starts_with('0') || !is_grouped(digits, own) {
                    return None;
                }
                marked.push(digits.replace(own, ".").parse::<f64>().ok()?);
                whole.push(1e3 * marked[marked.len() - 1]);
            }
            None if digits.is_empty() => {}
            None => {
                plain.push(digits.parse::<f64>().ok().filter(|_| digits.len() <= 3)?);
                whole.push(plain[plain.len() - 1]);
            }
        }
    }
    let rises = whole.len() > ENOUGH && whole.windows(2).all(|w| w[1] > w[0]);
    if rises && !marked.is_empty() && !plain.is_empty() {
        return mark;
    }
    let most = marked.iter().copied().reduce(f64::max)?;
    plain.retain(|v| *v != 0.0);
    // what is written without decimals now and then lies among the rest
    let outside = plain.iter().filter(|v| **v > 2.0 * most).count();
    mark.filter(|_| 2 * outside > plain.len())
}

/// Numbers from which a column shows that it rises.
const ENOUGH: usize = 10;

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
    /// Takes one more cell. The number of decimals holds as long as writing each value with it gives the cell's text
    /// again.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_many_countries() {
        let read = |cells: &[&str]| {
            let mut numbers = Numbers::new(';', None);
            cells.iter().map(|c| numbers.read(c, "P1").unwrap_or(f64::NAN)).collect::<Vec<_>>()
        };
        assert_eq!(read(&["\u{2212}1.5", "+2.25", "1e-3", "- 1.5", "2.5D-03"]), [-1.5, 2.25, 1e-3, -1.5, 2.5e-3]);
        assert_eq!(read(&["2'802.5", "2\u{2019}802.5", "-12'345'678"]), [2802.5, 2802.5, -12345678.0]);
        assert_eq!(read(&["2 802,5", "2\u{a0}802,5", "2\u{202f}802"]), [2802.5, 2802.5, 2802.0]);
        assert_eq!(read(&["1.200,25", "120,5"]), [1200.25, 120.5]);
        assert!(read(&["1 2", "12 34", "1'2"]).iter().all(|v| v.is_nan()), "groups of three only");
    }

    #[test]
    fn a_mark_of_thousands_is_told_from_a_decimal_one_by_the_numbers_without_it() {
        let of = |cells: &[&str]| thousands(cells.iter().copied());
        assert_eq!(of(&["2.802", "2.802", "998", "1.003"]), Some('.'));
        assert_eq!(of(&["2,802", "998"]), Some(','));
        for decimal in [
            &["2.802", "3", "2.998"][..],
            &["2.802", "2.95"],
            &["2.802", "1.003"],
            &["998", "1003"],
            &["0.001", "0", "0.002"],
            &["0.125", "3"],
        ] {
            assert_eq!(of(decimal), None, "{decimal:?}");
        }
        let mut numbers = Numbers::new(';', Some('.'));
        assert_eq!(numbers.read("2.802", "").unwrap(), 2802.0);
        assert_eq!(numbers.read("1.002,5", "").unwrap(), 1002.5);
        assert!(numbers.repairs().iter().any(|r| r.what == "thousands" && r.guessed));
    }

    #[test]
    fn a_mark_behind_a_number_is_none_of_its_digits_and_no_unit() {
        let mut numbers = Numbers::new(',', None);
        let mut read = |cell| numbers.read_marked(cell, "P1").ok();
        assert_eq!(
            (read("10.09H"), read("10.1*"), read("-3.5 L"), read("7")),
            (Some(10.09), Some(10.1), Some(-3.5), Some(7.0))
        );
        for cell in ["1.2k", "10.0V", "1.5e", "12 bar", "7C", "H10", "1.2.3", "5HH"] {
            assert_eq!(read(cell), None, "{cell}");
        }
        let said = numbers.repairs();
        assert!(
            said.iter().any(|r| r.guessed && r.count == 3 && r.text.contains("'*' 1 ×, 'H' 1 ×, 'L' 1 ×")),
            "{said:?}"
        );
    }
}
