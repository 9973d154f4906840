//! What a calibration gives back.

pub mod band;
pub mod compare;
pub mod fit;
