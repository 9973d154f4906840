//! The next test as text, JSON and a page.

pub mod html;
pub mod text;
