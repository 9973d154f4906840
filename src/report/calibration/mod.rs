//! A calibration as text, as JSON and as the pieces of a page.

pub(crate) mod correlation;
pub(crate) mod energy;
pub(crate) mod heatmap;
pub(crate) mod parameters;
pub mod posterior;
pub(crate) mod profiles;
pub(crate) mod rig;
pub(crate) mod sensor;
pub(crate) mod spectrum;
pub(crate) mod stages;
pub mod steps;
pub mod text;
