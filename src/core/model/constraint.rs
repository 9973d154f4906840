//! User settings for a parameter: a held value, other bounds, or a start.

use crate::model::parameter::{Parameter, Scale};

/// Holds a parameter, or keeps it between other than its usual bounds. Values are in the parameter's own unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraint {
    /// The parameter's name.
    pub name: String,
    /// The run it belongs to, if the parameter is a run's own.
    pub run: Option<String>,
    /// Least value that a fit may take.
    pub lower: f64,
    /// Greatest value that a fit may take.
    pub upper: f64,
}

/// A start value that the user gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The parameter's name.
    pub name: String,
    /// The run it belongs to; none for a shared parameter, and for a run's own parameter in all runs.
    pub run: Option<String>,
    /// The value, in the parameter's own unit.
    pub value: f64,
}

impl Given {
    /// Whether it applies to the parameter `name` of `run`.
    pub fn concerns(&self, name: &str, run: Option<&str>) -> bool {
        self.name == name && (self.run.is_none() || self.run.as_deref() == run)
    }
}

impl Constraint {
    /// Whether it applies to the parameter `name` of `run`.
    pub fn concerns(&self, name: &str, run: Option<&str>) -> bool {
        self.name == name && self.run.as_deref() == run
    }

    /// Whether it holds the parameter at one value.
    pub fn holds(&self) -> bool {
        self.lower == self.upper
    }

    /// Whether the bounds are valid for a parameter: in order, finite, and above zero on a log scale.
    pub fn suits(&self, parameter: &Parameter) -> bool {
        let ordered = self.lower <= self.upper && self.lower.is_finite() && self.upper.is_finite();
        ordered && (parameter.scale == Scale::Linear || self.lower > 0.0)
    }

    /// Applies to a parameter: narrows its bounds, wherever its start lay.
    pub fn narrow(&self, parameter: &mut Parameter) {
        if !self.suits(parameter) {
            return;
        }
        (parameter.lower, parameter.upper) = (self.lower, self.upper);
        parameter.start = parameter.start.clamp(self.lower, self.upper);
    }
}
