//! A calibration as a problem of PEST: control, template and instruction file, for PEST, PEST++ and pyEMU.
//!
//! The forms are those of the PEST manual (Doherty 2018, "PEST, Model-Independent Parameter Estimation, User Manual
//! Part I", chapters 2 to 4). One model command writes all runs: PEST takes several commands for alternatives in
//! derivatives, not for a sequence.
//!
//! PEST's objective function is then the calibration's: the sum of the squares of its residuals, priors as prior
//! information.

pub mod case;
pub mod control;
pub mod form;
pub(crate) mod names;
pub mod observations;
