//! Effects in competition: the best form of each, what it leaves, and its fit to all samples.

use crate::diagnose::baseline::Ground;
use crate::diagnose::evidence::{Worth, tempered};
use crate::diagnose::refit::Refit;
use crate::diagnose::verdict::LEAST_EVIDENCE;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::outcome::uncertainty::Uncertainty;
use crate::fit::problem::error::FitError;
use crate::fit::search::calibrate::{CoarseFit, calibrate, fit_coarsely, refine, with_more_elements};
use crate::fit::search::options::{Options, Progress};
use crate::model::effects::{CERTAIN, Chosen, Circumstances};
use crate::rig::Rig;

/// Finest grid of a fit with cavities: the spikes of their collapse belong to the grid (Bergant, Simpson & Tijsseling 2006).
const MOST_REACHES_WITH_CAVITIES: usize = 128;

/// Iterations on each of the finer grids until it is known who wins.
const GLANCED: usize = 6;

/// An effect in its best form.
pub(crate) struct Rival<'a> {
    pub(crate) refit: &'a Refit,
    pub(crate) evidence: f64,
    /// Sum over all samples of the residual's square over the noise's, of the fit or as forecast.
    pub(crate) square: f64,
    pub(crate) fit: Option<Fit>,
}

impl<'a> Rival<'a> {
    /// As the refit forecasts it from what it leaves of the start model's square.
    pub(crate) fn forecast(ground: &Ground, start: &Fit, refit: &'a Refit, evidence: f64) -> Self {
        let left = ground.mean_square(&refit.residuals) / ground.mean_square(&ground.residuals);
        Rival { refit, evidence, square: square(start) * left, fit: None }
    }

    pub(crate) fn odds(&self, known: &Circumstances) -> f64 {
        // What speaks for an effect beforehand does not make up for a fit that has nothing of it.
        let odds = self.refit.form.chosen.effect.odds(known);
        // What a record shows by itself needs a model that is better with it, no more.
        let least = if odds >= CERTAIN { 0.0 } else { LEAST_EVIDENCE };
        if self.evidence < least { odds.min(1.0) } else { odds }
    }

    pub(crate) fn log_odds(&self, known: &Circumstances) -> f64 {
        tempered(self.evidence) + self.odds(known).ln()
    }

    /// Its effects and the values of all variables, of its fit where there is one.
    pub(crate) fn model(&self) -> (&[Chosen], Vec<f64>) {
        match &self.fit {
            Some(fit) => (&fit.effects, fit.values()),
            None => (&self.refit.effects, self.refit.values.clone()),
        }
    }

    /// The form of its fit, where there is one.
    pub(crate) fn label(&self) -> String {
        let fitted = self.fit.as_ref().and_then(|f| f.effects.last());
        fitted.unwrap_or(&self.refit.form.chosen).label()
    }

    /// Free parameters that it has more than the start model, more elements of an effect of that among them.
    pub(crate) fn added(&self, ground: &Ground, start: &Fit) -> usize {
        let own = self.refit.values.len() - ground.values.len();
        let more = self.fit.as_ref().map_or(0, |f| f.parameters.len().saturating_sub(start.parameters.len() + own));
        self.refit.added + more
    }

    /// Its error as a part of the start model's.
    pub(crate) fn left_of(&self, start: &Fit) -> f64 {
        (self.square / square(start)).sqrt()
    }

    /// Whether there is more of it than every rig has.
    pub(crate) fn is_noteworthy(&self, ground: &Ground) -> bool {
        let values: Vec<f64> = self.own_parameters(ground).iter().map(|p| p.value).collect();
        self.refit.form.chosen.effect.noteworthy(&values)
    }

    /// Keeps a fit if it is better than the one known.
    pub(crate) fn take(&mut self, fit: Result<Fit, FitError>) {
        if let Ok(fit) = fit
            && self.fit.as_ref().is_none_or(|known| square(&fit) < square(known))
        {
            self.square = square(&fit);
            self.fit = Some(fit);
        }
    }

    /// The added effect's parameters.
    pub(crate) fn own_parameters(&self, ground: &Ground) -> Vec<FittedParameter> {
        let own = |effects: &[Chosen]| {
            let model = ground.model(effects);
            let size = model.effect_sizes().last().copied().unwrap_or(0);
            (model.shared.len() - size..model.shared.len(), model.shared)
        };
        if let Some(fit) = &self.fit {
            return fit.parameters[own(&fit.effects).0].to_vec();
        }
        let (range, shared) = own(&self.refit.effects);
        shared[range.clone()]
            .iter()
            .zip(&self.refit.values[range])
            .map(|(p, &value)| FittedParameter {
                name: p.name.clone(),
                about: p.about,
                run: None,
                value,
                uncertainty: Uncertainty::NotAtOptimum,
                interval_95: (f64::NEG_INFINITY, f64::INFINITY),
                profile: None,
                unit: p.unit,
                at_bound: value <= p.lower || value >= p.upper,
                lower: p.lower,
                upper: p.upper,
                held: false,
                prior: None,
                scale: p.scale,
                belief: p.prior,
            })
            .collect()
    }
}

/// Sum over all samples of the residual's square over the noise's.
pub(crate) fn square(fit: &Fit) -> f64 {
    let sensors = fit.runs.iter().flat_map(|r| &r.sensors);
    sensors.map(|s| s.time_s.len() as f64 * (s.rmse_m / s.white_noise_m).powi(2)).sum()
}

/// What a fit's residuals say evidence is worth.
pub(crate) fn worth(fit: &Fit, features: f64) -> Worth {
    let residuals: Vec<f64> = fit
        .runs
        .iter()
        .flat_map(|r| &r.sensors)
        .flat_map(|s| s.measured_m.iter().zip(&s.model_m).map(|(a, b)| (a - b) / s.white_noise_m))
        .collect();
    Worth::of(&residuals, features)
}

/// The best form of each effect, with its evidence.
pub(crate) fn best_forms(refits: &[Refit], evidence: impl Fn(&Refit) -> f64) -> Vec<(f64, &Refit)> {
    let mut best: Vec<(f64, &Refit)> = Vec::new();
    for refit in refits {
        let own = evidence(refit);
        match best.iter_mut().find(|(_, b)| b.form.effect == refit.form.effect) {
            Some(known) if own > known.0 => *known = (own, refit),
            Some(_) => {}
            None => best.push((own, refit)),
        }
    }
    best
}

/// Fits candidates to all samples on the fine grid.
pub(crate) struct Finisher<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) runs: &'a [RunData],
    /// The start model's effects as they were asked for.
    pub(crate) effects: &'a [Chosen],
    pub(crate) options: &'a Options,
    pub(crate) progress: &'a (dyn Fn(&str) + Sync),
}

impl Finisher<'_> {
    /// From where the refit ended.
    pub(crate) fn finished(&self, refit: &Refit) -> Result<Fit, FitError> {
        self.refined(refit, &refit.effects, &refit.values)
    }

    /// From where a coarse fit ended.
    pub(crate) fn refined(&self, refit: &Refit, effects: &[Chosen], values: &[f64]) -> Result<Fit, FitError> {
        // Elements had better be added one by one.
        if refit.form.chosen.elements.is_some() {
            return self.scratch_fit(refit);
        }
        let shown = |p: &Progress| (self.progress)(&format!("{} added, {}", refit.form.effect, p.stage));
        refine(self.rig, self.runs, effects, values, &self.options_of(refit), &shown)
    }

    /// From the signals, as if nothing had been fitted before.
    pub(crate) fn scratch_fit(&self, refit: &Refit) -> Result<Fit, FitError> {
        let effects: Vec<Chosen> =
            self.effects.iter().cloned().chain([Chosen { elements: None, ..refit.form.chosen.clone() }]).collect();
        let shown = |p: &Progress| (self.progress)(&format!("{} from scratch, {}", refit.form.effect, p.stage));
        calibrate(self.rig, self.runs, &effects, &self.options_of(refit), &shown)
    }

    /// A coarse fit from the signals.
    pub(crate) fn approached(&self, refit: &Refit) -> Result<CoarseFit, FitError> {
        (self.progress)(&format!("{} from the signals", refit.form.effect));
        let mut effects = refit.effects.clone();
        if let Some(added) = effects.last_mut() {
            added.sensor = None;
        }
        fit_coarsely(self.rig, self.runs, &effects, self.options)
    }

    /// With more elements of what the start model has, if their number was left open and the fit asks for more.
    pub(crate) fn with_more_elements(&self, rival: &Rival) -> Result<Fit, FitError> {
        let fit = rival.fit.as_ref().ok_or(FitError::NoRun)?;
        let shown = |p: &Progress| (self.progress)(&format!("{} and more elements, {}", rival.label(), p.stage));
        let grown = with_more_elements(self.rig, self.runs, fit, self.effects, &self.options_of(rival.refit), &shown)?;
        grown.ok_or(FitError::NoRun)
    }

    fn options_of(&self, refit: &Refit) -> Options {
        let boils = refit.effects.iter().any(|c| c.effect.lets_boil());
        let most = if boils { MOST_REACHES_WITH_CAVITIES } else { usize::MAX };
        Options { most_reaches: self.options.most_reaches.min(most), patience: GLANCED, ..self.options.clone() }
    }

    /// The fit of a rival, with all patience.
    pub(crate) fn settled(&self, rival: &Rival) -> Result<Fit, FitError> {
        let fit = rival.fit.as_ref().ok_or(FitError::NoRun)?;
        let shown = |p: &Progress| (self.progress)(&format!("{}, {}", rival.label(), p.stage));
        let options = Options { patience: self.options.patience, ..self.options_of(rival.refit) };
        refine(self.rig, self.runs, &fit.effects, &fit.values(), &options, &shown)
    }
}
