//! The lines of a table: a line break within quotes ends none.

use crate::storage::import::csv::stamp::Stamp;
use crate::storage::import::source::Order;
use crate::storage::import::source::Repair;

/// A line that quotes hold together spans no more than so many.
const MOST_JOINED: usize = 8;

/// A line of a table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line<'t> {
    /// Its place in the file, from 1.
    pub(crate) at: usize,
    /// Its text, without its end.
    pub(crate) text: &'t str,
}

/// All lines of a text, also those that hold nothing.
pub(crate) fn lines(text: &str) -> Vec<Line<'_>> {
    let mut found: Vec<Line<'_>> = Vec::new();
    let mut open: Option<(usize, usize)> = None;
    let mut from = 0;
    for (i, piece) in text.split_inclusive('\n').enumerate() {
        let (at, to) = (i + 1, from + piece.len());
        let is_odd = piece.contains('"') && piece.bytes().filter(|b| *b == b'"').count() % 2 == 1;
        let whole = |from: usize| text[from..to].trim_end_matches(['\r', '\n']);
        match open {
            Some((begin, first)) if is_odd => {
                found.truncate(found.len() - (at - first));
                found.push(Line { at: first, text: whole(begin) });
                open = None;
            }
            // a quote that nothing closes holds nothing together
            Some((_, first)) if at - first >= MOST_JOINED => {
                found.push(Line { at, text: whole(from) });
                open = None;
            }
            _ => {
                found.push(Line { at, text: whole(from) });
                open = open.or(is_odd.then_some((from, at)));
            }
        }
        from = to;
    }
    found
}

/// What stands between the time at which a serial monitor received a line, and the line.
const RECEIVED: &str = " -> ";

/// The lines as a device sent them, without what Arduino's serial monitor puts before each, and a remark on it.
pub(crate) fn without_receipt(lines: Vec<Line<'_>>) -> (Vec<Line<'_>>, Option<Repair>) {
    let sent = |line: &Line<'_>| {
        let (received, _) = line.text.split_once(RECEIVED)?;
        Stamp::parse(received, Order::Unknown).filter(|s| s.has_time).map(|_| received.len() + RECEIVED.len())
    };
    let filled = lines.iter().filter(|l| !l.text.trim().is_empty()).count();
    let received = lines.iter().filter(|l| sent(l).is_some()).count();
    if received == 0 || 10 * received < 9 * filled {
        return (lines, None);
    }
    let text = "the times before '->' are those at which a serial monitor received the lines: the device's own count";
    let lines = lines.into_iter().map(|line| Line { text: &line.text[sent(&line).unwrap_or(0)..], ..line }).collect();
    (lines, Some(Repair::new("serial-monitor", received, None, text)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_break_within_quotes_ends_no_line_and_a_quote_alone_joins_none() {
        let of = |text| lines(text).iter().map(|l| (l.at, l.text)).collect::<Vec<_>>();
        assert_eq!(of("\"P1\n(bar)\",\"P2\r\n(bar)\"\r\n1,2\n"), [(1, "\"P1\n(bar)\",\"P2\r\n(bar)\""), (4, "1,2")]);
        let inches = format!("pipe 3\" copper\n{}", "1,2\n".repeat(9));
        assert_eq!(of(&inches).len(), 10);
        assert_eq!(of("a\n\nb"), [(1, "a"), (2, ""), (3, "b")]);
    }
}
