//! The undamped step of a linearised problem within bounds, and the reduction of the sum of squares that it predicts.
//!
//! The prediction is the square of Newton's decrement (Boyd & Vandenberghe 2004, Convex Optimization, sec. 9.5.1) of
//! the linearised problem. In units of what one independent sample leaves it is the square of the distance to the
//! optimum in standard errors.

use nalgebra::{DMatrix, DVector};

use crate::fit::numeric::thresholds::ACTIVE_SETS_PER_VARIABLE;
use crate::fit::numeric::uncertainty::determined_inverse;
use crate::product::{along, gram, plus};

/// Reduction of the sum of squares that a step of the linearised problem brings, never negative.
pub(crate) fn reduction_of(columns: &[Vec<f64>], residuals: &[f64], step: &DVector<f64>) -> f64 {
    let left = plus(residuals, columns, step.as_slice());
    // `|r|² - |r + Jd|²`, term by term: the sums may differ by little
    residuals.iter().zip(left).map(|(r, l)| (r - l) * (r + l)).sum::<f64>().max(0.0)
}

/// The step from `x` that takes most off the sum of squares of the linearised problem within its `bounds`.
pub(crate) fn bounded_step(
    columns: &[Vec<f64>],
    residuals: &[f64],
    x: &[f64],
    bounds: (&[f64], &[f64]),
) -> DVector<f64> {
    let room: (Vec<f64>, Vec<f64>) = (0..x.len()).map(|j| (bounds.0[j] - x[j], bounds.1[j] - x[j])).unzip();
    step_within(&gram(columns), &along(columns, residuals), (&room.0, &room.1))
}

/// The same of `JᵀJ` and `Jᵀr`, where steps from `low` to `high` are within the bounds.
///
/// Least squares in a box by active sets (Stark & Parker 1995, Comput. Stat. 10, 129): each step lowers the sum, and a
/// variable that a bound has stopped is released where that lowers it further.
pub(crate) fn step_within(
    normal: &DMatrix<f64>,
    gradient: &DVector<f64>,
    (low, high): (&[f64], &[f64]),
) -> DVector<f64> {
    let n = low.len();
    let mut step = DVector::zeros(n);
    let outward = |j: usize, slope: f64, at: f64| (at >= high[j] && slope < 0.0) || (at <= low[j] && slope > 0.0);
    let movable = |j: usize| low[j] < high[j] && normal[(j, j)] > 0.0;
    let mut free: Vec<usize> = (0..n).filter(|&j| movable(j) && !outward(j, gradient[j], 0.0)).collect();
    for _ in 0..ACTIVE_SETS_PER_VARIABLE * n {
        let slope = gradient + normal * &step;
        let moved = undamped(normal, &slope, &free);
        // As far as the first bound.
        let room = |a: usize| {
            let (j, by) = (free[a], moved[a]);
            let to = if by < 0.0 { low[j] } else { high[j] };
            if by == 0.0 { f64::INFINITY } else { (to - step[j]) / by }
        };
        let stop = (0..free.len()).min_by(|&a, &b| room(a).total_cmp(&room(b))).filter(|&a| room(a) < 1.0);
        let share = stop.map_or(1.0, |a| room(a).max(0.0));
        free.iter().zip(moved.iter()).for_each(|(&j, by)| step[j] += share * by);
        if let Some(a) = stop {
            let j = free.remove(a);
            step[j] = if moved[a] < 0.0 { low[j] } else { high[j] };
            continue;
        }
        let slope = gradient + normal * &step;
        let pull = |j: &usize| slope[*j].abs() / normal[(*j, *j)].sqrt();
        let held = (0..n).filter(|&j| movable(j) && !free.contains(&j) && !outward(j, slope[j], step[j]));
        match held.filter(|j| pull(j) > 0.0).max_by(|a, b| pull(a).total_cmp(&pull(b))) {
            None => break,
            Some(j) => free.push(j),
        }
    }
    step
}

/// The step of the `free` variables down the `slope`, over what the normal matrix determines.
fn undamped(normal: &DMatrix<f64>, slope: &DVector<f64>, free: &[usize]) -> DVector<f64> {
    let scale: Vec<f64> = free.iter().map(|&j| normal[(j, j)].sqrt()).collect();
    let matrix = DMatrix::from_fn(free.len(), free.len(), |a, b| normal[(free[a], free[b])] / (scale[a] * scale[b]));
    let right = DVector::from_iterator(free.len(), free.iter().zip(&scale).map(|(&j, s)| -slope[j] / s));
    let (inverse, _) = determined_inverse(matrix);
    let mut step = inverse * right;
    step.iter_mut().zip(&scale).for_each(|(step, s)| *step /= s);
    step
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::dot;

    fn predicted_reduction(columns: &[Vec<f64>], residuals: &[f64], x: &[f64], bounds: (&[f64], &[f64])) -> f64 {
        reduction_of(columns, residuals, &bounded_step(columns, residuals, x, bounds))
    }

    /// A line through noisy points: from any place, the prediction is what solving it gains.
    #[test]
    fn of_a_linear_problem_the_promise_is_kept() {
        let t: Vec<f64> = (0..40).map(|i| f64::from(i) / 20.0).collect();
        let columns = vec![vec![-1.0; 40], t.iter().map(|t| -t).collect::<Vec<f64>>()];
        let left = |x: &[f64]| -> Vec<f64> {
            t.iter().map(|t| 1.0 + 2.0 * t + 0.1 * (40.0 * t).sin() - x[0] - x[1] * t).collect()
        };
        let wide = (&[-10.0, -10.0][..], &[10.0, 10.0][..]);
        let square = |x: &[f64]| left(x).iter().map(|r| r * r).sum::<f64>();
        // Where the textbook puts the line.
        let mean =
            |of: &dyn Fn(f64, f64) -> f64| t.iter().zip(left(&[0.0, 0.0])).map(|(t, y)| of(*t, y)).sum::<f64>() / 40.0;
        let (mt, my) = (mean(&|t, _| t), mean(&|_, y| y));
        let slope = (mean(&|t, y| t * y) - mt * my) / (mean(&|t, _| t * t) - mt * mt);
        let best = [my - slope * mt, slope];
        for x in [[0.0, 0.0], [3.0, -1.0]] {
            let predicted = predicted_reduction(&columns, &left(&x), &x, wide);
            assert!((predicted - (square(&x) - square(&best))).abs() < 1e-9, "{predicted}");
        }
        assert!(predicted_reduction(&columns, &left(&best), &best, wide).abs() < 1e-12);
        // With the slope kept to 1 at the most, the intercept alone follows.
        let x = [0.0, 0.5];
        let predicted = predicted_reduction(&columns, &left(&x), &x, (&[-10.0, 0.0], &[10.0, 1.0]));
        let held = [my - mt, 1.0];
        assert!((predicted - (square(&x) - square(&held))).abs() < 1e-9, "{predicted}");
        // At that bound, nothing is left; a held variable and one that nothing shows predict nothing.
        assert!(predicted_reduction(&columns, &left(&held), &held, (&[-10.0, 0.0], &[10.0, 1.0])).abs() < 1e-12);
        assert_eq!(predicted_reduction(&columns, &left(&x), &x, (&x, &x)), 0.0);
        assert_eq!(predicted_reduction(&[vec![0.0; 40]], &left(&x), &[0.0], (&[-1.0], &[1.0])), 0.0);
    }

    /// Against all ways to put variables at their bounds, for columns that are nearly alike.
    #[test]
    fn in_a_box_the_promise_is_the_most_that_any_set_of_bounds_allows() {
        let mut random = fastrand::Rng::with_seed(4);
        for _ in 0..200 {
            let mut draw = || 2.0 * random.f64() - 1.0;
            let base: Vec<f64> = (0..12).map(|_| draw()).collect();
            let columns: Vec<Vec<f64>> = (0..4).map(|_| base.iter().map(|b| b + 0.2 * draw()).collect()).collect();
            let residuals: Vec<f64> = (0..12).map(|_| draw()).collect();
            let upper: Vec<f64> = (0..4).map(|_| draw().abs()).collect();
            let lower: Vec<f64> = (0..4).map(|_| -draw().abs()).collect();
            let fall = |d: &[f64]| -> f64 {
                let left = (0..12).map(|i| residuals[i] + (0..4).map(|j| columns[j][i] * d[j]).sum::<f64>());
                residuals.iter().map(|r| r * r).sum::<f64>() - left.map(|r| r * r).sum::<f64>()
            };
            let mut most = 0.0f64;
            for set in 0..3usize.pow(4) {
                let state: Vec<usize> = (0..4u32).map(|j| set / 3usize.pow(j) % 3).collect();
                let free: Vec<usize> = (0..4).filter(|&j| state[j] == 2).collect();
                let mut d: Vec<f64> = (0..4).map(|j| [lower[j], upper[j], 0.0][state[j]]).collect();
                let normal = DMatrix::from_fn(free.len(), free.len(), |a, b| dot(&columns[free[a]], &columns[free[b]]));
                let there: Vec<f64> =
                    (0..12).map(|i| residuals[i] + (0..4).map(|j| columns[j][i] * d[j]).sum::<f64>()).collect();
                let right = DVector::from_iterator(free.len(), free.iter().map(|&j| -dot(&columns[j], &there)));
                let solved = if free.is_empty() { Some(right) } else { normal.lu().solve(&right) };
                let Some(solved) = solved else { continue };
                free.iter().zip(solved.iter()).for_each(|(&j, v)| d[j] = *v);
                if (0..4).all(|j| (lower[j] - 1e-12..=upper[j] + 1e-12).contains(&d[j])) {
                    most = most.max(fall(&d));
                }
            }
            let predicted = predicted_reduction(&columns, &residuals, &[0.0; 4], (&lower, &upper));
            assert!((predicted - most).abs() < 1e-9 * (1.0 + most), "{predicted} for {most}");
        }
    }
}
