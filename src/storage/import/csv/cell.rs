//! What a cell of a table holds.

use crate::storage::import::csv::heading::is_known_unit;
use crate::storage::import::csv::missing::says_missing;
use crate::storage::import::csv::numbers::Numbers;
use crate::storage::import::csv::stamp::Stamp;
use crate::storage::import::source::Order;

/// A cell by its looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Cell {
    /// Nothing.
    Empty,
    /// A word for no value.
    Missing,
    /// A number.
    Number(f64),
    /// A date, a time of day or both.
    Stamp(Stamp),
    /// Anything else.
    Word,
}

impl Cell {
    pub(crate) fn of(cell: &str) -> Cell {
        if cell.is_empty() {
            return Cell::Empty;
        }
        // whatever mark the file has, it is a number
        if let Some(value) = Numbers::new(',', None).read(cell, "").ok().filter(|v| !v.is_nan()) {
            return Cell::Number(value);
        }
        if let Some((value, _)) = with_unit(cell) {
            return Cell::Number(value);
        }
        match stamp_of(cell) {
            Some(stamp) => Cell::Stamp(stamp),
            None if says_missing(cell) => Cell::Missing,
            None => Cell::Word,
        }
    }

    pub(crate) fn is_number(self) -> bool {
        matches!(self, Cell::Number(_))
    }

    pub(crate) fn is_word(self) -> bool {
        matches!(self, Cell::Word)
    }

    /// The number; NaN where it holds none.
    pub(crate) fn value(self) -> f64 {
        if let Cell::Number(value) = self { value } else { f64::NAN }
    }
}

/// A number and the unit behind it: `2.802 bar`, `0.001 sec`.
pub(crate) fn with_unit(cell: &str) -> Option<(f64, &str)> {
    let (number, unit) =
        cell.split_once(' ').filter(|(_, unit)| !unit.starts_with(['(', '[']) && is_known_unit(unit.trim()))?;
    let value = Numbers::new(',', None).read(number, "").ok().filter(|v| !v.is_nan())?;
    Some((value, unit.trim()))
}

/// A date, a time of day or both, whichever of day and month stands first.
pub(crate) fn stamp_of(cell: &str) -> Option<Stamp> {
    let has_digit = cell.starts_with(|c: char| c.is_ascii_digit())
        || (cell.contains(' ') && cell.contains(|c: char| c.is_ascii_digit()));
    let read = |order| Stamp::parse(cell, order).filter(|_| has_digit);
    read(Order::DayFirst).or_else(|| read(Order::MonthFirst))
}
