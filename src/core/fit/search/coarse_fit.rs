//! The coarse fit: from the signals or from a smaller model, on a coarse grid, from the first cycles to the whole
//! record.

use rayon::prelude::*;

use crate::fit::numeric::least_squares::{Limits, Problem, have_met};
use crate::fit::outcome::residual_summary::ResidualSummary;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::search::calibrator::{Calibrator, Estimate};
use crate::fit::search::starts::{Start, differing, drawn, starts_from, starts_of, vanish};
use crate::fit::search::thresholds::{
    COARSE, COARSE_REACHES, EVALUATE_ONLY, HOPELESS_START_RATIO, LEADING, LOCKING, LOCKING_PERIODS, LOCKING_REACHES,
    LOOKED_AGAIN, SCREENING,
};
use crate::model::effects::labels_of;
use crate::model::{Model, ModelError};

/// Ends of descents, the best first, and of those that have met the best alone.
fn distinct(mut states: Vec<Estimate>) -> Vec<Estimate> {
    states.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut places: Vec<Estimate> = Vec::new();
    for state in states {
        let here = |place: &Estimate| have_met(&place.residuals, &state.residuals, LOCKING.cost_tolerance * place.cost);
        if !places.iter().any(here) {
            places.push(state);
        }
    }
    places
}

/// Fits a model on a coarse grid: from the signals, or from a smaller model that is already fitted.
pub(crate) fn coarse_fit(
    ctx: &Calibrator,
    model: &Model,
    smaller: Option<(&Model, &Estimate)>,
) -> Result<Estimate, FitError> {
    let base = FitProblem::new(model, ctx.runs, ctx.window(COARSE_REACHES, f64::INFINITY)).start_values();
    match smaller {
        Some((small, state)) => best_of(ctx, model, &starts_from(model, small, state, &base)),
        None => ctx.known_or(&model.effects, || anew(ctx, model, base)),
    }
}

/// A coarse fit from the signals: the fit that is best over the first cycles goes on to the whole record. If starts are
/// drawn at random, more than one does.
fn anew(ctx: &Calibrator, model: &Model, base: Vec<f64>) -> Result<Estimate, FitError> {
    let followed = locked(ctx, model, &base)?.into_iter().take(1 + ctx.options.starts / 4);
    let found = best_of(ctx, model, &followed.map(|s| s.values).collect::<Vec<_>>())?;
    // The first cycles may lead away from a start that follows the whole record better.
    let start = attempt(ctx, model, &[], &base, f64::INFINITY, EVALUATE_ONLY)?;
    if start.cost < found.cost { best_of(ctx, model, &[base, found.values]) } else { Ok(found) }
}

/// Fits of the first cycles from all that signals, effects and chance propose, the best first.
fn locked(ctx: &Calibrator, model: &Model, base: &[f64]) -> Result<Vec<Estimate>, ModelError> {
    let period_s = model.period_s(&base[..model.shared.len()]);
    let random = drawn(model, base, ctx.options.starts, ctx.options.seed);
    let (scanned, few): (Vec<_>, Vec<_>) = starts_of(model, base).into_iter().partition(|s| s.of_many);
    if scanned.is_empty() {
        return lock(ctx, model, few.into_iter().map(|start| start.values).chain(random).collect(), period_s);
    }
    // Each effect that may be anywhere is looked for while the others are absent.
    let rests = few.into_iter().map(|mut start| {
        vanish(&mut start.values, &scanned, model);
        start.values
    });
    let mut from = in_places(ctx, model, &scanned, base, &rests.collect::<Vec<_>>(), period_s)?;
    from.push(base.to_vec());
    from.extend(random);
    let mut found = lock(ctx, model, from, period_s)?;
    if scanned.iter().any(|start| start.effect != scanned[0].effect) {
        let best = beside_each_other(ctx, model, &scanned, base, found.remove(0), period_s);
        found.insert(0, best);
    }
    Ok(found)
}

/// A fit of the first cycles whose effects that may be anywhere were each looked for while the others were absent: each
/// is looked for again beside the others, as long as that leaves much less. Where a place cannot be simulated, the fit
/// stays as it is.
fn beside_each_other(
    ctx: &Calibrator,
    model: &Model,
    scanned: &[Start],
    base: &[f64],
    mut best: Estimate,
    period_s: f64,
) -> Estimate {
    loop {
        let again = in_places(ctx, model, scanned, base, std::slice::from_ref(&best.values), period_s);
        let again = again.and_then(|again| lock(ctx, model, again, period_s)).unwrap_or_default();
        let Some(better) = again.into_iter().next().filter(|again| again.cost < best.cost) else { return best };
        let much = better.cost < LOOKED_AGAIN * best.cost;
        best = better;
        if !much {
            return best;
        }
    }
}

/// Fits of the first cycles with an effect that may be anywhere held in one place after the other, from each of the
/// `rests` of the variables. Everything but the place is free. Returns the values of the best.
fn in_places(
    ctx: &Calibrator,
    model: &Model,
    scanned: &[Start],
    base: &[f64],
    rests: &[Vec<f64>],
    period_s: f64,
) -> Result<Vec<Vec<f64>>, ModelError> {
    let places = differing(scanned, base);
    let tried = scanned.par_iter().flat_map(|start| rests.par_iter().map(move |rest| (start, rest)));
    let screened = tried.map(|(start, rest)| {
        let mut values = rest.clone();
        values[start.effect.clone()].copy_from_slice(&start.values[start.effect.clone()]);
        attempt(ctx, model, &places, &values, LOCKING_PERIODS[0] * period_s, SCREENING)
    });
    let mut screened = distinct(screened.collect::<Result<_, _>>()?);
    screened.truncate(LEADING);
    Ok(screened.into_iter().map(|state| state.values).collect())
}

/// Fits a model on a coarse grid from `values` of all its variables, and from the best places along the whole pipe for
/// its effects that may be anywhere. Their places may have made up for something that the model has got since.
pub(crate) fn relocated(ctx: &Calibrator, model: &Model, values: &[f64]) -> Result<Estimate, FitError> {
    let base = FitProblem::new(model, ctx.runs, ctx.window(COARSE_REACHES, f64::INFINITY)).start_values();
    let scanned: Vec<Start> = starts_of(model, &base).into_iter().filter(|s| s.of_many).collect();
    let period_s = model.period_s(&values[..model.shared.len()]);
    let own = [values.to_vec()];
    let screened = in_places(ctx, model, &scanned, &base, &own, period_s)?;
    let found = lock(ctx, model, screened, period_s)?.into_iter().next();
    best_of(ctx, model, &found.map(|s| s.values).into_iter().chain(own).collect::<Vec<_>>())
}

/// Screens the starts that are not hopeless, then fits from the best.
pub(crate) fn best_of(ctx: &Calibrator, model: &Model, starts: &[Vec<f64>]) -> Result<Estimate, FitError> {
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

/// Fits the first cycles, then more of them, so that the phase locks, from each of the `starts`. Returns the best
/// first.
fn lock(
    ctx: &Calibrator,
    model: &Model,
    mut starts: Vec<Vec<f64>>,
    period_s: f64,
) -> Result<Vec<Estimate>, ModelError> {
    let mut locked = Vec::new();
    for periods in LOCKING_PERIODS {
        let on = starts.par_iter().map(|start| attempt(ctx, model, &[], start, periods * period_s, LOCKING));
        locked = distinct(on.collect::<Result<_, _>>()?);
        starts = locked.iter().map(|state| state.values.clone()).collect();
    }
    Ok(locked)
}

fn attempt(
    ctx: &Calibrator,
    model: &Model,
    held: &[usize],
    values: &[f64],
    horizon_s: f64,
    limits: Limits,
) -> Result<Estimate, ModelError> {
    let shared = &values[..model.shared.len()];
    let window = if horizon_s.is_finite() {
        let reaches = model.fitting_reaches(shared, LOCKING_REACHES);
        ctx.locking(reaches, horizon_s, 0.25 * model.period_s(shared) / reaches as f64)
    } else {
        ctx.window(model.fitting_reaches(shared, COARSE_REACHES), horizon_s)
    };
    let mut problem = FitProblem::new(model, ctx.runs, window);
    if limits.iterations > 0 {
        problem = problem.with_coarse_slopes(ctx.least_reaches);
    }
    problem.hold(held, values);
    ctx.estimate(&problem, values, limits, &labels_of(&model.effects))
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

#[cfg(test)]
mod tests {
    use crate::fit::problem::test_record::{HDPE, record, short_branch};
    use crate::fit::search::calibrate::calibrate;
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;

    /// Beside one element of creep a short branch ends where it makes up for the others; beside all of them it is found
    /// where it is.
    #[test]
    fn a_branch_is_looked_for_again_when_the_creep_is_whole() {
        let (rig, record) = short_branch();
        let runs = [record];
        let effects = parse_list("viscoelastic-wall:2,side-branch").unwrap();
        let options = Options { most_reaches: 128, ..Options::default() };
        let fit = calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap();
        let run = &fit.runs[0];
        assert!(run.rmse_m < 1.03 * run.noise_m, "{} m", run.rmse_m);
        let place_m = fit.parameter("branch_position_m").unwrap().value;
        assert!((place_m - 89.9).abs() < 0.5, "{place_m} m");
    }

    /// Two strong effects along the pipe: neither is found while the other is absent, and each is beside the other.
    #[test]
    fn two_places_are_found_each_beside_the_other() {
        let steel = HDPE.replace("HDPE", "steel").replace("80.0", "100.0");
        let rig = Rig::from_toml(&steel, "rig.toml").unwrap();
        let effects = parse_list("side-branch,section-change").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.4, valve_head_m: 62.0, closing_time_s: 0.037, friction_scale: 1.0 };
        let runs = [record(&rig, &effects, &[1300.0, 60.1, 7.5, 0.6, 13.4, 27.3, 1.1, 1.0], run, 0.07, 4.0)];
        let options = Options { most_reaches: 128, ..Options::default() };
        let fit = calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap();
        let left = fit.runs[0].rmse_m / fit.runs[0].noise_m;
        assert!(left < 2.0, "{left} times the noise");
        for (name, exact_m) in [("branch_position_m", 60.1), ("section_start_m", 13.4), ("section_end_m", 27.3)] {
            let place_m = fit.parameter(name).unwrap().value;
            assert!((place_m - exact_m).abs() < 0.3, "{name}: {place_m} m");
        }
    }
}
