//! Why the interval of a fitted parameter is in doubt.

/// Why an interval from a standard error is in doubt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Doubt {
    /// The value is at a bound, or one lies within 1.96 standard errors of it.
    Bound,
    /// The model does not change along a straight line as far as the interval goes.
    Curved,
    /// The recordings leave the value open.
    Open,
}

impl Doubt {
    /// As a word.
    pub fn name(self) -> &'static str {
        match self {
            Doubt::Bound => "bound",
            Doubt::Curved => "curved",
            Doubt::Open => "open",
        }
    }
}
