//! Bounded nonlinear least squares: Levenberg-Marquardt, projected on a box.
//!
//! Marquardt (1963); Nielsen (1999), IMM-REP-1999-05, for how the damping falls; Transtrum & Sethna (2012,
//! arXiv:1201.5885) for how it rises, and for the second-order part of a step; variables held at a bound while the
//! gradient pushes outwards (Kanzow, Yamashita & Fukushima 2004). The Jacobian's columns are independent simulations and
//! run in parallel.

use std::cell::LazyCell;

use crate::fit::numeric::bounded_step::{reduction_of, step_within};
use crate::fit::numeric::thresholds::{
    ACCELERATION_PROBE, DAMPING_RISE, FIRST_DAMPING, FIRST_DAMPING_NEAR, MAX_ACCELERATION, MAX_STALLS,
};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use crate::product::{along, dot, gram};

/// A problem: residuals as a function of variables that the solver may move in a box.
pub trait Problem: Sync {
    /// Why an evaluation can fail.
    type Error: Send;
    /// Residuals, already divided by their standard deviations; always of one length.
    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, Self::Error>;
    /// The same with only variable `j` changed from a point whose residuals are `base`: problems whose residuals fall
    /// into parts save the parts that `j` does not touch.
    fn residuals_moved(&self, x: &[f64], j: usize, base: &[f64]) -> Result<Vec<f64>, Self::Error> {
        let _ = (j, base);
        self.residuals(x)
    }
    /// A problem that changes almost alike and costs less, whose differences make the Jacobian; none where this one's
    /// do.
    fn cheaper(&self) -> Option<&Self> {
        None
    }
    /// Lower and upper bound of each variable.
    fn bounds(&self) -> (&[f64], &[f64]);
    /// Step of the finite difference for each variable.
    fn difference_step(&self, j: usize) -> f64;
    /// How the residuals answer to variable `j`.
    fn way(&self, _j: usize) -> Way {
        Way::Even
    }
}

/// Which way a step of a variable leads: the straighter the residuals along it, the further it can go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// By the step, however long.
    Even,
    /// The variable is a logarithm, and the residuals are linear in it while its value changes by less than a factor of
    /// e: a step of a thorough descent goes no further.
    Ratio,
    /// The variable is the logarithm of a strength. What is weak acts in proportion to the strength, so a step is a share
    /// of it; one of -1 leads to nothing, or as near to it as the bounds let it go.
    Strength,
}

impl Way {
    /// How far it goes in one step of a thorough descent.
    fn longest(self) -> f64 {
        if self == Way::Ratio { 1.0 } else { f64::INFINITY }
    }
    /// Where a step from `x` leads.
    fn stepped(self, x: f64, step: f64) -> f64 {
        if self == Way::Strength { x + step.max(-1.0).ln_1p() } else { x + step }
    }
    /// The step from `x` that leads there.
    fn step_to(self, x: f64, there: f64) -> f64 {
        if self == Way::Strength { (there - x).exp_m1() } else { there - x }
    }
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Most iterations.
    pub iterations: usize,
    /// Relative fall of the cost below which it is settled.
    pub cost_tolerance: f64,
    /// Largest change of a variable below which it is settled.
    pub step_tolerance: f64,
    /// Follow narrow, bent valleys to their ends from a near start: the first step is hardly damped, steps have a
    /// second-order part, and the descent ends only where an undamped step would not gain more either.
    pub thorough: bool,
}

/// Why the solver stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The cost no longer falls.
    CostSettled,
    /// The variables no longer move.
    VariablesSettled,
    /// The gradient vanishes.
    Stationary,
    /// The budget of iterations ran out.
    IterationsSpent,
    /// No damping gives a lower cost.
    NoDescent,
}

impl Stop {
    /// Whether it has finished, rather than run out of iterations.
    pub fn converged(self) -> bool {
        !matches!(self, Stop::IterationsSpent)
    }
    /// In words.
    pub fn describe(self) -> &'static str {
        match self {
            Stop::CostSettled => "the error no longer falls",
            Stop::VariablesSettled => "the parameters no longer move",
            Stop::Stationary => "the gradient vanishes",
            Stop::IterationsSpent => "the budget of iterations ran out before the error settled",
            Stop::NoDescent => "no step, however short, lowers the error further",
        }
    }
}

/// Where the solver stopped.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Variables.
    pub x: Vec<f64>,
    /// Residuals there.
    pub residuals: Vec<f64>,
    /// `JᵀJ` there (or one accepted step before).
    pub normal: DMatrix<f64>,
    /// The Jacobian's columns, likewise; none where no iteration was made.
    pub columns: Vec<Vec<f64>>,
    /// Which variables lie at a bound.
    pub at_bound: Vec<bool>,
    /// Half the sum of squares.
    pub cost: f64,
    /// Evaluations of the residuals, those for the Jacobian included.
    pub evaluations: usize,
    /// Iterations.
    pub iterations: usize,
    /// Why it stopped.
    pub stop: Stop,
}

/// The second-order part of a step, in scaled variables (Transtrum & Sethna 2012, arXiv:1201.5885): the valley bends
/// where the residuals bend along the step. None where the acceleration is too large to be trusted.
#[allow(clippy::too_many_arguments)]
fn geodesic_acceleration<P: Problem>(
    problem: &P,
    x: &[f64],
    residuals: &[f64],
    columns: &[Vec<f64>],
    free: &[usize],
    scale: &[f64],
    step: &DVector<f64>,
    factor: &Cholesky<f64, Dyn>,
) -> Option<DVector<f64>> {
    let (lower, upper) = problem.bounds();
    let mut ahead = x.to_vec();
    for (a, &j) in free.iter().enumerate() {
        ahead[j] = problem.way(j).stepped(x[j], ACCELERATION_PROBE * step[a] / scale[j]);
        if ahead[j] < lower[j] || ahead[j] > upper[j] {
            return None;
        }
    }
    let mut curved = problem.residuals(&ahead).ok()?;
    for (c, r) in curved.iter_mut().zip(residuals) {
        *c = (*c - r) / ACCELERATION_PROBE;
    }
    for (a, &j) in free.iter().enumerate() {
        let by = step[a] / scale[j];
        curved.iter_mut().zip(&columns[j]).for_each(|(c, d)| *c -= by * d);
    }
    let right = DVector::from_iterator(
        free.len(),
        free.iter().map(|&j| -dot(&columns[j], &curved) / (ACCELERATION_PROBE * scale[j])),
    );
    let acceleration = factor.solve(&right);
    (acceleration.norm() <= MAX_ACCELERATION * step.norm()).then_some(acceleration)
}

/// The steps from `x` that lead to the lower and the upper bounds.
fn room<P: Problem>(problem: &P, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (lower, upper) = problem.bounds();
    let to = |bounds: &[f64]| (0..x.len()).map(|j| problem.way(j).step_to(x[j], bounds[j])).collect();
    (to(lower), to(upper))
}

/// Reduction of the sum of squares that an undamped step from `x` predicts within the bounds.
pub(crate) fn predicted_at<P: Problem>(problem: &P, columns: &[Vec<f64>], residuals: &[f64], x: &[f64]) -> f64 {
    let (low, high) = room(problem, x);
    reduction_of(columns, residuals, &step_within(&gram(columns), &along(columns, residuals), (&low, &high)))
}

fn half_square(residuals: &[f64]) -> f64 {
    0.5 * dot(residuals, residuals)
}

/// Whether two descents stand in one place, whatever the names of their variables: their residuals differ by no more
/// than `most`, half the sum of squares.
pub fn have_met(a: &[f64], b: &[f64], most: f64) -> bool {
    a.len() == b.len() && 0.5 * a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() <= most
}

/// The Jacobian by forward differences, one column a variable (backward where the upper bound is near or the problem
/// ends), of the problem or of a cheaper one that stands for it.
///
/// # Errors
/// An evaluation that fails on both sides.
pub fn jacobian<P: Problem>(problem: &P, x: &[f64], base: &[f64]) -> Result<Vec<Vec<f64>>, P::Error> {
    // a coarser grid may not hold what the problem's own one does
    if let Some(cheaper) = problem.cheaper()
        && let Ok(columns) = cheaper.residuals(x).and_then(|base| jacobian(cheaper, x, &base))
    {
        return Ok(columns);
    }
    let (_, upper) = problem.bounds();
    (0..x.len())
        .into_par_iter()
        .map(|j| {
            let by = |step: f64| {
                let mut moved = x.to_vec();
                moved[j] += step;
                let mut column = problem.residuals_moved(&moved, j, base)?;
                column.iter_mut().zip(base).for_each(|(c, b)| *c = (*c - b) / step);
                Ok(column)
            };
            let step = problem.difference_step(j);
            let inwards = if x[j] + step > upper[j] { -step } else { step };
            // What is held may stand at an end of all that can be evaluated, on either side.
            by(inwards).or_else(|error: P::Error| by(-inwards).map_err(|_| error))
        })
        .collect()
}

/// Minimises half the sum of squared residuals from `start`; `progress` sees iteration and cost.
///
/// # Errors
/// Only if the start itself cannot be evaluated, or a Jacobian at an accepted point; a trial step that fails is a bad
/// step.
pub fn minimise<P: Problem>(
    problem: &P,
    start: &[f64],
    limits: Limits,
    mut progress: impl FnMut(usize, f64),
) -> Result<Solution, P::Error> {
    minimise_in_view(problem, start, limits, |iteration, cost, _| progress(iteration, cost))
}

/// The same; `progress` also sees the variables.
///
/// # Errors
/// As [`minimise`].
pub fn minimise_in_view<P: Problem>(
    problem: &P,
    start: &[f64],
    limits: Limits,
    mut progress: impl FnMut(usize, f64, &[f64]),
) -> Result<Solution, P::Error> {
    let (lower, upper) = problem.bounds();
    let n = start.len();
    let clamp = |x: &mut [f64]| {
        for (v, (l, u)) in x.iter_mut().zip(lower.iter().zip(upper)) {
            *v = v.clamp(*l, *u);
        }
    };
    let mut x = start.to_vec();
    clamp(&mut x);
    let mut residuals = problem.residuals(&x)?;
    let mut cost = half_square(&residuals);
    let mut evaluations = 1;
    let mut normal = DMatrix::zeros(n, n);
    let mut columns = Vec::new();
    let mut damping = if limits.thorough { FIRST_DAMPING_NEAR } else { FIRST_DAMPING };
    let mut stop = Stop::IterationsSpent;
    let (mut iterations, mut stalls) = (0, 0);
    'outer: while iterations < limits.iterations {
        iterations += 1;
        columns = jacobian(problem, &x, &residuals)?;
        evaluations += n;
        normal = gram(&columns);
        let gradient = along(&columns, &residuals);
        // Held: at a bound, with the descent direction pointing out of the box.
        let free: Vec<usize> = (0..n)
            .filter(|&j| !((x[j] <= lower[j] && gradient[j] > 0.0) || (x[j] >= upper[j] && gradient[j] < 0.0)))
            .collect();
        let scale: Vec<f64> = (0..n).map(|j| normal[(j, j)].sqrt().max(1e-12)).collect();
        if free.iter().all(|&j| gradient[j].abs() / scale[j] <= 1e-9 * (2.0 * cost).sqrt().max(1e-12)) {
            stop = Stop::Stationary;
            break;
        }
        // Marquardt's scaling: the damped system is solved in units of each column's norm.
        let damped = |damping: f64| {
            DMatrix::from_fn(free.len(), free.len(), |a, b| {
                let (i, j) = (free[a], free[b]);
                let unit = normal[(i, j)] / (scale[i] * scale[j]);
                if a == b { unit + damping } else { unit }
            })
        };
        let rhs = DVector::from_iterator(free.len(), free.iter().map(|&j| -gradient[j] / scale[j]));
        let led_by = |step: &DVector<f64>| {
            let mut end = x.clone();
            for (a, &j) in free.iter().enumerate() {
                end[j] = problem.way(j).stepped(x[j], step[a] / scale[j]);
            }
            clamp(&mut end);
            end
        };
        let model_fall = |by: &DVector<f64>| -(gradient.dot(by) + 0.5 * by.dot(&(&normal * by)));
        // The fall that a step without damping predicts within the box.
        let undamped_fall = LazyCell::new(|| {
            let (low, high) = room(problem, &x);
            model_fall(&step_within(&normal, &gradient, (&low, &high)))
        });
        loop {
            let Some(factor) = damped(damping).cholesky() else {
                damping = (damping * 10.0).max(1e-10);
                if damping > 1e16 {
                    stop = Stop::NoDescent;
                    break 'outer;
                }
                continue;
            };
            let mut step = factor.solve(&rhs);
            if limits.thorough {
                let share = |(a, &j): (usize, &usize)| problem.way(j).longest() * scale[j] / step[a].abs();
                step *= free.iter().enumerate().map(share).fold(1.0, f64::min);
            }
            let mut trial = led_by(&step);
            let moved = DVector::from_fn(n, |j, _| problem.way(j).step_to(x[j], trial[j]));
            let largest = moved.amax();
            if largest <= limits.step_tolerance {
                stop = Stop::VariablesSettled;
                break 'outer;
            }
            evaluations += 1;
            let predicted = model_fall(&moved);
            if limits.thorough
                && let Some(acceleration) =
                    geodesic_acceleration(problem, &x, &residuals, &columns, &free, &scale, &step, &factor)
            {
                evaluations += 1;
                trial = led_by(&(&step + acceleration));
            }
            let outcome = problem.residuals(&trial).ok().map(|r| (half_square(&r), r)).filter(|(c, _)| c.is_finite());
            match outcome {
                Some((new_cost, new_residuals)) if new_cost < cost => {
                    let ratio = (cost - new_cost) / predicted.max(f64::MIN_POSITIVE);
                    let fall = (cost - new_cost) / cost;
                    let settles = fall <= limits.cost_tolerance && ratio > 0.1;
                    let goes_on = settles
                        && limits.thorough
                        && *undamped_fall - (cost - new_cost) > limits.cost_tolerance * new_cost;
                    x = trial;
                    residuals = new_residuals;
                    cost = new_cost;
                    damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(1.0 / 3.0, 2.0);
                    damping = damping.max(1e-12);
                    progress(iterations, cost, &x);
                    if fall > limits.cost_tolerance {
                        stalls = 0;
                    } else if settles {
                        stalls += 1;
                        if !goes_on || stalls >= MAX_STALLS {
                            stop = Stop::CostSettled;
                            break 'outer;
                        }
                        // A narrow valley: damping holds the step back, not the lack of a descent.
                        damping = (damping * 0.1).max(1e-12);
                    }
                    break;
                }
                // Where even an undamped step would gain nothing, no shorter one does.
                _ if *undamped_fall <= limits.cost_tolerance * cost => {
                    stop = Stop::CostSettled;
                    break 'outer;
                }
                _ => {
                    damping *= DAMPING_RISE;
                    if damping > 1e16 {
                        stop = Stop::NoDescent;
                        break 'outer;
                    }
                }
            }
        }
    }
    let at_bound = x.iter().zip(lower.iter().zip(upper)).map(|(v, (l, u))| v <= l || v >= u).collect();
    Ok(Solution { x, residuals, normal, columns, at_bound, cost, evaluations, iterations, stop })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::numeric::test_problem::Test;

    const LIMITS: Limits = Limits { iterations: 200, cost_tolerance: 1e-14, step_tolerance: 1e-12, thorough: false };

    /// Moré, Garbow & Hillstrom (1981), problem 1.
    #[test]
    fn rosenbrock_is_solved() {
        let problem = Test {
            f: |x: &[f64]| vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]],
            lower: vec![-5.0; 2],
            upper: vec![5.0; 2],
            way: Way::Even,
        };
        let s = minimise(&problem, &[-1.2, 1.0], LIMITS, |_, _| {}).unwrap();
        assert!(s.stop.converged());
        assert!((s.x[0] - 1.0).abs() < 1e-6 && (s.x[1] - 1.0).abs() < 1e-6, "{:?}", s.x);
    }

    /// Rosenbrock's valley, narrower: where straight, damped steps creep, bent ones reach its end.
    #[test]
    fn bent_steps_follow_a_bent_valley() {
        let problem = Test {
            f: |x: &[f64]| vec![3000.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]],
            lower: vec![-5.0; 2],
            upper: vec![5.0; 2],
            way: Way::Even,
        };
        let [plain, bent] = [false, true].map(|thorough| {
            let s = minimise(&problem, &[0.5, 0.2], Limits { iterations: 20, thorough, ..LIMITS }, |_, _| {}).unwrap();
            (s.x[0] - 1.0).abs()
        });
        assert!(bent < 1e-6 && plain > 0.1, "{bent} against {plain}");
    }

    /// A thorough descent goes no further at once than the residuals can be trusted, and gets there all the same.
    #[test]
    fn a_step_keeps_within_reach() {
        let problem =
            Test { f: |x: &[f64]| vec![10.0 * (x[0] - 4.5)], lower: vec![-9.0], upper: vec![9.0], way: Way::Ratio };
        for (iterations, end) in [(1, 1.0), (2, 2.0), (20, 4.5)] {
            let s = minimise(&problem, &[0.0], Limits { iterations, thorough: true, ..LIMITS }, |_, _| {}).unwrap();
            assert!((s.x[0] - end).abs() < 1e-6, "{iterations}: {:?}", s.x);
        }
    }

    /// What acts in proportion to a strength is found in one step, be it almost absent at the start or far too strong:
    /// the logarithm of the strength, moved evenly, creeps.
    #[test]
    fn a_strength_is_found_in_one_step() {
        let from = |way: Way, start: f64, wanted: f64| {
            let f = move |x: &[f64]| vec![x[0].exp() - wanted, 1.0];
            let problem = Test { f, lower: vec![-30.0], upper: vec![9.0], way };
            minimise(&problem, &[start], Limits { iterations: 1, thorough: true, ..LIMITS }, |_, _| {}).unwrap().x[0]
        };
        for start in [-11.0, 0.7] {
            let found = from(Way::Strength, start, 0.25).exp();
            assert!((found - 0.25).abs() < 1e-5, "from {start}: {found}");
        }
        assert!(from(Way::Ratio, -11.0, 0.25) <= -10.0);
        // asked for less than nothing, it vanishes
        assert_eq!(from(Way::Strength, -1.0, -0.25), -30.0);
    }

    /// Two strengths whose traces are nearly alike, one of them absent: a descent ends at the best that strengths of no
    /// less than nothing allow, and no step is predicted to lower it.
    #[test]
    fn of_two_strengths_alike_the_absent_one_vanishes() {
        let t: Vec<f64> = (0..50).map(|i| f64::from(i) / 25.0).collect();
        let trace = |x: &[f64]| -> Vec<f64> {
            t.iter().map(|t| x[0].exp() * (-t).exp() + x[1].exp() * (-1.05 * t).exp()).collect()
        };
        let shown: Vec<f64> = t.iter().map(|t| 0.3 * (-0.95 * t).exp()).collect();
        let f = |x: &[f64]| trace(x).iter().zip(&shown).map(|(a, b)| (a - b) / 1e-4).collect::<Vec<f64>>();
        for start in [[-3.0, -3.0], [-11.0, -1.0], [-1.0, -11.0], [0.5, 0.5]] {
            let problem = Test { f, lower: vec![-14.0; 2], upper: vec![3.0; 2], way: Way::Strength };
            let limits = Limits { cost_tolerance: 1e-6, thorough: true, ..LIMITS };
            let s = minimise(&problem, &start, limits, |_, _| {}).unwrap();
            // alone, the slower one leaves least: the projection of what is shown on its trace
            let slow: Vec<f64> = t.iter().map(|t| (-t).exp()).collect();
            let alone = dot(&slow, &shown) / dot(&slow, &slow);
            assert!((s.x[0].exp() / alone - 1.0).abs() < 1e-3 && s.x[1] < -13.0, "{start:?}: {:?} {alone}", s.x);
            let columns = jacobian(&problem, &s.x, &s.residuals).unwrap();
            let left = predicted_at(&problem, &columns, &s.residuals, &s.x);
            assert!(left < 1e-5 * 2.0 * s.cost, "{start:?}: {left} of {}", 2.0 * s.cost);
        }
    }

    /// A step leads where the step back comes from, and at first it leads on by as much as the step.
    #[test]
    fn a_way_leads_there_and_back() {
        for way in [Way::Even, Way::Ratio, Way::Strength] {
            for (x, step) in [(-4.0, 0.3), (2.0, -0.9), (0.0, 7.0)] {
                assert!((way.step_to(x, way.stepped(x, step)) - step).abs() < 1e-12, "{way:?} {x} {step}");
                assert!((way.stepped(x, 1e-7 * step) - x - 1e-7 * step).abs() < 1e-12, "{way:?} {x} {step}");
            }
        }
    }

    /// In a blunt corner the slope on either side promises little and no step gains anything: a thorough descent does
    /// not go on trying.
    #[test]
    fn a_descent_ends_where_no_step_can_gain() {
        let corner = |x: &[f64]| vec![1.0 + 1e-4 * x[0].abs(), x[0]];
        let problem = Test { f: corner, lower: vec![-5.0], upper: vec![5.0], way: Way::Even };
        let ends = |cost_tolerance: f64| {
            let limits = Limits { cost_tolerance, step_tolerance: 1e-300, thorough: true, ..LIMITS };
            minimise(&problem, &[0.0], limits, |_, _| {}).unwrap()
        };
        let (settled, tried) = (ends(1e-6), ends(1e-9));
        assert_eq!((settled.stop, settled.x[0]), (Stop::CostSettled, 0.0));
        assert!(settled.evaluations <= 4, "{}", settled.evaluations);
        // where the slope promises more than the tolerance, shorter steps are tried
        assert!(tried.evaluations > 10 && tried.stop == Stop::NoDescent, "{} {:?}", tried.evaluations, tried.stop);
    }

    /// Moré, Garbow & Hillstrom (1981), problem 13: singular Jacobian at the solution (0, 0, 0, 0).
    #[test]
    fn powells_singular_function_is_solved() {
        let problem = Test {
            f: |x: &[f64]| {
                vec![
                    x[0] + 10.0 * x[1],
                    5f64.sqrt() * (x[2] - x[3]),
                    (x[1] - 2.0 * x[2]).powi(2),
                    10f64.sqrt() * (x[0] - x[3]).powi(2),
                ]
            },
            lower: vec![-10.0; 4],
            upper: vec![10.0; 4],
            way: Way::Even,
        };
        let s = minimise(&problem, &[3.0, -1.0, 0.0, 1.0], LIMITS, |_, _| {}).unwrap();
        assert!(s.cost < 1e-10, "{}", s.cost);
    }

    /// Rosenbrock with x₁ ≤ 0.5: the constrained minimum is (0.5, 0.25), on the bound.
    #[test]
    fn a_bound_is_held_and_said() {
        let problem = Test {
            f: |x: &[f64]| vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]],
            lower: vec![-5.0, -5.0],
            upper: vec![0.5, 5.0],
            way: Way::Even,
        };
        let s = minimise(&problem, &[-1.2, 1.0], LIMITS, |_, _| {}).unwrap();
        assert!((s.x[0] - 0.5).abs() < 1e-12 && (s.x[1] - 0.25).abs() < 1e-5, "{:?}", s.x);
        assert_eq!(s.at_bound, [true, false]);
    }

    /// NIST StRD, Misra1a (lower difficulty): certified b1 = 238.94212918, b2 = 5.5015643181e-4,
    /// s.e. 2.7070075241, 7.2668688436e-6.
    #[test]
    fn nist_misra1a_with_its_standard_errors() {
        let y = [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78];
        let t = [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0];
        let problem = Test {
            f: |x: &[f64]| y.iter().zip(&t).map(|(y, t)| y - x[0] * (1.0 - (-x[1] * 1e-4 * t).exp())).collect(),
            lower: vec![1.0, 0.01],
            upper: vec![1000.0, 100.0],
            way: Way::Even,
        };
        let s = minimise(&problem, &[500.0, 1.0], LIMITS, |_, _| {}).unwrap();
        assert!((s.x[0] - 238.94212918).abs() < 1e-4, "{:?}", s.x);
        assert!((s.x[1] - 5.5015643181).abs() < 1e-5, "{:?}", s.x);
        let variance = 2.0 * s.cost / 12.0;
        let covariance = s.normal.try_inverse().unwrap() * variance;
        assert!((covariance[(0, 0)].sqrt() / 2.7070075241 - 1.0).abs() < 1e-3);
        assert!((covariance[(1, 1)].sqrt() / 7.2668688436e-2 - 1.0).abs() < 1e-3);
    }
}
