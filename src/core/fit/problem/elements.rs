//! The elements of effects that have several (Kelvin-Voigt elements of creep) among a problem's variables.

use crate::fit::numeric::least_squares::Problem;
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::parameter::Scale;

/// An element: where its compliance and its retardation time are among the variables.
#[derive(Clone, Copy)]
pub(crate) struct Element {
    /// The effect that it belongs to.
    pub(crate) effect: usize,
    pub(crate) strength: usize,
    pub(crate) time: usize,
}

/// The elements of effects that have several, if a strength of zero makes them vanish.
pub(crate) fn elements(problem: &FitProblem) -> Vec<Element> {
    let model = problem.model;
    let mut at = model.effects_from();
    let mut elements = Vec::new();
    for (effect, (chosen, &size)) in model.effects.iter().zip(model.effect_sizes()).enumerate() {
        if chosen.elements.is_some_and(|n| n > 1 && size == 2 * n) {
            elements.extend((at..at + size).step_by(2).map(|j| Element { effect, strength: j, time: j + 1 }));
        }
        at += size;
    }
    let of = |j: usize| &problem.parameters[j];
    elements.retain(|e| of(e.strength).is_strength() && of(e.time).scale == Scale::Log);
    elements
}

/// The elements that nothing holds or bounds and of which nothing is known.
pub(crate) fn free_elements(problem: &FitProblem) -> Vec<Element> {
    let (lower, upper) = problem.bounds();
    let free = |j: usize| {
        let p = &problem.parameters[j];
        let settled = problem.model.constraints.iter().any(|c| c.concerns(&p.name, None));
        p.prior.is_none() && !settled && lower[j] < upper[j]
    };
    elements(problem).into_iter().filter(|e| free(e.strength) && free(e.time)).collect()
}

/// Elements that vanished in a fit although it was free to keep them.
pub(crate) fn vanished(problem: &FitProblem, values: &[f64]) -> Vec<Element> {
    let least = |e: &Element| {
        let strength = &problem.parameters[e.strength];
        strength.lower < strength.upper && values[e.strength] <= strength.lower
    };
    let settled =
        |e: &Element| problem.model.constraints.iter().any(|c| c.concerns(&problem.parameters[e.strength].name, None));
    elements(problem).into_iter().filter(|e| least(e) && !settled(e)).collect()
}

/// Variables that are fixed at the end of a fit: those at a bound, and both of an element that has vanished. The little
/// that its retardation time moves looks like another element, which would seem undetermined for it.
pub(crate) fn fixed_variables(problem: &FitProblem, values: &[f64], at_bound: &[bool]) -> Vec<bool> {
    let mut fixed = at_bound.to_vec();
    for element in vanished(problem, values) {
        (fixed[element.strength], fixed[element.time]) = (true, true);
    }
    fixed
}
