//! What a recording shows without a model, as text and JSON.

pub mod json;
pub mod text;
