//! The last stretch of a fit: whole Gauss-Newton steps, where damping let it stop early.
//!
//! In a flat valley (two parameters that nearly stand for each other) a damped step moves so little along it that the error seems
//! settled, while the values are standard errors away from the bottom. So the step is tried without damping before a fit counts as done.

use super::least_squares::{Limits, Problem, Solution, jacobian, minimise};
use super::uncertainty::gauss_newton_step;

/// Most whole steps.
const MOST_STEPS: usize = 4;
/// Shortest part of a step that is tried.
const LEAST_PART: f64 = 0.1;
/// Fall of half the sum of squares that is worth another step; residuals come in units of the noise, so it moves no parameter by more than a
/// seventh of its standard error.
const WORTH: f64 = 0.01;

/// Goes on from `solution` until a whole step is worth nothing more.
///
/// # Errors
/// A Jacobian that cannot be had at an accepted point.
pub fn settle<P: Problem>(
    problem: &P,
    mut solution: Solution,
    limits: Limits,
    mut progress: impl FnMut(usize, f64),
) -> Result<Solution, P::Error> {
    for _ in 0..MOST_STEPS {
        let columns = jacobian(problem, &solution.x, &solution.residuals)?;
        let step = gauss_newton_step(&columns, &solution.residuals, &solution.at_bound);
        let mut evaluations = solution.evaluations + columns.len();
        let further = shortened(problem, &solution, &step, &mut evaluations);
        solution.evaluations = evaluations;
        let Some(further) = further else { break };
        let before = solution.cost;
        let iterations = solution.iterations;
        let next = minimise(problem, &further, limits, |i, cost| progress(iterations + i, cost))?;
        solution =
            Solution { evaluations: evaluations + next.evaluations, iterations: iterations + next.iterations, ..next };
        if before - solution.cost < WORTH {
            break;
        }
    }
    Ok(solution)
}

/// The longest part of a step, halved at the most until [`LEAST_PART`], that lowers the cost by what is worth it.
fn shortened<P: Problem>(problem: &P, from: &Solution, step: &[f64], evaluations: &mut usize) -> Option<Vec<f64>> {
    let (lower, upper) = problem.bounds();
    let mut part = 1.0;
    while part >= LEAST_PART {
        let bounds = lower.iter().zip(upper);
        let moved = from.x.iter().zip(step).zip(bounds);
        let trial: Vec<f64> = moved.map(|((x, s), (l, u))| (x + part * s).clamp(*l, *u)).collect();
        *evaluations += 1;
        let cost = problem.residuals(&trial).ok().map(|r| 0.5 * r.iter().map(|r| r * r).sum::<f64>());
        if cost.is_some_and(|c| c < from.cost - WORTH) {
            return Some(trial);
        }
        // A step that promises nothing is not worth halving.
        if cost.is_some_and(|c| (c - from.cost).abs() < WORTH) {
            return None;
        }
        part *= 0.5;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// Two variables that all but stand for each other, one thousandth apart, and a cost of a thousand that nothing lowers.
    struct Valley;

    impl Problem for Valley {
        type Error = Infallible;
        fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, Infallible> {
            let (sum, difference) = (x[0] + x[1] - 3.0, 1e-3 * (x[0] - x[1] + 1.0));
            Ok(vec![1e3 * sum, 1e3 * difference, 2000f64.sqrt()])
        }
        fn bounds(&self) -> (&[f64], &[f64]) {
            (&[-100.0, -100.0], &[100.0, 100.0])
        }
        fn difference_step(&self, _j: usize) -> f64 {
            1e-6
        }
    }

    #[test]
    fn a_flat_valley_is_followed_to_its_bottom() {
        let limits = Limits { iterations: 40, cost_tolerance: 1e-4, step_tolerance: 1e-9 };
        let stopped = minimise(&Valley, &[2.2, 1.3], limits, |_, _| {}).unwrap();
        let evaluations = stopped.evaluations;
        let far = (stopped.x[0] - 1.0).abs();
        let settled = settle(&Valley, stopped, limits, |_, _| {}).unwrap();
        assert!((settled.x[0] - 1.0).abs() < 1e-3 && (settled.x[1] - 2.0).abs() < 1e-3, "{:?}", settled.x);
        assert!(far > 0.5, "the damped fit got there by itself, to {far}: this tests nothing");
        assert!(settled.evaluations > evaluations);
    }
}
