//! Calibration: from a recording to the fitted model of the run.

mod approach;
pub mod calibrate;
pub mod compare;
pub mod conflict;
pub mod creep;
pub mod data;

pub mod energy;
mod finish;
pub mod least_squares;
pub mod model_file;
pub mod outcome;
pub mod prepare;
pub mod problem;
pub mod sensor_choice;
mod starts;
pub mod uncertainty;
pub mod valve_curve;
