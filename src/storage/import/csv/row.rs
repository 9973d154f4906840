//! Lines of a table and their cells.

use std::borrow::Cow;

/// The cells of a line.
#[derive(Default)]
pub(crate) struct Row<'t> {
    cells: Vec<Cow<'t, str>>,
}

impl<'t> Row<'t> {
    /// Takes the cells of a line in the place of those it has.
    pub(crate) fn read(&mut self, line: &'t str, separator: char) {
        self.cells.clear();
        // a blank stands for any number of them
        if separator == ' ' {
            self.cells.extend(line.split_whitespace().map(Cow::Borrowed));
            return;
        }
        if !line.contains('"') {
            self.cells.extend(line.split(separator).map(|cell| Cow::Borrowed(cell.trim())));
            return;
        }
        let delimiter = u8::try_from(separator).unwrap_or(b',');
        let mut quoted = csv::ReaderBuilder::new().has_headers(false).delimiter(delimiter).from_reader(line.as_bytes());
        let record = quoted.records().next().and_then(Result::ok).unwrap_or_default();
        // `="0.5"` keeps a spreadsheet from reading a number
        let plain = |cell: &str| {
            cell.trim().strip_prefix("=\"").and_then(|c| c.strip_suffix('"')).unwrap_or(cell.trim()).to_owned()
        };
        self.cells.extend(record.iter().map(|cell| Cow::Owned(plain(cell))));
    }

    /// Takes a unit off that stands behind a number.
    pub(crate) fn take_suffix(&mut self, place: usize, suffix: &str) {
        if let Some(cell) = self.cells.get_mut(place)
            && let Some(number) = cell.strip_suffix(suffix)
        {
            *cell = Cow::Owned(number.trim_end().to_owned());
        }
    }

    /// The cells themselves.
    pub(crate) fn into_cells(self) -> Vec<Cow<'t, str>> {
        self.cells
    }

    /// Number of cells.
    pub(crate) fn len(&self) -> usize {
        self.cells.len()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &str> {
        self.cells.iter().map(|cell| &**cell)
    }

    pub(crate) fn get(&self, place: usize) -> Option<&str> {
        self.cells.get(place).map(|cell| &**cell)
    }

    /// Number of cells of a line that has too few or too many; empty ones at its end do not count as far as the header
    /// has them too. Elsewhere a surplus cell is a decimal comma.
    pub(crate) fn ragged(&self, expected: usize, widest: usize) -> Option<usize> {
        let found = self.len();
        let fits = (expected..=widest).contains(&found) && self.iter().skip(expected).all(str::is_empty);
        (!fits).then_some(found)
    }
}

/// Neither blank nor a comment.
pub(crate) fn is_line(line: &str) -> bool {
    !line.trim().is_empty() && !line.starts_with('#')
}

/// A line that holds more than separators, and is not Excel's word on what they are, which the headings show anyway.
pub(crate) fn is_row(line: &str) -> bool {
    let separator = line.trim_end_matches(['\r', '\n']).strip_prefix("sep=").is_some_and(|s| s.chars().count() <= 1);
    // a line that is ruled holds nothing either
    !separator && !line.starts_with('#') && line.chars().any(|c| !c.is_whitespace() && !",;-=_|+".contains(c))
}
