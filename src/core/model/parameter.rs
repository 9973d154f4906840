//! A parameter: its name with the unit, its bounds, and its scale in a fit.

/// Scale on which a fit moves a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum Scale {
    /// In equal steps.
    #[default]
    Linear,
    /// In equal ratios; bounds are positive. Strengths go by amounts, see [`Parameter::is_strength`].
    Log,
}

impl Scale {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Scale::Linear => "linear",
            Scale::Log => "log",
        }
    }
}

/// One parameter of a model. Values, bounds and prior are in `unit`.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name with its unit, e.g. `wave_speed_m_s`.
    pub name: String,
    /// Unit as displayed.
    pub unit: &'static str,
    /// What it is, in words.
    pub about: &'static str,
    /// Where a fit starts.
    pub start: f64,
    /// Least value a fit may take.
    pub lower: f64,
    /// Greatest value a fit may take.
    pub upper: f64,
    /// How a fit moves it.
    pub scale: Scale,
    /// The value at which the effect vanishes, if there is one.
    pub vanishes_at: Option<f64>,
    /// Prior: mean, and a standard deviation that is relative on a log scale.
    pub prior: Option<(f64, f64)>,
}

impl Parameter {
    /// A log-scaled parameter without prior.
    pub fn log(
        name: impl Into<String>,
        unit: &'static str,
        about: &'static str,
        start: f64,
        lower: f64,
        upper: f64,
    ) -> Self {
        Parameter {
            name: name.into(),
            unit,
            about,
            start,
            lower,
            upper,
            scale: Scale::Log,
            vanishes_at: None,
            prior: None,
        }
    }

    /// A linear parameter without prior.
    pub fn linear(
        name: impl Into<String>,
        unit: &'static str,
        about: &'static str,
        start: f64,
        lower: f64,
        upper: f64,
    ) -> Self {
        Parameter { scale: Scale::Linear, ..Parameter::log(name, unit, about, start, lower, upper) }
    }

    /// Whether it is a strength: positive, and nothing is left of the effect at 0.
    pub fn is_strength(&self) -> bool {
        self.scale == Scale::Log && self.vanishes_at == Some(0.0)
    }

    /// Sets the prior.
    pub fn with_prior(self, mean: f64, deviation: f64) -> Self {
        Parameter { prior: Some((mean, deviation)), ..self }
    }

    /// The same with what a rig file knows of it: a nominal value, exact if its tolerance, a share of it, is 0. Without
    /// a tolerance it stays as it is.
    pub fn known_within(self, nominal: f64, tolerance: Option<f64>) -> Self {
        match tolerance {
            Some(0.0) => Parameter { start: nominal, lower: nominal, upper: nominal, ..self },
            Some(share) => Parameter { start: nominal, ..self }.with_prior(nominal, share),
            None => self,
        }
    }

    /// Sets the value at which the effect vanishes.
    pub fn vanishing_at(self, value: f64) -> Self {
        Parameter { vanishes_at: Some(value), ..self }
    }
}
