//! How a calibration searches, as the command line says it.

use std::error::Error;
use std::path::PathBuf;

use clap::ValueEnum;

use crate::fit::problem::method;
use crate::fit::search::options::Options;
use crate::model::constraint::Given;
use crate::results::model_file::Entry;
use crate::study::models;

/// More would take hours of any model.
const MOST_STARTS: i64 = 10_000;

/// Options of a search.
#[derive(Debug, clap::Args)]
pub struct Search {
    /// How to search.
    #[arg(long, value_enum, default_value_t = Method::LeastSquares)]
    method: Method,
    /// Additional random starts of least squares over the whole range of the shared parameters.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=MOST_STARTS),
          allow_negative_numbers = true)]
    starts: Option<u32>,
    /// Most simulations of a global search or micro-genetic algorithm per model [default: 20000].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    budget: Option<u32>,
    /// Seed of the random draws.
    #[arg(long, value_name = "N", default_value_t = Options::default().seed, allow_negative_numbers = true)]
    seed: u64,
    /// Stop a stepwise calibration after this many steps; continue it later with --save and --from.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    steps: Option<usize>,
    /// Start parameters at these values instead of those from signals, rig and effects; a parameter of each run starts there in all runs. Name the
    /// recordings first.
    #[arg(long, value_name = "NAME=VALUE", value_parser = crate::cli::args::values::setting, num_args = 1..)]
    start: Vec<(String, f64)>,
    /// Continue from the current model of this model file: with its values, held parameters (`fixed = true`), bounds and priors, and its effects
    /// unless others are given. A stepwise calibration first uses the features left from last time (`features_left`), then the whole record.
    #[arg(long, value_name = "MODEL.toml")]
    from: Option<PathBuf>,
}

/// How to search for the best parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Bounded Levenberg-Marquardt from several starts.
    LeastSquares,
    /// Differential evolution over the whole range, then a covariance-adapting evolution strategy (CMA-ES) around the best point.
    Global,
    /// A micro-genetic algorithm over the whole range.
    MicroGa,
    /// The global search, then least squares from its result.
    GlobalLocal,
    /// One parameter after the other, each from the feature that it affects most.
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
    /// Where parameters are to start.
    pub fn started(&self) -> &[(String, f64)] {
        &self.start
    }

    /// Refuses a start for what is `held`: it does not move.
    ///
    /// # Errors
    /// The first such.
    pub fn check_held<'a>(&self, mut held: impl Iterator<Item = &'a str>) -> Result<(), String> {
        match held.find(|held| self.start.iter().any(|(name, _)| name == held)) {
            None => Ok(()),
            Some(name) => {
                Err(format!("{name} is held, so it cannot start elsewhere: leave it out of --start, or do not hold it"))
            }
        }
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

    /// The model that it goes on from.
    ///
    /// # Errors
    /// A file of models that cannot be read.
    pub fn from(&self) -> Result<Option<Entry>, Box<dyn Error + Send + Sync>> {
        self.from.as_ref().map(|path| Ok(models::load(path)?.current().clone())).transpose()
    }

    /// Refuses what the method does not heed.
    fn refuse_unheeded(&self) -> Result<(), String> {
        use Method::{Global, GlobalLocal, LeastSquares, MicroGa, Stepwise};
        let unheeded = |option: &str, given: bool, of: &[Method]| match given && !of.contains(&self.method) {
            false => Ok(()),
            true => {
                let names: Vec<&str> = of.iter().map(|&m| method::Method::from(m).name()).collect();
                let own = method::Method::from(self.method).name();
                Err(format!("{option} is for --method {}; --method {own} does not use it", names.join(", ")))
            }
        };
        unheeded("--starts", self.starts.is_some(), &[LeastSquares])?;
        unheeded("--budget", self.budget.is_some(), &[Global, MicroGa, GlobalLocal])?;
        unheeded("--steps", self.steps.is_some(), &[Stepwise])
    }

    /// Options of a fit that searches so, going on `from` a model.
    ///
    /// # Errors
    /// What the method does not heed.
    pub fn options(&self, from: Option<&Entry>) -> Result<Options, String> {
        self.refuse_unheeded()?;
        let given = self.start.iter().map(|(name, value)| Given { name: name.clone(), run: None, value: *value });
        // The command line goes first.
        let starts_at = given.chain(from.iter().flat_map(|model| model.given())).collect();
        let usual = Options::default();
        Ok(Options {
            method: self.method.into(),
            starts: self.starts.map_or(usual.starts, |n| n as usize),
            budget: self.budget.map_or(usual.budget, |budget| budget as usize),
            seed: self.seed,
            most_steps: self.steps.unwrap_or(usual.most_steps),
            features_left: from.map(|model| model.features_left.clone()),
            starts_at,
            ..usual
        })
    }
}
