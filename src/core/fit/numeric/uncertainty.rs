//! Linear algebra of a Jacobian for white noise: covariance, correlation, Gauss-Newton steps; and the inflation by
//! autocorrelation.

use nalgebra::{DMatrix, DVector};

use crate::fit::numeric::thresholds::{UNDETERMINED_EIGENVALUE, UNDETERMINED_PART};
use crate::product::{dot, gram};

/// Factor by which correlation between neighbours reduces the effective number of residuals: `(1 + ρ)/(1 - ρ)` for the
/// lag-one autocorrelation `ρ` of a first-order process, not below 1.
pub fn correlation_inflation(residuals: &[f64]) -> f64 {
    let n = residuals.len();
    if n < 3 {
        return 1.0;
    }
    let mean = residuals.iter().sum::<f64>() / n as f64;
    let variance: f64 = residuals.iter().map(|r| (r - mean).powi(2)).sum();
    if variance == 0.0 {
        return 1.0;
    }
    let lagged: f64 = residuals.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum();
    let rho = (lagged / variance).clamp(0.0, 0.9999);
    (1.0 + rho) / (1.0 - rho)
}

/// `JᵀJ` of the variables that are not at a bound, each column scaled to length one so that units do not matter.
pub(crate) struct Normal {
    /// Which variables these are.
    pub free: Vec<usize>,
    /// Norm of each one's column; 1 where the column is zero.
    pub scale: Vec<f64>,
    pub matrix: DMatrix<f64>,
}

impl Normal {
    pub fn of(columns: &[Vec<f64>], at_bound: &[bool]) -> Self {
        Self::among(&gram(columns), at_bound)
    }

    /// Of the `products` of all columns.
    pub fn among(products: &DMatrix<f64>, at_bound: &[bool]) -> Self {
        let free: Vec<usize> = (0..products.nrows()).filter(|&j| !at_bound[j]).collect();
        let norm = |&j: &usize| Some(products[(j, j)].sqrt()).filter(|n| *n > 0.0).unwrap_or(1.0);
        let scale: Vec<f64> = free.iter().map(norm).collect();
        let matrix =
            DMatrix::from_fn(free.len(), free.len(), |a, b| products[(free[a], free[b])] / scale[a] / scale[b]);
        Normal { free, scale, matrix }
    }
}

/// Inverse of a scaled normal matrix over the combinations of variables that it determines (Moore and Penrose's), and
/// which variables it leaves open. All of them where it is not finite.
pub(crate) fn determined_inverse(matrix: DMatrix<f64>) -> (DMatrix<f64>, Vec<bool>) {
    let p = matrix.nrows();
    let (mut inverse, mut open) = (DMatrix::zeros(p, p), vec![false; p]);
    // The decomposition does not end on values that are not numbers.
    if matrix.iter().any(|v| !v.is_finite()) {
        return (inverse, vec![true; p]);
    }
    if p == 0 {
        return (inverse, open);
    }
    let eigen = matrix.symmetric_eigen();
    let least = UNDETERMINED_EIGENVALUE * eigen.eigenvalues.max();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > least {
            inverse += vector * vector.transpose() / *value;
        } else {
            vector.iter().zip(&mut open).for_each(|(v, o)| *o |= v.abs() > UNDETERMINED_PART);
        }
    }
    (inverse, open)
}

/// Correlations between the errors of the variables, one row and one column a variable: `C_ij / √(C_ii C_jj)`,
/// `C = (JᵀJ)⁻¹`.
///
/// NaN where a variable is at a bound, and everywhere where the data leave a combination of the variables open.
pub fn correlation(columns: &[Vec<f64>], at_bound: &[bool]) -> Vec<Vec<f64>> {
    let Normal { free, matrix, .. } = Normal::of(columns, at_bound);
    let mut correlation = vec![vec![f64::NAN; columns.len()]; columns.len()];
    let Some(c) = matrix.try_inverse() else { return correlation };
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate() {
            let both = 0.5 * (c[(a, b)] + c[(b, a)]) / (c[(a, a)].sqrt() * c[(b, b)].sqrt());
            correlation[i][j] = if a == b && both.is_finite() { 1.0 } else { both.clamp(-1.0, 1.0) };
        }
    }
    correlation
}

/// `(JᵀJ)⁻¹` of all variables; zero in the rows and columns of those at a bound, infinite on the diagonal where the
/// data leave a combination of them open.
pub fn covariance(columns: &[Vec<f64>], at_bound: &[bool]) -> DMatrix<f64> {
    let Normal { free, scale, matrix } = Normal::of(columns, at_bound);
    let mut all = DMatrix::zeros(columns.len(), columns.len());
    let inverse = matrix.try_inverse();
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate() {
            let open = if a == b { f64::INFINITY } else { 0.0 };
            all[(i, j)] = inverse.as_ref().map_or(open, |c| c[(a, b)] / (scale[a] * scale[b]));
        }
    }
    all
}

/// The step that compensates a change of the residuals, `-(JᵀJ)⁻¹ Jᵀ change`, in the variables that are not at a bound;
/// zero in those that are, and in all where the data determine none.
pub fn gauss_newton_step(columns: &[Vec<f64>], change: &[f64], at_bound: &[bool]) -> Vec<f64> {
    let Normal { free, scale, matrix } = Normal::of(columns, at_bound);
    let right =
        DVector::from_iterator(free.len(), free.iter().zip(&scale).map(|(&j, s)| -dot(&columns[j], change) / s));
    let mut steps = vec![0.0; columns.len()];
    if let Some(solved) = matrix.cholesky().map(|c| c.solve(&right)) {
        for (a, &j) in free.iter().enumerate() {
            steps[j] = solved[a] / scale[a];
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_covariance_leaves_out_what_is_at_a_bound() {
        let found = covariance(&[vec![2.0, 0.0], vec![0.0, 4.0], vec![1.0, 1.0]], &[false, false, true]);
        let expected = DMatrix::from_diagonal(&DVector::from_row_slice(&[0.25, 0.0625, 0.0]));
        assert!((found - expected).norm() < 1e-15);
        assert!(covariance(&[vec![1.0, 1.0], vec![1.0, 1.0]], &[false, false])[(0, 0)] > 1e12);
    }

    #[test]
    fn correlated_residuals_widen_it() {
        let mut state = 1u64;
        let mut white = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as f64 / (1u64 << 31) as f64 - 0.5
        };
        let (mut r, mut series) = (0.0, Vec::new());
        for _ in 0..20_000 {
            r = 0.8 * r + white();
            series.push(r);
        }
        assert!((correlation_inflation(&series) / 9.0 - 1.0).abs() < 0.15, "{}", correlation_inflation(&series));
    }

    #[test]
    fn a_change_that_is_a_column_is_taken_up_whole() {
        let columns = vec![vec![1.0, 0.0, 1.0], vec![0.0, 2.0, 1.0], vec![1.0, 1.0, 0.0]];
        let change: Vec<f64> = (0..3).map(|i| 0.5 * columns[0][i] - 0.25 * columns[1][i]).collect();
        let step = gauss_newton_step(&columns, &change, &[false, false, true]);
        assert!((step[0] + 0.5).abs() < 1e-12 && (step[1] - 0.25).abs() < 1e-12 && step[2] == 0.0, "{step:?}");
    }

    /// Of two columns at an angle `φ` the errors of the two variables correlate by `-cos φ`.
    #[test]
    fn columns_at_an_angle_correlate_by_its_cosine() {
        let phi = 0.3f64;
        let columns = vec![vec![2.0, 0.0, 0.0], vec![3.0 * phi.cos(), 3.0 * phi.sin(), 0.0], vec![1.0, 1.0, 9.0]];
        let found = correlation(&columns, &[false, false, true]);
        assert!((found[0][1] + phi.cos()).abs() < 1e-12 && found[0][1] == found[1][0], "{found:?}");
        assert!(found[0][0] == 1.0 && found[1][1] == 1.0);
        assert!(found[2].iter().all(|r| r.is_nan()) && found[0][2].is_nan(), "at its bound: {found:?}");
        let alike = correlation(&[vec![1.0, 1.0], vec![1.0, 1.0]], &[false, false]);
        assert!(alike.iter().flatten().all(|r| r.is_nan() || r.abs() <= 1.0));
    }
}
