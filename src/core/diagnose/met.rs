//! A model that the search has met: what it adds to the start model, how well it is fitted, and where a fit of it may begin.

use crate::diagnose::measures::square;
use crate::fit::outcome::fit::Fit;
use crate::model::effects::Chosen;

/// Names of the effects that a model has and the start model lacks, in alphabetical order.
pub(crate) type Key = Vec<&'static str>;

/// See the module.
pub(crate) struct Met {
    pub(crate) key: Key,
    /// The best that is known of it without a fit to all samples: a forecast.
    pub(crate) forecast: Option<Forecast>,
    pub(crate) fit: Option<Fit>,
    /// It was fitted from the signals.
    pub(crate) is_from_signals: bool,
    /// It was fitted on until it converged, or cannot be.
    pub(crate) is_converged: bool,
    /// The other effects were tried in the place of each of its own.
    pub(crate) is_contested: bool,
}

/// Where a fit of a model may begin, and what it promises to leave.
#[derive(Debug, Clone)]
pub(crate) struct Forecast {
    pub(crate) effects: Vec<Chosen>,
    /// Values of all variables.
    pub(crate) values: Vec<f64>,
    /// Sum over all samples of (residual / noise)².
    pub(crate) square: f64,
    /// Evidence for it over the model that it was grown from, on the coarse grid.
    pub(crate) evidence: f64,
    /// A fit was begun there.
    pub(crate) is_tried: bool,
}

impl Met {
    pub(crate) fn new(key: Key) -> Self {
        Met { key, forecast: None, fit: None, is_from_signals: false, is_converged: false, is_contested: false }
    }

    /// Sum over all samples of (residual / noise)², of the fit or as forecast.
    pub(crate) fn square(&self) -> f64 {
        let forecast = self.forecast.as_ref().map_or(f64::INFINITY, |f| f.square);
        self.fit.as_ref().map_or(forecast, square)
    }

    /// Its effects, in the form of the fit or of the forecast.
    pub(crate) fn effects(&self) -> Option<&[Chosen]> {
        let forecast = || self.forecast.as_ref().map(|f| &f.effects[..]);
        self.fit.as_ref().map(|fit| &fit.effects[..]).or_else(forecast)
    }

    /// Effects and values of all variables, of the fit or as forecast.
    pub(crate) fn model(&self) -> Option<(&[Chosen], Vec<f64>)> {
        let forecast = || self.forecast.as_ref().map(|f| (&f.effects[..], f.values.clone()));
        self.fit.as_ref().map(|fit| (&fit.effects[..], fit.values())).or_else(forecast)
    }

    /// Keeps a fit if it is better than the one so far.
    pub(crate) fn take(&mut self, fit: Fit) {
        if self.fit.as_ref().is_none_or(|known| square(&fit) < square(known)) {
            self.is_converged = false;
            self.is_contested = false;
            self.fit = Some(fit);
        }
    }
}
