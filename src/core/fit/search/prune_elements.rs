//! More elements of creep than a record supports: the least useful one is taken out, then placed where it helps or left
//! out and reported.
//!
//! The effect of an element is nearly linear in its compliance, not in its retardation time. Two elements of one time,
//! and one without compliance, are edges where a descent creeps: the linearised problem keeps predicting a reduction
//! that would take a negative spread of times, while an element of quite another time may help. So where a descent ends
//! short of an optimum, the element that the others replace best is taken out. Then all retardation times are tried for
//! one more, as the gradient function of a mixture is (Lindsay 1983, Ann. Statist. 11, 86), and the descent restarts at
//! its peaks. Where none of them leads to an optimum and the element gains no more than its two parameters gain of
//! noise alone, the record does not support it: its compliance stays at its lower bound. In autocorrelated noise an
//! element may gain more than that by chance: it is kept then, and its errors, which take the autocorrelation into
//! account, show how little is known of it.

use nalgebra::DVector;
use rayon::prelude::*;

use crate::fit::inference::thresholds::OPTIMUM_REDUCTION;
use crate::fit::numeric::bounded_step::{bounded_step, reduction_of};
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, have_met, jacobian};
use crate::fit::problem::elements::{Element, elements, free_elements};
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::descent::{polishing_from, predict_reduction, slopes};
use crate::fit::search::thresholds::{ELEMENT_NOISE_REDUCTION, LEADING, NO_COMPLIANCE, PROBED_TIMES, STEP_SHARES};
use crate::model::ModelError;

/// One more element, of one retardation time.
struct Placement {
    /// Values of all variables, with almost nothing of it.
    values: Vec<f64>,
    /// The step of all of them, and the reduction of the sum of squares that it predicts.
    step: DVector<f64>,
    reduction: f64,
}

/// Leads a descent on to an optimum where elements of creep that the record does not support kept it from one.
pub(crate) fn prune_elements(
    ctx: &Calibrator,
    problem: &FitProblem,
    mut solution: Solution,
    limits: Limits,
) -> Result<Solution, ModelError> {
    let elements = free_elements(problem);
    if elements.len() < 2 {
        return Ok(solution);
    }
    let predicted = predict_reduction(ctx, problem, &solution)?;
    if predicted.at_optimum(problem, &solution) {
        return Ok(solution);
    }
    let (element, fewer) = with_one_less(ctx, problem, &solution, &predicted.columns, &elements, limits)?;
    // Half of what one sample leaves.
    let unit = fewer.cost / problem.samples().max(1) as f64;
    let places = placements(ctx, problem, &fewer, element)?;
    let (mut best, mut ends): (Option<Solution>, Vec<Solution>) = (None, Vec::new());
    for place in peaks(&places).into_iter().filter(|p| p.reduction > OPTIMUM_REDUCTION * 2.0 * unit).take(LEADING) {
        let Some(mut from) = lower_along(ctx, problem, &place.values, &place.step, fewer.cost)? else { continue };
        put_in_order(problem, &mut from);
        // Some samples and a coarser grid show the way, the problem itself the place.
        let mut near = ctx.passing(problem.model, ctx.compared(problem.window().reaches));
        near.hold(&held(problem), &from);
        let on_the_way = polishing_from(ctx, &near, &from, limits)?;
        let there = ctx.minimise(&near, &from, on_the_way, "one element placed again")?;
        let here = |end: &Solution| have_met(&end.residuals, &there.residuals, on_the_way.cost_tolerance * end.cost);
        if ends.iter().any(here) {
            continue;
        }
        let again =
            ctx.minimise(problem, &problem.values(&there.x), limits, "all samples, one element placed again")?;
        ends.push(there);
        let at_optimum = predict_reduction(ctx, problem, &again)?.at_optimum(problem, &again);
        if at_optimum && best.as_ref().is_none_or(|b| again.cost < b.cost) {
            best = Some(again);
        } else if again.cost < solution.cost {
            solution = again;
        }
    }
    if let Some(best) = best.filter(|b| b.cost <= solution.cost + OPTIMUM_REDUCTION * unit) {
        return Ok(best);
    }
    if fewer.cost > solution.cost + ELEMENT_NOISE_REDUCTION * unit {
        return Ok(solution);
    }
    let least = places.iter().min_by(|a, b| a.reduction.total_cmp(&b.reduction));
    let Some(mut nowhere) = least.map(|place| place.values.clone()) else { return Ok(solution) };
    put_in_order(problem, &mut nowhere);
    let pruned = solution_at(ctx, problem, fewer, &nowhere)?;
    let at_optimum = predict_reduction(ctx, problem, &pruned)?.at_optimum(problem, &pruned);
    Ok(if at_optimum { pruned } else { solution })
}

/// The solution at other, equally good values, with the slopes there.
fn solution_at(ctx: &Calibrator, problem: &FitProblem, like: Solution, values: &[f64]) -> Result<Solution, ModelError> {
    let x = problem.variables(values);
    let residuals = problem.residuals(&x)?;
    let columns = jacobian(problem, &x, &residuals)?;
    ctx.count(columns.len() + 1);
    let (lower, upper) = problem.bounds();
    let at_bound = (0..x.len()).map(|j| x[j] <= lower[j] || x[j] >= upper[j]).collect();
    let cost = 0.5 * residuals.iter().map(|r| r * r).sum::<f64>();
    Ok(Solution { x, residuals, columns, at_bound, cost, ..like })
}

/// The end of a descent without one of its elements: the one that the others replace best.
fn with_one_less(
    ctx: &Calibrator,
    problem: &FitProblem,
    solution: &Solution,
    columns: &[Vec<f64>],
    elements: &[Element],
    limits: Limits,
) -> Result<(Element, Solution), ModelError> {
    let values = problem.values(&solution.x);
    let by_value = by_value(problem, columns, &values);
    let starts: Vec<(Element, Vec<f64>)> = elements
        .iter()
        .flat_map(|&e| {
            let compensated = compensate(problem, &by_value, &solution.residuals, &values, e);
            [(e, compensated), (e, given_to_neighbour(problem, &values, elements, e))]
        })
        .collect();
    ctx.count(starts.len());
    let costs = starts.par_iter().map(|(_, values)| {
        let residuals = problem.residuals(&problem.variables(values)).ok()?;
        Some(residuals.iter().map(|r| r * r).sum::<f64>()).filter(|c| c.is_finite())
    });
    let costs: Vec<f64> = costs.map(|c| c.unwrap_or(f64::INFINITY)).collect();
    let best = (0..starts.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
    let (element, from) = &starts[best];
    let mut fewer = ctx.passing(problem.model, problem.window());
    fewer.hold(&[held(problem), vec![element.strength, element.time]].concat(), from);
    let solution = ctx.minimise(&fewer, from, limits, "all samples, one element less")?;
    Ok((*element, prune_elements(ctx, &fewer, solution, limits)?))
}

/// The columns of a Jacobian by the values instead of the variables.
fn by_value(problem: &FitProblem, columns: &[Vec<f64>], values: &[f64]) -> Vec<Vec<f64>> {
    let of = |(j, column): (usize, &Vec<f64>)| {
        let stretch = problem.stretch(j, values[j]);
        column.iter().map(|c| c / stretch).collect()
    };
    columns.iter().enumerate().map(of).collect()
}

/// Values after a step, or after a share of it, that cost less than `cost`; none where no share does.
fn lower_along(
    ctx: &Calibrator,
    problem: &FitProblem,
    values: &[f64],
    step: &DVector<f64>,
    cost: f64,
) -> Result<Option<Vec<f64>>, ModelError> {
    let (lower, upper) = problem.bounds();
    let (lower, upper) = (problem.values(lower), problem.values(upper));
    for share in STEP_SHARES {
        let there: Vec<f64> =
            (0..values.len()).map(|j| (values[j] + share * step[j]).clamp(lower[j], upper[j])).collect();
        ctx.count(1);
        let residuals = problem.residuals(&problem.variables(&there))?;
        if 0.5 * residuals.iter().map(|r| r * r).sum::<f64>() < cost {
            return Ok(Some(there));
        }
    }
    Ok(None)
}

/// The variables that a problem holds.
fn held(problem: &FitProblem) -> Vec<usize> {
    let (lower, upper) = problem.bounds();
    (0..lower.len()).filter(|&j| lower[j] == upper[j]).collect()
}

/// One more element beside the others, at each retardation time that is tried.
fn placements(
    ctx: &Calibrator,
    problem: &FitProblem,
    fewer: &Solution,
    element: Element,
) -> Result<Vec<Placement>, ModelError> {
    let Element { strength, time, .. } = element;
    let (lower, upper) = problem.bounds();
    let columns = slopes(ctx, problem, fewer)?;
    let values = problem.values(&fewer.x);
    let least = values[strength];
    let mut none = fewer.x.clone();
    none[strength] += NO_COMPLIANCE.ln();
    let without = problem.residuals(&none)?;
    let (mut low, mut high) = (problem.values(lower), problem.values(upper));
    let by_value = by_value(problem, &columns, &values);
    (low[time], high[time]) = (values[time], values[time]);
    ctx.count(PROBED_TIMES + 1);
    let places = (0..PROBED_TIMES).into_par_iter().map(|i| {
        let share = i as f64 / (PROBED_TIMES - 1) as f64;
        let mut there = fewer.x.clone();
        there[time] = lower[time] + share * (upper[time] - lower[time]);
        let mut twice = there.clone();
        twice[strength] += std::f64::consts::LN_2;
        let with: Vec<f64> =
            problem.residuals(&twice)?.iter().zip(&without).map(|(twice, none)| 0.5 * (twice + none)).collect();
        let mut columns = by_value.clone();
        columns[strength] = with.iter().zip(&without).map(|(with, none)| (with - none) / least).collect();
        let step = bounded_step(&columns, &with, &values, (&low, &high));
        let reduction = reduction_of(&columns, &with, &step);
        Ok(Placement { values: problem.values(&there), step, reduction })
    });
    places.collect()
}

/// Placements that help more than their neighbours, the best first.
fn peaks(places: &[Placement]) -> Vec<&Placement> {
    let reduction = |i: usize| places.get(i).map_or(f64::NEG_INFINITY, |p| p.reduction);
    let highest = |i: &usize| reduction(*i) >= reduction(i.wrapping_sub(1)) && reduction(*i) > reduction(i + 1);
    let mut peaks: Vec<&Placement> = (0..places.len()).filter(highest).map(|i| &places[i]).collect();
    peaks.sort_by(|a, b| b.reduction.total_cmp(&a.reduction));
    peaks
}

/// Puts elements into the effects' order, unless something is known or held under a parameter's name.
fn put_in_order(problem: &FitProblem, values: &mut [f64]) {
    let all_free = free_elements(problem).len() == elements(problem).len();
    if all_free && problem.model.constraints.is_empty() && problem.model.priors.is_empty() {
        problem.model.put_in_order(values);
    }
}

/// Values without an element: the others move as the linearised problem predicts to replace it.
fn compensate(
    problem: &FitProblem,
    by_value: &[Vec<f64>],
    residuals: &[f64],
    values: &[f64],
    element: Element,
) -> Vec<f64> {
    let (lower, upper) = problem.bounds();
    let (mut lower, mut upper) = (problem.values(lower), problem.values(upper));
    let mut there = values.to_vec();
    there[element.strength] = lower[element.strength];
    for j in [element.strength, element.time] {
        (lower[j], upper[j]) = (there[j], there[j]);
    }
    let taken = there[element.strength] - values[element.strength];
    let left: Vec<f64> = residuals.iter().zip(&by_value[element.strength]).map(|(r, c)| r + taken * c).collect();
    let step = bounded_step(by_value, &left, &there, (&lower, &upper));
    there
        .iter_mut()
        .zip(step.iter())
        .zip(lower.iter().zip(&upper))
        .for_each(|((v, by), (l, u))| *v = (*v + by).clamp(*l, *u));
    there
}

/// Values without an element: the one with the nearest retardation time takes its compliance.
fn given_to_neighbour(problem: &FitProblem, values: &[f64], elements: &[Element], element: Element) -> Vec<f64> {
    let mut there = values.to_vec();
    let apart = |e: &&Element| (values[e.time] / values[element.time]).ln().abs();
    let others = elements.iter().filter(|e| e.strength != element.strength);
    if let Some(neighbour) = others.min_by(|a, b| apart(a).total_cmp(&apart(b))) {
        there[neighbour.strength] += there[element.strength];
    }
    there[element.strength] = problem.value(element.strength, problem.bounds().0[element.strength]);
    there
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::fit::search::calibrate::calibrate;
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;

    /// A wall of one element, fitted with more: the fit ends at an optimum that is no worse than with one, and reports
    /// what has vanished.
    #[test]
    fn more_elements_than_there_are_end_at_an_optimum() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let run = RunValues { initial_velocity_m_s: 0.4, valve_head_m: 40.0, closing_time_s: 0.1, friction_scale: 1.0 };
        let runs = [record(&rig, &parse_list("viscoelastic-wall:1").unwrap(), &[380.0, 0.2, 0.15], run, 0.05, 6.0)];
        let fitted = |elements: &str| {
            let effects = parse_list(elements).unwrap();
            calibrate(&rig, &runs, &effects, &Options::default(), &|_| {}).unwrap()
        };
        let enough = fitted("viscoelastic-wall:1").runs[0].rmse_m;
        for elements in ["viscoelastic-wall:2", "viscoelastic-wall:3"] {
            let fit = fitted(elements);
            assert!(fit.converged, "{elements}: {}", fit.stopped_because);
            assert!(fit.runs[0].rmse_m < (1.0 + 1e-5) * enough, "{elements}: {} for {enough}", fit.runs[0].rmse_m);
            let speed = &fit.parameters[0];
            assert!((speed.value - 380.0).abs() < 4.0 * speed.standard_error() + 0.1, "{elements}: {}", speed.value);
            for gone in fit.parameters.iter().filter(|p| p.name.starts_with('J') && p.value <= p.lower) {
                let named = fit.unidentifiable.iter().find(|u| u.parameters.contains(&gone.name));
                assert!(named.is_some_and(|u| u.in_words.contains("viscoelastic-wall:")), "{}", gone.name);
                for name in named.iter().flat_map(|u| &u.parameters) {
                    let own = fit.parameters.iter().find(|p| p.name == *name).unwrap();
                    assert!(own.standard_error().is_nan() && own.interval_95.0 == f64::NEG_INFINITY, "{name}");
                }
            }
        }
    }

    #[test]
    fn peaks_come_best_first_and_ends_may_be_some() {
        let places: Vec<Placement> = [3.0, 1.0, 2.0, 2.0, 0.0, 5.0]
            .map(|reduction| Placement { values: vec![reduction], step: DVector::zeros(1), reduction })
            .into_iter()
            .collect();
        let reductions: Vec<f64> = peaks(&places).iter().map(|p| p.reduction).collect();
        assert_eq!(reductions, [5.0, 3.0, 2.0]);
    }
}
