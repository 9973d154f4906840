//! What programs write where there is no value: words, and numbers that stand for none.

use std::collections::BTreeMap;

use crate::storage::import::source::{Repair, counted};

/// A cell that says that its value is missing: unlike an empty one, a sample was due there. It is a NaN of its own.
const MISSING: u64 = f64::NAN.to_bits() | 0x5eed;

/// Words for no value, in lower case, without signs and blanks.
const WORDS: [&str; 58] = [
    "nan",
    "nan(ind)",
    "1.#qnan",
    "1.#ind",
    "1.#inf",
    "na",
    "n/a",
    "n/v",
    "nv",
    "nat",
    "null",
    "none",
    "nil",
    "ol",
    "o.l",
    "ovl",
    "ovld",
    "ovrng",
    "over",
    "under",
    "overload",
    "overrange",
    "overflow",
    "underrange",
    "underflow",
    "outofrange",
    "lo",
    "hi",
    "open",
    "burnout",
    "nodata",
    "invalid",
    "bad",
    "error",
    "err",
    "inf",
    "infinity",
    "missing",
    "fehlt",
    "н/д",
    "无",
    "欠測",
    "nd",
    "ofl",
    "ovf",
    "low",
    "high",
    "stale",
    "timeout",
    "short",
    "badinput",
    "i/otimeout",
    "ptcreated",
    "commfail",
    "scanoff",
    "configure",
    "notconnect",
    "shutdown",
];

/// Numbers that loggers write for no value: Campbell's, and the ends of a converter's range.
const NUMBERS: [f64; 8] = [-7999.0, 7999.0, 6999.0, 32767.0, -32768.0, 65535.0, 6553.5, 655.35];
/// Instruments write 9.9E+37 (SCPI), or the largest number of four bytes.
const ABOVE_ALL: f64 = 1e30;
/// A number is far outside of the rest where it lies so many times their spread, and so many times their size, away from them.
const FAR: f64 = 10.0;
/// Values from which the spread of the rest is known.
const ENOUGH: usize = 20;

/// The value of a cell that says it has none.
pub(crate) fn missing() -> f64 {
    f64::from_bits(MISSING)
}

/// True for the value of such a cell, false for an empty one's.
pub(crate) fn is_missing(value: f64) -> bool {
    value.to_bits() == MISSING
}

/// Whether a cell says that its value is missing; an empty cell says nothing.
pub(crate) fn says_missing(cell: &str) -> bool {
    let first = cell.bytes().next();
    let may = first.is_some_and(|b| b.is_ascii_alphabetic() || b"-+*#<([1.?_=".contains(&b) || !b.is_ascii());
    may && (is_filler(cell) || is_spreadsheet_error(cell) || is_word(cell))
}

fn is_word(cell: &str) -> bool {
    let bare = cell.trim_start_matches(['+', '-', '#']);
    let inner = bare.strip_prefix(['<', '(', '[']).and_then(|rest| rest.strip_suffix(['>', ')', ']']));
    let bare: String = inner.unwrap_or(bare).chars().filter(|c| *c != ' ').collect::<String>().to_lowercase();
    bare == "∞" || WORDS.contains(&bare.as_str())
}

/// `#VALUE!`, `#DIV/0!`, `#NAME?`.
fn is_spreadsheet_error(cell: &str) -> bool {
    cell.starts_with('#') && cell.len() > 2 && cell.ends_with(['!', '?'])
}

/// `---`, `+++++`, `****`, `?`: signs and nothing else.
fn is_filler(cell: &str) -> bool {
    cell.bytes().all(|b| b"-+*#?_=".contains(&b))
}

/// Cells without a value, by their spelling: how many, and the line of the first.
#[derive(Debug, Default)]
pub(crate) struct Spellings(BTreeMap<String, (usize, usize)>);

impl Spellings {
    /// Counts one more.
    pub(crate) fn count(&mut self, spelling: &str, line: usize) {
        match self.0.get_mut(spelling) {
            Some((count, _)) => *count += 1,
            None => {
                self.0.insert(spelling.to_owned(), (1, line));
            }
        }
    }

    /// Lists them: what they stand for is gone, and gaps stand in their places.
    pub(crate) fn repair(&self) -> Option<Repair> {
        let count = self.0.values().map(|(count, _)| count).sum();
        let line = self.0.values().map(|(_, line)| *line).min()?;
        let listed: Vec<String> =
            self.0.iter().map(|(spelling, (count, _))| format!("'{spelling}' {count} ×")).collect();
        let text = counted(count, "value is missing", "values are missing")
            + &format!(" ({}): recorded as gaps", listed.join(", "));
        Some(Repair { lost: true, ..Repair::new("missing-values", count, Some(line), text) })
    }
}

/// Takes the numbers that stand for no value out of a column. A number does where it lies far outside of all others and is one that loggers use so, or
/// comes again to the last digit.
pub(crate) fn take_sentinels(values: &mut [f64], lines: &[usize], spellings: &mut Spellings) {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan() && !is_known(*v)).collect();
    sorted.sort_by(f64::total_cmp);
    // a value that stands for none is the least or the largest, however often it comes: the spread is that of the others
    let ends = [sorted.first(), sorted.last()].map(|end| end.copied().unwrap_or(f64::NAN));
    let all = sorted.len();
    if all >= ENOUGH {
        sorted.retain(|v| !ends.contains(v));
    }
    let Some(last) = sorted.len().checked_sub(1) else { return };
    // The middle nine tenths, in which no few strays count.
    let (low, high) = (sorted[last / 20], sorted[last - last / 20]);
    let (spread, size) = (high - low, low.abs().max(high.abs()));
    // what loggers are known to write needs only be outside of the rest
    let known_reach = spread.max(0.1 * size);
    let is_known_stray = |v: f64| is_known(v) && (v < low - known_reach || v > high + known_reach);
    // a clipped peak has others near it, and of two levels each lasts
    let reach = FAR * spread.max(size);
    let comes_again = |end: f64| {
        let count = values.iter().filter(|v| **v == end).count();
        let alone = sorted.iter().chain(&ends).all(|v| *v == end || (v - end).abs() > reach);
        count > 1 && 20 * count <= all && alone
    };
    let strays: Vec<f64> = match spread > 0.0 && all >= ENOUGH {
        true => ends.into_iter().filter(|end| comes_again(*end)).collect(),
        false => Vec::new(),
    };
    for (value, line) in values.iter_mut().zip(lines) {
        if is_known_stray(*value) || strays.contains(value) {
            spellings.count(&shown(*value), *line);
            *value = missing();
        }
    }
}

/// Nines, the ends of a range, or more than anything measures.
fn is_known(value: f64) -> bool {
    let digits: String = value.abs().to_string().chars().filter(|c| *c != '.').collect();
    let nines = digits.trim_end_matches('0');
    let is_nines = nines.len() >= 3 && nines.bytes().all(|b| b == b'9') && value.abs() >= 99.0;
    is_nines || value.abs() >= ABOVE_ALL || NUMBERS.contains(&value)
}

fn shown(value: f64) -> String {
    if value.abs() >= 1e9 { format!("{value:e}") } else { value.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_for_no_value_are_no_numbers_and_numbers_are() {
        for word in [
            "NaN",
            "NAN",
            "-nan(ind)",
            "---",
            "#N/A",
            "OL",
            "inf",
            "∞",
            "+++++",
            "*****",
            "No Data",
            "?",
            "-1.#INF",
            "+OVER",
            "(null)",
            "<NA>",
            "-nan(ind)",
            "#VALUE!",
            "#DIV/0!",
            "Over Range",
            "OVLD",
        ] {
            assert!(says_missing(word), "{word}");
        }
        for word in ["", "1", "-1.5", "+2", "P1", "remark", "-9999", "1e5", "."] {
            assert!(!says_missing(word), "{word}");
        }
        assert!(is_missing(missing()) && !is_missing(f64::NAN) && missing().is_nan());
    }

    /// A pressure of some bar with `strays` in it.
    fn column(strays: &[(usize, f64)]) -> (Vec<f64>, String) {
        let mut values: Vec<f64> = (0..100).map(|i| 2.8 + 0.5 * f64::from(i).sin()).collect();
        strays.iter().for_each(|(at, v)| values[*at] = *v);
        let mut spellings = Spellings::default();
        take_sentinels(&mut values, &(1..=100).collect::<Vec<_>>(), &mut spellings);
        (values, spellings.repair().map_or(String::new(), |r| r.text))
    }

    #[test]
    fn a_number_stands_for_none_where_it_is_far_outside_and_known_or_comes_again() {
        for (stray, spelling) in
            [(-9999.0, "'-9999' 1 ×"), (9.9e37, "'9.9e37' 1 ×"), (-999.9, "'-999.9' 1 ×"), (7999.0, "'7999' 1 ×")]
        {
            let (values, said) = column(&[(4, stray)]);
            assert!(is_missing(values[4]) && said.contains(spelling), "{said}");
            assert_eq!(values.iter().filter(|v| v.is_nan()).count(), 1);
        }
        let (values, said) = column(&[(4, -500.25), (70, -500.25)]);
        assert!(is_missing(values[4]) && is_missing(values[70]) && said.contains("'-500.25' 2 ×"), "{said}");
        let mut few = [2.8, 2.9, -9999.0, 2.8];
        let mut spellings = Spellings::default();
        take_sentinels(&mut few, &[1, 2, 3, 4], &mut spellings);
        assert!(is_missing(few[2]) && few[3] == 2.8);
        // a block of them on end, at the beginning, within or at the end
        for from in [0, 50, 95] {
            let block: Vec<(usize, f64)> = (from..from + 5).map(|at| (at, -1234.5)).collect();
            let (values, said) = column(&block);
            assert!(values[from..from + 5].iter().all(|v| is_missing(*v)) && said.contains("5 ×"), "{said}");
        }
        // a sensor that shows no more than 100 has others near it
        let clipped: Vec<(usize, f64)> = [(40, 60.0), (41, 100.0), (42, 100.0), (43, 71.0)].to_vec();
        assert_eq!(column(&clipped).1, "");
        // a peak is a peak, also a high one, and so is a value that comes again near the rest
        assert_eq!(column(&[(4, 123.0)]).1, "");
        assert_eq!(column(&[(4, 9.99), (70, 9.99)]).1, "");
        // pulses of a trigger, a flow that stops
        let mut pulses = [0.0; 100];
        (pulses[50], pulses[51]) = (5.0, 5.0);
        let mut spellings = Spellings::default();
        take_sentinels(&mut pulses, &[1; 100], &mut spellings);
        assert!(spellings.repair().is_none());
    }
}
