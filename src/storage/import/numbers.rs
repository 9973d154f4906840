//! The numbers of a column, and how they are written.

use std::fmt::Write as _;

use crate::storage::CsvProblem;

/// Reads the numbers of a column and watches how they are written.
#[derive(Default)]
pub(crate) struct Numbers {
    written: Written,
    scratch: String,
}

#[derive(Default, Clone, Copy, PartialEq)]
enum Written {
    #[default]
    Nothing,
    Decimals(u8),
    Mixed,
}

impl Numbers {
    pub(crate) fn read(&mut self, cell: &str, column: &str) -> Result<Option<f64>, CsvProblem> {
        if cell.is_empty() {
            return Ok(None);
        }
        let named = || (column.to_string(), cell.to_string());
        let value: f64 = cell.parse().map_err(|_| {
            let (column, cell) = named();
            CsvProblem::NotANumber { column, cell }
        })?;
        if !value.is_finite() {
            let (column, cell) = named();
            return Err(CsvProblem::NotFinite { column, cell });
        }
        self.watch(cell, value);
        Ok(Some(value))
    }

    /// Keeps the number of decimals as long as writing each value with it gives the cell's text again.
    fn watch(&mut self, cell: &str, value: f64) {
        if self.written == Written::Mixed {
            return;
        }
        let decimals = cell.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        self.scratch.clear();
        let again = write!(self.scratch, "{value:.decimals$}").is_ok() && self.scratch == cell;
        self.written = match (self.written, u8::try_from(decimals)) {
            (Written::Nothing, Ok(d)) if again => Written::Decimals(d),
            (Written::Decimals(same), Ok(d)) if again && d == same => Written::Decimals(d),
            _ => Written::Mixed,
        };
    }

    pub(crate) fn decimals(&self) -> Option<u8> {
        match self.written {
            Written::Decimals(d) => Some(d),
            _ => None,
        }
    }
}
