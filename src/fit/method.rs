//! How a fit searches.

/// The ways there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Bounded Levenberg-Marquardt from several starts.
    #[default]
    LeastSquares,
    /// Differential evolution over the whole box; nothing is refined by descent.
    Global,
    /// A micro-genetic algorithm over the whole box; nothing is refined by descent.
    MicroGa,
    /// Differential evolution, then least squares from where it ended.
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

    /// Whether descent has the last word.
    pub fn descends(self) -> bool {
        matches!(self, Method::LeastSquares | Method::GlobalLocal)
    }
}
