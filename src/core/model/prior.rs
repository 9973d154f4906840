//! What is known of a parameter before the fit, from elsewhere than the recordings.

use crate::model::parameter::Parameter;

/// Knowledge of a shared parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// The parameter's name.
    pub name: String,
    /// Where it is most likely, in the parameter's unit.
    pub mean: f64,
    /// Standard deviation: relative where the parameter is moved as a logarithm, otherwise in its unit.
    pub sd: f64,
}

impl Prior {
    /// Tells a parameter, which then starts there.
    pub fn inform(&self, parameter: &mut Parameter) {
        parameter.start = self.mean.clamp(parameter.lower, parameter.upper);
        parameter.prior = Some((self.mean, self.sd));
    }
}
