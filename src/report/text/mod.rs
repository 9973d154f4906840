//! Plain text for the terminal: tables, numbers, small plots.

pub mod number;
pub mod plot;
pub mod table;
pub mod value;
