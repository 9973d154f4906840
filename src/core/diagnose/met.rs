//! A model that the search has met: what it adds to the start model, how well it is fitted, and where a fit of it may
//! begin.

use crate::diagnose::measures::{square, square_at_optimum};
use crate::fit::inference::thresholds::OPTIMUM_REDUCTION;
use crate::fit::outcome::fit::Fit;
use crate::model::effects::Chosen;

/// Names of the effects that a model has and the start model lacks, in alphabetical order.
pub(crate) type Key = Vec<&'static str>;

/// Whether a model has all effects of another.
pub(crate) fn has_all(key: &[&'static str], of: &[&'static str]) -> bool {
    of.iter().all(|name| key.contains(name))
}

/// A step that was taken: from which state, how, and what that left then.
pub(crate) type Done = (Key, Starts, f64);

/// How a step looks for the fits of a state's neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Starts {
    /// From the state's own fit, by a forecast.
    Forecast,
    /// The leading ones of them from the signals.
    LeadingFromSignals,
    /// All of them from the signals.
    AllFromSignals,
}

/// See the module.
pub(crate) struct Met {
    pub(crate) key: Key,
    /// Where a fit of it may begin. It goes when a fit has begun there.
    pub(crate) forecast: Option<Forecast>,
    pub(crate) fit: Option<Fit>,
    /// It was fitted from the signals.
    pub(crate) is_from_signals: bool,
    /// The fit is at its optimum, on as fine a grid as it takes; or no descent leads on from it.
    pub(crate) is_at_end: bool,
    /// What the fit left when the models around it were looked at.
    pub(crate) looked_around: Option<f64>,
    /// Its elements of creep were pruned, or cannot be.
    pub(crate) is_pruned: bool,
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
}

impl Met {
    pub(crate) fn new(key: Key) -> Self {
        Met {
            key,
            forecast: None,
            fit: None,
            is_from_signals: false,
            is_at_end: false,
            looked_around: None,
            is_pruned: false,
        }
    }

    /// Sum over all samples of (residual / noise)², of the fit or as forecast.
    pub(crate) fn square(&self) -> f64 {
        let forecast = self.forecast.as_ref().map_or(f64::INFINITY, |f| f.square);
        self.fit.as_ref().map_or(forecast, square)
    }

    /// The same at its optimum, without the error of its grid.
    pub(crate) fn promise(&self) -> f64 {
        let fit = self.fit.as_ref().filter(|_| !self.is_at_end);
        fit.map_or_else(|| self.square(), square_at_optimum)
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

    /// Keeps a fit if it leaves less than the one so far, by more than two fits differ that are at one optimum.
    pub(crate) fn take(&mut self, fit: Fit) {
        let same = |known: &Fit| OPTIMUM_REDUCTION * square(known) / known.samples().max(1) as f64;
        if self.fit.as_ref().is_none_or(|known| square(&fit) < square(known) - same(known)) {
            self.is_at_end = false;
            self.is_pruned = false;
            self.fit = Some(fit);
        }
    }
}
