//! Tables in long form: a column names the channel of each row, and the rows of all channels stand in one column of
//! values.

use std::collections::BTreeMap;

use crate::storage::import::csv::cell::Cell;
use crate::storage::import::csv::heading::is_known_unit;
use crate::storage::import::csv::layout::{Layout, cells};
use crate::storage::import::csv::lines::Line;
use crate::storage::import::csv::row::is_row;

/// Most channels of a table.
const MOST: usize = 100;
/// Each channel has as many rows at least.
const LEAST_ROWS: usize = 3;

/// The rows of one channel.
pub(crate) struct Channel {
    /// The column that names it.
    pub(crate) column: usize,
    pub(crate) name: String,
}

/// A table in long form.
pub(crate) struct Keyed<'t> {
    /// Each channel, and the lines of the file without the rows of the others.
    pub(crate) channels: Vec<(Channel, Vec<Line<'t>>)>,
}

impl<'t> Keyed<'t> {
    /// Finds the channels; none where each row holds them all.
    pub(crate) fn find(layout: &Layout<'_>, lines: &[Line<'t>]) -> Option<Keyed<'t>> {
        let is_key = |i: &usize| {
            let found = Names::of(layout, *i);
            found.is_some_and(|names| is_key(layout, *i, &names) || begins_anew(layout, lines, *i, &names))
        };
        let keys: Vec<usize> = (0..layout.columns.len()).filter(is_key).collect();
        // a name says more than a number
        let is_worded = |i: &&usize| layout.column(**i).any(|cell| Cell::of(cell).is_word());
        let column = *keys.iter().find(is_worded).or(keys.first())?;
        let key = |line: &Line<'t>| cells(line.text, layout.separator).get(column).map(|cell| cell.to_string());
        let (head, rows) = lines.split_at(layout.first);
        let mut of: BTreeMap<String, Vec<Line<'t>>> = BTreeMap::new();
        let mut order: Vec<String> = Vec::new();
        for line in rows.iter().filter(|line| is_row(line.text)) {
            // what is no row is for the reader of the rows
            let name = key(line).filter(|name| !name.is_empty())?;
            if !of.contains_key(&name) {
                order.push(name.clone());
            }
            of.entry(name).or_default().push(*line);
        }
        let heading = &layout.columns[column].heading;
        let channels = order.into_iter().map(|key| {
            let lines = head.iter().copied().chain(of.remove(&key).unwrap_or_default()).collect();
            // a number alone is no name
            let name = if Cell::of(&key).is_number() { format!("{heading} {key}") } else { key };
            (Channel { column, name: name.trim().to_owned() }, lines)
        });
        Some(Keyed { channels: channels.collect() })
    }
}

/// The cells of a column of a few words or whole numbers.
struct Names<'l> {
    cells: Vec<&'l str>,
    /// How often each stands.
    counts: BTreeMap<&'l str, usize>,
}

impl<'l> Names<'l> {
    fn of(layout: &'l Layout<'_>, column: usize) -> Option<Names<'l>> {
        let cells: Vec<&str> = layout.column(column).collect();
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        cells.iter().for_each(|name| *counts.entry(name).or_default() += 1);
        let is_name = |name: &&str| match Cell::of(name) {
            Cell::Word => !is_known_unit(name),
            Cell::Number(_) => name.bytes().all(|b| b.is_ascii_digit()),
            _ => false,
        };
        let few = (2..=MOST).contains(&counts.len()) && counts.values().all(|n| *n >= LEAST_ROWS);
        (few && counts.keys().all(is_name)).then_some(Names { cells, counts })
    }
}

/// What repeats a whole test is no channel of it.
const RUNS: [&str; 7] = ["run", "test", "trial", "shot", "repeat", "versuch", "lauf"];

/// Whether the rows of one channel stand after those of the other, and the times begin anew with each. Of several
/// columns of values they are runs.
fn begins_anew(layout: &Layout<'_>, lines: &[Line<'_>], column: usize, names: &Names<'_>) -> bool {
    let Names { cells: names, counts } = names;
    let heading = layout.columns[column].name.to_lowercase();
    let is_run = heading.split(|c: char| !c.is_alphabetic()).any(|word| RUNS.contains(&word));
    let blocks = names.windows(2).filter(|w| w[0] != w[1]).count() + 1;
    let varies = |i: &usize| {
        let cells: Vec<&str> = layout.column(*i).collect();
        let changes = |(w, n): (&[&str], &[&str])| w[0] != w[1] && n[0] == n[1];
        cells.windows(2).zip(names.windows(2)).any(changes) && cells.iter().all(|c| Cell::of(c).is_number())
    };
    let is_worded = counts.keys().all(|name| Cell::of(name).is_word());
    if blocks != counts.len() || is_run || !is_worded {
        return false;
    }
    let values: Vec<usize> = (0..layout.columns.len()).filter(|i| *i != column).filter(varies).collect();
    let rows = || lines[layout.first..].iter().filter(|l| is_row(l.text)).map(|l| cells(l.text, layout.separator));
    (0..layout.columns.len()).filter(|&i| i != column).any(|i| {
        let judged: Vec<&str> = layout.column(i).collect();
        let is_time = times_of(&judged).is_some_and(|times| times.windows(2).any(|w| w[1] > w[0]));
        let one_value = values.iter().filter(|value| **value != i).count() == 1;
        let mut seen: Vec<String> = Vec::new();
        let mut before = f64::NAN;
        is_time
            && one_value
            && rows().all(|row| {
                let (Some(name), Some(cell)) = (row.get(column), row.get(i)) else { return false };
                let Some(time) = times_of(&[cell]).map(|times| times[0]) else { return false };
                // each has its rows on end, and falls back where the next begins
                let same = seen.last().is_some_and(|last| **last == **name);
                let is_new = !seen.iter().any(|other| **other == **name) && (seen.is_empty() || time <= before);
                let fits = if same { time >= before } else { is_new };
                if !same {
                    seen.push(name.to_string());
                }
                before = time;
                fits
            })
    })
}

/// Whether a column names channels: a few words or whole numbers, and wherever a time repeats that of the row above,
/// another one; or another one in most rows, each channel with times of its own.
fn is_key(layout: &Layout<'_>, column: usize, names: &Names<'_>) -> bool {
    let Names { cells: names, counts } = names;
    let is_worded = counts.keys().any(|name| Cell::of(name).is_word());
    let changes = |i: usize| names[i] != names[i - 1];
    let alternates = 2 * (1..names.len()).filter(|i| changes(*i)).count() > names.len();
    let times = (0..layout.columns.len()).filter(|&i| i != column).any(|i| {
        let times: Vec<&str> = layout.column(i).collect();
        let Some(values) = times_of(&times).filter(|values| values.len() == names.len()) else { return false };
        let falls = values.windows(2).filter(|w| w[1] < w[0]).count();
        let is_time = 20 * falls <= values.len() && values.windows(2).any(|w| w[1] > w[0]);
        let again: Vec<usize> = (1..times.len()).filter(|&i| times[i] == times[i - 1]).collect();
        let apart = again.iter().filter(|i| changes(**i)).count();
        is_time && again.len() >= LEAST_ROWS && apart == again.len()
    });
    // numbers that alternate may be anything, as the state of a bit
    times || (is_worded && alternates)
}

/// The cells as times, s, where all are numbers, or dates and times.
fn times_of(cells: &[&str]) -> Option<Vec<f64>> {
    let time = |cell: &&str| match Cell::of(cell) {
        Cell::Number(value) => Some(value),
        Cell::Stamp(stamp) if stamp.has_time => Some(1e-9 * stamp.unix_ns(0) as f64),
        _ => None,
    };
    cells.iter().map(time).collect()
}
