//! Tables in plain text: aligned, no colour.

use crate::shown::Shown as _;

/// Columns aligned by their widest cell; a heading that starts with `<` aligns its column to the right.
pub(crate) struct Table {
    headings: Vec<String>,
    right: Vec<bool>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new(headings: &[&str]) -> Self {
        Self {
            headings: headings.iter().map(|h| h.trim_start_matches('<').into()).collect(),
            right: headings.iter().map(|h| h.starts_with('<')).collect(),
            rows: Vec::new(),
        }
    }

    pub(crate) fn row(&mut self, cells: impl Into<Vec<String>>) {
        // names in cells may hold anything
        self.rows.push(cells.into().into_iter().map(|cell| cell.shown().into_owned()).collect());
    }

    pub(crate) fn without_empty_columns(mut self) -> Self {
        let used: Vec<bool> = (0..self.headings.len())
            .map(|c| self.rows.iter().any(|r| r.get(c).is_some_and(|t| !t.is_empty())))
            .collect();
        fn keep<T>(list: &mut Vec<T>, used: &[bool]) {
            let mut flags = used.iter();
            list.retain(|_| flags.next().copied().unwrap_or(false));
        }
        keep(&mut self.headings, &used);
        keep(&mut self.right, &used);
        self.rows.iter_mut().for_each(|r| keep(r, &used));
        self
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.rows.is_empty() {
            return Ok(());
        }
        let lines = || std::iter::once(&self.headings).chain(&self.rows);
        let widths: Vec<usize> = (0..self.headings.len())
            .map(|c| lines().filter_map(|l| l.get(c)).map(|t| t.chars().count()).max().unwrap_or(0))
            .collect();
        for (number, line) in lines().enumerate() {
            let cells: Vec<String> = line
                .iter()
                .zip(widths.iter().zip(&self.right))
                .map(
                    |(text, (&width, &right))| {
                        if right { format!("{text:>width$}") } else { format!("{text:<width$}") }
                    },
                )
                .collect();
            writeln!(f, "{}", cells.join("  ").trim_end())?;
            if number == 0 {
                let rule: Vec<String> = widths.iter().map(|w| "-".repeat(*w)).collect();
                writeln!(f, "{}", rule.join("  ").trim_end())?;
            }
        }
        Ok(())
    }
}
