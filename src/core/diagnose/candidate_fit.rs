//! Candidates in competition: the best form of each effect, what it leaves, and its fit to all samples.

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::Form;
use crate::diagnose::evidence::{EvidenceScale, tempered};
use crate::diagnose::limits::{
    ERROR_OF_EFFECT, LEAST_EVIDENCE, LEAST_FALL, MODEL_ERROR, MOST_REACHES_NEAR_NOISE, MOST_REACHES_WITH_CAVITIES,
    ODDS_AT_BOUND, START_DOUBTFUL,
};
use crate::diagnose::next::answer::Answer;
use crate::diagnose::refit::Refit;
use crate::fit::data::run_data::{RunData, SensorData};
use crate::fit::outcome::fit::{Fit, FittedParameter, SensorFit};
use crate::fit::outcome::uncertainty::Uncertainty;
use crate::fit::problem::error::FitError;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::{CoarseFit, calibrate, fit_coarsely, go_on, refine, relocate, without};
use crate::fit::search::options::Options;
use crate::model::Model;
use crate::model::effects::{Chosen, SHOWN, boils};
use crate::rig::Rig;

/// An effect in its best form, with its refit and, later, its full fit.
pub(crate) struct CandidateFit<'a> {
    pub(crate) refit: &'a Refit,
    pub(crate) evidence: f64,
    /// Sum over all samples of (residual / noise)², of the full fit or as the refit forecasts it.
    pub(crate) square: f64,
    pub(crate) fit: Option<Fit>,
    /// A fit on from there was tried: another one would end there again.
    is_tried: bool,
}

impl<'a> CandidateFit<'a> {
    /// Forecasts the square of the full fit from the share of the start model's square that the refit leaves.
    pub(crate) fn forecast(baseline: &Baseline, start: &Fit, refit: &'a Refit, evidence: f64) -> Self {
        let left = baseline.mean_square(&refit.residuals) / baseline.mean_square(&baseline.residuals);
        CandidateFit { refit, evidence, square: square(start) * left, fit: None, is_tried: false }
    }

    pub(crate) fn odds(&self, baseline: &Baseline) -> f64 {
        // Prior odds in favour of an effect do not make up for a fit without evidence.
        let odds = self.refit.form.chosen.effect.odds(&baseline.known);
        // If a record shows the effect by itself, any improvement will do.
        let shown = odds >= SHOWN;
        let least = if shown { 0.0 } else { LEAST_EVIDENCE };
        let odds = if self.evidence < least { odds.min(1.0) } else { odds };
        let at_bound = !shown && self.own_parameters(baseline).iter().any(|p| p.at_bound);
        if at_bound { ODDS_AT_BOUND * odds } else { odds }
    }

    pub(crate) fn log_odds(&self, baseline: &Baseline) -> f64 {
        tempered(self.evidence) + self.odds(baseline).ln()
    }

    /// Its effects and the values of all variables: of the full fit if there is one, else of the refit.
    pub(crate) fn model(&self) -> (&[Chosen], Vec<f64>) {
        match &self.fit {
            Some(fit) => (&fit.effects, fit.values()),
            None => (&self.refit.effects, self.refit.values.clone()),
        }
    }

    /// What it says.
    pub(crate) fn answer(&self) -> Answer {
        let (effects, values) = self.model();
        Answer { name: self.label(), effects: effects.to_vec(), values }
    }

    /// The form that was fitted.
    pub(crate) fn label(&self) -> String {
        let fitted = self.fit.as_ref().and_then(|f| f.effects.last());
        fitted.unwrap_or(&self.refit.form.chosen).label()
    }

    /// Free parameters in addition to the start model's, including further elements of the start model's effects.
    pub(crate) fn added(&self, baseline: &Baseline, start: &Fit) -> usize {
        let own = self.refit.values.len() - baseline.values.len();
        let more = self.fit.as_ref().map_or(0, |f| f.parameters.len().saturating_sub(start.parameters.len() + own));
        self.refit.added + more
    }

    /// Its error as a share of the start model's.
    pub(crate) fn left_of(&self, start: &Fit) -> f64 {
        (self.square / square(start)).sqrt()
    }

    /// Whether it is stronger than what every rig has of it.
    pub(crate) fn is_noteworthy(&self, baseline: &Baseline) -> bool {
        self.refit.form.chosen.effect.noteworthy(&self.own_values(baseline), &baseline.known)
    }

    /// The effect that it stands in for, if it is no physics of its own.
    pub(crate) fn stands_for(&self, baseline: &Baseline) -> Option<&'static str> {
        self.refit.form.chosen.effect.stands_for(&self.own_values(baseline))
    }

    fn own_values(&self, baseline: &Baseline) -> Vec<f64> {
        self.own_parameters(baseline).iter().map(|p| p.value).collect()
    }

    /// Keeps a fit if it is better than the one so far.
    pub(crate) fn take(&mut self, fit: Result<Fit, FitError>) {
        if let Ok(fit) = fit
            && self.fit.as_ref().is_none_or(|known| square(&fit) < square(known))
        {
            self.square = square(&fit);
            self.is_tried = false;
            self.fit = Some(fit);
        }
    }

    /// Whether its fit is as good as it gets.
    pub(crate) fn is_settled(&self, fitter: &FullFitter) -> bool {
        let at_end = |fit: &Fit| fit.converged && !fitter.is_held_back(fit);
        self.is_tried || self.fit.as_ref().is_none_or(at_end)
    }

    /// Fits on until it converges, on as fine a grid as it takes.
    pub(crate) fn converge(&mut self, fitter: &FullFitter) {
        if let Some(fit) = self.fit.as_ref().filter(|_| !self.is_settled(fitter)) {
            let converged = fitter.converged(fit);
            self.take(converged);
            self.is_tried = true;
        }
    }

    /// The added effect's parameters.
    pub(crate) fn own_parameters(&self, baseline: &Baseline) -> Vec<FittedParameter> {
        let own = |effects: &[Chosen]| {
            let model = baseline.model(effects);
            (model.parameters_of(effects.len() - 1), model.shared)
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
                rig_error: None,
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

/// Sum over all samples of (residual / noise)².
pub(crate) fn square(fit: &Fit) -> f64 {
    let sensors = fit.runs.iter().flat_map(|r| &r.sensors);
    sensors.map(|s| s.time_s.len() as f64 * (s.rmse_m / s.white_noise_m).powi(2)).sum()
}

/// Error over noise of a fit: each sensor's error over its total noise before the closure, rms over all samples.
pub(crate) fn over_noise(fit: &Fit, runs: &[RunData]) -> f64 {
    over_samples(fit, runs, |fitted, data| (fitted.rmse_m / data.total_noise_m).powi(2)).sqrt()
}

/// The square of the error over noise of a fit beyond what every model of a closure leaves: noise, and what oscillates in the pipe before the closure.
pub(crate) fn beyond(fit: &Fit, runs: &[RunData]) -> f64 {
    over_samples(fit, runs, |fitted, data| {
        (fitted.rmse_m.powi(2) - data.oscillation_m.powi(2)) / data.total_noise_m.powi(2) - 1.0
    })
}

/// The mean of what `of` says of each sensor, over all samples of a fit.
fn over_samples(fit: &Fit, runs: &[RunData], of: impl Fn(&SensorFit, &SensorData) -> f64) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (fitted, run) in fit.runs.iter().zip(runs) {
        for (sensor, data) in fitted.sensors.iter().zip(&run.sensors) {
            let samples = sensor.time_s.len() as f64;
            sum += samples * of(sensor, data);
            n += samples;
        }
    }
    sum / f64::max(n, 1.0)
}

/// By how much the square of the error over noise falls from a sum of squares to another, both over the samples of a start model.
pub(crate) fn fall(start: &Fit, runs: &[RunData], from: f64, to: f64) -> f64 {
    over_noise(start, runs).powi(2) * (from - to) / square(start)
}

/// The least fall of the squared error over noise that is worth a model: more than noise does, and more than solvers differ by. Effects that were
/// found before have `taken` so much of it, and a solver errs by a share of that.
pub(crate) fn least_fall(runs: &[RunData], taken: f64) -> f64 {
    let (mut square, mut n) = (0.0, 0.0);
    for sensor in runs.iter().flat_map(|run| &run.sensors) {
        let (low, high) =
            sensor.head_m.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), m| (l.min(*m), h.max(*m)));
        let samples = sensor.head_m.len() as f64;
        square += samples * (MODEL_ERROR * 0.5 * (high - low) / sensor.total_noise_m).powi(2);
        n += samples;
    }
    (square / f64::max(n, 1.0)).max(LEAST_FALL.powi(2)) + ERROR_OF_EFFECT.powi(2) * taken.max(0.0)
}

/// What a fit would leave if it went on to the optimum that its linearised problem predicts.
pub(crate) fn square_at_optimum(fit: &Fit) -> f64 {
    square(fit) * (1.0 - fit.predicted_reduction / fit.samples().max(1) as f64)
}

/// The scale of evidence that the residuals of a fit set.
pub(crate) fn evidence_scale(fit: &Fit, features: f64) -> EvidenceScale {
    let residuals: Vec<f64> = fit
        .runs
        .iter()
        .flat_map(|r| &r.sensors)
        .flat_map(|s| s.measured_m.iter().zip(&s.model_m).map(|(a, b)| (a - b) / s.white_noise_m))
        .collect();
    EvidenceScale::of(&residuals, features)
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
pub(crate) struct FullFitter<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) runs: &'a [RunData],
    /// The start model's effects as the user asked for them.
    pub(crate) effects: &'a [Chosen],
    pub(crate) options: &'a Options,
    pub(crate) progress: &'a OnProgress<'a>,
    /// See [`least_fall`].
    pub(crate) least_fall: f64,
}

impl FullFitter<'_> {
    /// Starts where the refit ended.
    pub(crate) fn fit_from_refit(&self, refit: &Refit) -> Result<Fit, FitError> {
        self.fit_from_values(refit, &refit.effects, &refit.values)
    }

    /// Starts where a coarse fit ended.
    pub(crate) fn fit_from_values(&self, refit: &Refit, effects: &[Chosen], values: &[f64]) -> Result<Fit, FitError> {
        // The calibration adds elements one by one, which is more reliable.
        if refit.form.chosen.elements.is_some() {
            return self.fit_from_scratch(refit);
        }
        let shown = |p: &Progress| (self.progress)(&p.within(&format!("{} added", refit.form.effect)));
        refine(self.rig, self.runs, effects, values, &self.brief(effects), &shown)
    }

    /// Fits a model with two forms to all samples, from where a coarse fit ended.
    pub(crate) fn fit_pair(&self, of: &[Form; 2], effects: &[Chosen], values: &[f64]) -> Result<Fit, FitError> {
        let (options, shown) = (self.brief(effects), self.pair_shown(of));
        refine(self.rig, self.runs, effects, values, &options, &shown)
    }

    /// The same afresh from the signals.
    pub(crate) fn fit_pair_from_scratch(&self, of: &[Form; 2]) -> Result<Fit, FitError> {
        let added = of.iter().map(|form| Chosen { elements: None, ..form.chosen.clone() });
        let effects: Vec<Chosen> = self.effects.iter().cloned().chain(added).collect();
        let (options, shown) = (self.brief(&effects), self.pair_shown(of));
        calibrate(self.rig, self.runs, &effects, &options, &shown)
    }

    /// Fits a model with two forms coarsely, from the signals.
    pub(crate) fn coarse_pair(&self, of: &[Form; 2], effects: &[Chosen]) -> Result<CoarseFit, FitError> {
        self.pair_shown(of)(&Progress::from("from the signals"));
        fit_coarsely(self.rig, self.runs, effects, self.options)
    }

    fn pair_shown(&self, of: &[Form; 2]) -> impl Fn(&Progress) + Sync + use<'_> {
        let names = format!("{} and {} added", of[0].effect, of[1].effect);
        move |p| (self.progress)(&p.within(&names))
    }

    /// Fits a candidate on from where its rival ended: rivals are compared at their optima.
    pub(crate) fn fit_from_rival(&self, candidate_fit: &CandidateFit, rival: &Fit) -> Result<Fit, FitError> {
        let (effects, values) = self.in_the_place_of(candidate_fit, rival)?;
        let shown = |p: &Progress| (self.progress)(&p.within(&candidate_fit.label()));
        refine(self.rig, self.runs, &effects, &values, &self.brief(&effects), &shown)
    }

    /// A candidate's rival with the candidate's own effect in the place of the rival's: the effects, and the values of all variables.
    fn in_the_place_of(&self, candidate_fit: &CandidateFit, rival: &Fit) -> Result<(Vec<Chosen>, Vec<f64>), FitError> {
        let water = &self.runs.first().ok_or(FitError::NoRun)?.conditions.water;
        let added = |effects: &[Chosen]| Model::new(self.rig, water, effects).parameters_of(effects.len() - 1);
        let (own, ours) = candidate_fit.model();
        let (from_rival, from_own) = (added(&rival.effects), added(own));
        let theirs = rival.values();
        let values = [&theirs[..from_rival.start], &ours[from_own], &theirs[from_rival.end..]].concat();
        let mut effects = rival.effects.clone();
        effects.pop();
        effects.extend(own.last().cloned());
        Ok((effects, values))
    }

    /// Starts from the signals, without any earlier fit.
    pub(crate) fn fit_from_scratch(&self, refit: &Refit) -> Result<Fit, FitError> {
        let effects: Vec<Chosen> =
            self.effects.iter().cloned().chain([Chosen { elements: None, ..refit.form.chosen.clone() }]).collect();
        let shown = |p: &Progress| (self.progress)(&p.within(&format!("{} from scratch", refit.form.effect)));
        calibrate(self.rig, self.runs, &effects, &self.brief(&effects), &shown)
    }

    /// Fits coarsely from the signals.
    pub(crate) fn coarse_fit(&self, refit: &Refit) -> Result<CoarseFit, FitError> {
        (self.progress)(&Progress::from(format!("{} from the signals", refit.form.effect)));
        let mut effects = refit.effects.clone();
        if let Some(added) = effects.last_mut() {
            added.sensor = None;
        }
        fit_coarsely(self.rig, self.runs, &effects, self.options)
    }

    /// Fits a candidate coarsely in the place of a rival, after looking for its effect along the whole pipe.
    pub(crate) fn relocated(&self, candidate_fit: &CandidateFit, rival: &Fit) -> Result<CoarseFit, FitError> {
        let (effects, values) = self.in_the_place_of(candidate_fit, rival)?;
        let shown = |p: &Progress| (self.progress)(&p.within(&format!("{} along the pipe", candidate_fit.label())));
        relocate(self.rig, self.runs, &effects, &values, self.options, &shown)
    }

    /// Places elements of creep again, or leaves them out, that have kept an answer from its optimum.
    pub(crate) fn prune(&self, fit: &mut Fit) {
        let shown = |p: &Progress| (self.progress)(&p.within("the answer"));
        if let Ok(pruned) = go_on(self.rig, self.runs, fit, self.options, &shown)
            && pruned.converged
        {
            *fit = pruned;
        }
    }

    /// Of a brief fit with these effects.
    fn brief(&self, effects: &[Chosen]) -> Options {
        Options { brief: true, ..self.bounded(effects, MOST_REACHES_WITH_CAVITIES) }
    }

    /// The options, on no more reaches than so many where the effects have cavities. Models are compared, so their elements are not pruned.
    fn bounded(&self, effects: &[Chosen], with_cavities: usize) -> Options {
        let most = if boils(effects) { with_cavities } else { usize::MAX };
        Options { most_reaches: self.options.most_reaches.min(most), prune: false, ..self.options.clone() }
    }

    /// Fits a model without its effect `i`, briefly.
    pub(crate) fn without(&self, fit: &Fit, i: usize) -> Result<Fit, FitError> {
        without(self.rig, self.runs, fit, i, &self.brief(&fit.effects), &|_| {})
    }

    /// Whether a brief fit with cavities stopped on a coarse grid, whose error may decide between rivals so near the noise.
    pub(crate) fn is_held_back(&self, fit: &Fit) -> bool {
        boils(&fit.effects) && over_noise(fit, self.runs) < START_DOUBTFUL
    }

    /// Fits a candidate or a pair until it converges. Near the noise a model with cavities has a finer grid than before, for it is not to lose by the
    /// grid's error.
    pub(crate) fn converged(&self, fit: &Fit) -> Result<Fit, FitError> {
        let labels: Vec<String> = fit.effects.iter().map(Chosen::label).collect();
        let shown = |p: &Progress| (self.progress)(&p.within(&labels.join(" + ")));
        let most = if self.is_held_back(fit) { MOST_REACHES_NEAR_NOISE } else { MOST_REACHES_WITH_CAVITIES };
        refine(self.rig, self.runs, &fit.effects, &fit.values(), &self.bounded(&fit.effects, most), &shown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::model::RunValues;

    /// A pump that pulsates in one run excuses that run, by its share of the samples that are compared, and no other.
    #[test]
    fn what_oscillates_before_the_closure_is_not_held_against_a_model() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let mut runs = [1.0, 3.0].map(|duration_s| record(&rig, &[], &[380.0], run, 0.05, duration_s));
        let options = Options { most_reaches: 64, ..Options::default() };
        let fit = calibrate(&rig, &runs, &[], &options, &|_| {}).unwrap();
        let quiet = beyond(&fit, &runs);
        assert!(quiet.abs() < 0.1, "{quiet}");
        runs[0].sensors[0].oscillation_m = 3.0 * 0.05;
        let [short, long] = [0, 1].map(|r: usize| fit.runs[r].sensors[0].time_s.len() as f64);
        let excused = 9.0 * short / (short + long);
        assert!(excused > 1.0 && (quiet - beyond(&fit, &runs) - excused).abs() < 1e-9, "{}", beyond(&fit, &runs));
    }
}
