//! Bytes become text: UTF-8, UTF-16 with its mark, and Latin-1 where only comments and headings need it.

use std::borrow::Cow;

use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::source::Repair;

/// A longer line is none of a table, bytes.
const LONGEST_LINE: usize = 16 << 20;

/// Refuses a line so long that reading it as a row would take all memory.
pub(crate) fn check_lines(bytes: &[u8]) -> Result<(), CsvFault> {
    let mut at = 0;
    while bytes.len() - at > LONGEST_LINE {
        let end = bytes[at..at + LONGEST_LINE].iter().rposition(|b| matches!(b, b'\n' | b'\r'));
        let Some(end) = end else {
            return Err((None, Box::new(CsvProblem::LongLine { mebibytes: LONGEST_LINE >> 20 })));
        };
        at += end + 1;
    }
    Ok(())
}

/// The text of a file, without a byte-order mark, its lines ended by line feeds.
pub(crate) fn decode<'b>(bytes: &'b [u8], repairs: &mut Vec<Repair>) -> Result<Cow<'b, str>, CsvFault> {
    let text = characters(bytes, repairs)?;
    if text.contains('\n') || !text.contains('\r') {
        return Ok(text);
    }
    repairs.push(Repair::new("line-ends", 1, None, "lines end in carriage returns alone, as on old Macintoshes"));
    Ok(Cow::Owned(text.replace('\r', "\n")))
}

fn characters<'b>(bytes: &'b [u8], repairs: &mut Vec<Repair>) -> Result<Cow<'b, str>, CsvFault> {
    if let Some(text) = utf16(bytes) {
        let text =
            text.ok_or((None, Box::new(CsvProblem::NotUtf8 { hint: " (nor UTF-16, which its first bytes promise)" })))?;
        repairs.push(Repair::new("encoding", 1, None, "the text is UTF-16"));
        return Ok(Cow::Owned(text));
    }
    match text_of(bytes) {
        Ok(text) => {
            if bytes.starts_with(b"\xef\xbb\xbf") {
                repairs.push(Repair::new("byte-order-mark", 1, Some(1), "the file begins with a byte-order mark"));
            }
            Ok(Cow::Borrowed(text))
        }
        Err(fault) => latin1(bytes, repairs).map(Cow::Owned).ok_or(fault),
    }
}

/// `None` where it is not UTF-16, by its mark; `Some(None)` where the mark lies.
fn utf16(bytes: &[u8]) -> Option<Option<String>> {
    let (little, rest) = match bytes {
        [0xff, 0xfe, rest @ ..] => (true, rest),
        [0xfe, 0xff, rest @ ..] => (false, rest),
        _ => return None,
    };
    let unit = |pair: &[u8]| if little { [pair[0], pair[1]] } else { [pair[1], pair[0]] };
    let units: Vec<u16> = rest.chunks_exact(2).map(|pair| u16::from_le_bytes(unit(pair))).collect();
    Some(String::from_utf16(&units).ok().filter(|_| rest.len() % 2 == 0))
}

/// Latin-1 (every byte is its own code point), if what is not ASCII stands in comments and in what comes before the first line of numbers only.
fn latin1(bytes: &[u8], repairs: &mut Vec<Repair>) -> Option<String> {
    let text: String = bytes.iter().map(|&b| char::from(b)).collect();
    let numbers = text.lines().position(is_numbers)?;
    let line = text.lines().position(|l| !l.is_ascii())?;
    if text.lines().skip(numbers).any(|l| !l.is_ascii() && !l.starts_with('#')) {
        return None;
    }
    repairs.push(Repair::new("encoding", 1, Some(line + 1), "the text is not UTF-8 and was read as Latin-1"));
    Some(text)
}

/// Whether a line holds samples: digits, and no letters but those of exponents and times of day.
fn is_numbers(line: &str) -> bool {
    line.bytes().any(|b| b.is_ascii_digit()) && line.chars().all(|c| !c.is_alphabetic() || "eEaApPmMTZ".contains(c))
}

/// UTF-8 text without its byte-order mark.
pub(crate) fn text_of(bytes: &[u8]) -> Result<&str, CsvFault> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let utf16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        let hint = if utf16 { " (UTF-16, by its first bytes)" } else { "" };
        (Some(line), CsvProblem::NotUtf8 { hint }.into())
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_fills_the_memory_is_refused_and_long_files_are_not() {
        let line = vec![b'1'; LONGEST_LINE + 1];
        assert!(matches!(*check_lines(&line).unwrap_err().1, CsvProblem::LongLine { mebibytes: 16 }));
        let mut lines = b"time_s,P1\n".repeat(3 * LONGEST_LINE / 10);
        assert!(check_lines(&lines).is_ok());
        lines.extend(line);
        assert!(check_lines(&lines).is_err());
    }
}
