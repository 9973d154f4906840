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

/// Words in a remark among the samples that say that what follows is not like what came before.
const BREAKS: [&str; 12] = [
    "lost",
    "overrun",
    "dropped",
    "changed",
    "doubled",
    "halved",
    "gain",
    "range",
    "missing",
    "skipped",
    "verloren",
    "geändert",
];
/// Remarks that are shown.
const SHOWN: usize = 3;

/// What the remarks among the samples say, if there are any; where one says that something changed, nobody here can
/// follow it.
pub(crate) fn among_samples(lines: &[Line<'_>]) -> Option<Repair> {
    let last = lines.iter().rposition(|line| is_row(line.text))?;
    let among: Vec<&Line<'_>> = lines[..last].iter().filter(|line| line.text.starts_with('#')).collect();
    let says = |line: &Line<'_>| line.text.trim_start_matches('#').trim().to_lowercase();
    let breaks =
        |line: &&&Line<'_>| says(line).split(|c: char| !c.is_alphanumeric()).any(|word| BREAKS.contains(&word));
    let first = among.first()?;
    let lost = among.iter().find(breaks);
    let shown = among.iter().filter(|line| lost.is_none() || breaks(line)).take(SHOWN);
    let shown: Vec<String> = shown.map(|line| format!("'{}'", line.text.trim_start_matches('#').trim())).collect();
    let text =
        format!("{} among the samples: {}", if shown.len() > 1 { "remarks" } else { "a remark" }, shown.join(", "));
    let text = if lost.is_some() { text + ": what it says is not followed; check the samples around it" } else { text };
    Some(Repair {
        lost: lost.is_some(),
        ..Repair::new("remarks-among", among.len(), Some(lost.unwrap_or(first).at), text)
    })
}

fn noted<'t>(lines: impl Iterator<Item = &'t str>) -> Vec<(String, String)> {
    let kept: Vec<&str> = lines.filter(|line| !line.is_empty()).take(KEPT_LINES).collect();
    if kept.is_empty() { Vec::new() } else { vec![("comment".into(), kept.join("\n"))] }
}

/// The comment lines, without their signs.
fn comments<'t>(lines: impl Iterator<Item = &'t str>) -> impl Iterator<Item = &'t str> {
    lines.filter_map(|line| line.strip_prefix('#')).map(str::trim)
}

/// The start of the recording, and a remark on it, that a comment such as `start: 2026-03-14T09:26:53.5Z` or
/// `Start time = 14.03.2026 09:26:53` gives.
pub(crate) fn start_in_comments(text: &str, options: &SourceOptions) -> Option<(Start, Repair)> {
    let mut settings = Settings::default();
    comments(text.lines()).take(KEPT_LINES).for_each(|line| settings.take(&[Cow::Borrowed(line)]));
    settings.start(options)
}
