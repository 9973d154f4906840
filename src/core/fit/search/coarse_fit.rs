//! The coarse fit: from the signals or from a smaller model, on a coarse grid, from the first cycles to the whole record.

use rayon::prelude::*;

use crate::fit::numeric::least_squares::{Limits, Problem};
use crate::fit::outcome::residual_summary::ResidualSummary;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::search::calibrator::{Calibrator, Estimate};
use crate::fit::search::starts::{differing, drawn, starts_from, starts_of, take_over, vanish};
use crate::fit::search::thresholds::{
    COARSE, COARSE_REACHES, EVALUATE_ONLY, HOPELESS_START_RATIO, LOCKING_PERIODS, LOCKING_REACHES, MAX_RELEASED,
    POOR_FIT_COST, SCREENING,
};
use crate::model::effects::Chosen;
use crate::model::{Model, ModelError};

fn sorted(mut states: Vec<Estimate>) -> Vec<Estimate> {
    states.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    states
}

/// Fits a model on a coarse grid: from the signals, or from a smaller model that is already fitted.
pub(crate) fn coarse_fit(
    ctx: &Calibrator,
    model: &Model,
    smaller: Option<(&Model, &Estimate)>,
) -> Result<Estimate, FitError> {
    let problem = FitProblem::new(model, ctx.runs, ctx.window(COARSE_REACHES, f64::INFINITY));
    let base: Vec<f64> = problem.parameters.iter().map(|p| p.start).collect();
    let mut candidates = Vec::new();
    // A good smaller model is the best start; a poor one has its parameters in the wrong places.
    if smaller.is_none_or(|(_, state)| state.cost > POOR_FIT_COST * problem.samples() as f64) {
        // The fits that are best over the first cycles go on to the whole record.
        let locked = locked(ctx, model, smaller, &base)?;
        candidates.extend(locked.into_iter().take(2 + ctx.options.starts / 4).map(|s| s.values));
    }
    if let Some((small, state)) = smaller {
        candidates.extend(starts_from(model, small, state, &base));
    }
    best_of(ctx, model, &candidates)
}

/// Fits a model on a coarse grid from the signals, and where that leaves it poor, from each smaller model that it contains: a model that contains another
/// never ends worse.
pub(crate) fn nested_fit(ctx: &Calibrator, model: &Model) -> Result<Estimate, FitError> {
    let mut best = coarse_fit(ctx, model, None)?;
    for i in 0..model.effects.len() {
        if mean_square(ctx, model, &best) < 2.0 * POOR_FIT_COST {
            break;
        }
        let rest = model.effects.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, effect)| effect.clone());
        let smaller = ctx.model(&rest.collect::<Vec<_>>());
        let state = nested_fit(ctx, &smaller)?;
        let on = grow(ctx, model, &smaller, &state)?;
        if on.cost < best.cost {
            best = on;
        }
    }
    Ok(best)
}

/// Fits of the first cycles from all that signals, effects and chance propose, the best first.
fn locked(
    ctx: &Calibrator,
    model: &Model,
    smaller: Option<(&Model, &Estimate)>,
    base: &[f64],
) -> Result<Vec<Estimate>, ModelError> {
    let period_s = model.period_s(&base[..model.shared.len()]);
    let random = drawn(model, base, ctx.options.starts, ctx.options.seed);
    let (scanned, few): (Vec<_>, Vec<_>) = starts_of(model, base).into_iter().chain(random).partition(|s| s.of_many);
    let scanned = if smaller.is_none() { scanned } else { Vec::new() };
    let places = differing(&scanned, base);
    let from = few.into_par_iter().map(|mut start| {
        // The phase locks without the effects that may be anywhere: in the wrong place they would distort everything else.
        let held = match smaller {
            Some((small, state)) => {
                take_over(&mut start.values, model, small, state);
                Vec::new()
            }
            None => vanish(&mut start.values, &scanned, model),
        };
        lock(ctx, model, &held, &start.values, period_s)
    });
    let mut locked = sorted(from.collect::<Result<_, _>>()?);
    if places.is_empty() {
        return Ok(locked);
    }
    // An effect that may be anywhere is held in one place after the other with everything else free; then the best places are released.
    // Without it the rest may have gone where no place leads back from, so the places are also tried from what the signals say.
    locked.truncate(1);
    let rests = [&locked[0].values[..], base];
    let screened = scanned.par_iter().flat_map(|start| rests.map(|rest| (start, rest))).map(|(start, rest)| {
        let mut values = rest.to_vec();
        values[start.effect.clone()].copy_from_slice(&start.values[start.effect.clone()]);
        attempt(ctx, model, &places, &values, LOCKING_PERIODS[0] * period_s, SCREENING)
    });
    let mut screened = sorted(screened.collect::<Result<_, _>>()?);
    screened.truncate(MAX_RELEASED);
    screened.append(&mut locked);
    let released = screened.par_iter().map(|start| lock(ctx, model, &[], &start.values, period_s));
    Ok(sorted(released.collect::<Result<_, _>>()?))
}

/// Fits a model on a coarse grid, starting only from the fit of a smaller one.
pub(crate) fn grow(ctx: &Calibrator, model: &Model, smaller: &Model, state: &Estimate) -> Result<Estimate, FitError> {
    let problem = FitProblem::new(model, ctx.runs, ctx.window(COARSE_REACHES, f64::INFINITY));
    let base: Vec<f64> = problem.parameters.iter().map(|p| p.start).collect();
    best_of(ctx, model, &starts_from(model, smaller, state, &base))
}

/// Screens the starts that are not hopeless, then fits from the best.
fn best_of(ctx: &Calibrator, model: &Model, starts: &[Vec<f64>]) -> Result<Estimate, FitError> {
    let mut best: Option<Estimate> = None;
    for values in starts {
        let evaluated =
            best.as_ref().map(|_| attempt(ctx, model, &[], values, f64::INFINITY, EVALUATE_ONLY)).transpose()?;
        let hopeless =
            evaluated.zip(best.as_ref()).is_some_and(|(start, best)| start.cost > HOPELESS_START_RATIO * best.cost);
        if hopeless {
            continue;
        }
        let state = attempt(ctx, model, &[], values, f64::INFINITY, SCREENING)?;
        if best.as_ref().is_none_or(|b| state.cost < b.cost) {
            best = Some(state);
        }
    }
    let best = best.ok_or(FitError::NoRun)?;
    Ok(attempt(ctx, model, &[], &best.values, f64::INFINITY, COARSE)?)
}

/// Fits the first cycles, then more of them, so that the phase locks; the variables `held` stay as they are.
fn lock(
    ctx: &Calibrator,
    model: &Model,
    held: &[usize],
    values: &[f64],
    period_s: f64,
) -> Result<Estimate, ModelError> {
    let first = attempt(ctx, model, held, values, LOCKING_PERIODS[0] * period_s, COARSE)?;
    attempt(ctx, model, held, &first.values, LOCKING_PERIODS[1] * period_s, COARSE)
}

fn attempt(
    ctx: &Calibrator,
    model: &Model,
    held: &[usize],
    values: &[f64],
    horizon_s: f64,
    limits: Limits,
) -> Result<Estimate, ModelError> {
    let reaches = if horizon_s.is_finite() { LOCKING_REACHES } else { COARSE_REACHES };
    let reaches = model.fitting_reaches(&values[..model.shared.len()], reaches);
    let mut problem = FitProblem::new(model, ctx.runs, ctx.window(reaches, horizon_s));
    problem.hold(held, values);
    let label = model.effects.iter().map(Chosen::label).collect::<Vec<_>>().join(" + ");
    let label = if label.is_empty() { "base model" } else { &label };
    let solution = ctx.minimise(&problem, values, limits, label)?;
    Ok(Estimate { values: problem.values(&solution.x), cost: solution.cost })
}

/// Mean square of the residuals of a coarse fit, priors included, in units of the noise's.
pub(crate) fn mean_square(ctx: &Calibrator, model: &Model, state: &Estimate) -> f64 {
    let problem = FitProblem::new(model, ctx.runs, ctx.window(COARSE_REACHES, f64::INFINITY));
    2.0 * state.cost / problem.samples().max(1) as f64
}

/// The residuals of a coarse fit, summarised.
pub(crate) fn residual_summary(
    ctx: &Calibrator,
    model: &Model,
    state: &Estimate,
) -> Result<ResidualSummary, ModelError> {
    let reaches = model.fitting_reaches(&state.values[..model.shared.len()], COARSE_REACHES);
    let problem = FitProblem::new(model, ctx.runs, ctx.window(reaches, f64::INFINITY));
    let residuals = problem.residuals(&problem.variables(&state.values))?;
    Ok(ResidualSummary::of(&residuals[..problem.samples()], model.shared.len()))
}
