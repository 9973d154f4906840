//! A diagnosis as text, JSON and page.

pub(crate) mod html;
pub(crate) mod ranking;
pub mod rest;
pub(crate) mod signature;
pub mod text;
pub(crate) mod words;
