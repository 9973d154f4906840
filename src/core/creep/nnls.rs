//! Non-negative least squares: Lawson & Hanson (1974), Solving Least Squares Problems, ch. 23, algorithm NNLS.
//!
//! Each trial set of columns is solved by QR of the columns themselves, not by normal equations: exponentials of
//! neighbouring retardation times are nearly parallel.

use crate::creep::thresholds::NNLS_TOLERANCE;
use nalgebra::{DMatrix, DVector};

/// The `x ≥ 0` that minimises `|a x - b|`; what is not needed is exactly 0. `a` has as many rows as `b`.
pub fn nnls(a: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let n = a.ncols();
    let norms: Vec<f64> = a.column_iter().map(|c| c.norm()).collect();
    let mut unit = a.clone();
    for (mut column, &norm) in unit.column_iter_mut().zip(&norms) {
        if norm > 0.0 {
            column /= norm;
        }
    }
    let mut x = DVector::zeros(n);
    let mut passive: Vec<usize> = Vec::new();
    // Columns whose gain was only rounding; they may be tried again once another column has entered.
    let mut refused: Vec<usize> = Vec::new();
    for _ in 0..10 * n.max(1) {
        let gradient = unit.tr_mul(&(b - &unit * &x));
        let candidates = (0..n).filter(|j| !passive.contains(j) && !refused.contains(j) && norms[*j] > 0.0);
        let best = candidates.max_by(|&i, &j| gradient[i].total_cmp(&gradient[j]));
        let Some(entering) = best.filter(|&j| gradient[j] > NNLS_TOLERANCE * b.norm()) else { break };
        passive.push(entering);
        let mut solution = least_squares(&unit, b, &passive);
        if solution.as_ref().is_none_or(|s| s[passive.len() - 1] <= 0.0) {
            passive.pop();
            refused.push(entering);
            continue;
        }
        refused.clear();
        while let Some(trial) = &solution {
            if trial.iter().all(|&v| v > 0.0) {
                for (&j, &v) in passive.iter().zip(trial) {
                    x[j] = v;
                }
                break;
            }
            // As far towards the trial as nothing falls below zero; what reaches it leaves.
            let ratio = |(&j, &v): (&usize, &f64)| if v > 0.0 { f64::INFINITY } else { x[j] / (x[j] - v) };
            let ratios: Vec<f64> = passive.iter().zip(trial).map(ratio).collect();
            let step = ratios.iter().copied().fold(1.0, f64::min);
            for (&j, &v) in passive.iter().zip(trial) {
                x[j] += step * (v - x[j]);
            }
            let leaving: Vec<usize> =
                passive.iter().zip(&ratios).filter(|(_, r)| **r <= step).map(|(j, _)| *j).collect();
            for &j in &leaving {
                x[j] = 0.0;
            }
            passive.retain(|j| !leaving.contains(j));
            solution = least_squares(&unit, b, &passive);
        }
    }
    for (value, norm) in x.iter_mut().zip(norms) {
        *value = if norm > 0.0 { value.max(0.0) / norm } else { 0.0 };
    }
    x
}

/// Least squares in some columns; none where they are not independent.
fn least_squares(a: &DMatrix<f64>, b: &DVector<f64>, columns: &[usize]) -> Option<Vec<f64>> {
    if columns.len() > a.nrows() {
        return None;
    }
    let qr = a.select_columns(columns).qr();
    let mut right = b.clone();
    qr.q_tr_mul(&mut right);
    let solved = qr.unpack_r().solve_upper_triangular(&right.rows(0, columns.len()).clone_owned())?;
    solved.iter().all(|v| v.is_finite()).then(|| solved.iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_would_be_negative_is_left_out() {
        // Unconstrained (2, -1); with x₂ = 0 the mean of what column 1 sees: (1·1 + 1·1 + 0·(-1))/2.
        let a = DMatrix::from_row_slice(3, 2, &[1.0, 1.0, 1.0, 1.0, 0.0, 1.0]);
        let x = nnls(&a, &DVector::from_row_slice(&[1.0, 1.0, -1.0]));
        assert!((x[0] - 1.0).abs() < 1e-14 && x[1] == 0.0, "{x}");
        let all_negative = nnls(&a, &DVector::from_row_slice(&[-1.0, -1.0, -1.0]));
        assert_eq!(all_negative, DVector::zeros(2));
    }

    #[test]
    fn odd_problems_do_no_harm() {
        let twice = DMatrix::from_row_slice(2, 3, &[1.0, 1.0, 0.0, 2.0, 2.0, 0.0]);
        let x = nnls(&twice, &DVector::from_row_slice(&[1.0, 2.0]));
        assert!((x[0] + x[1] - 1.0).abs() < 1e-12 && x[2] == 0.0, "{x}");
        assert_eq!(nnls(&DMatrix::zeros(3, 0), &DVector::zeros(3)).len(), 0);
        assert_eq!(nnls(&DMatrix::zeros(3, 2), &DVector::from_element(3, 1.0)), DVector::zeros(2));
    }

    proptest! {
        /// Karush, Kuhn and Tucker: nothing negative; no gain from a column that is used, none from raising one that is
        /// not.
        #[test]
        fn the_optimum_satisfies_its_conditions(cells in prop::collection::vec(-1.0f64..1.0, 60), right in prop::collection::vec(-1.0f64..1.0, 10)) {
            let a = DMatrix::from_row_slice(10, 6, &cells);
            let b = DVector::from_vec(right);
            let x = nnls(&a, &b);
            let gradient = a.tr_mul(&(&b - &a * &x));
            for (value, slope) in x.iter().zip(gradient.iter()) {
                prop_assert!(*value >= 0.0);
                prop_assert!(if *value > 0.0 { slope.abs() < 1e-8 } else { *slope < 1e-8 }, "{} {}", value, slope);
            }
        }
    }
}
