//! From the end of a search to its result: errors, intervals, bands, and each run under the fitted model.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::atomic::Ordering;

use crate::fit::inference::errors::{Errors, InTime, Linearised, Moments};
use crate::fit::inference::identify::unidentifiable;
use crate::fit::inference::interval::linear;
use crate::fit::numeric::least_squares::{Problem, Solution, jacobian};
use crate::fit::numeric::uncertainty::{correlation, gauss_newton_step};
use crate::fit::outcome::band::{curve_sd_m, half_width_m};
use crate::fit::outcome::fit::{Fit, FittedParameter, RunFit, SensorFit};
use crate::fit::outcome::uncertainty::Uncertainty;
use crate::fit::outcome::unidentifiable::Unidentifiable;
use crate::fit::problem::compare::{Pair, mape_percent, rmse};
use crate::fit::problem::elements::fixed_variables;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Modelled, Window};
use crate::fit::problem::hum::without_hum;
use crate::fit::problem::method::Method;
use crate::fit::problem::objective::Objective;
use crate::fit::problem::rows::CommonError;
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::descent::{predict_reduction_by, slopes};
use crate::model::{Model, ModelError};
use crate::signal::trace::mean;

/// A fit of frequencies, seen from the samples.
struct Sampled<'a> {
    /// The same fit with every sample compared.
    problem: FitProblem<'a>,
    /// Its Jacobian's columns.
    columns: Vec<Vec<f64>>,
    /// The columns over frequencies, seen from the samples.
    seen: Vec<Vec<f64>>,
    /// Residuals of the samples, and where each record's are.
    residuals: Vec<f64>,
    records: Vec<Vec<Range<usize>>>,
}

impl Sampled<'_> {
    fn in_time(&self) -> InTime<'_> {
        InTime { columns: &self.seen, residuals: &self.residuals, records: &self.records }
    }
}

pub(crate) fn assemble(ctx: &Calibrator, problem: &FitProblem, solution: &Solution) -> Result<Fit, FitError> {
    if problem.samples() == 0 {
        // A constraint holds the start of the closure behind the last of them.
        return Err(FitError::NoSample { file: ctx.runs.first().map_or(String::new(), |run| run.file.clone()) });
    }
    let values = problem.values(&solution.x);
    let start_values = problem.start_values();
    let columns = slopes(ctx, problem, solution)?;
    let prediction = predict_reduction_by(ctx, problem, solution, Cow::Borrowed(&columns))?;
    let converged = prediction.at_optimum(problem, solution);
    let fixed = fixed_variables(problem, &values, &solution.at_bound);
    let (shifts, halving_m) = last_halving(ctx, problem, solution, &columns, &fixed)?;
    let known = if converged { Some(known(ctx, problem, solution, &columns, &fixed, &shifts)?) } else { None };
    let model = problem.model;
    // A held parameter keeps the bounds that it will have when it is released.
    let unheld = Model::new(ctx.rig, ctx.water, &model.effects);
    let usual = FitProblem::new(&unheld, ctx.runs, problem.window()).parameters;
    let of_value = |j: usize| match &known {
        _ if problem.parameters[j].lower >= problem.parameters[j].upper => (Uncertainty::Held, (values[j], values[j])),
        Some(known) => known.of_values[j],
        None => (Uncertainty::NotAtOptimum, (f64::NAN, f64::NAN)),
    };
    let parameters = problem
        .parameters
        .iter()
        .enumerate()
        .map(|(j, p)| FittedParameter {
            name: p.name.clone(),
            about: p.about,
            run: problem.run_of(j).map(|r| ctx.runs[r].file.clone()),
            value: values[j],
            uncertainty: of_value(j).0,
            interval_95: of_value(j).1,
            profile: None,
            posterior: None,
            doubt: None,
            rig_error: ctx.rig.tolerance_of(&p.name).map(|share| share * values[j].abs()),
            unit: p.unit,
            at_bound: solution.at_bound[j] && p.lower < p.upper,
            lower: if p.lower < p.upper { p.lower } else { usual[j].lower.min(p.lower) },
            upper: if p.lower < p.upper { p.upper } else { usual[j].upper.max(p.upper) },
            held: p.lower == p.upper,
            prior: model.priors.iter().find(|known| known.name == p.name).map(|known| (known.mean, known.sd)),
            scale: p.scale,
            belief: p.prior,
        })
        .collect();
    let period_s = model.period_s(&values[..model.shared.len()]);
    let runs = (0..ctx.runs.len())
        .map(|r| {
            let band = known.as_ref().map(|known| &known.curve_sd_m[r][..]);
            let run = run_fit(ctx, problem, r, &values, &start_values, period_s, band)?;
            Ok(RunFit { noise_dies_away: known.as_ref().is_some_and(|known| known.decayed_runs.contains(&r)), ..run })
        })
        .collect::<Result<_, ModelError>>()?;
    let stopped_because = match (converged, solution.stop.describe()) {
        (true, why) => why.to_owned(),
        (false, _) => not_at_optimum(
            prediction.reduction / problem.samples() as f64,
            prediction.independent(problem, solution),
            ctx.options.method,
        ),
    };
    let (correlation, unidentifiable) = known.map_or_else(Default::default, |k| (k.correlation, k.unidentifiable));
    Ok(Fit {
        method: ctx.options.method,
        effects: model.effects.clone(),
        runs,
        parameters,
        correlation,
        unidentifiable,
        reaches: problem.window().reaches,
        grid_error_m: 0.25 * halving_m,
        evaluations: ctx.evaluations.load(Ordering::Relaxed),
        seconds: ctx.began.elapsed().as_secs_f64(),
        steps: Vec::new(),
        features_left: Vec::new(),
        stopped_because,
        converged,
        cost: solution.cost,
        predicted_reduction: prediction.reduction,
        posterior: None,
    })
}

/// What is known only at an optimum.
struct Known {
    /// Errors and intervals of the values.
    of_values: Vec<(Uncertainty, (f64, f64))>,
    correlation: Vec<Vec<f64>>,
    unidentifiable: Vec<Unidentifiable>,
    /// See [`curve_sd_m`].
    curve_sd_m: Vec<Vec<Vec<f64>>>,
    /// Runs whose noise dies away.
    decayed_runs: BTreeSet<usize>,
}

/// What an optimum tells; `shifts` are the changes that the last halving of the step made in the variables.
fn known(
    ctx: &Calibrator,
    problem: &FitProblem,
    solution: &Solution,
    columns: &[Vec<f64>],
    fixed: &[bool],
    shifts: &[f64],
) -> Result<Known, ModelError> {
    let values = problem.values(&solution.x);
    // A second-order scheme has a third of it still to come; half of it allows for kinks, which are of first order.
    let left: Vec<f64> = shifts.iter().map(|s| 0.5 * s).collect();
    let records = problem.rows.record_rows();
    let common: Vec<_> = problem.rows.gain_errors().into_values().collect();
    let sampled = match ctx.options.objective {
        Objective::Time => None,
        Objective::Frequency => Some(sampled(ctx, problem, solution, columns)?),
    };
    let linearised = Linearised {
        columns,
        residuals: &solution.residuals,
        records: &records,
        common: &common,
        at_bound: fixed,
        in_time: sampled.as_ref().map(Sampled::in_time),
    };
    let before = problem.rows.noise_before();
    let decayed = before.as_ref().map_or(Vec::new(), |noise| linearised.decayed(noise));
    let counts = before.as_ref().filter(|_| decayed.contains(&true));
    let counts = counts.map(|noise| linearised.noise_that_counts(noise, &decayed));
    let noises = [counts.as_deref(), before.as_deref()];
    let (moments, of_before) = match before {
        None => (linearised.moments(None), None),
        Some(_) => {
            let [moments, of_before] = linearised.moments_of(noises);
            (moments, Some(Errors::among(&of_before, fixed)))
        }
    };
    let errors = Errors::among(&moments, fixed);
    // The band takes the noise before the closure, so that what a model fails to explain shows outside it.
    let covariance = of_before.as_ref().unwrap_or(&errors).by_noise.clone();
    let errors = errors.and(&left);
    let curve_sd_m = match &sampled {
        None => curve_sd_m(problem, columns, &covariance),
        Some(sampled) => curve_sd_m(&sampled.problem, &sampled.columns, &covariance),
    };
    let of_value = |j: usize| {
        let uncertainty = Uncertainty::of(errors.of_variable(j) * problem.stretch(j, values[j]));
        (uncertainty, linear(problem, (linearised, &moments), &errors, &solution.x, j))
    };
    let decayed_runs = problem.rows.runs_of_records().into_iter().zip(decayed);
    Ok(Known {
        of_values: (0..values.len()).map(of_value).collect(),
        correlation: correlation(columns, fixed),
        unidentifiable: unidentifiable(problem, &values, linearised, &errors),
        curve_sd_m,
        decayed_runs: decayed_runs.filter_map(|(run, decayed)| decayed.then_some(run)).collect(),
    })
}

/// The change that the last halving of the step made where the fit ended: in the variables, and at the samples, rms, m.
/// It depends on grid and values, not on the way there.
fn last_halving(
    ctx: &Calibrator,
    problem: &FitProblem,
    solution: &Solution,
    columns: &[Vec<f64>],
    fixed: &[bool],
) -> Result<(Vec<f64>, f64), ModelError> {
    let values = problem.values(&solution.x);
    let halved = problem.window().reaches.div_ceil(2);
    let reaches = problem.model.fitting_reaches(&values[..problem.model.shared.len()], halved);
    let coarser = ctx.problem(problem.model, Window { reaches, ..problem.window() }).residuals(&solution.x)?;
    ctx.count(1);
    let change: Vec<f64> = solution.residuals.iter().zip(&coarser).map(|(f, c)| f - c).collect();
    let noise = problem.rows.sample_noise();
    let square: f64 = change.iter().zip(&noise).map(|(c, n)| (c * n).powi(2)).sum();
    let error_m = (square / noise.len().max(1) as f64).sqrt();
    Ok((gauss_newton_step(columns, &change, fixed), error_m))
}

/// A fit of frequencies, seen from the samples: their noise is stationary.
fn sampled<'a>(
    ctx: &'a Calibrator,
    problem: &FitProblem<'a>,
    solution: &Solution,
    columns: &[Vec<f64>],
) -> Result<Sampled<'a>, ModelError> {
    let in_time = FitProblem::new(problem.model, ctx.runs, problem.window());
    let residuals = in_time.residuals(&solution.x)?;
    let own = jacobian(&in_time, &solution.x, &residuals)?;
    ctx.count(own.len() + 1);
    let records = in_time.rows.record_rows();
    Ok(Sampled { problem: in_time, columns: own, seen: problem.rows.seen_in_time(columns), residuals, records })
}

fn run_fit(
    ctx: &Calibrator,
    problem: &FitProblem,
    r: usize,
    values: &[f64],
    start_values: &[f64],
    period_s: f64,
    curve_sd_m: Option<&[Vec<f64>]>,
) -> Result<RunFit, ModelError> {
    let (run, reaches) = (&ctx.runs[r], problem.window().reaches);
    let Modelled { traces, meter_flow_m3_s } = problem.modelled(r, values, reaches)?;
    let first_traces = problem.modelled(r, start_values, reaches)?.traces;
    let start = problem.closure_start_s(r, values);
    let first_start = problem.closure_start_s(r, start_values);
    let mut sensors = Vec::new();
    for (s, sensor) in run.sensors.iter().enumerate() {
        let offset = problem.offset_m(r, s, values);
        let from = sensor.time_s.partition_point(|&t| t < start);
        let time_s: Vec<f64> = sensor.time_s[from..].iter().map(|t| t - start).collect();
        let mut measured_m = sensor.head_m[from..].to_vec();
        let model_m: Vec<f64> = time_s.iter().map(|&t| offset + traces[s].at(t)).collect();
        if !sensor.hum.is_empty() {
            let left = measured_m.iter().zip(&model_m).map(|(measured, model)| measured - model).collect();
            let left = without_hum(sensor, &time_s, left);
            measured_m = left.iter().zip(&model_m).map(|(left, model)| left + model).collect();
        }
        let before: Vec<f64> = time_s.iter().map(|&t| first_traces[s].at(t + start - first_start)).collect();
        let found: Vec<_> = run.extrema[s].iter().map(|&(t, cycle, peak)| (t - start, cycle, peak)).collect();
        let pair =
            Pair { time_s: &time_s, measured_m: &measured_m, model_m: &model_m, noise_m: sensor.noise_m, period_s };
        let extrema = pair.extrema(&found);
        // The newest of it, for supplies drift; where the model's closure starts late, the rise is none of it.
        let until = start.min(run.start.closure_s.0) + traces[s].late_s.min(0.0);
        let [first, last] = [until - period_s, until].map(|s| sensor.time_s.partition_point(|&t| t < s));
        let lead: Vec<f64> = sensor.head_m[first..last].iter().map(|m| m - offset - traces[s].values[0]).collect();
        sensors.push(SensorFit {
            name: sensor.sensor.name.clone(),
            position_m: sensor.sensor.position_m,
            band_m: curve_sd_m.map_or_else(Vec::new, |sd_m| half_width_m(problem, r, s, &sd_m[s], from)),
            noise_m: sensor.total_noise_m,
            white_noise_m: sensor.noise_m,
            rmse_m: rmse(&measured_m, &model_m),
            start_rmse_m: rmse(&measured_m, &before),
            before_m: (!lead.is_empty()).then(|| mean(&lead)),
            extrema,
            time_s,
            measured_m,
            model_m,
        });
    }
    // Over all samples of all sensors: the weight of a sensor's mean square is its number of samples.
    let total = sensors.iter().map(|s| s.time_s.len()).sum::<usize>().max(1) as f64;
    let pooled = |f: &dyn Fn(&SensorFit) -> f64| {
        (sensors.iter().map(|s| f(s).powi(2) * s.time_s.len() as f64).sum::<f64>() / total).sqrt()
    };
    Ok(RunFit {
        file: run.file.clone(),
        rmse_m: pooled(&|s| s.rmse_m),
        noise_m: pooled(&|s| s.noise_m),
        mape_extrema_percent: mape_percent(sensors.iter().flat_map(|s| &s.extrema)),
        noise_dies_away: false,
        meter_flow_m3_s,
        sensors,
    })
}

/// What the errors of a solution's variables follow from.
pub(crate) fn moments_of(
    problem: &FitProblem,
    solution: &Solution,
    columns: &[Vec<f64>],
    common: &[CommonError],
) -> Moments {
    let records = problem.rows.record_rows();
    let (residuals, at_bound) = (&solution.residuals, &solution.at_bound);
    Linearised { columns, residuals, records: &records, common, at_bound, in_time: None }.moments(None)
}

/// Why an end is no optimum, from where a step predicts a reduction by this `share` of the sum of squares, and by so
/// much in units of what one independent sample leaves; and what to do.
fn not_at_optimum(share: f64, reduction: f64, method: Method) -> String {
    let share = 100.0 * share.min(1.0);
    let digits = if share < 0.1 { 3 } else { usize::from(share < 10.0) };
    format!(
        "the search did not reach an optimum (a descent from its end would take {share:.digits$}% off the sum of squares, and some values \
         may be off by {:.0} standard errors); {}",
        reduction.sqrt().max(1.0),
        method.advice()
    )
}
