//! Lines for standard output and standard error.

use std::borrow::Cow;
use std::io::Write as _;
use std::sync::{Mutex, PoisonError};

use crate::shown::controls;
use crate::shown::options::reworded;

/// A line on standard output. Where nobody reads it any more (`| head`) that is no error: `println!` would panic.
macro_rules! say {
    ($($arg:tt)*) => { $crate::cli::console::print::write_out(format_args!("{}\n", format_args!($($arg)*)))? };
}
/// Text on standard output as it stands, likewise.
macro_rules! say_text {
    ($text:expr) => {
        $crate::cli::console::print::write_out(format_args!("{}", $text))?
    };
}
/// A line on standard error: progress, notes, warnings. Where nobody reads it any more, or its disk is full, the work
/// goes on and the exit code stays: `eprintln!` would panic.
macro_rules! tell {
    ($($arg:tt)*) => { $crate::cli::console::print::write_err(format_args!($($arg)*)) };
}
/// A warning: a line on standard error, and an entry of the `warnings` in the next JSON document.
macro_rules! tell_warning {
    ($($arg:tt)*) => { $crate::cli::console::print::write_warning(&format!($($arg)*)) };
}
pub(crate) use {say, say_text, tell, tell_warning};

/// Warnings that no document has told yet.
static WARNINGS: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Writes a warning, and keeps it for the next document.
pub(crate) fn write_warning(text: &str) {
    tell!("warning: {text}");
    WARNINGS.lock().unwrap_or_else(PoisonError::into_inner).push(with_flags(text).into_owned());
}

/// The warnings since the last time that they were taken.
pub(crate) fn take_warnings() -> Vec<String> {
    std::mem::take(&mut WARNINGS.lock().unwrap_or_else(PoisonError::into_inner))
}

/// The text with the options that the library names (option `date_order dmy`) as flags of the command line
/// (`--date-order dmy`).
pub(crate) fn with_flags(text: &str) -> Cow<'_, str> {
    reworded(text, |option| {
        let value = option.value.map_or(String::new(), |value| format!(" {value}"));
        format!("--{}{value}", option.name.replace('_', "-"))
    })
}

/// Text whose lines are the program's own and in which nothing else controls a terminal: everything printed passes
/// here. Names and paths show line breaks as `\n` before they come here ([`Shown`](crate::shown::Shown)). Written as
/// JSON does, in JSON as well.
pub(crate) fn harmless(text: &str) -> Cow<'_, str> {
    let is_harmful = |c: char| controls(c) && c != '\n' && c != '\t';
    if !text.contains(is_harmful) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(
        text.chars().map(|c| if is_harmful(c) { format!("\\u{:04x}", u32::from(c)) } else { c.into() }).collect(),
    )
}

/// Writes to standard output; a closed pipe is not an error, nor is a terminal that has hung up.
pub(crate) fn write_out(text: std::fmt::Arguments) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(harmless(&with_flags(&text.to_string())).as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        #[cfg(unix)]
        Err(error) if error.raw_os_error() == Some(nix::errno::Errno::EIO as i32) => Ok(()),
        other => other,
    }
}

/// Writes a line to standard error, whatever has become of it.
pub(crate) fn write_err(line: std::fmt::Arguments) {
    // in one piece, so that lines of two threads do not mix
    let _ = std::io::stderr().lock().write_all(harmless(&with_flags(&format!("{line}\n"))).as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_printed_controls_a_terminal() {
        assert_eq!(harmless("a\tb\nc"), "a\tb\nc");
        assert_eq!(harmless("{\"a\": \"\u{7f}\u{202e}\"}\u{1b}[2J"), "{\"a\": \"\\u007f\\u202e\"}\\u001b[2J");
    }

    #[test]
    fn options_of_the_library_are_flags_on_the_command_line() {
        let said = "an option `2` is none; add option `date_order dmy` or option `map 'A=P1'`, with option `time-unit`";
        assert_eq!(with_flags(said), "an option `2` is none; add --date-order dmy or --map 'A=P1', with --time-unit");
    }
}
