//! What a calibration gives back.

pub mod band;
pub mod doubt;
pub mod fit;
pub mod posterior;
pub mod profile;
pub(crate) mod residual_summary;
pub mod thresholds;
pub mod uncertainty;
pub mod unidentifiable;
