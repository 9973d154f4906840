//! The likelihood of a fit's values, wherever they are: the fit's own residuals, with the errors that the fit knows of.
//!
//! Errors and intervals of a fit come from `C = A M A`: its residuals' slopes, and the covariance of the noise, of
//! gauges and of the grid over what these slopes show ([`crate::fit::inference::errors`]). The likelihood keeps that
//! and lets go of the straight line. With `Q` an orthonormal basis of the slopes at the fit, the residuals `r` of any
//! values fall into `z = Qᵀr` and a rest that no slope shows. The first has the covariance `B` of all known errors over
//! that basis; the rest has that of noise alone, `κ` times as large as believed on average:
//!
//! `-2 log L = zᵀB⁻¹z + (rᵀr - zᵀz)/κ`.
//!
//! Where the residuals are linear, `L` is the normal density of covariance `C` about the fit; where the noise is white,
//! as large as believed, and nothing else disturbs, `-2 log L = rᵀr`. Priors are rows of the residuals, hum has been
//! integrated out of them, and a bound is where `L` ends.

use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, RowDVector};

use crate::fit::inference::errors::{Errors, Linearised};
use crate::fit::numeric::least_squares::{Problem, jacobian};
use crate::fit::numeric::randomised::{Density, Shown};
use crate::fit::numeric::thresholds::{UNDETERMINED_EIGENVALUE, UNDETERMINED_PART};
use crate::fit::numeric::uncertainty::Normal;
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::ModelError;
use crate::product::dot;

/// See the module.
pub(crate) struct Likelihood<'a> {
    problem: &'a FitProblem<'a>,
    /// The same on a grid of half the reaches, for slopes elsewhere than at the fit.
    coarser: &'a FitProblem<'a>,
    /// The variables that may move.
    pub(crate) free: Vec<usize>,
    /// All variables at the fit.
    pub(crate) centre: Vec<f64>,
    /// Logarithm of the likelihood there.
    pub(crate) at_centre: f64,
    /// `Q`, a vector over all residuals each.
    basis: Vec<Vec<f64>>,
    /// `z` at the fit.
    z: DVector<f64>,
    /// Of `B`.
    factor: Cholesky<f64, Dyn>,
    /// `κ`.
    inflation: f64,
    /// Step of the free variables for a unit of each vector of the basis, a column each.
    back: DMatrix<f64>,
    /// Its inverse over what the residuals show: how far a step of the free variables goes along each vector of the
    /// basis.
    ahead: DMatrix<f64>,
    /// Which free variables a step moves that the residuals do not show.
    is_open: Vec<bool>,
    /// How many were taken so far.
    pub(crate) simulations: AtomicUsize,
}

impl<'a> Likelihood<'a> {
    /// Of a `problem` at the variables `centre`; `coarser` is the same on a grid of half the reaches. None
    /// where the noise or the slopes are not finite, or nothing may move.
    pub(crate) fn of(
        problem: &'a FitProblem<'a>,
        coarser: &'a FitProblem<'a>,
        centre: &[f64],
    ) -> Result<Option<Self>, ModelError> {
        let on_coarser = coarser.residuals(centre)?;
        let residuals = problem.residuals(centre)?;
        let columns = jacobian(problem, centre, &residuals)?;
        let (lower, upper) = problem.bounds();
        let held: Vec<bool> = lower.iter().zip(upper).map(|(l, u)| l >= u).collect();
        let Normal { free, scale, matrix } = Normal::of(&columns, &held);
        if free.is_empty() || matrix.iter().any(|v| !v.is_finite()) {
            return Ok(None);
        }
        let eigen = matrix.symmetric_eigen();
        let least = UNDETERMINED_EIGENVALUE * eigen.eigenvalues.max();
        let (mut basis, mut back, mut ahead) = (Vec::new(), Vec::new(), Vec::new());
        let mut is_open = vec![false; free.len()];
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value <= least {
                vector.iter().zip(&mut is_open).for_each(|(v, open)| *open |= v.abs() > UNDETERMINED_PART);
                continue;
            }
            ahead.push(RowDVector::from_fn(free.len(), |_, a| vector[a] * scale[a] * value.sqrt()));
            let step = DVector::from_fn(free.len(), |a, _| vector[a] / (scale[a] * value.sqrt()));
            let mut along = vec![0.0; residuals.len()];
            for (&j, by) in free.iter().zip(step.iter()) {
                along.iter_mut().zip(&columns[j]).for_each(|(q, c)| *q += by * c);
            }
            basis.push(along);
            back.push(step);
        }
        let records = problem.rows.record_rows();
        let common: Vec<_> = problem.rows.gain_errors().into_values().collect();
        let linearised = Linearised {
            columns: &basis,
            residuals: &residuals,
            records: &records,
            common: &common,
            at_bound: &vec![false; basis.len()],
            in_time: None,
        };
        let counts = problem.rows.noise_before().and_then(|before| {
            let decayed = linearised.decayed(&before);
            decayed.contains(&true).then(|| linearised.noise_that_counts(&before, &decayed))
        });
        let errors = Errors::among(&linearised.moments(counts.as_deref()), linearised.at_bound);
        let inflation = errors.taken / basis.len() as f64;
        // As for errors, half of what the last halving of the grid's step changed.
        let change: Vec<f64> = residuals.iter().zip(&on_coarser).map(|(f, c)| 0.5 * (f - c)).collect();
        let by_grid: Vec<f64> = basis.iter().map(|q| dot(q, &change)).collect();
        let Some(factor) = errors.and(&by_grid).covariance.cholesky() else { return Ok(None) };
        let z = projected(&basis, &residuals);
        let mut likelihood = Likelihood {
            problem,
            coarser,
            free,
            centre: centre.to_vec(),
            at_centre: 0.0,
            basis,
            z,
            factor,
            inflation,
            back: DMatrix::from_columns(&back),
            ahead: DMatrix::from_rows(&ahead),
            is_open,
            simulations: AtomicUsize::new(0),
        };
        likelihood.at_centre = likelihood.log_of(&residuals, &likelihood.z);
        Ok(Some(likelihood).filter(|l| l.at_centre.is_finite()))
    }

    /// Logarithm of the likelihood of free variables, and `z`; none out of bounds, and where nothing can be simulated.
    fn seen(&self, free: &[f64]) -> Option<(f64, DVector<f64>)> {
        let (lower, upper) = self.problem.bounds();
        let mut inside = self.free.iter().zip(free).map(|(&j, x)| (lower[j]..=upper[j]).contains(x));
        if !inside.all(|inside| inside) {
            return None;
        }
        let residuals = self.problem.all_residuals(&self.all(free), false).ok()?;
        let z = projected(&self.basis, &residuals);
        Some((self.log_of(&residuals, &z), z))
    }

    fn log_of(&self, residuals: &[f64], z: &DVector<f64>) -> f64 {
        -0.5 * z.dot(&self.factor.solve(z)) - self.rest(residuals, z)
    }

    /// What the residuals that no slope shows take from the logarithm.
    fn rest(&self, residuals: &[f64], z: &DVector<f64>) -> f64 {
        0.5 * (dot(residuals, residuals) - z.norm_squared()).max(0.0) / self.inflation
    }

    fn whitened(&self, z: DVector<f64>) -> Option<DVector<f64>> {
        self.factor.l_dirty().solve_lower_triangular(&z)
    }

    /// All variables where the free ones are these.
    pub(crate) fn all(&self, free: &[f64]) -> Vec<f64> {
        let mut all = self.centre.clone();
        self.free.iter().zip(free).for_each(|(&j, x)| all[j] = *x);
        all
    }

    /// The free variables at the fit.
    pub(crate) fn centre(&self) -> Vec<f64> {
        self.free.iter().map(|&j| self.centre[j]).collect()
    }

    /// Bounds of the free variables.
    pub(crate) fn bounds(&self) -> Vec<(f64, f64)> {
        let (lower, upper) = self.problem.bounds();
        self.free.iter().map(|&j| (lower[j], upper[j])).collect()
    }

    /// The displacement of all free variables that the linearised likelihood expects where variable `a` of them stands
    /// `by` standard errors off; none where the data leave it open.
    pub(crate) fn along(&self, a: usize, by: f64) -> Option<Vec<f64>> {
        let spread = &self.back * self.factor.l();
        let row = spread.row(a).transpose();
        let sd = row.norm();
        (!self.is_open[a] && sd > 0.0).then(|| (spread * row * (by / sd)).as_slice().to_vec())
    }

    /// Where the residuals show what the linearised ones would at a displacement: one correction by the slopes at the
    /// fit. With the rise of `-2 log L` there; none where that lies out of bounds or cannot be simulated.
    pub(crate) fn corrected(&self, displacement: &[f64]) -> Option<(Vec<f64>, f64)> {
        let start: Vec<f64> = self.centre().iter().zip(displacement).map(|(x, d)| x + d).collect();
        let (_, z) = self.seen(&start)?;
        let expected = &self.z + &self.ahead * DVector::from_column_slice(displacement);
        let by = &self.back * (z - expected);
        let there: Vec<f64> = start.iter().zip(by.iter()).map(|(x, b)| x - b).collect();
        let (log, _) = self.seen(&there)?;
        Some((there, 2.0 * (self.at_centre - log)))
    }
}

/// The data are `z`, whitened by `B`.
impl Density for Likelihood<'_> {
    fn shown(&self, x: &[f64]) -> Option<Shown> {
        self.simulations.fetch_add(1, Ordering::Relaxed);
        let residuals = self.problem.residuals(&self.all(x)).ok()?;
        let z = projected(&self.basis, &residuals);
        let rest = self.rest(&residuals, &z);
        Some(Shown { data: self.whitened(z)?, rest })
    }

    /// On the coarser grid, a quarter of the work: what it changes in their determinant is about the same everywhere.
    fn slopes(&self, x: &[f64]) -> Option<DMatrix<f64>> {
        self.simulations.fetch_add(1 + self.free.len(), Ordering::Relaxed);
        let (x, problem) = (self.all(x), self.coarser);
        let columns = jacobian(problem, &x, &problem.residuals(&x).ok()?).ok()?;
        let of = |&j: &usize| self.whitened(projected(&self.basis, &columns[j]));
        Some(DMatrix::from_columns(&self.free.iter().map(of).collect::<Option<Vec<_>>>()?))
    }
}

fn projected(basis: &[Vec<f64>], residuals: &[f64]) -> DVector<f64> {
    DVector::from_iterator(basis.len(), basis.iter().map(|q| dot(q, residuals)))
}
