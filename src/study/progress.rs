//! How far a computation has come.

use std::fmt;

use crate::fit::search::options;

/// How far a calibration or a diagnosis has come. Its text fits one line.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// What is being done, in words.
    pub stage: String,
    /// Reaches of the grid, where a model is being fitted.
    pub reaches: Option<usize>,
    /// Iteration within the stage, where a model is being fitted.
    pub iteration: Option<usize>,
    /// Root mean square of the residuals over their noise, where a model is being fitted: 1 is the noise.
    pub error_over_noise: Option<f64>,
}

impl From<&options::Progress> for Progress {
    fn from(p: &options::Progress) -> Self {
        Progress {
            stage: p.stage.clone(),
            reaches: Some(p.reaches),
            iteration: Some(p.iteration),
            error_over_noise: Some(p.error_over_noise),
        }
    }
}

impl From<&str> for Progress {
    fn from(stage: &str) -> Self {
        Progress { stage: stage.to_owned(), ..Progress::default() }
    }
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.stage)?;
        if let (Some(reaches), Some(iteration), Some(error)) = (self.reaches, self.iteration, self.error_over_noise) {
            write!(f, ": {reaches} reaches, iteration {iteration}, error {error:.2} x noise")?;
        }
        Ok(())
    }
}

/// Learns how far a computation has come; it may be called from several threads.
pub type OnProgress<'a> = dyn Fn(&Progress) + Sync + 'a;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_says_where_it_stands_and_a_diagnosis_what_it_does() {
        let of_fit = options::Progress { stage: "fine".into(), reaches: 64, iteration: 3, error_over_noise: 1.234 };
        assert_eq!(Progress::from(&of_fit).to_string(), "fine: 64 reaches, iteration 3, error 1.23 x noise");
        assert_eq!(Progress::from("leak refitted").to_string(), "leak refitted");
    }
}
