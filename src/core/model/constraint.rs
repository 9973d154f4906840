//! What a person has settled about a parameter: narrower bounds, or its value.

use crate::model::parameter::{Parameter, Scale};

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

/// Where a person lets a parameter start.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The parameter's name.
    pub name: String,
    /// The run it belongs to; none for one that all share, and for that of each run alike.
    pub run: Option<String>,
    /// The value, in the parameter's own unit.
    pub value: f64,
}

impl Given {
    /// Whether it is about the parameter `name` of `run`.
    pub fn concerns(&self, name: &str, run: Option<&str>) -> bool {
        self.name == name && (self.run.is_none() || self.run.as_deref() == run)
    }
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

    /// Whether a parameter can have these bounds: in order, finite, and more than zero where it is moved as a logarithm.
    pub fn suits(&self, parameter: &Parameter) -> bool {
        let ordered = self.lower <= self.upper && self.lower.is_finite() && self.upper.is_finite();
        ordered && (parameter.scale == Scale::Linear || self.lower > 0.0)
    }

    /// Narrows a parameter that it suits, wherever its start lay.
    pub fn narrow(&self, parameter: &mut Parameter) {
        if !self.suits(parameter) {
            return;
        }
        (parameter.lower, parameter.upper) = (self.lower, self.upper);
        parameter.start = parameter.start.clamp(self.lower, self.upper);
    }
}
