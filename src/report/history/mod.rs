//! A rig's history as text, JSON, CSV and page.

pub mod html;
pub mod text;
