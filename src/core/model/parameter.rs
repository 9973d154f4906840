//! A parameter: its name with the unit, where it may lie, and how the fit moves it.

/// How a fit moves a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// In equal steps.
    #[default]
    Linear,
    /// In equal ratios; bounds are positive.
    Log,
}

impl Scale {
    /// What files call it.
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
    /// What it is, for people.
    pub about: &'static str,
    /// Where a fit starts.
    pub start: f64,
    /// Least value a fit may take.
    pub lower: f64,
    /// Greatest value a fit may take.
    pub upper: f64,
    /// How a fit moves it.
    pub scale: Scale,
    /// The value at which what it describes is gone, where there is one.
    pub vanishes_at: Option<f64>,
    /// What is known before the fit: mean, and a standard deviation that is relative on a log scale.
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

    /// With what is known before the fit.
    pub fn with_prior(self, mean: f64, deviation: f64) -> Self {
        Parameter { prior: Some((mean, deviation)), ..self }
    }

    /// With the value at which what it describes is gone.
    pub fn vanishing_at(self, value: f64) -> Self {
        Parameter { vanishes_at: Some(value), ..self }
    }
}
