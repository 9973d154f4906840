//! Columns of text that give way where the terminal is narrow.

use console::{Alignment, measure_text_width, pad_str, truncate_str};

/// Between two columns.
const SPACE: usize = 2;

/// A column.
pub(crate) struct Column {
    /// The first is what its heading says, the others a cell a row.
    pub(crate) cells: Vec<String>,
    /// Numbers stand at the right.
    pub(crate) right: bool,
    /// The lowest give way first; 0 stays whatever comes.
    pub(crate) gives_way: u8,
}

impl Column {
    /// A column under a heading.
    pub(crate) fn new(heading: &str, right: bool, gives_way: u8, cells: impl Iterator<Item = String>) -> Column {
        Column { cells: std::iter::once(heading.to_owned()).chain(cells).collect(), right, gives_way }
    }

    fn width(&self) -> usize {
        self.cells.iter().map(|cell| measure_text_width(cell)).max().unwrap_or(0)
    }
}

/// Width of columns beside each other.
pub(crate) fn width(columns: &[Column]) -> usize {
    columns.iter().map(Column::width).sum::<usize>() + SPACE * columns.len().saturating_sub(1)
}

/// Leaves out the columns that give way until the others fit, least important first.
pub(crate) fn fitted(mut columns: Vec<Column>, room: usize) -> Vec<Column> {
    while width(&columns) > room {
        let candidate = (0..columns.len()).filter(|&i| columns[i].gives_way > 0).min_by_key(|&i| columns[i].gives_way);
        let Some(least) = candidate else { break };
        columns.remove(least);
    }
    columns
}

/// The lines, the heading first, none wider than `room`.
pub(crate) fn lines(columns: &[Column], room: usize) -> Vec<String> {
    let rows = columns.first().map_or(0, |column| column.cells.len());
    let row = |i: usize| {
        let cell = |column: &Column| {
            let side = if column.right { Alignment::Right } else { Alignment::Left };
            pad_str(column.cells.get(i).map_or("", String::as_str), column.width(), side, None).into_owned()
        };
        let text = columns.iter().map(cell).collect::<Vec<_>>().join(&" ".repeat(SPACE));
        truncate_str(text.trim_end(), room, "…").into_owned()
    };
    (0..rows).map(row).collect()
}
