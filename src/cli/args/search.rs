//! How a calibration searches, as the command line says it.

use std::error::Error;
use std::path::PathBuf;

use clap::ValueEnum;

use crate::fit::problem::method;
use crate::fit::search::options::Options;
use crate::results::model_file::Entry;
use crate::study::{models, search};

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
    /// Start parameters at these values instead of those from signals, rig and effects; a parameter of each run starts
    /// there in all runs. Name the recordings first.
    #[arg(long, value_name = "NAME=VALUE", value_parser = crate::cli::args::values::setting, num_args = 1..)]
    start: Vec<(String, f64)>,
    /// Continue from the current model of this model file: with its values, held parameters (`fixed = true`), bounds
    /// and priors, and its effects unless others are given. A stepwise calibration first uses the features left from
    /// last time (`features_left`), then the whole record.
    #[arg(long, value_name = "MODEL.toml")]
    from: Option<PathBuf>,
}

/// How to search for the best parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Bounded Levenberg-Marquardt from several starts.
    LeastSquares,
    /// Differential evolution over the whole range, then a covariance-adapting evolution strategy (CMA-ES) around the
    /// best point.
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

    /// The same as the library takes it.
    pub fn said(&self) -> search::Search {
        search::Search {
            method: self.method.into(),
            starts: self.starts.map(|n| n as usize),
            budget: self.budget.map(|n| n as usize),
            steps: self.steps,
            seed: Some(self.seed),
            start: self.start.clone(),
        }
    }

    /// The model that it goes on from.
    ///
    /// # Errors
    /// A file of models that cannot be read.
    pub fn from(&self) -> Result<Option<Entry>, Box<dyn Error + Send + Sync>> {
        self.from.as_ref().map(|path| Ok(models::load(path)?.current().clone())).transpose()
    }
}
