//! Tables in long form: a column names the channel of each row, and the rows of all channels stand in one column of values.

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
        let column = (0..layout.columns.len()).find(|&i| is_key(layout, i))?;
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

/// Whether a column names channels: a few words or whole numbers, and wherever a time repeats that of the row above, another one; or another one in
/// most rows, each channel with times of its own.
fn is_key(layout: &Layout<'_>, column: usize) -> bool {
    let names: Vec<&str> = layout.column(column).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    names.iter().for_each(|name| *counts.entry(name).or_default() += 1);
    let is_name = |name: &&str| match Cell::of(name) {
        Cell::Word => !is_known_unit(name),
        Cell::Number(_) => name.bytes().all(|b| b.is_ascii_digit()),
        _ => false,
    };
    let few = (2..=MOST).contains(&counts.len()) && counts.values().all(|n| *n >= LEAST_ROWS);
    if !few || !counts.keys().all(is_name) {
        return false;
    }
    let is_worded = counts.keys().any(|name| Cell::of(name).is_word());
    let changes = |i: usize| names[i] != names[i - 1];
    let alternates = 2 * (1..names.len()).filter(|i| changes(*i)).count() > names.len();
    let times = (0..layout.columns.len()).filter(|&i| i != column).any(|i| {
        let times: Vec<&str> = layout.column(i).collect();
        if times.len() != names.len() || !is_time(&times) {
            return false;
        }
        let again: Vec<usize> = (1..times.len()).filter(|&i| times[i] == times[i - 1]).collect();
        let apart = again.iter().filter(|i| changes(**i)).count();
        again.len() >= LEAST_ROWS && apart == again.len()
    });
    // numbers that alternate may be anything, as the state of a bit
    times || (is_worded && alternates)
}

/// Whether the cells are times, or dates and times: they never fall, and do rise.
fn is_time(cells: &[&str]) -> bool {
    let values: Option<Vec<f64>> = cells
        .iter()
        .map(|cell| match Cell::of(cell) {
            Cell::Number(value) => Some(value),
            Cell::Stamp(stamp) if stamp.has_time => Some(stamp.unix_ns(0) as f64),
            _ => None,
        })
        .collect();
    values.is_some_and(|values| {
        let falls = values.windows(2).filter(|w| w[1] < w[0]).count();
        20 * falls <= values.len() && values.windows(2).any(|w| w[1] > w[0])
    })
}
