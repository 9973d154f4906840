//! How far a computation has come.

use std::fmt;
use std::sync::Arc;

use crate::model::constraint::Given;
use crate::model::effects::Chosen;

/// How far a calibration or a diagnosis has come. Its text fits one line.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// What is being done, in words.
    pub stage: String,
    /// Where the fit of a model stands, where one is being fitted.
    pub fitting: Option<Fitting>,
    /// The model as it is at this moment, where a descent is on its way.
    pub passing: Option<Arc<Passing>>,
}

/// A model on its way to the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Passing {
    /// Its effects.
    pub effects: Vec<Chosen>,
    /// The values of all its parameters.
    pub given: Vec<Given>,
}

/// Where the fit of a model stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fitting {
    /// Reaches of the grid.
    pub reaches: usize,
    /// Iteration within the stage.
    pub iteration: usize,
    /// Root mean square of the weighted residuals: 1 is the noise.
    pub error_over_noise: f64,
}

/// Learns how far a computation has come; it may be called from several threads.
pub type OnProgress<'a> = dyn Fn(&Progress) + Sync + 'a;

impl Progress {
    /// Of the fit of a model.
    pub fn fitting(stage: impl Into<String>, reaches: usize, iteration: usize, error_over_noise: f64) -> Self {
        Progress { fitting: Some(Fitting { reaches, iteration, error_over_noise }), ..Progress::from(stage) }
    }

    /// The same, with the model as it is at this moment.
    pub fn passing(self, passing: Passing) -> Self {
        Progress { passing: Some(Arc::new(passing)), ..self }
    }

    /// The same as part of something larger.
    pub fn within(&self, whole: &str) -> Self {
        Progress { stage: format!("{whole}, {}", self.stage), ..self.clone() }
    }
}

impl<T: Into<String>> From<T> for Progress {
    fn from(stage: T) -> Self {
        Progress { stage: stage.into(), ..Progress::default() }
    }
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.stage)?;
        if let Some(Fitting { reaches, iteration, error_over_noise }) = self.fitting {
            write!(f, ": {reaches} reaches, iteration {iteration}, error {error_over_noise:.2} x noise")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_says_where_it_stands_and_a_diagnosis_what_it_does() {
        let of_fit = Progress::fitting("fine", 64, 3, 1.234);
        assert_eq!(of_fit.to_string(), "fine: 64 reaches, iteration 3, error 1.23 x noise");
        assert_eq!(of_fit.within("leak").to_string(), "leak, fine: 64 reaches, iteration 3, error 1.23 x noise");
        assert_eq!(Progress::from("leak refitted").to_string(), "leak refitted");
    }
}
