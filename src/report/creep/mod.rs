//! A creep test as text, JSON and page.

pub mod html;
pub mod text;
