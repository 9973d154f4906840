//! More elements of creep than a record supports: the one that is missed least is taken out and put where it helps, or left out and said.
//!
//! What an element adds is nearly linear in its compliance, not in its retardation time. Two elements of one time, and one without compliance, are edges
//! where a descent creeps: the straightened problem goes on to promise a fall that would take a negative spread of times, while an element of
//! quite another time may help. So where a descent ends short of an optimum, the element that the others make up for best is taken out. Then all
//! retardation times are tried for one more, as the gradient function of a mixture is (Lindsay 1983, Ann. Statist. 11, 86), and the descent
//! is begun anew where it has its peaks. Where none of them leads to an optimum and the element gains no more than its two parameters gain of noise
//! alone, the record does not support it: its compliance stays at its lower bound. In coloured noise an element may gain more than that of noise alone: it is
//! kept then, and its errors, which know the colour, say how little it is known.

use nalgebra::DVector;
use rayon::prelude::*;

use crate::fit::inference::optimum::{AT_OPTIMUM, fall_of, promising_step};
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, jacobian};
use crate::fit::problem::fit_problem::Calibration;
use crate::fit::search::coarse_fit::Fitter;
use crate::fit::search::polish::by_value;
use crate::model::ModelError;
use crate::model::parameter::Scale;

/// Retardation times that are tried, evenly in ratio between their bounds.
const TIMES: usize = 32;
/// Of these, at how many a descent is begun at the most.
const PLACES: usize = 3;
/// Fall of the sum of squares that two parameters bring of noise alone, in units of what one sample leaves: the mean of χ² with two degrees
/// of freedom.
const OF_NOISE: f64 = 2.0;
/// Compliance, in units of the least, that stands for none.
const NONE: f64 = 1e-12;

/// An element: where its compliance and its retardation time are among the variables.
#[derive(Clone, Copy)]
pub(crate) struct Element {
    /// The effect that it belongs to.
    pub(crate) effect: usize,
    pub(crate) strength: usize,
    pub(crate) time: usize,
}

/// An element more, of one retardation time.
struct Place {
    /// Values of all variables, with next to nothing of it.
    values: Vec<f64>,
    /// How all of them are to move, and the fall of the sum of squares which that promises.
    step: DVector<f64>,
    fall: f64,
}

/// Elements of effects that have several, as far as a strength of zero makes them vanish.
pub(crate) fn elements(problem: &Calibration) -> Vec<Element> {
    let model = problem.model;
    let mut at = model.effects_from();
    let mut elements = Vec::new();
    for (effect, (chosen, &size)) in model.effects.iter().zip(model.effect_sizes()).enumerate() {
        if chosen.elements.is_some_and(|n| n > 1 && size == 2 * n) {
            elements.extend((at..at + size).step_by(2).map(|j| Element { effect, strength: j, time: j + 1 }));
        }
        at += size;
    }
    let vanishes = |e: &Element| problem.parameters[e.strength].vanishes_at == Some(0.0);
    let logarithmic = |e: &Element| [e.strength, e.time].iter().all(|&j| problem.parameters[j].scale == Scale::Log);
    elements.retain(|e| vanishes(e) && logarithmic(e));
    elements
}

/// Those that a fit may move as it likes.
fn free_elements(problem: &Calibration) -> Vec<Element> {
    let (lower, upper) = problem.bounds();
    let free = |j: usize| {
        let p = &problem.parameters[j];
        let settled = problem.model.constraints.iter().any(|c| c.concerns(&p.name, None));
        p.prior.is_none() && !settled && lower[j] < upper[j]
    };
    elements(problem).into_iter().filter(|e| free(e.strength) && free(e.time)).collect()
}

/// Elements that a fit has let vanish, though it might have kept them.
pub(crate) fn vanished(problem: &Calibration, values: &[f64]) -> Vec<Element> {
    let least = |e: &Element| {
        let strength = &problem.parameters[e.strength];
        strength.lower < strength.upper && values[e.strength] <= strength.lower
    };
    let settled =
        |e: &Element| problem.model.constraints.iter().any(|c| c.concerns(&problem.parameters[e.strength].name, None));
    elements(problem).into_iter().filter(|e| least(e) && !settled(e)).collect()
}

/// Variables that stand still at the end of a fit: those at a bound, and all of an element that has vanished. What little its retardation time
/// moves looks like what another element's does, and would make that one look undetermined.
pub(crate) fn at_rest(problem: &Calibration, values: &[f64], at_bound: &[bool]) -> Vec<bool> {
    let mut at_rest = at_bound.to_vec();
    for element in vanished(problem, values) {
        (at_rest[element.strength], at_rest[element.time]) = (true, true);
    }
    at_rest
}

impl Fitter<'_> {
    /// From the end of a descent to an optimum, where elements of creep that the record does not support kept it from one.
    pub(crate) fn without_surplus(
        &self,
        problem: &Calibration,
        mut solution: Solution,
        limits: Limits,
    ) -> Result<Solution, ModelError> {
        let elements = free_elements(problem);
        if elements.len() < 2 {
            return Ok(solution);
        }
        let promised = self.promised(problem, &solution)?;
        if promised.at_optimum(&solution) {
            return Ok(solution);
        }
        let (element, fewer) = self.with_one_less(problem, &solution, &promised.columns, &elements, limits)?;
        // Half of what one sample leaves.
        let unit = fewer.cost / problem.samples().max(1) as f64;
        let places = self.places(problem, &fewer, element)?;
        let mut best: Option<Solution> = None;
        for place in peaks(&places).into_iter().filter(|p| p.fall > AT_OPTIMUM * 2.0 * unit).take(PLACES) {
            let Some(mut from) = self.lower_along(problem, &place.values, &place.step, fewer.cost)? else { continue };
            put_in_order(problem, &mut from);
            let again = self.minimise(problem, &from, limits, "all samples, an element placed anew")?;
            let there = self.promised(problem, &again)?.at_optimum(&again);
            if there && best.as_ref().is_none_or(|b| again.cost < b.cost) {
                best = Some(again);
            } else if again.cost < solution.cost {
                solution = again;
            }
        }
        if let Some(best) = best.filter(|b| b.cost <= solution.cost + AT_OPTIMUM * unit) {
            return Ok(best);
        }
        if fewer.cost > solution.cost + OF_NOISE * unit {
            return Ok(solution);
        }
        let least = places.iter().min_by(|a, b| a.fall.total_cmp(&b.fall));
        let Some(mut nowhere) = least.map(|place| place.values.clone()) else { return Ok(solution) };
        put_in_order(problem, &mut nowhere);
        let surplus = self.at(problem, fewer, &nowhere)?;
        let there = self.promised(problem, &surplus)?.at_optimum(&surplus);
        Ok(if there { surplus } else { solution })
    }

    /// A solution at other values that are as good, its slopes taken there.
    fn at(&self, problem: &Calibration, like: Solution, values: &[f64]) -> Result<Solution, ModelError> {
        let x = problem.variables(values);
        let residuals = problem.residuals(&x)?;
        let columns = jacobian(problem, &x, &residuals)?;
        self.count(columns.len() + 1);
        let (lower, upper) = problem.bounds();
        let at_bound = (0..x.len()).map(|j| x[j] <= lower[j] || x[j] >= upper[j]).collect();
        let cost = 0.5 * residuals.iter().map(|r| r * r).sum::<f64>();
        Ok(Solution { x, residuals, columns, at_bound, cost, ..like })
    }

    /// The end of a descent without one of its elements: of all of them, the one whose compliance the others make up for best.
    fn with_one_less(
        &self,
        problem: &Calibration,
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
                let told = made_up_for(problem, &by_value, &solution.residuals, &values, e);
                [(e, told), (e, given_to_neighbour(problem, &values, elements, e))]
            })
            .collect();
        self.count(starts.len());
        let costs = starts.par_iter().map(|(_, values)| {
            let residuals = problem.residuals(&problem.variables(values)).ok()?;
            Some(residuals.iter().map(|r| r * r).sum::<f64>()).filter(|c| c.is_finite())
        });
        let costs: Vec<f64> = costs.map(|c| c.unwrap_or(f64::INFINITY)).collect();
        let best = (0..starts.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
        let (element, from) = &starts[best];
        let mut fewer = self.problem(problem.model, problem.window());
        let (lower, upper) = problem.bounds();
        let held = (0..lower.len()).filter(|&j| lower[j] == upper[j]).chain([element.strength, element.time]);
        fewer.hold(&held.collect::<Vec<_>>(), from);
        let solution = self.minimise(&fewer, from, limits, "all samples, an element less")?;
        Ok((*element, self.without_surplus(&fewer, solution, limits)?))
    }

    /// An element more, beside the others, of each retardation time that is tried.
    fn places(&self, problem: &Calibration, fewer: &Solution, element: Element) -> Result<Vec<Place>, ModelError> {
        let Element { strength, time, .. } = element;
        let (lower, upper) = problem.bounds();
        let columns = self.slopes(problem, fewer)?;
        let values = problem.values(&fewer.x);
        let least = values[strength];
        let mut none = fewer.x.clone();
        none[strength] += NONE.ln();
        let without = problem.residuals(&none)?;
        let (mut low, mut high) = (problem.values(lower), problem.values(upper));
        let by_value = by_value(problem, &columns, &values);
        (low[time], high[time]) = (values[time], values[time]);
        self.count(TIMES + 1);
        let places = (0..TIMES).into_par_iter().map(|i| {
            let share = i as f64 / (TIMES - 1) as f64;
            let mut there = fewer.x.clone();
            there[time] = lower[time] + share * (upper[time] - lower[time]);
            let mut twice = there.clone();
            twice[strength] += std::f64::consts::LN_2;
            let with: Vec<f64> =
                problem.residuals(&twice)?.iter().zip(&without).map(|(twice, none)| 0.5 * (twice + none)).collect();
            let mut columns = by_value.clone();
            columns[strength] = with.iter().zip(&without).map(|(with, none)| (with - none) / least).collect();
            let step = promising_step(&columns, &with, &values, (&low, &high));
            let fall = fall_of(&columns, &with, &step);
            Ok(Place { values: problem.values(&there), step, fall })
        });
        places.collect()
    }
}

/// Places at which an element helps more than at those beside them, the best first.
fn peaks(places: &[Place]) -> Vec<&Place> {
    let fall = |i: usize| places.get(i).map_or(f64::NEG_INFINITY, |p| p.fall);
    let highest = |i: &usize| fall(*i) >= fall(i.wrapping_sub(1)) && fall(*i) > fall(i + 1);
    let mut peaks: Vec<&Place> = (0..places.len()).filter(highest).map(|i| &places[i]).collect();
    peaks.sort_by(|a, b| b.fall.total_cmp(&a.fall));
    peaks
}

/// As the effects order them, unless something is known, settled or held under a parameter's name.
fn put_in_order(problem: &Calibration, values: &mut [f64]) {
    let all_free = free_elements(problem).len() == elements(problem).len();
    if all_free && problem.model.constraints.is_empty() && problem.model.priors.is_empty() {
        problem.model.put_in_order(values);
    }
}

/// Values without an element: all others go where the straightened problem says that they make up for it.
fn made_up_for(
    problem: &Calibration,
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
    let step = promising_step(by_value, &left, &there, (&lower, &upper));
    there
        .iter_mut()
        .zip(step.iter())
        .zip(lower.iter().zip(&upper))
        .for_each(|((v, by), (l, u))| *v = (*v + by).clamp(*l, *u));
    there
}

/// Values without an element: the one with the nearest retardation time takes its compliance.
fn given_to_neighbour(problem: &Calibration, values: &[f64], elements: &[Element], element: Element) -> Vec<f64> {
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
    use crate::fit::search::calibrate::{Options, calibrate};
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;

    /// A wall of one element, fitted with more: an optimum that is no worse than with one, and what has vanished is said.
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
            assert!((speed.value - 380.0).abs() < 4.0 * speed.standard_error + 0.1, "{elements}: {}", speed.value);
            for gone in fit.parameters.iter().filter(|p| p.name.starts_with('J') && p.value <= p.lower) {
                let said = fit.unseen.iter().find(|u| u.parameters.contains(&gone.name));
                assert!(said.is_some_and(|u| u.in_words.contains("viscoelastic-wall:")), "{}", gone.name);
                for name in said.iter().flat_map(|u| &u.parameters) {
                    let own = fit.parameters.iter().find(|p| p.name == *name).unwrap();
                    assert!(own.standard_error.is_nan() && own.interval_95.0 == f64::NEG_INFINITY, "{name}");
                }
            }
        }
    }

    #[test]
    fn peaks_come_best_first_and_ends_may_be_some() {
        let places: Vec<Place> = [3.0, 1.0, 2.0, 2.0, 0.0, 5.0]
            .map(|fall| Place { values: vec![fall], step: DVector::zeros(1), fall })
            .into_iter()
            .collect();
        let falls: Vec<f64> = peaks(&places).iter().map(|p| p.fall).collect();
        assert_eq!(falls, [5.0, 3.0, 2.0]);
    }
}
