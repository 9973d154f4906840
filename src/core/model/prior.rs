//! Prior knowledge of a parameter, from sources other than the recordings.

use crate::model::parameter::Parameter;

/// Prior of a shared parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// The parameter's name.
    pub name: String,
    /// Most likely value, in the parameter's unit.
    pub mean: f64,
    /// Standard deviation: relative if the fit moves the parameter on a log scale, else in its unit.
    pub sd: f64,
}

impl Prior {
    /// Gives a parameter this prior and starts it there.
    pub fn inform(&self, parameter: &mut Parameter) {
        parameter.start = self.mean.clamp(parameter.lower, parameter.upper);
        parameter.prior = Some((self.mean, self.sd));
    }
}
