//! A sensitivity study for the terminal and as a page.

pub mod html;
pub(crate) mod tables;

pub use crate::report::sensitivity::tables::{f_value, failures, range, repeats, share, text, undefined};
