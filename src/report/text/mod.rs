//! Plain text: tables, numbers, small plots, and escapes for HTML and SVG.

pub mod escape;
pub mod plot;
pub mod table;
pub mod value;

pub use crate::number;
