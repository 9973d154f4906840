//! The block of `#` comments: kept, and asked for the time at which the acquisition started.

use crate::storage::import::csv::stamp::{Order, Stamp};
use crate::storage::import::source::{Repair, SourceOptions, Start};

/// Most that is kept of the comments: a file may be nothing else.
const KEPT_LINES: usize = 1000;
/// Kind of the remark on a start in the comments.
pub(crate) const START: &str = "start";

/// The block of comments as a note, if there is one.
pub(crate) fn comment_notes(text: &str) -> Vec<(String, String)> {
    let comments = comments(text);
    if comments.is_empty() { Vec::new() } else { vec![("comment".into(), comments.join("\n"))] }
}

/// The comment lines, without their signs.
fn comments(text: &str) -> Vec<String> {
    let comments = text.lines().filter_map(|line| line.strip_prefix('#'));
    comments.map(|line| line.trim().to_string()).filter(|line| !line.is_empty()).take(KEPT_LINES).collect()
}

/// The start of the recording, and a remark on it, that a comment such as `start: 2026-03-14T09:26:53.5Z` or `Start time = 14.03.2026 09:26:53`
/// gives.
pub(crate) fn start_in_comments(text: &str, options: &SourceOptions) -> Option<(Start, Repair)> {
    comments(text).iter().find_map(|line| {
        let (key, value) = line.split_once(['=', ':']).or_else(|| line.split_once('\t'))?;
        let key = key.trim().to_lowercase();
        let names_it =
            key.contains("start") || ["date", "datetime", "date time", "timestamp", "time 0"].contains(&&*key);
        let order = match options.day_first {
            Some(true) => Order::DayFirst,
            Some(false) => Order::MonthFirst,
            None => Order::Unknown,
        };
        let stamp = Stamp::parse(value.trim(), order).filter(|s| names_it && s.has_date)?;
        let ns = u64::try_from(stamp.unix_ns(options.zone_s.unwrap_or(0))).ok()?;
        let zone = if stamp.zone_s.is_some() || options.zone_s.is_some() { "" } else { ", taken as UTC" };
        let text = format!("time 0 is the start given in the comments, {}{zone}", value.trim());
        Some((Start { unix_ns: ns, digit_s: stamp.digit_s }, Repair::new(START, 1, None, text)))
    })
}
