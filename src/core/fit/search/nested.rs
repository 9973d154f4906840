//! Models that contain others, compared at their ends on the fine grid.
//!
//! A model that contains another should not end worse. So each model with one effect less is fitted on from where the
//! fit ended and, where the fit leaves more than noise or an effect proposes several starts, also from the signals;
//! where one of them leaves less, the fit goes on from its end. And an element of creep that the coarse grid's own
//! error hid is found on the fine grid: without it, the others stand in for it, and what else is fitted moves with
//! them.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::least_squares::Limits;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::error::FitError;
use crate::fit::problem::method::Method;
use crate::fit::progress::OnProgress;
use crate::fit::search::calibrate::{OneLess, calibrate, fit_coarsely, growing};
use crate::fit::search::calibrator::{Calibrator, Estimate};
use crate::fit::search::finish::descend;
use crate::fit::search::options::Options;
use crate::fit::search::starts::{proposes_starts, starts_from};
use crate::fit::search::thresholds::{
    AS_GOOD_WITHOUT, EVALUATE_ONLY, HOPELESS_SMALLER, HOPELESS_START_RATIO, SCREENING, SMALLER_ABOVE,
};
use crate::model::Model;
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// [`calibrate`], and on from each model with one effect less, fitted the same way, that leaves less; then with as many
/// more elements as the evidence supports, where their number is open.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_nested(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Fit, FitError> {
    fitted(rig, runs, effects, options, progress, &mut HashMap::new())
}

/// Fits of models by the labels of their effects: each is met in several bigger ones.
type Known = HashMap<Vec<String>, Fit>;

fn fitted(
    rig: &Rig,
    runs: &[RunData],
    effects: &[Chosen],
    options: &Options,
    progress: &OnProgress<'_>,
    known: &mut Known,
) -> Result<Fit, FitError> {
    let mut fit = calibrate(rig, runs, effects, options, progress)?;
    if options.method != Method::LeastSquares || !options.starts_at.is_empty() {
        return Ok(fit);
    }
    for i in 0..effects.len() {
        let rest = OneLess::of(rig, runs, &fit, i, options)?;
        let near = without_it(rig, runs, &fit, &rest, options, progress)?;
        // an effect that proposes several starts can have ended beside its optimum
        let astray = fit.mean_square() > SMALLER_ABOVE || rest.effects.iter().any(proposes_starts);
        let far = if astray { searched(rig, runs, &fit, &rest, progress, known)? } else { None };
        let smaller = [near, far].into_iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost));
        if let Some(smaller) = smaller.filter(|smaller| smaller.cost < fit.cost) {
            let on = grown(rig, runs, &fit.effects, &smaller, options, progress, 0.0)?;
            fit = on.filter(|on| on.cost < fit.cost).unwrap_or(fit);
        }
    }
    let Some(i) = growing(effects).filter(|&i| effects[i].elements.is_none()) else { return Ok(fit) };
    let most = effects[i].most_elements().unwrap_or(1);
    with_more_elements(rig, runs, fit, (i, most), options, progress)
}

/// The fit with as many more elements of its effect `i`, up to `most`, as the evidence supports.
///
/// # Errors
/// As [`calibrate`].
pub fn with_more_elements(
    rig: &Rig,
    runs: &[RunData],
    mut fit: Fit,
    (i, most): (usize, usize),
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Fit, FitError> {
    for elements in fit.effects[i].elements.unwrap_or(1) + 1..=most {
        let mut more = fit.effects.clone();
        more[i] = more[i].with_elements(elements);
        let on = grown(rig, runs, &more, &fit, options, progress, 0.5 * STRONG_EVIDENCE)?;
        let Some(on) = on.filter(|on| on.evidence_over(&fit) >= STRONG_EVIDENCE) else { break };
        fit = on;
    }
    Ok(fit)
}

/// The `rest` of a fitted model, fitted on from where the fit ended; none where a few steps show that it leaves more.
fn without_it(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    rest: &OneLess,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Option<Fit>, FitError> {
    let all = fit.values();
    let (with, ctx) = (
        Calibrator::new(rig, runs, options, progress, &fit.effects, Some(&all))?,
        Calibrator::new(rig, runs, &rest.options, progress, &rest.effects, Some(&rest.values))?,
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

/// The `rest` of a fitted model, from the signals and from smaller ones still; none where a coarse fit shows that it
/// leaves far more.
fn searched(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    rest: &OneLess,
    progress: &OnProgress<'_>,
    known: &mut Known,
) -> Result<Option<Fit>, FitError> {
    let labels: Vec<String> = rest.effects.iter().map(Chosen::label).collect();
    if let Some(fit) = known.get(&labels) {
        return Ok(Some(fit.clone()));
    }
    let coarse = fit_coarsely(rig, runs, &rest.effects, &rest.options)?;
    if coarse.mean_square > HOPELESS_SMALLER * 2.0 * fit.cost / fit.samples() as f64 {
        return Ok(None);
    }
    let fit = fitted(rig, runs, &rest.effects, &rest.options, progress, known)?;
    known.insert(labels, fit.clone());
    Ok(Some(fit))
}

/// A fit that began elsewhere than at the signals, or, where it leaves more than noise and less is left from there, the
/// fit from the signals: a bound may have shut out the optimum that it began at.
///
/// # Errors
/// As [`calibrate`].
pub fn or_from_signals(
    fit: Fit,
    rig: &Rig,
    runs: &[RunData],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Fit, FitError> {
    if fit.mean_square() <= SMALLER_ABOVE {
        return Ok(fit);
    }
    let anew = calibrate_nested(rig, runs, &fit.effects, options, progress)?;
    Ok(if anew.cost < fit.cost { anew } else { fit })
}

/// The bigger model's fit from the smaller one's end, on its grid: with what is new almost absent, or as it usually
/// starts. None where a few steps gain less than `least_gain` of the cost.
fn grown(
    rig: &Rig,
    runs: &[RunData],
    bigger: &[Chosen],
    smaller: &Fit,
    options: &Options,
    progress: &OnProgress<'_>,
    least_gain: f64,
) -> Result<Option<Fit>, FitError> {
    let ctx = Calibrator::new(rig, runs, options, progress, bigger, None)?;
    let (model, small) = (ctx.model(bigger), ctx.model(&smaller.effects));
    let state = Estimate::unseen(smaller.values());
    let base = ctx.problem(&model, ctx.whole(smaller.reaches)).start_values();
    let starts = starts_from(&model, &small, &state, &base);
    let reaches = model.fitting_reaches(&starts[0][..model.shared.len()], smaller.reaches);
    let screened = ctx.problem(&model, ctx.window(reaches, f64::INFINITY));
    let from = |values: &Vec<f64>, limits| ctx.estimate(&screened, values, limits, "from a smaller model");
    let tried = starts.par_iter().map(|values| from(values, SCREENING)).collect::<Result<Vec<_>, _>>()?;
    let best = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let (Some(absent), Some(best)) = (starts.last(), best) else { return Ok(None) };
    if from(absent, EVALUATE_ONLY)?.cost - best.cost < least_gain {
        return Ok(None);
    }
    descend(&ctx, &model, best.values, reaches).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::test_record::{HDPE, record};
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
            calibrate_nested(&rig, &runs, &effects, &options, &|_| {}).unwrap().cost
        };
        let without = left("none");
        assert!(without > 1e5, "{without}");
        for effect in ["air-pocket", "valve-seat-leak", "supply-drift", "leak"] {
            let with = left(effect);
            assert!(with <= 1.001 * without, "{effect}: {with} {without}");
        }
    }

    /// Every effect that may be anywhere can be as small as a record needs it to be: where there is none of it, a fit
    /// with it leaves no more.
    #[test]
    fn what_is_not_there_vanishes() {
        let rig = Rig::from_toml(&HDPE.replace("HDPE", "copper"), "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.3, valve_head_m: 40.0, closing_time_s: 0.03, friction_scale: 1.0 };
        let runs = [record(&rig, &[], &[1250.0], run, 0.02, 3.0)];
        let options = Options { most_reaches: 64, ..Options::default() };
        let left = |effects: &str| {
            let effects = parse_list(effects).unwrap();
            calibrate_nested(&rig, &runs, &effects, &options, &|_| {}).unwrap().cost
        };
        let without = left("none");
        for effect in ["leak", "blockage", "section-change", "side-branch"] {
            let with = left(effect);
            assert!(with <= 1.001 * without, "{effect}: {with} {without}");
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
        let better = or_from_signals(corner, &rig, &runs, &Options::default(), &|_| {}).unwrap();
        assert!(better.mean_square() < 1.2, "{}", better.mean_square());
    }
}
