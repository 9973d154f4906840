//! Runs at several temperatures as text, JSON, CSV and page.

pub mod html;
pub mod text;
