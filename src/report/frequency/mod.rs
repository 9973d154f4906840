//! A frequency response as text, JSON, pictures and page.

pub mod html;
pub mod text;
