//! The walk along one variable of a profile: where all others are at their optimum, and where it ends.
//!
//! A point counts where the descent of all other variables has reached an optimum ([`predicted_at`]):
//! elsewhere the sum of squares shows neither that the threshold is passed nor that it is not. Such a point is tried
//! again from other starts, then replaced by a nearer one.

use rayon::prelude::*;

use crate::fit::inference::thresholds::OPTIMUM_REDUCTION;
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, Way, jacobian, minimise, predicted_at};
use crate::fit::numeric::quantiles::Z_95;
use crate::fit::validate::thresholds::MAX_PROFILE_POINTS;
use crate::fit::validate::thresholds::{
    NARROW_BRACKET, PROFILE_COST_TOLERANCE, THRESHOLD_WITHIN, THRESHOLD_WITHIN_AT_LAST, UNRESOLVED_SHARE,
};

/// Where a side of a profile ends, in the variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum End {
    /// At the threshold, or between it and the last place before.
    At(f64),
    /// The bound comes before the threshold.
    Open,
    /// No optimum was found beyond this.
    Unknown(f64),
}

/// The profile along variable `j`, in variables.
pub(crate) struct Walk {
    /// Ends of the interval.
    pub ends: [End; 2],
    /// Variable and rise, ascending, of the points that are optima.
    pub points: Vec<(f64, f64)>,
    /// Points that are no optima.
    pub unresolved: usize,
    /// By how much the sum of squares fell below that of the centre at any point.
    pub fell_by: f64,
    pub evaluations: usize,
}

/// One side of a profile.
#[derive(Default)]
struct Side {
    points: Vec<(f64, f64)>,
    unresolved: usize,
    fell_by: f64,
    evaluations: usize,
}

/// Where a walk starts.
pub(crate) struct Start<'a> {
    pub best: &'a Solution,
    pub j: usize,
    /// Rise of the sum of squares that counts as one.
    pub unit: f64,
    /// First step, in the variable.
    pub first: f64,
    /// How the other variables follow, to first order.
    pub follow: &'a [f64],
}

/// The end of a descent with the variable held.
struct HeldDescent {
    x: Vec<f64>,
    /// Root of the rise: standard errors from the best; infinite where nothing could be simulated.
    root: f64,
    rise: f64,
    resolved: bool,
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
    fn way(&self, j: usize) -> Way {
        self.inner.way(j)
    }
    fn difference_step(&self, j: usize) -> f64 {
        self.inner.difference_step(j)
    }
}

/// Both sides of a variable.
pub(crate) fn walk<P: Problem>(problem: &P, start: &Start) -> Walk {
    let ((low, down), (high, up)) = rayon::join(|| side(problem, start, -1.0), || side(problem, start, 1.0));
    let mut points = [low.points, vec![(start.best.x[start.j], 0.0)], high.points].concat();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    Walk {
        ends: [down, up],
        points,
        unresolved: low.unresolved + high.unresolved,
        fell_by: low.fell_by.max(high.fell_by),
        evaluations: low.evaluations + high.evaluations,
    }
}

/// One side, and its end.
fn side<P: Problem>(problem: &P, start: &Start, sign: f64) -> (Side, End) {
    let Start { best, j, first, follow, .. } = *start;
    let (lower, upper) = problem.bounds();
    let room = if sign < 0.0 { best.x[j] - lower[j] } else { upper[j] - best.x[j] };
    let mut side = Side::default();
    // The last place inside, the first outside, and the first unresolved one: their distances, and how many standard
    // errors.
    let (mut near, mut far, mut unknown) = ((0.0, 0.0, best.x.clone()), None::<(f64, f64)>, None::<f64>);
    let mut away = first.min(room);
    if room <= 0.0 {
        return (side, End::Open);
    }
    for _ in 0..MAX_PROFILE_POINTS {
        let at = best.x[j] + sign * away;
        let moved =
            |from: &[f64], by: f64| from.iter().zip(follow).map(|(x, f)| x + f * sign * by).collect::<Vec<f64>>();
        // Along the valley as linearised at the best fit, and straight on in case that leads astray; then from the
        // centre.
        let mut found = descend(problem, start, at, &[moved(&near.2, away - near.0), near.2.clone()], &mut side);
        if !found.resolved {
            let again = [found.x.clone(), moved(&best.x, away), best.x.clone()];
            let other = descend(problem, start, at, &again, &mut side);
            if other.rise <= found.rise {
                found = other;
            }
        }
        if found.rise.is_finite() {
            side.fell_by = side.fell_by.max(-found.rise);
        }
        if found.resolved {
            side.points.push((at, found.rise));
            if (found.root - Z_95).abs() < THRESHOLD_WITHIN {
                return (side, End::At(at));
            }
            if found.root < Z_95 {
                if away >= room {
                    return (side, End::Open);
                }
                near = (away, found.root, found.x);
            } else {
                far = Some((away, found.root));
            }
        } else {
            side.unresolved += 1;
            unknown = Some(away);
        }
        let wall = unknown.filter(|w| *w > near.0 && far.is_none_or(|f| *w < f.0));
        away = match (wall, far) {
            (Some(wall), _) => 0.5 * (near.0 + wall),
            (None, None) => (near.0 * (Z_95 / near.1).clamp(1.3, 4.0)).min(room),
            (None, Some((d, z))) => {
                let share = (Z_95 - near.1) / (z - near.1);
                near.0 + (d - near.0) * if z.is_finite() { share.clamp(0.1, 0.9) } else { 0.5 }
            }
        };
    }
    // The place nearest to the threshold among those tried, where it is near.
    let end = match far {
        Some((d, z)) if z - Z_95 < THRESHOLD_WITHIN_AT_LAST || d - near.0 < NARROW_BRACKET * d => {
            End::At(best.x[j] + sign * d)
        }
        _ if near.0 > 0.0 && Z_95 - near.1 < THRESHOLD_WITHIN_AT_LAST => End::At(best.x[j] + sign * near.0),
        _ => End::Unknown(best.x[j] + sign * near.0),
    };
    (side, end)
}

/// The best of the descents `from` some places with the variable held `at` one. What cannot be simulated does not fit.
fn descend<P: Problem>(problem: &P, start: &Start, at: f64, from: &[Vec<f64>], side: &mut Side) -> HeldDescent {
    let Start { best, j, unit, .. } = *start;
    let (lower, upper) = problem.bounds();
    let mut held = Held { inner: problem, lower: lower.to_vec(), upper: upper.to_vec() };
    (held.lower[j], held.upper[j]) = (at, at);
    let limits = Limits {
        iterations: 40,
        // Relative to the cost at the interval's end, so that it means the same in a fit that leaves no error.
        cost_tolerance: PROFILE_COST_TOLERANCE * unit / (best.cost + 0.5 * Z_95 * Z_95 * unit),
        step_tolerance: 1e-10,
        thorough: true,
    };
    let tried: Vec<Solution> = from.par_iter().filter_map(|x| minimise(&held, x, limits, |_, _| {}).ok()).collect();
    side.evaluations += tried.iter().map(|s| s.evaluations).sum::<usize>();
    let Some(found) = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) else {
        return HeldDescent { x: best.x.clone(), root: f64::INFINITY, rise: f64::INFINITY, resolved: true };
    };
    let rise = 2.0 * (found.cost - best.cost) / unit;
    let enough = OPTIMUM_REDUCTION.max(UNRESOLVED_SHARE * rise);
    let at_optimum = |columns: &[Vec<f64>]| predicted_at(&held, columns, &found.residuals, &found.x) / unit <= enough;
    let resolved = at_optimum(&found.columns) || {
        // The columns of the last step may be out of date.
        side.evaluations += found.x.len();
        jacobian(&held, &found.x, &found.residuals).is_ok_and(|columns| at_optimum(&columns))
    };
    HeldDescent { x: found.x, root: rise.max(0.0).sqrt(), rise, resolved }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::numeric::test_problem::Test;

    fn at(end: End) -> f64 {
        match end {
            End::At(x) => x,
            other => panic!("{other:?}"),
        }
    }

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
            way: Way::Even,
        };
        // Variance of the slope: 1/Σ(t - 1)² = 1/7.7 with unit noise; four times that is worth two standard errors.
        let error = (1.0f64 / 7.7).sqrt();
        for unit in [1.0, 4.0] {
            let found = profile(&problem, &[0.0, 0.0], 1, unit);
            let [low, high] = found.ends.map(at);
            let half = 0.5 * (high - low);
            assert!((half / (Z_95 * error * unit.sqrt()) - 1.0).abs() < THRESHOLD_WITHIN, "{half}");
        }
    }

    /// Counts of a rate: 2 (μ - n - n ln(μ/n)) = 3.8415 at n = 10 has the ends 5.011 and 17.539 (solved by scipy's
    /// brentq), far from symmetric.
    #[test]
    fn of_a_poisson_rate_it_is_the_likelihood_interval() {
        let n = 10.0f64;
        let problem = Test {
            f: |x: &[f64]| {
                vec![(x[0] - n - n * (x[0] / n).ln()).max(0.0).mul_add(2.0, 0.0).sqrt() * (x[0] - n).signum()]
            },
            lower: vec![0.5],
            upper: vec![100.0],
            way: Way::Even,
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
            stop: crate::fit::numeric::least_squares::Stop::Stationary,
        };
        let found = walk(&problem, &Start { best: &best, j: 0, unit: 1.0, first: 6.0, follow: &[1.0] });
        let [low, high] = found.ends.map(at);
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
            way: Way::Even,
        };
        let found = profile(&problem, &[50f64.ln(), 50f64.ln()], 1, 1.0);
        assert!(found.ends[1] == End::Open, "{:?}", found.points);
        let low = at(found.ends[0]).exp();
        assert!(low > 2.0 && low < 50.0, "{low}");
    }

    /// Beyond x₀ = 1 the other variable's residual is 10⁴ and a staircase, so that every difference predicts a way down
    /// that no step finds. Such points are no optima, and the end is not before them.
    #[test]
    fn a_descent_that_fails_is_no_end() {
        let problem = Test {
            f: |x: &[f64]| vec![0.3 * x[0], if x[0] > 1.0 { 1e4 - 1e-3 * (1e6 * x[1]).rem_euclid(1.0) } else { x[1] }],
            lower: vec![-20.0, -1e6],
            upper: vec![20.0, 1e6],
            way: Way::Even,
        };
        let found = profile(&problem, &[0.0, 0.0], 0, 1.0);
        assert!((at(found.ends[0]) + Z_95 / 0.3).abs() < 0.1, "{:?}", found.points);
        assert!(matches!(found.ends[1], End::Unknown(x) if (0.5..=1.0).contains(&x)), "{:?}", found.ends);
        assert!(found.unresolved > 0 && found.points.iter().all(|p| p.1 < 100.0), "{:?}", found.points);
    }

    /// What cannot be simulated beyond a place does not fit: the interval ends there.
    #[test]
    fn where_nothing_can_be_simulated_is_an_end() {
        struct Edge;
        impl Problem for Edge {
            type Error = String;
            fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, String> {
                if x[0] < 2.0 { Ok(vec![0.1 * x[0], x[1]]) } else { Err("beyond".into()) }
            }
            fn bounds(&self) -> (&[f64], &[f64]) {
                (&[-50.0, -1.0], &[50.0, 1.0])
            }
            fn difference_step(&self, _j: usize) -> f64 {
                1e-7
            }
        }
        let limits = Limits { iterations: 50, cost_tolerance: 1e-14, step_tolerance: 1e-12, thorough: false };
        let best = minimise(&Edge, &[0.5, 0.5], limits, |_, _| {}).unwrap();
        let found = walk(&Edge, &Start { best: &best, j: 0, unit: 1.0, first: 6.0, follow: &[1.0, 0.0] });
        assert!((2.0..2.2).contains(&at(found.ends[1])), "{:?}", found.ends);
    }
}
