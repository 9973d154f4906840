//! The method of search.

/// The methods of search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Method {
    /// Bounded Levenberg-Marquardt from several starts.
    #[default]
    LeastSquares,
    /// Differential evolution over the whole box, then an evolution strategy that follows the valley found; nothing is
    /// refined by descent.
    Global,
    /// A micro-genetic algorithm over the whole box; nothing is refined by descent.
    MicroGa,
    /// The same, then least squares from where it ended.
    GlobalLocal,
    /// A few parameters at a time, each from the feature that it moves most.
    Stepwise,
}

impl Method {
    /// Every method.
    pub const ALL: [Method; 5] =
        [Method::LeastSquares, Method::Global, Method::MicroGa, Method::GlobalLocal, Method::Stepwise];

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

    /// Its description in running text.
    pub fn in_words(self) -> &'static str {
        match self {
            Method::LeastSquares => "least squares",
            Method::Global => "differential evolution and CMA-ES",
            Method::MicroGa => "a micro-genetic algorithm",
            Method::GlobalLocal => "differential evolution and CMA-ES, then least squares",
            Method::Stepwise => "steps by features and by the whole record in turn",
        }
    }

    /// Advice where it ended short of an optimum.
    pub fn advice(self) -> &'static str {
        match self {
            Method::LeastSquares => {
                "use option `method stepwise`, a smaller model, or other starts (option `start`, option `starts`)"
            }
            Method::GlobalLocal => "raise option `budget`, or use another option `seed`",
            Method::Global | Method::MicroGa => "raise option `budget`, or use option `method global-local`",
            Method::Stepwise => {
                "continue it (option `save MODEL.toml`, then option `from MODEL.toml`), or use option `method least-squares`"
            }
        }
    }

    /// Whether it ends with a descent.
    pub fn descends(self) -> bool {
        matches!(self, Method::LeastSquares | Method::GlobalLocal)
    }
}
