//! What the effects of the catalogue are and do, as text and JSON, with an example.

pub mod check;
pub mod example;
pub mod json;
pub mod text;
