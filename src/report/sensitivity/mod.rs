//! A sensitivity study for the terminal, and the page of the source paper's rules.

pub mod html;
pub(crate) mod rules;
pub(crate) mod tables;

pub use crate::report::sensitivity::rules::rules_page;
pub use crate::report::sensitivity::tables::{f_value, failures, range, repeats, share, text, undefined};
