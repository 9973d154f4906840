//! The way to an optimum: coarse fits, descents, global searches, elements that come and go.

pub mod calibrate;
pub(crate) mod coarse_fit;
pub(crate) mod finish;
pub(crate) mod global;
pub(crate) mod polish;
pub(crate) mod prune_elements;
pub mod sensor_choice;
pub(crate) mod starts;
pub(crate) mod stepwise;
