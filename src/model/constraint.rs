//! What a person has settled about a parameter: narrower bounds, or its value.

use super::parameter::Parameter;

/// A parameter that is held, or kept between bounds other than its usual ones. Values are in the parameter's own unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraint {
    /// The parameter's name.
    pub name: String,
    /// The run it belongs to where it is not shared by all.
    pub run: Option<String>,
    /// Least value that a fit may take.
    pub lower: f64,
    /// Greatest value that a fit may take.
    pub upper: f64,
}

impl Constraint {
    /// Whether it is about the parameter `name` of `run`.
    pub fn concerns(&self, name: &str, run: Option<&str>) -> bool {
        self.name == name && self.run.as_deref() == run
    }

    /// Whether it leaves no choice.
    pub fn holds(&self) -> bool {
        self.lower == self.upper
    }

    /// Narrows a parameter, wherever its start lay.
    pub fn narrow(&self, parameter: &mut Parameter) {
        (parameter.lower, parameter.upper) = (self.lower, self.upper);
        parameter.start = parameter.start.clamp(self.lower, self.upper);
    }
}
