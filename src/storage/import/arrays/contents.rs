//! What a file of arrays holds.

/// What a file may unpack to, as a multiple of its size.
pub(crate) const MOST_UNPACKED: usize = 100;
/// Variables, groups or fields of a file beyond which it is none of a test.
pub(crate) const MOST_ARRAYS: usize = 10_000;
/// Groups or structures within each other.
pub(crate) const DEEPEST: usize = 16;

/// The message about a file of more.
pub(crate) fn too_many() -> String {
    format!("it holds more than {MOST_ARRAYS} arrays: save those of the test alone")
}

/// What a file holds.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    pub(crate) arrays: Vec<Array>,
    /// Single texts and their names; an attribute's name stands behind that of what it belongs to.
    pub(crate) texts: Vec<(String, String)>,
    /// Names of what cannot be read, and what it is.
    pub(crate) unread: Vec<(String, String)>,
}

/// A named array of numbers.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Array {
    /// Its name, with those of the groups around it, separated by `/`.
    pub(crate) name: String,
    /// Its columns, each of the longer of its two dimensions.
    pub(crate) columns: Vec<Vec<f64>>,
}

impl Array {
    /// An array of two dimensions whose first index runs fastest.
    pub(crate) fn new(name: String, [rows, columns]: [usize; 2], values: &[f64]) -> Array {
        let at = |row: usize, column: usize| values.get(row + column * rows).copied().unwrap_or(f64::NAN);
        let columns = if rows >= columns {
            (0..columns).map(|c| (0..rows).map(|r| at(r, c)).collect()).collect()
        } else {
            (0..rows).map(|r| (0..columns).map(|c| at(r, c)).collect()).collect()
        };
        Array { name, columns }
    }

    /// Values of a column.
    pub(crate) fn samples(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Samples and columns, for a message.
    pub(crate) fn sizes(&self) -> String {
        format!("{} × {}", self.samples(), self.columns.len())
    }
}
