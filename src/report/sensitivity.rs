//! A sensitivity study for the terminal, and the page of the source paper's rules.

mod rules;
mod tables;

pub use rules::rules_page;
pub use tables::{f_value, failures, range, repeats, share, text, undefined};
