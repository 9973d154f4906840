//! How a calibration searches, as the command line says it.

use std::error::Error;
use std::path::PathBuf;

use clap::ValueEnum;

use super::models;
use crate::fit::calibrate::Options;
use crate::fit::method;
use crate::model::constraint::Given;

/// Options of a search.
#[derive(Debug, clap::Args)]
pub struct Search {
    /// How to search.
    #[arg(long, value_enum, default_value_t = Method::LeastSquares)]
    method: Method,
    /// Random starts of least squares, over the whole range of the shared parameters, beside those that it has of its own.
    #[arg(long, value_name = "N", default_value_t = 0)]
    starts: usize,
    /// Simulations that a global search or micro-genetic algorithm may take for one model.
    #[arg(long, value_name = "N", default_value_t = Options::default().budget)]
    budget: usize,
    /// Seed of all that is drawn at random.
    #[arg(long, value_name = "N", default_value_t = Options::default().seed)]
    seed: u64,
    /// Stop a stepwise calibration after so many steps.
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Where parameters start, instead of where signals, rig and effects say; one that each run has of its own starts there in all of them. Recordings go before it.
    #[arg(long, value_name = "NAME=VALUE", value_parser = super::values::setting, num_args = 1..)]
    start: Vec<(String, f64)>,
    /// Start from the values of the model in force in this file.
    #[arg(long, value_name = "MODEL.toml")]
    from: Option<PathBuf>,
}

/// How to search for the best parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Bounded Levenberg-Marquardt from several starts.
    LeastSquares,
    /// Differential evolution over the whole box.
    Global,
    /// A micro-genetic algorithm over the whole box.
    MicroGa,
    /// Differential evolution, then least squares from where it ended.
    GlobalLocal,
    /// One parameter after the other, each from the feature that it moves most.
    Stepwise,
}

impl From<Method> for method::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::LeastSquares => method::Method::LeastSquares,
            Method::Global => method::Method::Global,
            Method::MicroGa => method::Method::MicroGa,
            Method::GlobalLocal => method::Method::GlobalLocal,
            Method::Stepwise => method::Method::Stepwise,
        }
    }
}

impl Search {
    /// How it searches.
    pub fn method(&self) -> method::Method {
        self.method.into()
    }

    /// Refuses a start for what is none of the `known` parameters.
    ///
    /// # Errors
    /// The first such.
    pub fn check<'a>(&self, known: impl Iterator<Item = &'a str> + Clone) -> Result<(), String> {
        match self.start.iter().find(|(name, _)| !known.clone().any(|k| k == name)) {
            None => Ok(()),
            Some((name, _)) => {
                let known: std::collections::BTreeSet<&str> = known.collect();
                let known = known.into_iter().collect::<Vec<_>>().join(", ");
                Err(format!("the model has no parameter '{name}' to start; it has {known}"))
            }
        }
    }

    /// Options of a fit that searches so.
    ///
    /// # Errors
    /// A file of models that cannot be read.
    pub fn options(&self) -> Result<Options, Box<dyn Error + Send + Sync>> {
        let said = self.start.iter().map(|(name, value)| Given { name: name.clone(), run: None, value: *value });
        let mut starts_at: Vec<Given> = said.collect();
        if let Some(path) = &self.from {
            let known = models::load(path)?;
            let of =
                |p: &crate::fit::model_file::Value| Given { name: p.name.clone(), run: p.run.clone(), value: p.value };
            // What is said on the command line goes first.
            starts_at.extend(known.current().parameters.iter().map(of));
        }
        Ok(Options {
            method: self.method.into(),
            starts: self.starts,
            budget: self.budget,
            seed: self.seed,
            most_steps: self.steps.unwrap_or(usize::MAX),
            starts_at,
            ..Options::default()
        })
    }
}
