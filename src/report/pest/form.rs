//! What all files of a problem share: their names, and how PEST reads numbers and names.

use crate::model::parameter::Parameter;

/// The files of a problem, and what the model command takes and makes.
pub mod file {
    /// The control file.
    pub const CONTROL: &str = "problem.pst";
    /// Template of the values.
    pub const TEMPLATE: &str = "values.tpl";
    /// The values, written by PEST, read by the model.
    pub const VALUES: &str = "values.txt";
    /// How to read what the model shows.
    pub const INSTRUCTIONS: &str = "modelled.ins";
    /// What the model shows, in the rows of [`MEASURED`].
    pub const MODELLED: &str = "modelled.csv";
    /// The observations.
    pub const MEASURED: &str = "measured.csv";
    /// What stands in the folder, for people.
    pub const README: &str = "README.txt";
}

/// Longest name of a parameter, of any group, and of an observation or prior information in PEST.
pub(crate) const LONGEST: usize = 12;
pub(crate) const LONGEST_OBSERVATION: usize = 20;

/// No way to fix it for PEST: it has no range.
pub(crate) fn fixed(parameter: &Parameter) -> bool {
    parameter.lower == parameter.upper
}

/// A number as PEST reads it, as many digits as it takes.
pub(crate) fn number(value: f64) -> String {
    format!("{value:E}")
}
