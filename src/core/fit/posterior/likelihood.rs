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

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, RowDVector};

use crate::fit::inference::errors::{Errors, Linearised};
use crate::fit::numeric::least_squares::{Problem, jacobian};
use crate::fit::numeric::thresholds::{UNDETERMINED_EIGENVALUE, UNDETERMINED_PART};
use crate::fit::numeric::uncertainty::Normal;
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::ModelError;
use crate::product::dot;

/// See the module.
pub(crate) struct Likelihood<'a> {
    problem: &'a FitProblem<'a>,
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
    /// Steps of the free variables that the residuals do not show.
    open: Vec<DVector<f64>>,
    /// Which free variables such a step moves.
    is_open: Vec<bool>,
}

impl<'a> Likelihood<'a> {
    /// Of a `problem` at the variables `centre`; `coarser` are the residuals there on a grid of half the reaches. None
    /// where the noise or the slopes are not finite, or nothing may move.
    pub(crate) fn of(problem: &'a FitProblem<'a>, centre: &[f64], coarser: &[f64]) -> Result<Option<Self>, ModelError> {
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
        let (mut basis, mut back, mut ahead, mut open) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut is_open = vec![false; free.len()];
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let step = DVector::from_fn(free.len(), |a, _| vector[a] / scale[a]);
            if *value <= least {
                open.push(step);
                vector.iter().zip(&mut is_open).for_each(|(v, open)| *open |= v.abs() > UNDETERMINED_PART);
                continue;
            }
            ahead.push(RowDVector::from_fn(free.len(), |_, a| vector[a] * scale[a] * value.sqrt()));
            let step = step / value.sqrt();
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
            elsewhere: None,
            common: &common,
            at_bound: &vec![false; basis.len()],
            in_time: None,
        };
        let counts = problem.rows.noise_before().and_then(|before| {
            let decayed = linearised.decayed(&before);
            decayed.contains(&true).then(|| linearised.noise_that_counts(&before, &decayed))
        });
        let errors = Errors::of(Linearised { elsewhere: counts.as_deref(), ..linearised });
        let inflation = errors.taken / basis.len() as f64;
        // As for errors, half of what the last halving of the grid's step changed.
        let change: Vec<f64> = residuals.iter().zip(coarser).map(|(f, c)| 0.5 * (f - c)).collect();
        let by_grid: Vec<f64> = basis.iter().map(|q| dot(q, &change)).collect();
        let Some(factor) = errors.and(&by_grid).covariance.cholesky() else { return Ok(None) };
        let z = projected(&basis, &residuals);
        let mut likelihood = Likelihood {
            problem,
            free,
            centre: centre.to_vec(),
            at_centre: 0.0,
            basis,
            z,
            factor,
            inflation,
            back: DMatrix::from_columns(&back),
            ahead: DMatrix::from_rows(&ahead),
            open,
            is_open,
        };
        likelihood.at_centre = likelihood.log_of(&residuals, &likelihood.z);
        Ok(Some(likelihood).filter(|l| l.at_centre.is_finite()))
    }

    /// Logarithm of the likelihood of free variables; minus infinity out of bounds, and where nothing can be simulated.
    pub(crate) fn log(&self, free: &[f64]) -> f64 {
        self.seen(free).map_or(f64::NEG_INFINITY, |(log, _)| log)
    }

    /// The same, with `z`; none where it is zero.
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
        let rest = (dot(residuals, residuals) - z.norm_squared()).max(0.0);
        -0.5 * (z.dot(&self.factor.solve(z)) + rest / self.inflation)
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

    /// Steps of the free variables, a column each: what a vector of independent standard normal numbers is multiplied
    /// by to become a draw of the linearised likelihood about the fit, and `share` of the range along what the data
    /// leave open.
    pub(crate) fn spread(&self, share: f64) -> DMatrix<f64> {
        let bounds = self.bounds();
        let scaled = |open: &DVector<f64>| {
            let room = |(a, (lower, upper)): (usize, &(f64, f64))| (upper - lower) / open[a].abs();
            open * (share * bounds.iter().enumerate().map(room).fold(f64::INFINITY, f64::min))
        };
        let determined = &self.back * self.factor.l();
        let columns = determined.column_iter().map(|c| c.into_owned()).chain(self.open.iter().map(scaled));
        DMatrix::from_columns(&columns.collect::<Vec<_>>())
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

fn projected(basis: &[Vec<f64>], residuals: &[f64]) -> DVector<f64> {
    DVector::from_iterator(basis.len(), basis.iter().map(|q| dot(q, residuals)))
}
