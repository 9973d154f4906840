//! How a fit searches.

/// The ways there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Bounded Levenberg-Marquardt from several starts.
    #[default]
    LeastSquares,
    /// Differential evolution over the whole box, then an evolution strategy that follows the valley found; nothing is refined by descent.
    Global,
    /// A micro-genetic algorithm over the whole box; nothing is refined by descent.
    MicroGa,
    /// The same, then least squares from where it ended.
    GlobalLocal,
    /// One parameter after the other, each from the feature that it moves most.
    Stepwise,
}

impl Method {
    /// Its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Method::LeastSquares => "least-squares",
            Method::Global => "global",
            Method::MicroGa => "micro-ga",
            Method::GlobalLocal => "global-local",
            Method::Stepwise => "stepwise",
        }
    }

    /// How a model is calibrated by it, in running text.
    pub fn in_words(self) -> &'static str {
        match self {
            Method::LeastSquares => "least squares",
            Method::Global => "differential evolution and CMA-ES",
            Method::MicroGa => "a micro-genetic algorithm",
            Method::GlobalLocal => "differential evolution and CMA-ES, then least squares",
            Method::Stepwise => "steps by features and by the whole record in turn",
        }
    }

    /// What to do where it ended short of an optimum.
    pub fn advice(self) -> &'static str {
        match self {
            Method::LeastSquares => {
                "take --method stepwise, or a smaller model, or start it elsewhere (--start, --starts)"
            }
            Method::GlobalLocal => "raise --budget, or draw anew with another --seed",
            Method::Global | Method::MicroGa => "raise --budget, or take --method global-local",
            Method::Stepwise => {
                "go on with it (--save MODEL.toml, then --from MODEL.toml), or take --method least-squares"
            }
        }
    }

    /// Whether descent has the last word.
    pub fn descends(self) -> bool {
        matches!(self, Method::LeastSquares | Method::GlobalLocal)
    }
}
