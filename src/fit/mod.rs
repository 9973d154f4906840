//! Calibration: from a recording to the fitted model of the run.

mod approach;
pub mod band;
pub mod calibrate;
mod cma;
pub mod colour;
pub mod compare;
pub mod conflict;
pub mod creep;
pub mod cross_validate;
pub mod data;
pub mod energy;
pub mod errors;
mod evolution;
pub mod family;
mod feature;
mod finish;
pub mod frequency;
pub mod held_out;
pub mod identify;
pub mod interval;
mod last_descent;
pub mod least_squares;
pub mod method;
mod micro_ga;
pub mod misfit;
pub mod model_file;
pub mod observed;
mod optimum;
pub mod outcome;
pub mod predict;
pub mod prepare;
pub mod problem;
pub mod profile;
mod search;
pub mod sensor_choice;
mod starts;
mod stepwise;
mod surplus;
#[cfg(test)]
mod test_problem;
#[cfg(test)]
mod test_record;
pub mod uncertainty;
pub mod valve_curve;
pub mod valve_shift;
