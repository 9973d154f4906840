//! Reads tables of a rig file key by key. All faults are collected, each with its line, so that a user sees them at
//! once.

use std::cell::RefCell;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::rig::error::Problem;
use crate::shown::{Shown as _, cell, controls};

/// Characters of the longest text: names stand in columns.
const LONGEST_TEXT: usize = 200;

/// The file's text and the problems found in it so far.
pub(crate) struct Source<'a> {
    pub text: &'a str,
    /// Where each problem is and what it is.
    problems: RefCell<Vec<(Option<usize>, String)>>,
    /// It stands in a recording: what was allowed when that was made is allowed.
    stored: bool,
}

impl<'a> Source<'a> {
    pub fn new(text: &'a str) -> Self {
        Source { text, problems: RefCell::default(), stored: false }
    }

    /// The text of a rig file that is stored in a recording.
    pub fn stored(text: &'a str) -> Self {
        Source { stored: true, ..Source::new(text) }
    }

    /// Reports a problem at a place in the text, or in the file as a whole.
    pub fn report(&self, place: Option<Range<usize>>, message: impl Into<String>) {
        self.problems.borrow_mut().push((place.map(|p| p.start), message.into().shown().into_owned()));
    }

    /// All problems, in the order of the lines; those of the whole file last.
    pub fn into_problems(self) -> Vec<Problem> {
        let mut found = self.problems.into_inner();
        found.sort_by_key(|(place, _)| place.unwrap_or(usize::MAX));
        // the line is counted on from one problem to the next: a file of two megabytes may have a million
        let (mut line, mut counted) = (1, 0);
        let mut problems: Vec<Problem> = Vec::new();
        for (place, message) in found {
            let Some(place) = place.map(|place| self.text.floor_char_boundary(place)) else {
                problems.push(Problem { line: None, message, source_line: String::new() });
                continue;
            };
            line += self.text[counted..place].matches('\n').count();
            counted = place;
            let begin = self.text[..place].rfind('\n').map_or(0, |at| at + 1);
            let source_line = self.text[begin..].lines().next().unwrap_or_default().trim_end();
            // one so long says no more
            let source_line = source_line.chars().take(LONGEST_TEXT).collect();
            problems.push(Problem { line: Some(line), message, source_line });
        }
        problems.sort_by_key(|p| p.line.unwrap_or(usize::MAX));
        problems.dedup();
        problems
    }

    pub fn is_clean(&self) -> bool {
        self.problems.borrow().is_empty()
    }
}

/// Names less similar than this (Jaro-Winkler) are not slips of one another.
const ALIKE: f64 = 0.75;

/// The name in `known` that is most similar to `name`, if one is similar enough.
pub(crate) fn nearest<'k>(name: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    let lower = name.to_lowercase();
    let likeness = |k: &str| strsim::jaro_winkler(&lower, &k.to_lowercase());
    let alike = known.into_iter().map(|k| (likeness(k), k)).filter(|(l, _)| *l >= ALIKE);
    alike.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| k)
}

/// Permissible values of a number.
pub(crate) struct Limits {
    pub holds: fn(f64) -> bool,
    pub words: &'static str,
}

/// No number of a rig is larger in its unit, nor a positive one smaller than its inverse: what is, is a slip, and would
/// overflow somewhere.
const LARGEST: f64 = 1e9;

pub(crate) const FINITE: Limits = Limits { holds: |v| v.abs() <= LARGEST, words: "a finite number within 1e9" };
pub(crate) const POSITIVE: Limits =
    Limits { holds: |v| (1.0 / LARGEST..=LARGEST).contains(&v), words: "a number above 0 and within 1e9" };
pub(crate) const NOT_NEGATIVE: Limits =
    Limits { holds: |v| (0.0..=LARGEST).contains(&v), words: "a number of at least 0 and within 1e9" };
pub(crate) const NOT_ZERO: Limits = Limits { holds: |v| v != 0.0, words: "a number other than 0" };

/// A value and its place in the file.
#[derive(Debug, Clone)]
pub(crate) struct At<T> {
    pub value: T,
    pub place: Range<usize>,
}

/// One table of the file. A getter returns `None` if the key is absent or faulty, and reports a fault at once.
pub(crate) struct Section<'a> {
    source: &'a Source<'a>,
    /// As written in the file, e.g. `[[pipe]]`.
    heading: &'static str,
    table: &'a DeTable<'a>,
    place: Range<usize>,
    keys: &'static [&'static str],
    /// Known keys that an unknown one probably means; these are not reported as missing as well.
    misspelt: Vec<&'static str>,
}

impl<'a> Section<'a> {
    /// Opens a table and reports every key that is not among `keys`; `others` are the keys of other tables, for hints.
    pub fn open(
        source: &'a Source<'a>,
        heading: &'static str,
        table: &'a DeTable<'a>,
        place: Range<usize>,
        keys: &'static [&'static str],
        others: &[(&'static str, &'static [&'static str])],
    ) -> Self {
        let mut misspelt = Vec::new();
        for key in table.keys() {
            let name: &str = key.get_ref();
            if keys.contains(&name) {
                continue;
            }
            let hint = match others.iter().find(|(_, keys)| keys.contains(&name)) {
                Some((home, _)) => format!("it belongs in {home}"),
                None => match nearest(name, keys.iter().copied()) {
                    Some(near) => {
                        misspelt.push(near);
                        format!("did you mean '{near}'?")
                    }
                    None => format!("known are {}", keys.join(", ")),
                },
            };
            source.report(Some(key.span()), format!("unknown key '{name}' in {heading}; {hint}"));
        }
        Section { source, heading, table, place, keys, misspelt }
    }

    /// Reports a fault of the table as a whole, at its heading.
    pub fn fault(&self, message: impl Into<String>) {
        self.source.report(Some(self.place.clone()), message);
    }

    /// Reports a fault of one key.
    pub fn fault_at(&self, place: &Range<usize>, message: impl Into<String>) {
        self.source.report(Some(place.clone()), message);
    }

    fn get(&self, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        debug_assert!(self.keys.contains(&key), "'{key}' is not listed among the keys of {}", self.heading);
        self.table.get(key)
    }

    /// Reports `key` as missing if the file does not have it; returns `found`.
    pub fn required<T>(&self, key: &str, words: &str, found: Option<T>) -> Option<T> {
        if found.is_none() && self.get(key).is_none() && !self.misspelt.contains(&key) {
            self.fault(format!("missing key '{key}' in {}; it is {words}", self.heading));
        }
        found
    }

    fn wrong(&self, key: &str, value: &Spanned<DeValue<'_>>, words: &str) {
        let written = self.source.text.get(value.span()).unwrap_or_default();
        let short = written.chars().count() <= LONGEST_TEXT && !written.contains('\n');
        let written = if short { written } else { value.get_ref().type_str() };
        self.fault_at(&value.span(), format!("'{key}' in {} must be {words}, not {written}", self.heading));
    }

    /// The place of a key's value, if it is there.
    pub fn place_of(&self, key: &str) -> Option<Range<usize>> {
        self.get(key).map(Spanned::span)
    }

    /// An optional number within limits.
    pub fn number(&self, key: &str, limits: &Limits) -> Option<f64> {
        let value = self.get(key)?;
        let stored = self.source.stored;
        let sized = |v: f64| if stored && v != 0.0 { v.signum() * v.abs().clamp(1.0 / LARGEST, LARGEST) } else { v };
        let number = as_f64(value.get_ref()).filter(|v| v.is_finite() && (limits.holds)(sized(*v)));
        if number.is_none() {
            self.wrong(key, value, limits.words);
        }
        number
    }

    /// A number that is required.
    pub fn required_number(&self, key: &str, limits: &Limits) -> Option<f64> {
        self.required(key, limits.words, self.number(key, limits))
    }

    /// An optional whole number within `lo..=hi`.
    pub fn integer(&self, key: &str, lo: u64, hi: u64) -> Option<u64> {
        let value = self.get(key)?;
        let number = as_u64(value.get_ref()).filter(|v| (lo..=hi).contains(v));
        if number.is_none() {
            self.wrong(key, value, &format!("a whole number from {lo} to {hi}"));
        }
        number
    }

    /// An optional text that is not blank, and that tables, terminals and spreadsheets can show as it is.
    pub fn text(&self, key: &str) -> Option<At<&'a str>> {
        let value = self.get(key)?;
        let text = value.get_ref().as_str().filter(|t| !t.trim().is_empty());
        let wrong = match text {
            None => "a text in quotes that is not empty",
            Some(text) if self.source.stored => return Some(At { value: text, place: value.span() }),
            Some(text) if text.chars().count() > LONGEST_TEXT => "a text of at most 200 characters",
            Some(text) if text.chars().any(controls) => "a text without control characters",
            Some(text) if cell(text) != text => "a text that does not begin with =, +, - or @",
            Some(text) => return Some(At { value: text, place: value.span() }),
        };
        self.wrong(key, value, wrong);
        None
    }

    /// A text that is required.
    pub fn required_text(&self, key: &str, words: &str) -> Option<At<&'a str>> {
        self.required(key, words, self.text(key))
    }

    /// An optional word from a list.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Option<At<T>> {
        let text = self.text(key)?;
        let found = choices.iter().find(|(name, _)| *name == text.value);
        if found.is_none() {
            let near = nearest(text.value, choices.iter().map(|c| c.0)).filter(|_| choices.len() > 1);
            let message = format!("'{key}' in {} must be {}, not \"{}\"", self.heading, one_of(choices), text.value);
            let hint = near.map(|near| format!("; did you mean \"{near}\"?")).unwrap_or_default();
            self.fault_at(&text.place, message + &hint);
        }
        found.map(|(_, value)| At { value: *value, place: text.place })
    }

    /// A word from a list that is required.
    pub fn required_choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Option<At<T>> {
        self.required(key, &one_of(choices), self.choice(key, choices))
    }

    /// An optional pair `[lo, hi]` with lo < hi.
    pub fn interval(&self, key: &str) -> Option<[f64; 2]> {
        let value = self.get(key)?;
        match numbers(value.get_ref()).as_deref() {
            Some(&[lo, hi]) if lo < hi => Some([lo, hi]),
            _ => {
                self.wrong(key, value, "two finite numbers [lo, hi] with lo below hi");
                None
            }
        }
    }

    /// An optional pair of numbers.
    pub fn pair(&self, key: &str) -> Option<[f64; 2]> {
        let value = self.get(key)?;
        let pair = numbers(value.get_ref()).and_then(|v| <[f64; 2]>::try_from(v).ok());
        if pair.is_none() {
            self.wrong(key, value, "two finite numbers");
        }
        pair
    }

    /// An optional list of pairs of numbers, at least one.
    pub fn points(&self, key: &str, words: &str) -> Option<Vec<(f64, f64)>> {
        let value = self.get(key)?;
        let pair = |v: &Spanned<DeValue<'_>>| match numbers(v.get_ref()).as_deref() {
            Some(&[a, b]) => Some((a, b)),
            _ => None,
        };
        let all: Option<Vec<(f64, f64)>> = value.get_ref().as_array().and_then(|a| a.iter().map(pair).collect());
        let found = all.filter(|points| !points.is_empty());
        if found.is_none() {
            self.wrong(key, value, words);
        }
        found
    }

    /// Whether the value of this key is a number (for keys that take a number or a list).
    pub fn is_number(&self, key: &str) -> bool {
        self.get(key).is_some_and(|value| as_f64(value.get_ref()).is_some())
    }

    /// An optional list of texts, at least one, each of which a terminal can show.
    pub fn words(&self, key: &str, words: &str) -> Option<Vec<String>> {
        let value = self.get(key)?;
        let shows = |text: &str| !text.chars().any(controls);
        let text = |item: &Spanned<DeValue<'_>>| item.get_ref().as_str().filter(|text| shows(text)).map(str::to_owned);
        let found: Option<Vec<String>> = value.get_ref().as_array().and_then(|all| all.iter().map(text).collect());
        let found = found.filter(|all| !all.is_empty());
        if found.is_none() {
            self.wrong(key, value, words);
        }
        found
    }

    /// The text of a key, whatever it is; reports nothing.
    pub fn peek_text(&self, key: &str) -> Option<&'a str> {
        self.get(key)?.get_ref().as_str()
    }

    /// Whether the value of this key is a text (for keys that take a word or a number).
    pub fn is_text(&self, key: &str) -> bool {
        self.peek_text(key).is_some()
    }
}

/// Percentages of what is not exactly known.
const SHARE: Limits = Limits { holds: |v| (0.0..=50.0).contains(&v), words: "a percentage from 0 to 50" };

/// A percentage as a share.
pub(crate) fn share(section: &Section<'_>, key: &str) -> Option<f64> {
    section.number(key, &SHARE).map(|percent| percent / 100.0)
}

fn one_of<T>(choices: &[(&str, T)]) -> String {
    choices.iter().map(|(name, _)| format!("\"{name}\"")).collect::<Vec<_>>().join(" or ")
}

/// A list of finite numbers.
fn numbers(value: &DeValue<'_>) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(|v| as_f64(v.get_ref()).filter(|v| v.is_finite())).collect()
}

fn as_f64(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(number) => number.as_str().parse().ok(),
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok().map(|v| v as f64),
        _ => None,
    }
}

fn as_u64(value: &DeValue<'_>) -> Option<u64> {
    let number = value.as_integer()?;
    u64::from_str_radix(number.as_str(), number.radix()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn problems_stand_in_the_order_of_their_lines_with_the_lines() {
        let source = Source::new("a = 1\nb = 2\n\nc = 3");
        [(Some(13..14), "third"), (None, "whole"), (Some(4..5), "first"), (Some(6..7), "second")]
            .into_iter()
            .for_each(|(place, message)| source.report(place, message));
        let problems = source.into_problems();
        let seen: Vec<_> = problems.iter().map(|p| (p.line, p.message.as_str(), p.source_line.as_str())).collect();
        let expected = [
            (Some(1), "first", "a = 1"),
            (Some(2), "second", "b = 2"),
            (Some(4), "third", "c = 3"),
            (None, "whole", ""),
        ];
        assert_eq!(seen, expected);
    }
}
