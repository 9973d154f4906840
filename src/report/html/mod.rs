//! Pages: what all subjects share.

pub(crate) mod data;
pub(crate) mod figures;
pub(crate) mod matrix;
pub mod page;
