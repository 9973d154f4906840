//! Pages: what all subjects share.

pub(crate) mod data;
pub mod escape;
pub(crate) mod figures;
pub(crate) mod matrix;
pub mod page;
