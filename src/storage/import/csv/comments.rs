//! What stands around a table in words: kept as a note, and asked for the time at which the acquisition started.

use std::borrow::Cow;

use crate::storage::import::csv::lines::Line;
use crate::storage::import::csv::row::is_row;
use crate::storage::import::csv::settings::Settings;
use crate::storage::import::source::{Repair, SourceOptions, Start};

/// Most that is kept of the comments: a file may be nothing else.
const KEPT_LINES: usize = 1000;

/// The `#` comments of a text as a note, if there are any.
pub(crate) fn comment_notes(text: &str) -> Vec<(String, String)> {
    noted(comments(text.lines()))
}

/// The lines above a table but for its headings, and the comments below, as a note, if there are any.
pub(crate) fn note(above: &[Line<'_>], below: &[Line<'_>], headings: &[usize]) -> Vec<(String, String)> {
    let above = above.iter().enumerate().filter(|(at, _)| !headings.contains(at)).map(|(_, line)| line.text);
    let words =
        above.filter(|text| text.starts_with('#') || is_row(text)).map(|text| text.trim_start_matches('#').trim());
    noted(words.chain(comments(below.iter().map(|line| line.text))))
}

fn noted<'t>(lines: impl Iterator<Item = &'t str>) -> Vec<(String, String)> {
    let kept: Vec<&str> = lines.filter(|line| !line.is_empty()).take(KEPT_LINES).collect();
    if kept.is_empty() { Vec::new() } else { vec![("comment".into(), kept.join("\n"))] }
}

/// The comment lines, without their signs.
fn comments<'t>(lines: impl Iterator<Item = &'t str>) -> impl Iterator<Item = &'t str> {
    lines.filter_map(|line| line.strip_prefix('#')).map(str::trim)
}

/// The start of the recording, and a remark on it, that a comment such as `start: 2026-03-14T09:26:53.5Z` or `Start time = 14.03.2026 09:26:53`
/// gives.
pub(crate) fn start_in_comments(text: &str, options: &SourceOptions) -> Option<(Start, Repair)> {
    let mut settings = Settings::default();
    comments(text.lines()).take(KEPT_LINES).for_each(|line| settings.take(&[Cow::Borrowed(line)]));
    settings.start(options)
}
