//! What programs write where there is no value, in words.

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
}
