//! Calibration: from a recording to the fitted model of the run.

mod approach;
pub mod calibrate;
pub mod compare;
pub mod conflict;
pub mod creep;
pub mod data;
pub mod energy;
pub mod family;
mod finish;
pub mod least_squares;
pub mod method;
mod micro_ga;
pub mod model_file;
pub mod outcome;
pub mod prepare;
pub mod problem;
mod search;
pub mod sensor_choice;
pub mod settle;
mod starts;
mod stepwise;
pub mod uncertainty;
pub mod valve_curve;
