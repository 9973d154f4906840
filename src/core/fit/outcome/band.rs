//! The band in which a fitted model expects the samples: posterior predictive, `J C Jᵀ` of the parameters plus the
//! noise.
//!
//! Linear in the parameters around the fit (Seber & Wild 2003, *Nonlinear Regression*, sec. 5.1). Combinations that the
//! samples leave open do not move the curve there, so they are left out rather than counted as infinite. The covariance
//! is [`Errors::by_noise`](crate::fit::inference::errors::Errors::by_noise), by the noise before the closure where the
//! record shows any: what a model fails to explain must not widen the band but show outside it. Nor do errors of gains
//! widen it: a sensor reads its prediction with its own gain.

use nalgebra::DMatrix;

use crate::fit::numeric::quantiles::Z_95;
use crate::fit::problem::fit_problem::FitProblem;

/// Standard deviation of the curve from the uncertainty of the variables, m: for each run and sensor, at each of its
/// samples that enter. `columns` is the Jacobian of the residuals in time.
pub fn curve_sd_m(problem: &FitProblem, columns: &[Vec<f64>], covariance: &DMatrix<f64>) -> Vec<Vec<Vec<f64>>> {
    let mut row = 0;
    let mut runs = Vec::new();
    for (r, run) in problem.runs.iter().enumerate() {
        // Variables of other runs do not move this one.
        let own: Vec<usize> =
            (0..columns.len()).filter(|&j| problem.run_of(j).is_none_or(|other| other == r)).collect();
        let mut sensors = Vec::new();
        for (s, sensor) in run.sensors.iter().enumerate() {
            let rows = row..row + problem.rows.entering(r, s).1;
            row = rows.end;
            let mut variance = vec![0.0; rows.len()];
            for &i in &own {
                for &j in own.iter().filter(|&&j| j <= i && covariance[(i, j)] != 0.0) {
                    let twice = if i == j { 1.0 } else { 2.0 };
                    let weight = twice * covariance[(i, j)] * sensor.noise_m.powi(2);
                    let pairs = columns[i][rows.clone()].iter().zip(&columns[j][rows.clone()]);
                    variance.iter_mut().zip(pairs).for_each(|(v, (a, b))| *v += weight * a * b);
                }
            }
            sensors.push(variance.into_iter().map(|v| v.max(0.0).sqrt()).collect());
        }
        runs.push(sensors);
    }
    runs
}

/// Half the width of the band around the curve of a run's sensor, m, from its sample `from` on; `sd_m` is that of
/// [`curve_sd_m`].
pub fn half_width_m(problem: &FitProblem, r: usize, s: usize, sd_m: &[f64], from: usize) -> Vec<f64> {
    let sensor = &problem.runs[r].sensors[s];
    let (first, count) = problem.rows.entering(r, s);
    let last = count.saturating_sub(1);
    let at = |i: usize| sd_m.get(i.saturating_sub(first).min(last)).copied().unwrap_or(0.0);
    (from..sensor.time_s.len()).map(|i| Z_95 * at(i).hypot(sensor.total_noise_m)).collect()
}
