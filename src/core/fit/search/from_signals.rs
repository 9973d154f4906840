//! The fit of one model from the signals: from coarse to fine, from the first cycles to the whole record.
//!
//! A wave speed a few percent off is half a period late after twenty cycles, where least squares sees no way back. So
//! the fit starts with the first cycle and a half on a coarse grid, then takes in more of the record as the phase
//! locks. Then the grid is refined until halving its step changes less than the noise does.

use std::sync::{Mutex, PoisonError};

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::method::Method;
use crate::fit::problem::objective::Objective;
use crate::fit::progress::OnProgress;
use crate::fit::search::calibrator::{Calibrator, Estimate};
use crate::fit::search::coarse_fit::{coarse_fit, mean_square, relocated, residual_summary};
use crate::fit::search::finish::{finish, without_descent};
use crate::fit::search::global::global_search;
use crate::fit::search::options::Options;
use crate::fit::search::sensor_choice::with_sensors;
use crate::fit::search::stepwise::{conclude, stepwise};
use crate::fit::search::thresholds::{COARSE_REACHES, FOLLOWING, LOCKING_REACHES};
use crate::model::effects::Chosen;
use crate::model::{Model, check_places};
use crate::rig::Rig;

/// A fit of the base model with `effects`, which no smaller model helps: elements, sensors and errors are as
/// `calibrate` says.
pub(crate) fn from_signals(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Fit, FitError> {
    for run in runs {
        let any = run.sensors.iter().any(|s| s.time_s.last().is_some_and(|&t| t > run.start.closure_s.0));
        if !any {
            return Err(FitError::NoSample { file: run.file.clone() });
        }
    }
    check_places(rig, effects)?;
    if options.objective == Objective::Frequency {
        let model = Model::new(rig, &runs[0].conditions.water, &[]);
        let window = Window { reaches: 1, horizon_s: f64::INFINITY, stride: 1 };
        if let Some((file, sensor)) = FitProblem::new(&model, runs, window).comparing(options.objective).too_short() {
            return Err(FitError::NoRinging { file, sensor });
        }
    }
    let ctx = Calibrator::new(rig, runs, options, progress, effects, None)?;
    let mut chosen = place_at_sensors(&ctx, effects)?;
    // An effect with elements grows from one: a descent that starts with many ends in poorer places, unless it has a
    // start of its own.
    let has_start = !options.starts_at.is_empty() || options.method != Method::LeastSquares;
    let growing = growing(effects).filter(|&i| effects[i].elements.is_none() || !has_start);
    if let Some(i) = growing {
        chosen[i] = chosen[i].with_elements(known_elements(&ctx, &chosen, i));
    }
    let first = ctx.model(&chosen);
    let steps = Mutex::new(Vec::new());
    let search = |model: &Model, smaller: Option<(&Model, &Estimate)>| match options.method {
        Method::LeastSquares => coarse_fit(&ctx, model, smaller),
        Method::Global | Method::MicroGa | Method::GlobalLocal => Ok(global_search(&ctx, model)?),
        Method::Stepwise => {
            let (state, record) = stepwise(&ctx, model)?;
            steps.lock().unwrap_or_else(PoisonError::into_inner).push((model.effects.clone(), record));
            Ok(state)
        }
    };
    // Where an element is missing, the known ones move to stand in for it. So the search also starts again from where
    // they are known to be.
    let search_on = |bigger: &Model, model: &Model, state: &Estimate| {
        let on = search(bigger, Some((model, state)))?;
        if options.priors.is_empty() {
            return Ok(on);
        }
        let anew = search(bigger, None)?;
        Ok(if anew.cost < on.cost { anew } else { on })
    };
    let begun = search(&first, None)?;
    let (model, mut state) = match growing {
        Some(i) => grow_while_evident(&ctx, (first, begun), i, effects[i].elements, search_on)?,
        None => (first, begun),
    };
    let located = model.effects.iter().any(|c| c.effect.on_pipe());
    if located && model.effects != chosen && options.method == Method::LeastSquares {
        // Where a place cannot be simulated, the fit stays as it is.
        state = relocated(&ctx, &model, &state.values).unwrap_or(state);
    }
    if options.method.descends() {
        return finish(&ctx, &model, state);
    }
    // Several numbers of elements may have been tried: these are the steps of the one that was kept.
    let tried = steps.into_inner().unwrap_or_else(PoisonError::into_inner);
    match tried.into_iter().find(|(effects, _)| *effects == model.effects) {
        Some((_, record)) => conclude(&ctx, &model, state, record),
        None => without_descent(&ctx, &model, state),
    }
}

/// A coarse fit from the signals.
#[derive(Debug, Clone)]
pub struct CoarseFit {
    /// The effects, sensors chosen.
    pub effects: Vec<Chosen>,
    /// Values of all variables: shared ones first, then each run's.
    pub values: Vec<f64>,
    /// Mean square of the residuals, in units of the noise's, priors among them.
    pub mean_square: f64,
}

impl CoarseFit {
    fn of(ctx: &Calibrator, model: &Model, estimate: Estimate) -> Self {
        let mean_square = mean_square(ctx, model, &estimate);
        CoarseFit { mean_square, values: estimate.values, effects: model.effects.clone() }
    }
}

/// Fits a model coarsely from the signals alone: to some of the samples, on a coarse grid.
///
/// # Errors
/// As `calibrate`; the number of elements must be given.
pub fn fit_coarsely(rig: &Rig, runs: &[RunData], effects: &[Chosen], options: &Options) -> Result<CoarseFit, FitError> {
    let ctx = Calibrator::new(rig, runs, options, &|_| {}, effects, None)?;
    let effects = place_at_sensors(&ctx, effects)?;
    let model = ctx.model(&effects);
    Ok(CoarseFit::of(&ctx, &model, coarse_fit(&ctx, &model, None)?))
}

/// Moves the variables that the options do not hold a few steps towards their optimum, on a coarse grid and some of the
/// samples: what an eye that follows a slider needs. While it is `dragged` the grid is as coarse as where phases lock.
///
/// # Errors
/// As `calibrate`.
pub fn follow(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    values: &[f64],
    options: &Options,
    dragged: bool,
) -> Result<Vec<f64>, FitError> {
    let ctx = Calibrator::new(rig, runs, options, &|_| {}, effects, Some(values))?;
    let model = ctx.model(effects);
    let reaches = if dragged { LOCKING_REACHES } else { COARSE_REACHES };
    let problem = FitProblem::new(&model, ctx.runs, ctx.window(reaches, f64::INFINITY));
    problem.validate_constraints(&model.constraints)?;
    Ok(ctx.estimate(&problem, values, FOLLOWING, "the others follow")?.values)
}

/// The effects as a fit begins with them: where the number of elements is open, as many as are known beforehand, else
/// one.
///
/// # Errors
/// No run.
pub fn numbered(rig: &Rig, runs: &[RunData], effects: &[Chosen], options: &Options) -> Result<Vec<Chosen>, FitError> {
    let mut chosen = effects.to_vec();
    if let Some(i) = growing(effects).filter(|&i| effects[i].elements.is_none()) {
        let ctx = Calibrator::new(rig, runs, options, &|_| {}, effects, None)?;
        chosen[i] = chosen[i].with_elements(known_elements(&ctx, effects, i));
    }
    Ok(chosen)
}

/// The effect of a list whose elements are added one by one.
pub(crate) fn growing(effects: &[Chosen]) -> Option<usize> {
    effects.iter().position(|c| c.effect.elements().is_some_and(|r| r.contains(&2)))
}

/// The number of elements of effect `i` that are known beforehand, as by a creep test: a fit begins with these, or with
/// one.
fn known_elements(ctx: &Calibrator, effects: &[Chosen], i: usize) -> usize {
    let most = effects[i].most_elements().unwrap_or(1);
    let known = |n: &usize| {
        let mut with = effects.to_vec();
        with[i] = with[i].with_elements(*n);
        let model = ctx.model(&with);
        model.shared[model.parameters_of(i)].iter().all(|p| p.prior.is_some())
    };
    (1..=most).rev().find(known).unwrap_or(1)
}

/// The effects, each that concerns a sensor at the one where a coarse fit is best.
fn place_at_sensors(ctx: &Calibrator, effects: &[Chosen]) -> Result<Vec<Chosen>, FitError> {
    with_sensors(ctx.rig, effects, |trial| Ok(coarse_fit(ctx, &ctx.model(trial), None)?.cost))
}

/// A fitted model with more elements of its effect `i`: as many as `asked` for, or as many as the evidence supports. A
/// bigger model is `fitted` on from a smaller one where that stands.
fn grow_while_evident<'a>(
    ctx: &Calibrator<'a>,
    (mut model, mut state): (Model<'a>, Estimate),
    i: usize,
    asked: Option<usize>,
    fitted: impl Fn(&Model, &Model, &Estimate) -> Result<Estimate, FitError>,
) -> Result<(Model<'a>, Estimate), FitError> {
    let range = model.effects[i].effect.elements();
    let most = asked.or(range.map(|r| *r.end())).unwrap_or(1);
    let mut summary = residual_summary(ctx, &model, &state)?;
    for elements in model.effects[i].elements.unwrap_or(1) + 1..=most {
        let mut more = model.effects.clone();
        more[i] = more[i].with_elements(elements);
        let bigger = ctx.model(&more);
        let trial = fitted(&bigger, &model, &state)?;
        let trial_summary = residual_summary(ctx, &bigger, &trial)?;
        if asked.is_none() && trial_summary.evidence_over(&summary) < STRONG_EVIDENCE {
            break;
        }
        (model, state, summary) = (bigger, trial, trial_summary);
    }
    Ok((model, state))
}
