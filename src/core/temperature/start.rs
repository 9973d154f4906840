//! Where a joint fit starts: the laws' values by generalised least squares over the runs' own values with their
//! covariances.

use nalgebra::{DMatrix, DVector};

use crate::fit::numeric::least_squares::{Problem, minimise};
use crate::fit::outcome::fit::Fit;
use crate::model::parameter::Parameter;
use crate::rig::WaterProperties;
use crate::temperature::law::{LawModel, is_log};
use crate::temperature::member::Member;
use crate::temperature::thresholds::{KEPT_CORRELATION, LEAST_ERROR, START_LIMITS};

/// A variable of a law or of the model.
pub(crate) fn to_variable(parameter: &Parameter, value: f64) -> f64 {
    if is_log(parameter) { value.ln() } else { value }
}

/// The value of a variable.
pub(crate) fn to_value(parameter: &Parameter, variable: f64) -> f64 {
    if is_log(parameter) { variable.exp() } else { variable }
}

/// The shared parameters of one run's own fit.
struct Own {
    run: usize,
    degc: f64,
    water: WaterProperties,
    /// Which of them it determines.
    determined: Vec<usize>,
    variables: DVector<f64>,
    /// Makes their errors independent and of size one.
    whiten: DMatrix<f64>,
}

struct Summary<'a> {
    law: &'a LawModel<'a>,
    shared: &'a [Parameter],
    runs: Vec<Own>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Own {
    fn of(run: usize, member: &Member, fit: &Fit, shared: &[Parameter]) -> Own {
        let error = |j: usize| {
            let p = &fit.parameters[j];
            p.standard_error() / if is_log(&shared[j]) { p.value } else { 1.0 }
        };
        let open = |j: usize| fit.parameters[j].at_bound || fit.parameters[j].held || !error(j).is_finite();
        let determined: Vec<usize> = (0..shared.len()).filter(|&j| !open(j)).collect();
        let n = determined.len();
        let covariance = DMatrix::from_fn(n, n, |a, b| {
            let (i, j) = (determined[a], determined[b]);
            let alike = if a == b { 1.0 } else { KEPT_CORRELATION * fit.correlation[i][j] };
            let both = error(i).max(LEAST_ERROR) * error(j).max(LEAST_ERROR);
            if alike.is_finite() { alike * both } else { 0.0 }
        });
        let diagonal = || DMatrix::from_diagonal(&covariance.diagonal().map(|v| v.powf(-0.5)));
        let whiten = covariance.clone().cholesky().and_then(|c| c.l().try_inverse()).unwrap_or_else(diagonal);
        let own = determined.iter().map(|&j| to_variable(&shared[j], fit.parameters[j].value));
        let variables = DVector::from_iterator(n, own);
        Own { run, degc: member.temperature_degc, water: member.data.conditions.water, determined, variables, whiten }
    }
}

impl Problem for Summary<'_> {
    type Error = std::convert::Infallible;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, Self::Error> {
        let values: Vec<f64> = self.law.parameters.iter().zip(x).map(|(p, &v)| to_value(p, v)).collect();
        let mut out = Vec::new();
        for own in &self.runs {
            let (by_law, _) = self.law.shared(&values, own.degc, &own.water, Some(own.run));
            let by_law = own.determined.iter().map(|&j| to_variable(&self.shared[j], by_law[j]));
            let left = &own.variables - DVector::from_iterator(own.determined.len(), by_law);
            out.extend((&own.whiten * left).iter());
        }
        Ok(out)
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    fn difference_step(&self, j: usize) -> f64 {
        step_of(&self.law.parameters[j])
    }
}

/// Step of a finite difference of a law's variable.
pub(crate) fn step_of(parameter: &Parameter) -> f64 {
    if is_log(parameter) { 1e-5 } else { 1e-6 * (parameter.upper - parameter.lower) }
}

/// Bounds of the laws' variables.
pub(crate) fn bounds_of(parameters: &[Parameter]) -> (Vec<f64>, Vec<f64>) {
    parameters.iter().map(|p| (to_variable(p, p.lower), to_variable(p, p.upper))).unzip()
}

/// The laws' variables.
pub(crate) fn from_apart(law: &LawModel, shared: &[Parameter], members: &[Member], fits: &[Fit]) -> Vec<f64> {
    let runs = members.iter().zip(fits).enumerate().map(|(r, (member, fit))| Own::of(r, member, fit, shared)).collect();
    let (lower, upper) = bounds_of(&law.parameters);
    let start: Vec<f64> = law.parameters.iter().map(|p| to_variable(p, p.start)).collect();
    let problem = Summary { law, shared, runs, lower, upper };
    match minimise(&problem, &start, START_LIMITS, |_, _| {}) {
        Ok(solution) => solution.x,
        Err(never) => match never {},
    }
}
