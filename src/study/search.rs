//! How a calibration searches, as a person says it.

use std::collections::BTreeSet;

use crate::fit::problem::method::Method;
use crate::fit::search::options::Options;
use crate::model::constraint::Given;
use crate::results::model_file::Entry;

/// See the module. What is not said is as [`Options::default`] has it.
#[derive(Debug, Clone, Default)]
pub struct Search {
    /// How to search.
    pub method: Method,
    /// Random starts of least squares.
    pub starts: Option<usize>,
    /// Most simulations of a global search.
    pub budget: Option<usize>,
    /// Most steps of a stepwise calibration.
    pub steps: Option<usize>,
    /// Seed of the random draws.
    pub seed: Option<u64>,
    /// Where parameters are to start; of each run those of a run.
    pub start: Vec<(String, f64)>,
}

/// A search that contradicts itself, or the model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum SearchError {
    #[error("option `{option}` is for option `method {heeding}`; option `method {own}` does not use it")]
    Unheeded { option: &'static str, heeding: String, own: &'static str },
    #[error("{0} is held, so it cannot start elsewhere: leave it out of option `start`, or do not hold it")]
    Held(String),
    #[error("the model has no parameter '{name}' to start; it has {known}")]
    NoSuchParameter { name: String, known: String },
}

impl Search {
    /// Options of a fit that searches so, going on `from` a model of a file.
    ///
    /// # Errors
    /// What the method does not heed.
    pub fn options(&self, from: Option<&Entry>) -> Result<Options, SearchError> {
        use Method::{Global, GlobalLocal, LeastSquares, MicroGa, Stepwise};
        self.heeded("starts", self.starts.is_some(), &[LeastSquares])?;
        self.heeded("budget", self.budget.is_some(), &[Global, MicroGa, GlobalLocal])?;
        self.heeded("steps", self.steps.is_some(), &[Stepwise])?;
        let given = self.start.iter().map(|(name, value)| Given { name: name.clone(), run: None, value: *value });
        // What a person says goes first.
        let starts_at = given.chain(from.iter().flat_map(|model| model.given())).collect();
        let usual = Options::default();
        Ok(Options {
            method: self.method,
            starts: self.starts.unwrap_or(usual.starts),
            budget: self.budget.unwrap_or(usual.budget),
            seed: self.seed.unwrap_or(usual.seed),
            most_steps: self.steps.unwrap_or(usual.most_steps),
            features_left: from.map(|model| model.features_left.clone()),
            starts_at,
            ..usual
        })
    }

    /// Refuses an option that is `given` although only other methods heed it.
    fn heeded(&self, option: &'static str, given: bool, by: &[Method]) -> Result<(), SearchError> {
        if !given || by.contains(&self.method) {
            return Ok(());
        }
        let heeding = by.iter().map(|method| method.name()).collect::<Vec<_>>().join(", ");
        Err(SearchError::Unheeded { option, heeding, own: self.method.name() })
    }

    /// Refuses a start for what is `held`: it does not move.
    ///
    /// # Errors
    /// The first such.
    pub fn check_held<'a>(&self, mut held: impl Iterator<Item = &'a str>) -> Result<(), SearchError> {
        let both = held.find(|held| self.start.iter().any(|(name, _)| name == held));
        both.map_or(Ok(()), |name| Err(SearchError::Held(name.to_owned())))
    }

    /// Refuses a start for what is none of the `known` parameters.
    ///
    /// # Errors
    /// The first such.
    pub fn check<'a>(&self, known: impl Iterator<Item = &'a str> + Clone) -> Result<(), SearchError> {
        match self.start.iter().find(|(name, _)| !known.clone().any(|k| k == name)) {
            None => Ok(()),
            Some((name, _)) => {
                let known: BTreeSet<&str> = known.collect();
                let known = known.into_iter().collect::<Vec<_>>().join(", ");
                Err(SearchError::NoSuchParameter { name: name.clone(), known })
            }
        }
    }
}
