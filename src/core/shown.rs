//! Text from outside as it may be printed: names, notes and paths that control a terminal, or look like a line of the
//! program, do not.

pub mod options;

use std::borrow::Cow;
use std::path::Path;

/// How a text or a path is shown.
pub trait Shown {
    /// With its control characters, and those that turn the direction of text, written out (`\n`, `\u{1b}`).
    fn shown(&self) -> Cow<'_, str>;
}

impl Shown for str {
    fn shown(&self) -> Cow<'_, str> {
        if !self.chars().any(controls) {
            return Cow::Borrowed(self);
        }
        Cow::Owned(self.chars().map(|c| if controls(c) { c.escape_default().to_string() } else { c.into() }).collect())
    }
}

impl Shown for Path {
    fn shown(&self) -> Cow<'_, str> {
        Cow::Owned(self.to_string_lossy().shown().into_owned())
    }
}

/// A text as a cell of a CSV table: a spreadsheet runs what begins like a formula, so that gets an apostrophe. Numbers
/// stay.
pub fn cell(text: &str) -> Cow<'_, str> {
    let formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text.parse::<f64>().is_err();
    if formula { Cow::Owned(format!("'{text}")) } else { Cow::Borrowed(text) }
}

/// A number without digits that say nothing: 1e300, not three hundred of them.
pub fn number(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-5..1e15).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

/// True for a character that controls a terminal or turns the direction of the text after it.
pub fn controls(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_controls_a_terminal_is_written_out() {
        assert_eq!("P1 Größe 水锤".shown(), "P1 Größe 水锤");
        assert_eq!(
            "a\nverdict: nothing missing\u{1b}[2J\u{7}\u{202e}".shown(),
            "a\\nverdict: nothing missing\\u{1b}[2J\\u{7}\\u{202e}"
        );
        assert_eq!((cell("=1+1"), cell("-1.5e3"), cell("P1")), ("'=1+1".into(), "-1.5e3".into(), "P1".into()));
        assert_eq!((number(1e300), number(0.25), number(-3e-9)), ("1e300".into(), "0.25".into(), "-3e-9".into()));
        assert_eq!(Path::new("a\rb.mcap").shown(), "a\\rb.mcap");
    }
}
