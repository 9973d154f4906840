//! Arguments that several commands share.

pub(crate) mod beside;
pub(crate) mod creep_prior;
pub(crate) mod evaluation;
pub(crate) mod fit_output;
pub(crate) mod hold;
pub(crate) mod ignore;
pub(crate) mod import_options;
pub(crate) mod live;
pub(crate) mod misfit;
pub(crate) mod own_values;
pub(crate) mod posterior;
pub(crate) mod profile;
pub(crate) mod recordings;
pub(crate) mod run_models;
pub(crate) mod search;
pub(crate) mod solver;
pub(crate) mod triggers;
pub mod values;
