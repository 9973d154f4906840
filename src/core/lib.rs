//! The physics of surgescope: it knows no file, clock or wire. The package `surgescope` hands all of it on.
#![warn(missing_docs)]

pub mod align;
pub mod creep;
pub mod diagnose;
pub mod extent;
pub mod fit;
mod golden;
pub mod interned;
pub mod model;
pub mod number;
mod product;
pub mod recording;
pub mod rig;
pub mod robust;
pub mod sensitivity;
pub mod shown;
pub mod signal;
pub mod temperature;
pub mod text_file;
pub mod units;
pub mod valve;
mod wide;
