//! A model predicts recordings that it was not fitted to.
//!
//! Shared parameters (wave speed, creep, gas …) come from the model as they are. A run's own values come from its
//! signals: the head before the valve from the steady sensors, the friction from the model's own runs; velocity (within
//! the flow meter's uncertainty), start and duration of the closure and the sensors' zeros from the samples up to the
//! first return of the wave, 2L/a after the closure starts. Everything after that is prediction.

use nalgebra::DMatrix;

use crate::fit::data::run_data::RunData;
use crate::fit::inference::errors::{Errors, Linearised};
use crate::fit::numeric::least_squares::{Limits, Problem, jacobian, minimise};
use crate::fit::numeric::quantiles::Z_95;
use crate::fit::outcome::band::{curve_sd_m, half_width_m};
use crate::fit::outcome::fit::{Fit, SensorFit};
use crate::fit::outcome::uncertainty::Uncertainty;
use crate::fit::problem::compare::rmse;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::parameters::placed_sensor;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrate::refine;
use crate::fit::search::options::Options;
use crate::fit::search::thresholds::{FINAL, FINAL_REACHES};
use crate::fit::validate::thresholds::CLOSURE_MARGIN;
use crate::model::Model;
use crate::model::constraint::Constraint;
use crate::model::effects::Chosen;
use crate::product::gram;
use crate::rig::Rig;

/// A shared parameter as a model knows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Shared {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard error; none where it is not known.
    pub standard_error: Option<f64>,
}

/// What is known of a model that predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// Its effects.
    pub effects: Vec<Chosen>,
    /// Its shared parameters.
    pub shared: Vec<Shared>,
    /// Correlations of their errors, in their order; empty where they are not known.
    pub correlation: Vec<Vec<f64>>,
    /// Friction of its runs over that of the rig, geometric mean.
    pub friction_scale: f64,
}

/// A prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// The model at the runs; shared parameters are held.
    pub fit: Fit,
    /// Time after the start of the closure up to which samples were used for the runs' own values, s.
    pub known_until_s: f64,
}

impl Known {
    /// What is known from a fit.
    pub fn of(fit: &Fit) -> Self {
        let shared: Vec<usize> = (0..fit.parameters.len()).filter(|&j| fit.parameters[j].run.is_none()).collect();
        let of = |j: &usize| {
            let p = &fit.parameters[*j];
            let standard_error = Some(p.standard_error()).filter(|e| e.is_finite() && !p.held && !p.at_bound);
            Shared { name: p.name.clone(), value: p.value, standard_error }
        };
        let row = |i: &usize| shared.iter().map(|j| fit.correlation[*i][*j]).collect();
        let whole = fit.correlation.len() == fit.parameters.len();
        let scales = fit.parameters.iter().filter(|p| p.name == "friction_scale").map(|p| p.value);
        Known {
            effects: fit.effects.clone(),
            shared: shared.iter().map(of).collect(),
            correlation: if whole { shared.iter().map(row).collect() } else { Vec::new() },
            friction_scale: geometric_mean(scales),
        }
    }
}

/// The geometric mean; 1 where there are no values.
pub fn geometric_mean(values: impl Iterator<Item = f64>) -> f64 {
    let logs: Vec<f64> = values.map(f64::ln).collect();
    if logs.is_empty() { 1.0 } else { (logs.iter().sum::<f64>() / logs.len() as f64).exp() }
}

impl Prediction {
    /// Error over the samples after those that were used, m; NaN where there are none.
    pub fn ahead_m(&self, sensor: &SensorFit) -> f64 {
        let from = sensor.time_s.partition_point(|&t| t <= self.known_until_s);
        if from == sensor.time_s.len() { f64::NAN } else { rmse(&sensor.measured_m[from..], &sensor.model_m[from..]) }
    }

    /// Error over the same samples of a model that lacks nothing, m: from noise and from the errors of its values.
    pub fn expected_m(&self, sensor: &SensorFit) -> f64 {
        let ahead = sensor.time_s.iter().zip(&sensor.band_m).filter(|(t, _)| **t > self.known_until_s);
        let (square, n) = ahead.fold((0.0, 0.0), |(square, n), (_, half)| (square + (half / Z_95).powi(2), n + 1.0));
        if n > 0.0 { (square / n).sqrt() } else { sensor.noise_m }
    }
}

/// Predicts `runs` on `rig`; `held` gives values of the runs' own parameters that are better known than from the
/// signals.
///
/// # Errors
/// As [`refine`]; a held value that the model does not have, or that is outside its bounds.
pub fn predict(
    rig: &Rig,
    runs: &[RunData],
    known: &Known,
    held: &[Constraint],
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<Prediction, FitError> {
    let water = &runs.first().ok_or(FitError::NoRun)?.conditions.water;
    let settled = |name: &str, run: Option<&str>, value: f64| Constraint {
        name: name.to_owned(),
        run: run.map(str::to_owned),
        lower: value,
        upper: value,
    };
    // a recording need not have every sensor whose place the model knows
    let here = |name: &str| match placed_sensor(name) {
        Some(placed) => runs.iter().flat_map(|run| &run.sensors).any(|s| s.sensor.name == placed),
        None => true,
    };
    let model = Model::new(rig, water, &known.effects);
    // What an effect has got since the model was saved is where it starts: so it was when it was no parameter.
    let values: Vec<f64> = (model.shared.iter())
        .map(|p| known.shared.iter().find(|known| known.name == p.name).map_or(p.start, |known| known.value))
        .collect();
    let own = model.shared.iter().zip(&values).map(|(p, &value)| settled(&p.name, None, value));
    let is_own = |name: &str| model.shared.iter().any(|p| p.name == name);
    let others = known.shared.iter().filter(|p| !is_own(&p.name) && here(&p.name));
    let mut constraints: Vec<Constraint> = own.chain(others.map(|p| settled(&p.name, None, p.value))).collect();
    constraints.extend(held.iter().cloned());
    for run in runs {
        let mut settle = |name: &str, value: f64| {
            if !held.iter().any(|c| c.concerns(name, Some(&run.file))) {
                constraints.push(settled(name, Some(&run.file), value));
            }
        };
        settle("friction_scale", known.friction_scale);
        if run.start.valve_head_m.1.is_none() {
            settle("valve_head_m", run.start.valve_head_m.0);
        }
    }
    let model = model.constrained(&constraints);
    let period_s = model.period_s(&values);
    let closing_s = held.iter().filter(|c| c.name == "closing_time_s").map(|c| c.upper);
    let closing_s = closing_s.fold(rig.valve.closing_time_s, f64::max);
    let known_until_s = (0.5 * period_s).max(CLOSURE_MARGIN * closing_s);
    let reaches = (2 * FINAL_REACHES).max(model.least_reaches(&values));
    let problem = FitProblem::new(&model, runs, Window { reaches, horizon_s: known_until_s, stride: 1 });
    problem.validate_constraints(&constraints)?;
    // tuned; data unknown
    let own = minimise(&problem, &problem.start(), Limits { cost_tolerance: 1e-5, ..FINAL }, |iteration, cost| {
        let error_over_noise = (2.0 * cost / problem.samples().max(1) as f64).sqrt();
        progress(&Progress::fitting("the runs' own values", reaches, iteration, error_over_noise));
    })?;
    let columns = jacobian(&problem, &own.x, &own.residuals)?;
    let still: Vec<bool> = problem.parameters.iter().map(|p| p.lower == p.upper).collect();
    // The window is too short to show the autocorrelation of its noise; the samples before it show it.
    let (records, before) = (problem.rows.record_rows(), problem.rows.noise_before());
    let linearised = Linearised {
        columns: &columns,
        residuals: &own.residuals,
        records: &records,
        common: &problem.rows.gain_errors().into_values().collect::<Vec<_>>(),
        at_bound: &still,
        in_time: None,
    };
    let errors = Errors::among(&linearised.moments(before.as_deref()), &still);
    let values = problem.values(&own.x);
    let shared = of_shared(&problem, known, &values);
    let follow = followed(&columns, &errors.believed, &still);
    let with_shared = |own: &DMatrix<f64>| own + &follow * &shared * follow.transpose();
    let (covariance, by_noise) = (with_shared(&errors.covariance), with_shared(&errors.by_noise));
    // All values are known now; only the grid remains to be refined.
    let all: Vec<Constraint> = (problem.parameters.iter().enumerate())
        .map(|(j, p)| settled(&p.name, problem.run_of(j).map(|r| runs[r].file.as_str()), values[j]))
        .collect();
    let options = Options { constraints: all, priors: Vec::new(), starts_at: Vec::new(), ..options.clone() };
    let mut fit = refine(rig, runs, &known.effects, &values, &options, progress)?;
    let whole = FitProblem::new(&model, runs, Window { reaches: fit.reaches, horizon_s: f64::INFINITY, stride: 1 });
    let x = whole.variables(&values);
    let columns = jacobian(&whole, &x, &whole.residuals(&x)?)?;
    let bands = curve_sd_m(&whole, &columns, &by_noise);
    for (r, run) in fit.runs.iter_mut().enumerate() {
        for (s, sensor) in run.sensors.iter_mut().enumerate() {
            let from = runs[r].sensors[s].time_s.len() - sensor.time_s.len();
            sensor.band_m = half_width_m(&whole, r, s, &bands[r][s], from);
        }
    }
    for (j, parameter) in fit.parameters.iter_mut().enumerate() {
        if !still[j] {
            parameter.held = false;
            parameter.at_bound = own.at_bound[j];
        }
        let sd = covariance[(j, j)].sqrt();
        parameter.uncertainty = Uncertainty::of(sd * problem.stretch(j, values[j]));
        parameter.interval_95 = (problem.value(j, own.x[j] - Z_95 * sd), problem.value(j, own.x[j] + Z_95 * sd));
    }
    fit.converged = own.stop.converged();
    own.stop.describe().clone_into(&mut fit.stopped_because);
    Ok(Prediction { fit, known_until_s })
}

/// How the variables follow a change of each, to first order: held ones take only their own, free ones adjust to it
/// (Jazwinski 1970, Stochastic Processes and Filtering Theory, sec. 8.4; "consider" parameters).
fn followed(columns: &[Vec<f64>], inverse: &DMatrix<f64>, held: &[bool]) -> DMatrix<f64> {
    let n = columns.len();
    let free: Vec<usize> = (0..n).filter(|&j| !held[j] && inverse[(j, j)].is_finite()).collect();
    let products = gram(columns);
    DMatrix::from_fn(n, n, |i, j| match (held[j], free.contains(&i)) {
        (true, true) => -free.iter().map(|&k| inverse[(i, k)] * products[(k, j)]).sum::<f64>(),
        (true, false) if i == j => 1.0,
        _ => 0.0,
    })
}

/// The covariance of the model's shared parameters, as one of all variables.
fn of_shared(problem: &FitProblem, known: &Known, values: &[f64]) -> DMatrix<f64> {
    let mut covariance = DMatrix::zeros(values.len(), values.len());
    let place = |name: &str| {
        (0..problem.parameters.len()).find(|&j| problem.run_of(j).is_none() && problem.parameters[j].name == name)
    };
    let spread = |p: &Shared| Some((place(&p.name)?, p.standard_error?));
    for (a, (i, sd_i)) in known.shared.iter().enumerate().filter_map(|(a, p)| Some((a, spread(p)?))) {
        for (b, (j, sd_j)) in known.shared.iter().enumerate().filter_map(|(b, p)| Some((b, spread(p)?))) {
            let together =
                if a == b { 1.0 } else { known.correlation.get(a).and_then(|r| r.get(b)).copied().unwrap_or(0.0) };
            let together = if together.is_finite() { together } else { 0.0 };
            covariance[(i, j)] =
                together * sd_i * sd_j / (problem.stretch(i, values[i]) * problem.stretch(j, values[j]));
        }
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::numeric::uncertainty::covariance;
    use crate::fit::problem::test_record::{copper, record};
    use crate::model::RunValues;
    use crate::model::effects::parse_list;

    /// A model that was saved when its effect had a parameter fewer predicts, with that parameter as it starts.
    #[test]
    fn a_parameter_that_came_later_is_where_it_starts() {
        let rig = copper();
        let run =
            RunValues { initial_velocity_m_s: 0.3, valve_head_m: 40.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let effects = parse_list("entrained-gas").unwrap();
        let runs = [record(&rig, &effects, &[1250.0, 1e-5, 2e-5], run, 0.05, 1.0)];
        let value = |(name, value): (&str, f64)| Shared { name: name.to_owned(), value, standard_error: None };
        let shared = [("gas_fraction", 1e-5), ("wave_speed_m_s", 1250.0)].map(value).to_vec();
        let known = Known { effects, shared, correlation: Vec::new(), friction_scale: 1.0 };
        let prediction = predict(&rig, &runs, &known, &[], &Options::default(), &|_| {}).unwrap();
        let lag = prediction.fit.parameter("gas_lag_s").unwrap();
        assert!(lag.held && (lag.value / 2e-5 - 1.0).abs() < 1e-9, "{}", lag.value);
        assert!(prediction.fit.over_noise() < 1.2, "{}", prediction.fit.over_noise());
    }

    /// y = v + a t + o with a held at a value that is known to 0.1, over samples about t = 2: v makes up for what a is
    /// off by, twice as much; an offset that is held and known to 0.3 is taken by v whole. At t = 2 nothing of either
    /// is left, at t = 5 three times what a is off by.
    #[test]
    fn what_is_free_makes_up_for_what_is_held() {
        let t: Vec<f64> = (0..101).map(|i| 1.0 + f64::from(i) / 50.0).collect();
        let columns = vec![vec![-1.0; 101], t.iter().map(|t| -t).collect::<Vec<f64>>(), vec![-1.0; 101]];
        let held = [false, true, true];
        let follow = followed(&columns, &covariance(&columns, &held), &held);
        assert!((follow[(0, 1)] + 2.0).abs() < 1e-9 && (follow[(0, 2)] + 1.0).abs() < 1e-9, "{follow}");
        let known = DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&[0.0, 0.01, 0.09]));
        let all = &follow * known * follow.transpose();
        let curve = |t: f64| {
            let slope = nalgebra::DVector::from_row_slice(&[1.0, t, 1.0]);
            slope.dot(&(&all * &slope)).max(0.0).sqrt()
        };
        assert!(curve(2.0) < 1e-6 && (curve(5.0) - 0.3).abs() < 1e-6, "{} {}", curve(2.0), curve(5.0));
    }
}
