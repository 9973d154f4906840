//! How a valve closed, as text, JSON and picture.

pub mod json;
pub mod svg;
pub mod text;
