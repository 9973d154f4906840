//! The end of a fit: the grid is refined until halving its step changes less than the noise does, then all samples enter.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::atomic::Ordering;

use crate::fit::inference::errors::{Common, Errors, InTime, Linearised};
use crate::fit::inference::identify::unseen;
use crate::fit::inference::interval::linear;
use crate::fit::inference::optimum::short_of_it;
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, jacobian};
use crate::fit::numeric::uncertainty::{correlation, gauss_newton_step};
use crate::fit::outcome::band::{curve_sd_m, half_width_m};
use crate::fit::outcome::compare::{Pair, mape_percent, rmse};
use crate::fit::outcome::fit::{Fit, FittedParameter, RunFit, SensorFit};
use crate::fit::problem::fit_problem::{Calibration, Window};
use crate::fit::problem::objective::Misfit;
use crate::fit::search::calibrate::FitError;
use crate::fit::search::coarse_fit::{Fitter, State};
use crate::fit::search::prune_elements::at_rest;
use crate::model::{Model, ModelError};

/// Reaches from which the grid is refined.
pub(crate) const FINAL_REACHES: usize = 64;
const MIDDLE: Limits = Limits { iterations: 20, cost_tolerance: 1e-4, step_tolerance: 1e-8, thorough: true };
const LATE: Limits = Limits { iterations: usize::MAX, cost_tolerance: 1e-5, step_tolerance: 1e-9, thorough: true };
/// Fall of the sum of squares, in units of what one sample leaves, that is worth no iteration more: a seventh of a standard error.
const SETTLED: f64 = 0.02;

/// Pull of the grid on a parameter, in standard errors, that sends the fit to a finer one.
const MOST_PULL: f64 = 2.0;

/// What a finer grid changes.
struct Pull {
    /// At the samples, in units of their noise, rms.
    error_over_noise: f64,
    /// In the variables.
    shifts: Vec<f64>,
    /// Half the sum of squares that the unmoved variables leave on the finer grid.
    finer_cost: f64,
    /// The largest of these, in standard errors.
    over_errors: f64,
}

/// See [`Fitter::sampled`].
struct Sampled<'a> {
    /// The same fit with every sample compared.
    problem: Calibration<'a>,
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

impl Fitter<'_> {
    fn patient(&self, limits: Limits) -> Limits {
        Limits { iterations: limits.iterations.min(self.options.patience), ..limits }
    }

    /// A problem with the misfit that was asked for.
    pub(crate) fn problem<'a>(&'a self, model: &'a Model<'a>, window: Window) -> Calibration<'a> {
        Calibration::new(model, self.runs, window).comparing(self.options.misfit)
    }

    /// Some samples while the grid is sought; all of them where their transform is compared.
    fn compared(&self, reaches: usize) -> Window {
        match self.options.misfit {
            Misfit::Time => self.window(reaches, f64::INFINITY),
            Misfit::Frequency => self.whole(reaches),
        }
    }

    /// Refines the grid until its error is small against the noise and its pull on the parameters against their standard errors,
    /// then fits all samples on a grid of half that step and puts the result together.
    pub(crate) fn finish(&self, model: &Model, state: State) -> Result<Fit, FitError> {
        let mut values = state.values;
        let mut reaches = FINAL_REACHES.max(self.least_reaches);
        let fine = loop {
            let fitting = |n: usize| model.fitting_reaches(&values[..model.shared.len()], n);
            let (coarse, fine) = (fitting(reaches), fitting(2 * reaches));
            let problem = self.problem(model, self.compared(coarse));
            let solution = self.minimise(&problem, &values, self.patient(MIDDLE), &format!("{coarse} reaches"))?;
            values = problem.values(&solution.x);
            let pull = self.grid_pull(&problem, &solution, fine)?;
            // A second order scheme's own limit lies a third further on than half the step. Where the data hardly tell two
            // parameters apart the step may lead astray: the finer grid decides.
            let mut further = values.clone();
            for (j, value) in further.iter_mut().enumerate() {
                let by = pull.shifts[j] * 4.0 / 3.0;
                *value = (*value + problem.stretch(j, *value) * by)
                    .clamp(problem.parameters[j].lower, problem.parameters[j].upper);
            }
            let finer = self.problem(model, self.compared(fine));
            let moved = finer.residuals(&finer.variables(&further)).map(|r| 0.5 * r.iter().map(|r| r * r).sum::<f64>());
            self.count(1);
            if moved.is_ok_and(|cost| cost < pull.finer_cost) {
                values = further;
            }
            // Where the model leaves more than noise, the grid may err by as much more.
            let left = (2.0 * solution.cost / problem.samples().max(1) as f64).sqrt();
            let settled = pull.error_over_noise <= self.options.grid_error_over_noise * left.max(1.0)
                && pull.over_errors <= MOST_PULL;
            if settled || 4 * reaches > self.options.most_reaches {
                break fine;
            }
            reaches *= 2;
        };
        // What is held, or known before, stands under its own name.
        if model.constraints.is_empty() && model.priors.is_empty() {
            model.put_in_order(&mut values);
        }
        let problem = self.problem(model, self.whole(fine));
        problem.know(&model.constraints)?;
        let limits = Limits { cost_tolerance: SETTLED / problem.samples().max(1) as f64, ..self.patient(LATE) };
        let solution = self.last_descent(&problem, &values, limits)?;
        self.outcome(&problem, &solution)
    }

    /// What a search found, on a grid as fine as a fit ends on at the least, without any further descent.
    pub(crate) fn as_found(&self, model: &Model, state: State) -> Result<Fit, FitError> {
        let fitting = |n: usize| model.fitting_reaches(&state.values[..model.shared.len()], n);
        let still = Limits { iterations: 0, ..LATE };
        let problem = Calibration::new(model, self.runs, self.whole(fitting(2 * FINAL_REACHES)));
        problem.know(&model.constraints)?;
        let solution = self.minimise(&problem, &state.values, still, "as found")?;
        let fit = self.outcome(&problem, &solution)?;
        let over = "the search was over, and a descent from its end would gain nothing".to_owned();
        Ok(if fit.converged { Fit { stopped_because: over, ..fit } } else { fit })
    }

    /// What a finer grid would change: at the samples, and by one Gauss-Newton step in the parameters.
    fn grid_pull(&self, problem: &Calibration, solution: &Solution, fine: usize) -> Result<Pull, ModelError> {
        let finer = self.problem(problem.model, Window { reaches: fine, ..problem.window() });
        let residuals = finer.residuals(&solution.x)?;
        let columns = self.slopes(problem, solution)?;
        self.count(1);
        let errors = errors_of(problem, solution, &columns, &[]);
        let change: Vec<f64> = residuals.iter().zip(&solution.residuals).map(|(f, c)| f - c).collect();
        let shifts = gauss_newton_step(&columns, &change, &solution.at_bound);
        let n = problem.samples().max(1);
        let over_errors = (0..shifts.len())
            .map(|j| shifts[j].abs() / errors.of_variable(j))
            .filter(|r| r.is_finite())
            .fold(0.0, f64::max);
        let finer_cost = 0.5 * residuals.iter().map(|r| r * r).sum::<f64>();
        let error_over_noise = (change[..n].iter().map(|c| c * c).sum::<f64>() / n as f64).sqrt();
        Ok(Pull { error_over_noise, shifts, finer_cost, over_errors })
    }

    /// What the last halving of the step has changed where the fit ended: in the variables, and at the samples, rms, m. It belongs to grid
    /// and values, whichever way led there.
    fn last_halving(
        &self,
        problem: &Calibration,
        solution: &Solution,
        columns: &[Vec<f64>],
        at_rest: &[bool],
    ) -> Result<(Vec<f64>, f64), ModelError> {
        let values = problem.values(&solution.x);
        let halved = problem.window().reaches.div_ceil(2);
        let reaches = problem.model.fitting_reaches(&values[..problem.model.shared.len()], halved);
        let coarser = self.problem(problem.model, Window { reaches, ..problem.window() }).residuals(&solution.x)?;
        self.count(1);
        let change: Vec<f64> = solution.residuals.iter().zip(&coarser).map(|(f, c)| f - c).collect();
        let noise = problem.sample_noise();
        let square: f64 = change.iter().zip(&noise).map(|(c, n)| (c * n).powi(2)).sum();
        let error_m = (square / noise.len().max(1) as f64).sqrt();
        Ok((gauss_newton_step(columns, &change, at_rest), error_m))
    }

    /// A fit of frequencies seen from the samples, whose noise is stationary.
    fn sampled<'a>(
        &'a self,
        problem: &Calibration<'a>,
        solution: &Solution,
        columns: &[Vec<f64>],
    ) -> Result<Sampled<'a>, ModelError> {
        let in_time = Calibration::new(problem.model, self.runs, problem.window());
        let residuals = in_time.residuals(&solution.x)?;
        let own = jacobian(&in_time, &solution.x, &residuals)?;
        self.count(own.len() + 1);
        let records = in_time.record_rows();
        Ok(Sampled { problem: in_time, columns: own, seen: problem.seen_in_time(columns), residuals, records })
    }

    fn outcome(&self, problem: &Calibration, solution: &Solution) -> Result<Fit, FitError> {
        if problem.samples() == 0 {
            // The start of the closure is held behind the last of them.
            return Err(FitError::NoSample { file: self.runs.first().map_or(String::new(), |run| run.file.clone()) });
        }
        let values = problem.values(&solution.x);
        let start_values: Vec<f64> = problem.parameters.iter().map(|p| p.start).collect();
        let columns = self.slopes(problem, solution)?;
        let at_rest = at_rest(problem, &values, &solution.at_bound);
        let (shifts, halving_m) = self.last_halving(problem, solution, &columns, &at_rest)?;
        // A third of it is left to come; half of it allows for kinks, which are of first order.
        let left: Vec<f64> = shifts.iter().map(|s| 0.5 * s).collect();
        let records = problem.record_rows();
        let common: Vec<_> = problem.gain_errors().into_values().collect();
        let sampled = match self.options.misfit {
            Misfit::Time => None,
            Misfit::Frequency => Some(self.sampled(problem, solution, &columns)?),
        };
        let linearised = Linearised {
            columns: &columns,
            residuals: &solution.residuals,
            records: &records,
            common: &common,
            at_bound: &at_rest,
            in_time: sampled.as_ref().map(Sampled::in_time),
            elsewhere: None,
        };
        let before = problem.noise_before();
        let of_before = before.as_ref().map(|noise| Errors::of(Linearised { elsewhere: Some(noise), ..linearised }));
        let of_record = Errors::of(linearised);
        // What a model fails to explain is to show outside the band: the noise is that of before.
        let covariance = of_before.as_ref().unwrap_or(&of_record).by_noise.clone();
        let faded = before.as_ref().map_or(Vec::new(), |noise| linearised.faded(noise));
        let counts = before.filter(|_| faded.contains(&true)).map(|noise| linearised.noise_that_counts(&noise, &faded));
        let of_faded = counts.map(|noise| Errors::of(Linearised { elsewhere: Some(&noise), ..linearised }));
        let errors = of_faded.unwrap_or(of_record).and(&left);
        let bands = match &sampled {
            None => curve_sd_m(problem, &columns, &covariance),
            Some(sampled) => curve_sd_m(&sampled.problem, &sampled.columns, &covariance),
        };
        let model = problem.model;
        // What is held keeps the bounds that it will have when it is let go.
        let unheld = Model::new(self.rig, self.water, &model.effects);
        let usual = Calibration::new(&unheld, self.runs, problem.window()).parameters;
        let parameters = problem
            .parameters
            .iter()
            .enumerate()
            .map(|(j, p)| FittedParameter {
                name: p.name.clone(),
                about: p.about,
                run: problem.run_of(j).map(|r| self.runs[r].file.clone()),
                value: values[j],
                standard_error: if p.lower < p.upper {
                    errors.of_variable(j) * problem.stretch(j, values[j])
                } else {
                    0.0
                },
                interval_95: linear(problem, linearised, &errors, &solution.x, j),
                profile: None,
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
        let faded_runs: BTreeSet<usize> =
            problem.runs_of_records().into_iter().zip(faded).filter_map(|(run, faded)| faded.then_some(run)).collect();
        let runs = (0..self.runs.len())
            .map(|r| {
                let run = self.run_fit(problem, r, &values, &start_values, period_s, &bands[r])?;
                Ok(RunFit { noise_dies_away: faded_runs.contains(&r), ..run })
            })
            .collect::<Result<_, ModelError>>()?;
        let promise = self.promised(problem, solution)?;
        let (promised, converged) = (promise.fall, promise.at_optimum(solution));
        let stopped_because = match (converged, solution.stop.describe()) {
            (true, why) => why.to_owned(),
            (false, _) => short_of_it(promised, problem.samples(), self.options.method),
        };
        let fit = Fit {
            method: self.options.method,
            effects: model.effects.clone(),
            runs,
            parameters,
            correlation: correlation(&columns, &at_rest),
            unseen: unseen(problem, &values, linearised, &errors),
            reaches: problem.window().reaches,
            grid_error_m: 0.25 * halving_m,
            evaluations: self.evaluations.load(Ordering::Relaxed),
            seconds: f64::NAN,
            steps: Vec::new(),
            features_left: Vec::new(),
            stopped_because,
            converged,
            promised_fall: promised,
        };
        Ok(if converged { fit } else { fit.without_errors() })
    }

    fn run_fit(
        &self,
        problem: &Calibration,
        r: usize,
        values: &[f64],
        start_values: &[f64],
        period_s: f64,
        curve_sd_m: &[Vec<f64>],
    ) -> Result<RunFit, ModelError> {
        let (run, reaches) = (&self.runs[r], problem.window().reaches);
        let traces = problem.modelled(r, values, reaches)?.traces;
        let first_traces = problem.modelled(r, start_values, reaches)?.traces;
        let start = problem.closure_start_s(r, values);
        let first_start = problem.closure_start_s(r, start_values);
        let mut sensors = Vec::new();
        for (s, sensor) in run.sensors.iter().enumerate() {
            let offset = problem.offset_m(r, s, values);
            let from = sensor.time_s.partition_point(|&t| t < start);
            let time_s: Vec<f64> = sensor.time_s[from..].iter().map(|t| t - start).collect();
            let measured_m = sensor.head_m[from..].to_vec();
            let model_m: Vec<f64> = time_s.iter().map(|&t| offset + traces[s].at(t)).collect();
            let before: Vec<f64> = time_s.iter().map(|&t| first_traces[s].at(t + start - first_start)).collect();
            let found: Vec<_> = run.extrema[s].iter().map(|&(t, cycle, peak)| (t - start, cycle, peak)).collect();
            let pair =
                Pair { time_s: &time_s, measured_m: &measured_m, model_m: &model_m, noise_m: sensor.noise_m, period_s };
            let extrema = pair.extrema(&found);
            sensors.push(SensorFit {
                name: sensor.sensor.name.clone(),
                position_m: sensor.sensor.position_m,
                band_m: half_width_m(problem, r, s, &curve_sd_m[s], from),
                noise_m: sensor.total_noise_m,
                white_noise_m: sensor.noise_m,
                rmse_m: rmse(&measured_m, &model_m),
                start_rmse_m: rmse(&measured_m, &before),
                extrema,
                time_s,
                measured_m,
                model_m,
            });
        }
        // Over all samples of all sensors: each sensor's mean square weighs as its number of samples.
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
            sensors,
        })
    }
}

/// Errors of a solution's variables.
pub(crate) fn errors_of(problem: &Calibration, solution: &Solution, columns: &[Vec<f64>], common: &[Common]) -> Errors {
    let records = problem.record_rows();
    let (residuals, at_bound) = (&solution.residuals, &solution.at_bound);
    Errors::of(Linearised { columns, residuals, records: &records, common, at_bound, in_time: None, elsewhere: None })
}

#[cfg(test)]
mod tests {
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::fit::search::calibrate::{Options, calibrate, refine};
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;

    /// A fit begun anew where one has ended comes to the same place, and to the same errors: what the grid adds to them is no matter of the way.
    #[test]
    fn errors_belong_to_the_place_and_not_to_the_way_there() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let effects = parse_list("viscoelastic-wall:2").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let runs = [record(&rig, &effects, &[380.0, 0.12, 0.03, 0.35, 0.6], run, 0.05, 6.0)];
        let first = calibrate(&rig, &runs, &effects, &Options::default(), &|_| {}).unwrap();
        let again = refine(&rig, &runs, &effects, &first.values(), &Options::default(), &|_| {}).unwrap();
        assert_eq!(first.reaches, again.reaches);
        for (a, b) in first.parameters.iter().zip(&again.parameters) {
            assert!((a.value - b.value).abs() < 0.1 * a.standard_error, "{}: {} {}", a.name, a.value, b.value);
            let ratio = a.standard_error / b.standard_error;
            assert!((0.98..1.02).contains(&ratio), "{}: {} {}", a.name, a.standard_error, b.standard_error);
        }
    }
}
