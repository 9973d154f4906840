//! A table of numbers.

/// Times, lines of the file and columns, all of one length; NaN where a cell is empty.
#[derive(Default)]
pub(crate) struct Table {
    pub(crate) time_s: Vec<f64>,
    pub(crate) line: Vec<usize>,
    pub(crate) columns: Vec<Vec<f64>>,
}
