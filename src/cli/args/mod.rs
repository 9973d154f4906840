//! Arguments that several commands share.

pub(crate) mod creep_prior;
pub(crate) mod hold;
pub(crate) mod import_options;
pub(crate) mod misfit;
pub mod profile;
pub mod recordings;
pub(crate) mod search;
pub(crate) mod triggers;
pub mod values;
pub mod values_file;
