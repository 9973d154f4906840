//! Profile likelihood: how far one parameter can move while all others follow, before the fit is worse than noise can explain.
//!
//! Along the parameter the sum of squares is minimised over all others; the interval ends where it has risen by the 95% point of χ² with one
//! degree of freedom (Venzon & Moolgavkar 1988, Appl. Statist. 37, 87), times the factor by which the parameter scatters more
//! than white noise of the believed size would let it (Kent 1982, Biometrika 69, 19): see [`super::errors`]. Where the problem is linear that
//! is the linear interval; a side on which the threshold is not reached before the bound is open.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::approach::Fitter;
use super::calibrate::{FitError, Options, Progress};
use super::data::RunData;
use super::finish::{FINAL_REACHES, errors_of};
use super::interval::Z_95;
use super::least_squares::{Limits, Problem, Solution, jacobian, minimise};
use super::outcome::Fit;
use super::problem::Calibration;
use crate::rig::Rig;

/// Points on one side of the best value, at most.
const MOST: usize = 9;
/// How near to the threshold is near enough, in standard errors.
const NEAR: f64 = 0.03;
/// Fall of the sum of squares, in units of the threshold's, that is worth no iteration more.
const SETTLED: f64 = 0.01;
/// Share of the interval on one side by which profile and linear interval may differ before it is said.
const DIFFERENT: f64 = 0.3;

/// The profile of one parameter, in its own unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// The 95% interval; an open end is infinite.
    pub interval_95: (f64, f64),
    /// The linear one.
    pub linear_95: (f64, f64),
    /// Value and rise of the sum of squares, ascending by value; 3.84 is the threshold.
    pub points: Vec<(f64, f64)>,
    /// By how much less than nothing the rise became: the fit was not the best.
    pub fell_by: f64,
    /// Where it is centred: the optimum that a descent from the fit leads to.
    pub best: f64,
}

/// Profiles of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Profiles {
    /// Of each parameter that was asked for.
    pub of_each: Vec<Profile>,
    /// By how much lower than the fit's the sum of squares is at their centre, in units of what one sample leaves there.
    pub below_fit: f64,
    /// Simulations that they took.
    pub evaluations: usize,
}

impl Profile {
    /// Whether it says something else than the linear interval about its centre; where there is no linear one, it does not.
    pub fn disagrees(&self) -> bool {
        let value = self.best;
        if self.linear_95.0.is_nan() || self.linear_95.1.is_nan() {
            return false;
        }
        let sides = [(self.interval_95.0, self.linear_95.0), (self.interval_95.1, self.linear_95.1)];
        sides.into_iter().any(|(own, linear)| match (own.is_finite(), linear.is_finite()) {
            (true, true) => {
                let ratio = (own - value) / (linear - value);
                ratio.is_finite() && !(1.0 / (1.0 + DIFFERENT)..=1.0 + DIFFERENT).contains(&ratio)
            }
            (own, linear) => own != linear,
        })
    }
}

/// The profile along variable `j`, in variables.
struct Walk {
    /// Ends of the interval; none where the bound comes first.
    ends: [Option<f64>; 2],
    /// Variable and rise, ascending.
    points: Vec<(f64, f64)>,
    evaluations: usize,
}

/// One side of a profile: its end, where there is one before the bound, and the points that were tried.
struct Side {
    end: Option<f64>,
    points: Vec<(f64, f64)>,
    evaluations: usize,
}

/// Where a walk starts.
struct Start<'a> {
    best: &'a Solution,
    j: usize,
    /// Rise of the sum of squares that counts as one.
    unit: f64,
    /// First step, in the variable.
    first: f64,
    /// How the other variables follow, to first order.
    follow: &'a [f64],
}

/// A problem with one variable held.
struct Held<'a, P> {
    inner: &'a P,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<P: Problem> Problem for Held<'_, P> {
    type Error = P::Error;
    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, P::Error> {
        self.inner.residuals(x)
    }
    fn residuals_moved(&self, x: &[f64], j: usize, base: &[f64]) -> Result<Vec<f64>, P::Error> {
        self.inner.residuals_moved(x, j, base)
    }
    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }
    fn reach(&self, j: usize) -> f64 {
        self.inner.reach(j)
    }
    fn difference_step(&self, j: usize) -> f64 {
        self.inner.difference_step(j)
    }
}

/// Both sides of a variable.
fn walk<P: Problem>(problem: &P, start: &Start) -> Walk {
    let (low, high) = rayon::join(|| side(problem, start, -1.0), || side(problem, start, 1.0));
    let mut points = [low.points, vec![(start.best.x[start.j], 0.0)], high.points].concat();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    Walk { ends: [low.end, high.end], points, evaluations: low.evaluations + high.evaluations }
}

/// One side.
fn side<P: Problem>(problem: &P, start: &Start, sign: f64) -> Side {
    let Start { best, j, unit, first, follow } = *start;
    let (lower, upper) = problem.bounds();
    let room = if sign < 0.0 { best.x[j] - lower[j] } else { upper[j] - best.x[j] };
    let (mut points, mut evaluations) = (Vec::new(), 0);
    let (mut near, mut far) = ((0.0, 0.0, best.x.clone()), None::<(f64, f64)>);
    let mut away = first.min(room);
    while room > 0.0 && points.len() < MOST {
        let at = best.x[j] + sign * away;
        let mut held = Held { inner: problem, lower: lower.to_vec(), upper: upper.to_vec() };
        (held.lower[j], held.upper[j]) = (at, at);
        let limits = Limits {
            iterations: 40,
            // Of the cost at the interval's end, so that it is worth the same in a fit without any error left.
            cost_tolerance: SETTLED * unit / (best.cost + 0.5 * Z_95 * Z_95 * unit),
            step_tolerance: 1e-10,
            thorough: true,
        };
        // Along the valley as the best fit sees it, and straight on in case that leads astray. What cannot be simulated does not fit.
        let along: Vec<f64> = near.2.iter().zip(follow).map(|(x, f)| x + f * sign * (away - near.0)).collect();
        let (along, straight) =
            rayon::join(|| minimise(&held, &along, limits, |_, _| {}), || minimise(&held, &near.2, limits, |_, _| {}));
        let tried: Vec<Solution> = [along, straight].into_iter().flatten().collect();
        evaluations += tried.iter().map(|s| s.evaluations).sum::<usize>();
        let found = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        let rise = found.as_ref().map_or(f64::INFINITY, |s| 2.0 * (s.cost - best.cost) / unit);
        points.push((at, rise));
        let root = rise.max(0.0).sqrt();
        if (root - Z_95).abs() < NEAR {
            return Side { end: Some(at), points, evaluations };
        }
        match found {
            Some(solution) if root < Z_95 => {
                if away >= room {
                    return Side { end: None, points, evaluations };
                }
                near = (away, root, solution.x);
            }
            _ => far = Some((away, root)),
        }
        away = match far {
            None => (near.0 * (Z_95 / near.1).clamp(1.3, 4.0)).min(room),
            Some((d, z)) => {
                let share = (Z_95 - near.1) / (z - near.1);
                near.0 + (d - near.0) * if z.is_finite() { share.clamp(0.1, 0.9) } else { 0.5 }
            }
        };
    }
    Side { end: far.map(|_| best.x[j] + sign * away), points, evaluations }
}

/// Profiles of the parameters `which` of a fit, by their index, in that order.
///
/// Their centre is the optimum that a descent from the fit leads to on its own grid, whether or not the fit ended there. They are walked on a grid of
/// [`FINAL_REACHES`] reaches or little more, about the best fit there: the grid moves a valley more than it bends it.
///
/// # Errors
/// As [`super::calibrate::refine`].
pub fn profiles(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    which: &[usize],
    options: &Options,
    progress: &(dyn Fn(&Progress) + Sync),
) -> Result<Profiles, FitError> {
    let values = fit.values();
    let fitter = Fitter::new(rig, runs, options, progress, &fit.effects, Some(&values))?;
    let model = fitter.model(&fit.effects);
    let own = fitter.problem(&model, fitter.whole(fit.reaches));
    let limits = |problem: &Calibration| Limits {
        iterations: options.patience,
        cost_tolerance: SETTLED / problem.samples().max(1) as f64,
        step_tolerance: 1e-10,
        thorough: true,
    };
    let at_fit = own.residuals(&own.variables(&values))?;
    let centre = fitter.minimise(&own, &values, limits(&own), "profiles: their centre")?;
    let fall = at_fit.iter().map(|r| r * r).sum::<f64>() - 2.0 * centre.cost;
    let below_fit = fall / (2.0 * centre.cost / own.samples().max(1) as f64).max(f64::MIN_POSITIVE);
    let values = own.values(&centre.x);
    let reaches = model.fitting_reaches(&values[..model.shared.len()], FINAL_REACHES.max(fitter.least_reaches));
    let problem = fitter.problem(&model, fitter.whole(reaches));
    let best = fitter.minimise(&problem, &values, limits(&problem), "profiles: the best fit")?;
    let columns = jacobian(&problem, &best.x, &best.residuals)?;
    fitter.count(1 + columns.len());
    let fitted = problem.variables(&values);
    let done = AtomicUsize::new(0);
    let one = |&j: &usize| {
        let parameter = &fit.parameters[j];
        // Held variables do not follow; one at its bound is let go.
        let solution = Solution {
            at_bound: best.at_bound.iter().enumerate().map(|(i, held)| *held && i != j).collect(),
            ..best.clone()
        };
        let errors = errors_of(&problem, &solution, &columns, &problem.gain_errors().into_values().collect::<Vec<_>>());
        let believed = errors.believed[(j, j)];
        let error = parameter.standard_error / problem.stretch(j, values[j]);
        let unit = if error.is_finite() { (error * error / believed).max(1.0) } else { errors.inflation(j) };
        let (lower, upper) = problem.bounds();
        let half = Z_95 * if error.is_finite() { error } else { errors.covariance[(j, j)].sqrt() };
        let first = if half.is_finite() && half > 0.0 { half } else { 0.05 * (upper[j] - lower[j]) };
        let follow: Vec<f64> = (0..best.x.len())
            .map(|i| if i == j { 1.0 } else { errors.believed[(i, j)] / believed })
            .map(|f| if f.is_finite() { f } else { 0.0 })
            .collect();
        let walk = walk(&problem, &Start { best: &best, j, unit, first, follow: &follow });
        fitter.count(walk.evaluations);
        let name = |x: f64| problem.value(j, (fitted[j] + x - best.x[j]).clamp(lower[j], upper[j]));
        let end = |x: Option<f64>, open: f64| x.map_or(open, name);
        let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(&Progress {
            stage: format!("profile {finished} of {}: {}", which.len(), parameter.name),
            reaches,
            iteration: walk.points.len(),
            error_over_noise: (2.0 * best.cost / problem.samples().max(1) as f64).sqrt(),
        });
        Profile {
            interval_95: (end(walk.ends[0], f64::NEG_INFINITY), end(walk.ends[1], f64::INFINITY)),
            linear_95: parameter.interval_95,
            fell_by: walk.points.iter().map(|p| -p.1).fold(0.0, f64::max),
            best: values[j],
            points: walk.points.into_iter().filter(|p| p.1.is_finite()).map(|(x, rise)| (name(x), rise)).collect(),
        }
    };
    let of_each = which.par_iter().map(one).collect();
    Ok(Profiles { of_each, below_fit, evaluations: fitter.evaluations.load(Ordering::Relaxed) })
}

#[cfg(test)]
mod tests {
    use super::super::test_problem::Test;
    use super::*;

    fn profile<F: Fn(&[f64]) -> Vec<f64> + Sync>(problem: &Test<F>, start: &[f64], j: usize, unit: f64) -> Walk {
        let limits = Limits { iterations: 200, cost_tolerance: 1e-14, step_tolerance: 1e-12, thorough: false };
        let best = minimise(problem, start, limits, |_, _| {}).unwrap();
        let mut follow = vec![0.0; start.len()];
        follow[j] = 1.0;
        walk(problem, &Start { best: &best, j, unit, first: 0.3, follow: &follow })
    }

    /// A straight line: the profile of its slope is the textbook's interval, with the intercept following.
    #[test]
    fn of_a_line_it_is_the_linear_interval() {
        let t: Vec<f64> = (0..21).map(|i| f64::from(i) / 10.0).collect();
        let problem = Test {
            f: |x: &[f64]| t.iter().map(|t| (1.0 + 2.0 * t + 0.1 * (40.0 * t).sin()) - x[0] - x[1] * t).collect(),
            lower: vec![-10.0; 2],
            upper: vec![10.0; 2],
            reach: f64::INFINITY,
        };
        // Variance of the slope: 1/Σ(t - 1)² = 1/7.7 with unit noise; four times that is worth two standard errors.
        let error = (1.0f64 / 7.7).sqrt();
        for unit in [1.0, 4.0] {
            let found = profile(&problem, &[0.0, 0.0], 1, unit);
            let [low, high] = found.ends.map(Option::unwrap);
            let half = 0.5 * (high - low);
            assert!((half / (Z_95 * error * unit.sqrt()) - 1.0).abs() < NEAR, "{half}");
        }
    }

    /// Counts of a rate: 2 (μ - n - n ln(μ/n)) = 3.8415 at n = 10 has the ends 5.011 and 17.539 (solved by scipy's brentq), far from symmetric.
    #[test]
    fn of_a_poisson_rate_it_is_the_likelihood_interval() {
        let n = 10.0f64;
        let problem = Test {
            f: |x: &[f64]| {
                vec![(x[0] - n - n * (x[0] / n).ln()).max(0.0).mul_add(2.0, 0.0).sqrt() * (x[0] - n).signum()]
            },
            lower: vec![0.5],
            upper: vec![100.0],
            reach: f64::INFINITY,
        };
        let best = Solution {
            x: vec![n],
            residuals: vec![0.0],
            normal: nalgebra::DMatrix::zeros(1, 1),
            columns: Vec::new(),
            at_bound: vec![false],
            cost: 0.0,
            evaluations: 0,
            iterations: 0,
            stop: crate::fit::least_squares::Stop::Stationary,
        };
        let found = walk(&problem, &Start { best: &best, j: 0, unit: 1.0, first: 6.0, follow: &[1.0] });
        let [low, high] = found.ends.map(Option::unwrap);
        assert!((low - 5.011).abs() < 0.1 && (high - 17.539).abs() < 0.15, "{low} {high}");
    }

    /// A time constant far longer than the record: it may be anything above, and the end above is open.
    #[test]
    fn a_side_that_meets_the_bound_is_open() {
        let t: Vec<f64> = (1..40).map(|i| f64::from(i) / 40.0).collect();
        let problem = Test {
            // J (1 - exp(-t/τ)) with J/τ = 1, τ = 50, noise 0.01; variables ln J, ln τ.
            f: |x: &[f64]| {
                let model = |j: f64, tau: f64, t: f64| j * (1.0 - (-t / tau).exp());
                t.iter().map(|&t| (model(50.0, 50.0, t) - model(x[0].exp(), x[1].exp(), t)) / 0.01).collect()
            },
            lower: vec![-5.0; 2],
            upper: vec![7.0; 2],
            reach: f64::INFINITY,
        };
        let found = profile(&problem, &[50f64.ln(), 50f64.ln()], 1, 1.0);
        assert!(found.ends[1].is_none(), "{:?}", found.points);
        let low = found.ends[0].unwrap().exp();
        assert!(low > 2.0 && low < 50.0, "{low}");
    }

    #[test]
    fn disagreement_is_said() {
        let of = |interval_95, linear_95| Profile { interval_95, linear_95, points: vec![], fell_by: 0.0, best: 1.0 };
        assert!(!of((0.8, 1.25), (0.78, 1.22)).disagrees());
        assert!(of((0.8, 1.6), (0.78, 1.22)).disagrees());
        assert!(of((0.8, f64::INFINITY), (0.78, 1.22)).disagrees());
        assert!(!of((0.8, f64::INFINITY), (0.8, f64::INFINITY)).disagrees());
        assert!(!of((0.8, 1.6), (f64::NAN, f64::NAN)).disagrees());
    }
}
