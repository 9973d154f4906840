//! One fit of a model for every command: from the signals, or on from given values, as far as its caller wants it to go.
//!
//! A model that contains another should not end worse. So a whole fit from the signals is compared with each model that
//! has one effect less: that one is fitted on from where the fit ended and, where the fit leaves more than noise or an
//! effect proposes several starts, also from the signals. Where one of them leaves less, the fit goes on from its end,
//! with the effect almost absent at first. And an element of creep that the coarse grid's own error hid is found on the
//! fine grid: without it, the others stand in for it, and what else is fitted moves with them.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::least_squares::Limits;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::error::FitError;
use crate::fit::problem::method::Method;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrator::{Calibrator, Estimate};
use crate::fit::search::descent::polishing_from;
use crate::fit::search::finish::{descend, finish};
use crate::fit::search::from_signals::{fit_coarsely, from_signals, growing};
use crate::fit::search::options::{Effort, Options};
use crate::fit::search::starts::{proposes_starts, starts_from};
use crate::fit::search::thresholds::{
    AS_GOOD_WITHOUT, DOUBTFUL_ABOVE, EVALUATE_ONLY, HOPELESS_SMALLER, HOPELESS_START_RATIO, MOST_REACHES_WITH_CAVITIES,
    NOISE_LIKE, SCREENING,
};
use crate::model::Model;
use crate::model::effects::{Chosen, boils, labels_of};
use crate::rig::Rig;

/// A whole fit of the base model with `effects` to all `runs` at once, from the signals.
///
/// Where an effect has elements and their number is open, they are added one by one while the evidence supports it.
/// Where an effect concerns a pressure sensor and none is named, it takes the sensor at which a coarse fit is best.
///
/// # Errors
/// No run, a run without samples after its closure, a model that cannot be simulated at its start.
pub fn calibrate(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Fit, FitError> {
    Fitter::new(rig, runs, options, progress).fit(effects, Begin::Signals, options.effort)
}

/// Fits a model on from `values` of all its variables (shared ones, then each run's): to all samples, on as fine a grid
/// as it takes.
///
/// # Errors
/// As [`calibrate`].
pub fn refine(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    values: &[f64],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Fit, FitError> {
    let ctx = Calibrator::new(rig, runs, options, progress, effects, Some(values))?;
    finish(&ctx, &ctx.model(effects), Estimate::unseen(values.to_vec()))
}

/// Where a fit begins.
#[derive(Debug, Clone, Copy)]
pub enum Begin<'v> {
    /// At what the signals and the effects propose.
    Signals,
    /// At these values of all variables: shared ones first, then each run's.
    At(&'v [f64]),
}

/// Fits models of a rig to all samples of its runs.
pub struct Fitter<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) runs: &'a [RunData],
    pub(crate) options: &'a Options,
    pub(crate) progress: &'a OnProgress<'a>,
    /// Whole fits from the signals by the labels of their effects: a model is met in several bigger ones.
    known: Arc<Mutex<HashMap<Vec<String>, Fit>>>,
}

impl<'a> Fitter<'a> {
    /// For fits with these options, but for their effort.
    pub fn new(rig: &'a Rig, runs: &'a [RunData], options: &'a Options, progress: &'a OnProgress<'a>) -> Self {
        Fitter { rig, runs, options, progress, known: Arc::default() }
    }

    /// The same with other options, which differ in what no model of both has.
    fn with<'b>(&self, options: &'b Options, progress: &'b OnProgress<'b>) -> Fitter<'b>
    where
        'a: 'b,
    {
        Fitter { rig: self.rig, runs: self.runs, options, progress, known: self.known.clone() }
    }

    /// Fits the model with `effects`. Models that are compared are named in the progress, and those with cavities keep
    /// a coarse grid, except near the noise, where the grid's error decides between rivals.
    ///
    /// # Errors
    /// As [`calibrate`].
    pub fn fit(&self, effects: &[Chosen], begin: Begin, effort: Effort) -> Result<Fit, FitError> {
        self.going(effects, effort, MOST_REACHES_WITH_CAVITIES, |fitter| match begin {
            Begin::Signals if effort == Effort::Whole => fitter.whole(effects),
            Begin::Signals => from_signals(fitter.rig, fitter.runs, effects, fitter.options, fitter.progress),
            Begin::At(values) => fitter.on_from(effects, values),
        })
    }

    fn on_from(&self, effects: &[Chosen], values: &[f64]) -> Result<Fit, FitError> {
        refine(self.rig, self.runs, effects, values, self.options, self.progress)
    }

    /// What is `fitted` as far as the `effort` goes: among others, on no more reaches than so many where the effects
    /// have cavities.
    fn going<T>(
        &self,
        effects: &[Chosen],
        effort: Effort,
        with_cavities: usize,
        fitted: impl FnOnce(&Fitter) -> Result<T, FitError>,
    ) -> Result<T, FitError> {
        let is_compared = effort != Effort::Whole;
        let most = if is_compared && boils(effects) { with_cavities } else { usize::MAX };
        let options = Options { most_reaches: self.options.most_reaches.min(most), effort, ..self.options.clone() };
        let labels = labels_of(effects);
        let named = |p: &Progress| (self.progress)(&p.within(&labels));
        fitted(&self.with(&options, if is_compared { &named } else { self.progress }))
    }

    /// A fit led on until it converges. Near the noise a model with cavities has a finer grid than before.
    pub(crate) fn to_its_end(&self, fit: &Fit) -> Result<Fit, FitError> {
        let is_held_back = boils(&fit.effects) && fit.over_noise() < DOUBTFUL_ABOVE;
        if fit.converged && !is_held_back {
            return Ok(fit.clone());
        }
        let most = if is_held_back { usize::MAX } else { MOST_REACHES_WITH_CAVITIES };
        let values = fit.values();
        let end = self.going(&fit.effects, Effort::Converged, most, |fitter| fitter.on_from(&fit.effects, &values))?;
        // on a finer grid it may leave more, which is nearer to what its model leaves
        Ok(if end.reaches > fit.reaches || end.cost < fit.cost { end } else { fit.clone() })
    }

    /// A fit past the elements of creep that keep it from its optimum; none where it is there, or does not get there.
    pub(crate) fn pruned(&self, fit: &Fit) -> Option<Fit> {
        if fit.converged {
            return None;
        }
        let options = Options { effort: Effort::Whole, ..self.options.clone() };
        let values = fit.values();
        let ctx = Calibrator::new(self.rig, self.runs, &options, self.progress, &fit.effects, Some(&values)).ok()?;
        let pruned = descend(&ctx, &ctx.model(&fit.effects), values, fit.reaches).ok()?;
        pruned.converged.then_some(pruned)
    }

    /// The fit with as many more elements of its effect `i`, up to `most`, as the evidence supports.
    ///
    /// # Errors
    /// As [`calibrate`].
    pub fn with_more_elements(&self, fit: &Fit, i: usize, most: usize, effort: Effort) -> Result<Fit, FitError> {
        self.going(&fit.effects, effort, MOST_REACHES_WITH_CAVITIES, |fitter| fitter.more_elements(fit, i, most))
    }

    fn more_elements(&self, fit: &Fit, i: usize, most: usize) -> Result<Fit, FitError> {
        let mut fit = fit.clone();
        for elements in fit.effects[i].elements.unwrap_or(1) + 1..=most {
            let mut more = fit.effects.clone();
            more[i] = more[i].with_elements(elements);
            let mut on = self.grown(&more, &fit, STRONG_EVIDENCE)?;
            // Elements that stand in for one that was missing have far to go. From the signals they may not.
            if let Some(unfinished) = on.take_if(|on| !on.converged) {
                let anew = from_signals(self.rig, self.runs, &more, self.options, self.progress).ok();
                on = anew.filter(|anew| anew.cost < unfinished.cost).or(Some(unfinished));
            }
            let Some(on) = on.filter(|on| on.evidence_over(&fit) >= STRONG_EVIDENCE) else { break };
            fit = on;
        }
        Ok(fit)
    }

    /// The model without its effect `i`, fitted on from where the rest stands.
    ///
    /// # Errors
    /// As [`calibrate`].
    pub fn without(&self, fit: &Fit, i: usize, effort: Effort) -> Result<Fit, FitError> {
        let rest = OneLess::of(self, fit, i)?;
        self.with(&rest.options, self.progress).fit(&rest.effects, Begin::At(&rest.values), effort)
    }

    /// A fit that began elsewhere than at the signals, or, where it leaves more than noise and less is left from there,
    /// the fit from the signals: a bound may have shut out the optimum that it began at.
    ///
    /// # Errors
    /// As [`calibrate`].
    pub fn or_from_signals(&self, fit: Fit) -> Result<Fit, FitError> {
        if fit.mean_square() <= NOISE_LIKE.powi(2) {
            return Ok(fit);
        }
        let anew = self.fit(&fit.effects, Begin::Signals, Effort::Whole)?;
        Ok(if anew.cost < fit.cost { anew } else { fit })
    }

    /// See [`Effort::Whole`].
    fn whole(&self, effects: &[Chosen]) -> Result<Fit, FitError> {
        let labels: Vec<String> = effects.iter().map(Chosen::label).collect();
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(fit) = known().get(&labels) {
            return Ok(fit.clone());
        }
        let mut fit = from_signals(self.rig, self.runs, effects, self.options, self.progress)?;
        if self.options.method != Method::LeastSquares || !self.options.starts_at.is_empty() {
            return Ok(fit);
        }
        for i in 0..effects.len() {
            let rest = OneLess::of(self, &fit, i)?;
            let near = self.without_it(&fit, &rest)?;
            // an effect that proposes several starts can have ended beside its optimum
            let astray = fit.mean_square() > NOISE_LIKE.powi(2) || rest.effects.iter().any(proposes_starts);
            let far = if astray { self.smaller(&fit, &rest)? } else { None };
            let smaller = [near, far].into_iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost));
            // nothing supports an effect that gains no more: it may have ended where it does nothing
            let in_vain = |small: &Fit| small.cost < fit.cost || fit.evidence_over(small) < STRONG_EVIDENCE;
            if let Some(smaller) = smaller.filter(in_vain) {
                let on = self.grown(&fit.effects, &smaller, 0.0)?;
                fit = on.filter(|on| on.cost < fit.cost).unwrap_or(fit);
            }
        }
        if let Some(i) = growing(effects).filter(|&i| effects[i].elements.is_none()) {
            fit = self.more_elements(&fit, i, effects[i].most_elements().unwrap_or(1))?;
        }
        known().insert(labels, fit.clone());
        Ok(fit)
    }

    /// The `rest` of a fitted model, fitted on from where the fit ended; none where a few steps show that it leaves
    /// more.
    fn without_it(&self, fit: &Fit, rest: &OneLess) -> Result<Option<Fit>, FitError> {
        let all = fit.values();
        let (with, ctx) = (
            Calibrator::new(self.rig, self.runs, self.options, self.progress, &fit.effects, Some(&all))?,
            Calibrator::new(self.rig, self.runs, &rest.options, self.progress, &rest.effects, Some(&rest.values))?,
        );
        let left = |ctx: &Calibrator, model: &Model, values: &[f64], limits: Limits| {
            let problem = ctx.problem(model, ctx.window(fit.reaches, f64::INFINITY));
            ctx.estimate(&problem, values, limits, "without one of the effects")
        };
        let model = ctx.model(&rest.effects);
        let most = left(&with, &with.model(&fit.effects), &all, EVALUATE_ONLY)?.cost;
        if left(&ctx, &model, &rest.values, EVALUATE_ONLY)?.cost > HOPELESS_START_RATIO * most {
            return Ok(None);
        }
        let on = left(&ctx, &model, &rest.values, SCREENING)?;
        if on.cost > AS_GOOD_WITHOUT * most {
            return Ok(None);
        }
        descend(&ctx, &model, on.values, fit.reaches).map(Some)
    }

    /// The `rest` of a fitted model, from the signals; none where a coarse fit shows that it leaves far more.
    fn smaller(&self, fit: &Fit, rest: &OneLess) -> Result<Option<Fit>, FitError> {
        let coarse = fit_coarsely(self.rig, self.runs, &rest.effects, &rest.options)?;
        if coarse.mean_square > HOPELESS_SMALLER * 2.0 * fit.cost / fit.samples() as f64 {
            return Ok(None);
        }
        self.with(&rest.options, self.progress).whole(&rest.effects).map(Some)
    }

    /// The bigger model's fit from the smaller one's end, on its grid: with what is new almost absent, or as it usually
    /// starts. None where a few steps gain less than `least_gain` of the cost.
    fn grown(&self, bigger: &[Chosen], smaller: &Fit, least_gain: f64) -> Result<Option<Fit>, FitError> {
        let ctx = Calibrator::new(self.rig, self.runs, self.options, self.progress, bigger, None)?;
        let (model, small) = (ctx.model(bigger), ctx.model(&smaller.effects));
        let state = Estimate::unseen(smaller.values());
        let base = ctx.problem(&model, ctx.whole(smaller.reaches)).start_values();
        let starts = starts_from(&model, &small, &state, &base);
        let reaches = model.fitting_reaches(&starts[0][..model.shared.len()], smaller.reaches);
        // On some of the samples what a further element gains is too little to choose a start by.
        let problem = ctx.problem(&model, ctx.whole(reaches));
        let from = |values: &[f64], limits| ctx.estimate(&problem, values, limits, "from a smaller model");
        let on = |values: &[f64]| from(values, polishing_from(&ctx, &problem, values, SCREENING)?);
        let tried = starts.par_iter().map(|values| on(values)).collect::<Result<Vec<_>, _>>()?;
        let best = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        let (Some(absent), Some(best)) = (starts.last(), best) else { return Ok(None) };
        let best = on(&best.values)?;
        if from(absent, EVALUATE_ONLY)?.cost - best.cost < least_gain {
            return Ok(None);
        }
        descend(&ctx, &model, best.values, reaches).map(Some)
    }
}

/// A fitted model but for one of its effects.
struct OneLess {
    /// The other effects.
    effects: Vec<Chosen>,
    /// The options without what they say of its parameters.
    options: Options,
    /// The values of all variables but its own.
    values: Vec<f64>,
}

impl OneLess {
    /// A fit's model without its effect `i`.
    fn of(fitter: &Fitter, fit: &Fit, i: usize) -> Result<Self, FitError> {
        let water = &fitter.runs.first().ok_or(FitError::NoRun)?.conditions.water;
        let model = Model::new(fitter.rig, water, &fit.effects);
        let own = model.parameters_of(i);
        let gone = |name: &String| model.shared[own.clone()].iter().any(|p| p.name == *name);
        let options = Options {
            constraints: fitter.options.constraints.iter().filter(|c| !gone(&c.name)).cloned().collect(),
            priors: fitter.options.priors.iter().filter(|p| !gone(&p.name)).cloned().collect(),
            ..fitter.options.clone()
        };
        let effects = fit.effects.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| c.clone()).collect();
        let values = fit.values().into_iter().enumerate().filter(|(j, _)| !own.contains(j)).map(|(_, v)| v).collect();
        Ok(OneLess { effects, options, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::test_record::{HDPE, copper, record};
    use crate::model::RunValues;
    use crate::model::constraint::Constraint;
    use crate::model::effects::parse_list;

    /// A record of the plastic pipe with these elements of creep, and its rig.
    fn plastic(effects: &str, shared: &[f64]) -> (Rig, [RunData; 1]) {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let record = record(&rig, &parse_list(effects).unwrap(), shared, run, 0.05, 3.0);
        (rig, [record])
    }

    /// An elastic model of a plastic pipe follows nothing, so its optima are many; yet no effect beside it makes the
    /// end worse.
    #[test]
    fn one_more_effect_never_leaves_more() {
        let (rig, runs) = plastic("viscoelastic-wall:2", &[380.0, 0.12, 0.03, 0.35, 0.6]);
        let options = Options { most_reaches: 64, ..Options::default() };
        let left = |effects: &str| {
            let effects = parse_list(effects).unwrap();
            calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap().cost
        };
        let without = left("none");
        assert!(without > 1e5, "{without}");
        for effect in ["air-pocket", "valve-seat-leak", "supply-drift", "leak"] {
            let with = left(effect);
            assert!(with <= 1.001 * without, "{effect}: {with} {without}");
        }
    }

    /// Two elements stand in for three so well that on some of the samples the third gains next to nothing.
    #[test]
    fn a_third_element_that_gains_little_is_found() {
        let rig = HDPE.replace("80.0", "97.63").replace("= 50.0", "= 32.0").replace("= 5.0", "= 3.2");
        let rig = Rig::from_toml(&rig, "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.89, valve_head_m: 54.3, closing_time_s: 0.0843, friction_scale: 1.03 };
        let truth = [389.4, 0.1701, 0.019, 0.1794, 0.2083, 0.1094, 1.0525];
        let runs = [record(&rig, &parse_list("viscoelastic-wall:3").unwrap(), &truth, run, 0.4, 20.0)];
        let effects = parse_list("viscoelastic-wall").unwrap();
        let fit = calibrate(&rig, &runs, &effects, &Options::default(), &|_| {}).unwrap();
        assert_eq!(fit.effects[0].elements, Some(3));
    }

    /// Every effect that may be anywhere can be as small as a record needs it to be: where there is none of it, a fit
    /// with it leaves no more.
    #[test]
    fn what_is_not_there_vanishes() {
        let rig = copper();
        let run =
            RunValues { initial_velocity_m_s: 0.3, valve_head_m: 40.0, closing_time_s: 0.03, friction_scale: 1.0 };
        let runs = [record(&rig, &[], &[1250.0], run, 0.02, 3.0)];
        let options = Options { most_reaches: 64, ..Options::default() };
        let left = |effects: &str| {
            let effects = parse_list(effects).unwrap();
            calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap().cost
        };
        let without = left("none");
        for effect in ["leak", "blockage", "section-change", "side-branch"] {
            let with = left(effect);
            assert!(with <= 1.001 * without, "{effect}: {with} {without}");
        }
    }

    /// Gas that follows the pressure too late is as good as absent: a fit must not end there.
    #[test]
    fn little_gas_is_found() {
        let rig = copper();
        let run =
            RunValues { initial_velocity_m_s: 0.4, valve_head_m: 59.0, closing_time_s: 0.09, friction_scale: 1.0 };
        let gas = parse_list("entrained-gas").unwrap();
        for fraction in [2e-6, 1e-5, 1.3e-5] {
            let runs = [record(&rig, &gas, &[1250.0, fraction, 2e-6], run, 0.05, 3.0)];
            let options = Options { most_reaches: 64, ..Options::default() };
            let fit = calibrate(&rig, &runs, &gas, &options, &|_| {}).unwrap();
            let found = fit.parameter("gas_fraction").unwrap().value;
            assert!((found / fraction - 1.0).abs() < 0.03, "{fraction}: {found}, {}", fit.over_noise());
        }
    }

    /// A bound that shuts out the optimum where a fit stands leaves it in a corner; the signals lead elsewhere.
    #[test]
    fn a_fit_in_a_corner_gives_way_to_one_from_the_signals() {
        let (rig, runs) = plastic("viscoelastic-wall:1", &[380.0, 0.12, 0.03]);
        let effects = parse_list("viscoelastic-wall:1").unwrap();
        let held = Constraint { name: "tau1_s".to_owned(), run: None, lower: 3.0, upper: 3.0 };
        let still = Options { constraints: vec![held], ..Options::default() };
        let corner = calibrate(&rig, &runs, &effects, &still, &|_| {}).unwrap();
        assert!(corner.mean_square() > 4.0);
        let better = Fitter::new(&rig, &runs, &Options::default(), &|_| {}).or_from_signals(corner).unwrap();
        assert!(better.mean_square() < 1.2, "{}", better.mean_square());
    }
}
