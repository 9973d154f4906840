//! Layouts: the plots with which Foxglove and PlotJuggler open a recording.

pub mod foxglove;
pub mod plotjuggler;
pub mod plots;
