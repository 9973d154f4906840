//! Calibration as a least-squares problem: which variables the solver moves, and the residuals they leave.
//!
//! Variables are the model's shared parameters and the places of sensors, then for each run its velocity, head, closing
//! time and friction, the start of its closure and one offset for each sensor. Log-scaled parameters are moved as
//! logarithms. Residuals are measured minus modelled heads over each sensor's noise (or their transform, see
//! [`crate::fit::problem::objective`]), then one for each prior, then one for each run's flow meter.

use std::ops::Range;

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::least_squares::{Problem, Way};
use crate::fit::problem::error::FitError;
use crate::fit::problem::latest::Latest;
use crate::fit::problem::objective::{Bins, Objective};
use crate::fit::problem::parameters::placed_sensor;
use crate::fit::problem::rows::SampleRows;
use crate::fit::problem::thresholds::LEAD_OF_PERIOD;
use crate::fit::progress::Passing;
use crate::model::constraint::{Constraint, Given};
use crate::model::effects::boils;
use crate::model::parameter::{Parameter, Scale};
use crate::model::trace::Trace;
use crate::model::{Model, ModelError, RunValues};
use crate::rig::{Place, Sensor};

/// Index of the closure's start among a run's variables; those that the model takes come before it, offsets after it.
const CLOSURE_START: usize = RunValues::COUNT;
/// Index of its closing time among them.
const CLOSING_TIME: usize = 2;

/// Which samples enter, and how finely they are simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Reaches of the grid.
    pub reaches: usize,
    /// Longest time after the closure that enters, s.
    pub horizon_s: f64,
    /// One of how many samples enters.
    pub stride: usize,
}

/// The model's simulation of a run.
pub struct Modelled {
    /// Traces at the run's pressure sensors, as each shows them, without offsets.
    pub traces: Vec<Trace>,
    /// Flow before the closure at the flow meter, m³/s.
    pub meter_flow_m3_s: Option<f64>,
}

/// The least-squares problem of fitting one model to runs.
pub struct FitProblem<'a> {
    /// The model.
    pub model: &'a Model<'a>,
    /// The runs.
    pub runs: &'a [RunData],
    /// Every variable, described.
    pub parameters: Vec<Parameter>,
    /// First variable of each run.
    run_offsets: Vec<usize>,
    window: Window,
    objective: Objective,
    /// The samples that enter, and their residuals.
    pub rows: SampleRows<'a>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// The latest simulation of each run in the window.
    latest: Vec<Latest>,
    /// The same on a coarser grid, whose differences make the Jacobian.
    coarser: Option<Box<FitProblem<'a>>>,
}

fn to_variable(parameter: &Parameter, value: f64) -> f64 {
    match parameter.scale {
        Scale::Linear => value,
        Scale::Log => value.ln(),
    }
}

/// The variable of a bound maps back to the bound exactly, without rounding.
fn to_value(parameter: &Parameter, variable: f64) -> f64 {
    let bounds = [parameter.lower, parameter.upper];
    match parameter.scale {
        Scale::Linear => variable,
        Scale::Log => bounds.into_iter().find(|b| b.ln() == variable).unwrap_or_else(|| variable.exp()),
    }
}

impl<'a> FitProblem<'a> {
    /// The problem of fitting `model` to `runs`; `window` may be changed later.
    pub fn new(model: &'a Model<'a>, runs: &'a [RunData], window: Window) -> Self {
        let (parameters, run_offsets) = crate::fit::problem::parameters::of(model, runs);
        let lower = parameters.iter().map(|p| to_variable(p, p.lower)).collect();
        let upper = parameters.iter().map(|p| to_variable(p, p.upper)).collect();
        let mut problem = FitProblem {
            model,
            runs,
            parameters,
            run_offsets,
            window,
            objective: Objective::Time,
            rows: SampleRows::new(runs, window.stride, Vec::new(), Vec::new()),
            lower,
            upper,
            latest: Vec::new(),
            coarser: None,
        };
        problem.set_window(window);
        problem
    }

    /// Chooses the samples that enter and the grid.
    pub fn set_window(&mut self, window: Window) {
        self.window = window;
        self.latest = self.runs.iter().map(|_| Latest::default()).collect();
        let spans: Vec<Vec<(usize, usize)>> = self
            .runs
            .iter()
            .map(|run| {
                let start = run.start.closure_s.0;
                let lead = LEAD_OF_PERIOD * self.model.period_s(&self.start_values()[..self.model.shared.len()]);
                run.sensors
                    .iter()
                    .map(|sensor| {
                        let first = sensor.time_s.partition_point(|&t| t < start - lead);
                        let last = sensor.time_s.partition_point(|&t| t <= start + window.horizon_s);
                        (first, last.max(first))
                    })
                    .collect()
            })
            .collect();
        let compared = self.objective == Objective::Frequency && window.stride == 1;
        let bins =
            if compared { spans.iter().enumerate().map(|(r, s)| self.bins_of(r, s)).collect() } else { Vec::new() };
        self.rows = SampleRows::new(self.runs, window.stride, spans, bins);
    }

    /// The same problem with another objective; frequencies are compared where every sample enters. A sensor whose
    /// record is too short for it is compared in time.
    pub fn comparing(mut self, objective: Objective) -> Self {
        if objective != self.objective {
            self.objective = objective;
            self.set_window(self.window);
        }
        self
    }

    /// The same problem with a Jacobian from a grid of half the reaches (at least of `least`, and of a few more where
    /// that fits the joints): both change almost alike, and it costs a quarter, or on a coarse grid, whose steps cost
    /// more than its nodes, a half. Where that saves little the problem stays as it is.
    pub(crate) fn with_slopes_of_half(self, least: usize) -> Self {
        let reaches = self.model.fitting_reaches(&self.start_values(), (self.window.reaches / 2).max(least));
        if 3 * reaches >= 2 * self.window.reaches {
            return self;
        }
        let coarser =
            FitProblem::new(self.model, self.runs, Window { reaches, ..self.window }).comparing(self.objective);
        FitProblem { coarser: Some(Box::new(coarser)), ..self }
    }

    /// The same on a coarse grid, but for cavities, whose collapse belongs to the grid.
    pub(crate) fn with_coarse_slopes(self, least: usize) -> Self {
        if boils(&self.model.effects) { self } else { self.with_slopes_of_half(least) }
    }

    /// The first run and sensor whose frequencies should be compared and cannot be.
    pub fn too_short(&self) -> Option<(String, String)> {
        let (r, s) = self.rows.too_short()?;
        Some((self.runs[r].file.clone(), self.runs[r].sensors[s].sensor.name.clone()))
    }

    fn bins_of(&self, r: usize, spans: &[(usize, usize)]) -> Vec<Option<Bins>> {
        let (run, shared) = (&self.runs[r], self.model.shared.len());
        let closure = (run.start.closure_s.0, self.model.rig.valve.closing_time_s);
        let period_s = self.model.period_s(&self.start_values()[..shared]);
        let of = |(sensor, &(first, last)): (_, &(usize, usize))| Bins::of(sensor, first..last, closure, period_s);
        run.sensors.iter().zip(spans).map(of).collect()
    }

    /// Holds these variables at `values`, and releases all others.
    pub fn hold(&mut self, held: &[usize], values: &[f64]) {
        self.lower = self.parameters.iter().map(|p| to_variable(p, p.lower)).collect();
        self.upper = self.parameters.iter().map(|p| to_variable(p, p.upper)).collect();
        for &j in held {
            let x = to_variable(&self.parameters[j], values[j]).clamp(self.lower[j], self.upper[j]);
            (self.lower[j], self.upper[j]) = (x, x);
        }
    }

    /// The window in force.
    pub fn window(&self) -> Window {
        self.window
    }

    /// The values that all variables start from.
    pub(crate) fn start_values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.start).collect()
    }

    /// The variables of the start values.
    pub fn start(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| to_variable(p, p.start)).collect()
    }

    /// Values, in the parameters' units, of variables.
    pub fn values(&self, x: &[f64]) -> Vec<f64> {
        self.parameters.iter().zip(x).map(|(p, &v)| to_value(p, v)).collect()
    }

    /// Variables of values.
    pub fn variables(&self, values: &[f64]) -> Vec<f64> {
        self.parameters.iter().zip(values).map(|(p, &v)| to_variable(p, v)).collect()
    }

    /// Value, in the parameter's unit, of variable `j`.
    pub fn value(&self, j: usize, x: f64) -> f64 {
        to_value(&self.parameters[j], x)
    }

    /// How a small change of variable `j` at `value` changes the value.
    pub fn stretch(&self, j: usize, value: f64) -> f64 {
        match self.parameters[j].scale {
            Scale::Linear => 1.0,
            Scale::Log => value,
        }
    }

    /// Refuses a constraint on a parameter that the model does not have, or with bounds that do not suit it.
    ///
    /// # Errors
    /// The first such constraint.
    pub fn validate_constraints(&self, constraints: &[Constraint]) -> Result<(), FitError> {
        let runs = (0..self.parameters.len()).map(|j| self.run_of(j).map(|r| self.runs[r].file.as_str()));
        let own: Vec<_> = self.parameters.iter().zip(runs).collect();
        let unsuited = |c: &&Constraint| own.iter().any(|(p, run)| c.concerns(&p.name, *run) && !c.suits(p));
        if let Some(c) = constraints.iter().find(unsuited) {
            return Err(FitError::Bounds { name: c.name.clone(), lower: c.lower, upper: c.upper });
        }
        match constraints.iter().find(|c| !own.iter().any(|(p, run)| c.concerns(&p.name, *run))) {
            None => Ok(()),
            Some(unknown) => Err(FitError::NoSuchParameter {
                name: unknown.name.clone(),
                of: unknown.run.as_ref().map_or(String::new(), |run| format!(" of {run}")),
                known: own.iter().map(|(p, _)| p.name.as_str()).collect::<Vec<_>>().join(", "),
            }),
        }
    }

    /// Number of residuals that are samples rather than priors.
    pub fn samples(&self) -> usize {
        self.rows.count()
    }

    /// Where the residuals of priors are among all.
    pub fn prior_rows(&self) -> Range<usize> {
        let first = self.samples();
        first..first + self.parameters.iter().filter(|p| p.prior.is_some()).count()
    }

    /// The variables that are places of sensors.
    pub(crate) fn place_variables(&self) -> Range<usize> {
        self.model.shared.len()..self.run_offsets.first().copied().unwrap_or(self.parameters.len())
    }

    /// The model at the variables `x`, for those who watch.
    pub(crate) fn passing(&self, x: &[f64]) -> Passing {
        let run = |j| self.run_of(j).map(|r| self.runs[r].file.clone());
        let named = |(j, value): (usize, f64)| Given { name: self.parameters[j].name.clone(), run: run(j), value };
        let given = self.values(x).into_iter().enumerate().map(named).collect();
        Passing { effects: self.model.effects.clone(), given }
    }

    /// The run that variable `j` belongs to; none if it is shared.
    pub fn run_of(&self, j: usize) -> Option<usize> {
        self.run_offsets.iter().rposition(|&first| j >= first)
    }

    /// The variable that is the offset of a run's sensor.
    pub(crate) fn offset_variable(&self, r: usize, sensor: usize) -> usize {
        self.run_offsets[r] + CLOSURE_START + 1 + sensor
    }

    /// The variables of a run beside its offsets: velocity, head, closing time, friction and start of the closure.
    pub(crate) fn run_variables(&self, r: usize) -> [usize; CLOSURE_START + 1] {
        std::array::from_fn(|i| self.run_offsets[r] + i)
    }

    /// The variable that is a run's closing time.
    pub(crate) fn closing_time_variable(&self, r: usize) -> usize {
        self.run_offsets[r] + CLOSING_TIME
    }

    /// The prior of variable `j`, if it has one: mean and standard deviation, as variables.
    pub(crate) fn known(&self, j: usize) -> Option<(f64, f64)> {
        let parameter = &self.parameters[j];
        parameter.prior.map(|(mean, sd)| (to_variable(parameter, mean), sd))
    }

    /// The residual of the prior of variable `j`, if it has one.
    pub(crate) fn prior_residual(&self, j: usize, x: f64) -> Option<f64> {
        self.known(j).map(|(mean, sd)| (x - mean) / sd)
    }

    /// A run's own values.
    pub fn run_values(&self, r: usize, values: &[f64]) -> RunValues {
        let own = &values[self.run_offsets[r]..];
        RunValues::from_slice(own.first_chunk().unwrap_or(&[f64::NAN; RunValues::COUNT]))
    }

    /// Start of a run's closure on its clock, s.
    pub fn closure_start_s(&self, r: usize, values: &[f64]) -> f64 {
        values[self.run_offsets[r] + CLOSURE_START]
    }

    /// Offset of a run's sensor, m.
    pub fn offset_m(&self, r: usize, sensor: usize, values: &[f64]) -> f64 {
        values[self.offset_variable(r, sensor)]
    }

    /// Where a sensor stands.
    pub fn place(&self, sensor: &Sensor, values: &[f64]) -> Place {
        let own = self.place_variable(sensor);
        Place { position_m: own.map_or(sensor.position_m, |j| values[j]), ..sensor.place() }
    }

    /// The variable that is the place of a sensor.
    fn place_variable(&self, sensor: &Sensor) -> Option<usize> {
        self.place_variables().find(|&j| placed_sensor(&self.parameters[j].name) == Some(&sensor.name))
    }

    fn append_run(
        &self,
        r: usize,
        values: &[f64],
        keep: bool,
        out: &mut Vec<f64>,
        meters: &mut Vec<f64>,
    ) -> Result<(), ModelError> {
        let Modelled { traces, meter_flow_m3_s } = self.sensed(r, values, self.in_window(r, values, keep)?)?;
        if let (Some(meter), Some(flow)) = (&self.runs[r].meter, meter_flow_m3_s) {
            meters.push((flow / meter.flow_m3_s - 1.0) / meter.relative_sd);
        }
        let closure_start = self.closure_start_s(r, values);
        for (s, (sensor, trace)) in self.runs[r].sensors.iter().zip(&traces).enumerate() {
            let offset = self.offset_m(r, s, values);
            let weight = 1.0 / sensor.noise_m;
            let [time_s, head_m] = self.rows.samples_of(r, s);
            let first = out.len();
            out.resize(first + time_s.len(), 0.0);
            trace.read(closure_start, time_s, &mut out[first..]);
            out[first..].iter_mut().zip(head_m).for_each(|(of, head)| *of = weight * (head - offset - *of));
            if self.rows.are_mapped(r, s) {
                let left = out.split_off(first);
                out.extend(self.rows.seen(r, s, left));
            }
        }
        Ok(())
    }

    /// The residuals; with `keep`, the simulations are stored for later differences.
    pub(crate) fn all_residuals(&self, x: &[f64], keep: bool) -> Result<Vec<f64>, ModelError> {
        let values = self.values(x);
        let (mut out, mut meters) = (Vec::with_capacity(self.samples() + x.len() + self.runs.len()), Vec::new());
        for r in 0..self.runs.len() {
            self.append_run(r, &values, keep, &mut out, &mut meters)?;
        }
        self.append_priors(x, &mut out);
        out.append(&mut meters);
        Ok(out)
    }

    /// The offset `j` that residuals were computed with, read back from its prior's residual.
    fn base_offset(&self, base: &[f64], j: usize) -> f64 {
        let row = self.samples() + self.parameters[..j].iter().filter(|p| p.prior.is_some()).count();
        self.parameters[j].prior.map_or(0.0, |(mean, sd)| mean + sd * base[row])
    }

    fn append_priors(&self, x: &[f64], out: &mut Vec<f64>) {
        out.extend(x.iter().enumerate().filter_map(|(j, &v)| self.prior_residual(j, v)));
    }
}

impl Problem for FitProblem<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        self.all_residuals(x, true)
    }

    fn residuals_moved(&self, x: &[f64], j: usize, base: &[f64]) -> Result<Vec<f64>, ModelError> {
        let Some(moved) = self.run_of(j) else { return self.all_residuals(x, false) };
        let values = self.values(x);
        let mut out = Vec::with_capacity(base.len());
        if let Some(sensor) = (j - self.run_offsets[moved]).checked_sub(CLOSURE_START + 1) {
            // An offset shifts its sensor's residuals; nothing is simulated.
            let shift = (self.base_offset(base, j) - values[j]) / self.runs[moved].sensors[sensor].noise_m;
            out.extend_from_slice(&base[..self.samples()]);
            let one = self.rows.unit_offset(moved, sensor);
            out[self.rows.rows(moved, sensor)].iter_mut().zip(one).for_each(|(r, one)| *r += shift * one);
            self.append_priors(x, &mut out);
            out.extend_from_slice(&base[out.len()..]);
            return Ok(out);
        }
        let mut meters = Vec::new();
        let mut base_meters = base[base.len() - self.runs.iter().filter(|r| r.meter.is_some()).count()..].iter();
        for r in 0..self.runs.len() {
            let base_meter = self.runs[r].meter.as_ref().and_then(|_| base_meters.next());
            if r == moved {
                self.append_run(r, &values, false, &mut out, &mut meters)?;
            } else {
                let from = out.len();
                out.extend_from_slice(&base[from..from + self.rows.run_row_count(r)]);
                meters.extend(base_meter);
            }
        }
        self.append_priors(x, &mut out);
        out.append(&mut meters);
        Ok(out)
    }

    fn cheaper(&self) -> Option<&Self> {
        self.coarser.as_deref()
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    fn way(&self, j: usize) -> Way {
        let parameter = &self.parameters[j];
        match parameter.scale {
            Scale::Linear => Way::Even,
            // what is known of one is known of its logarithm
            Scale::Log if parameter.is_strength() && parameter.prior.is_none() => Way::Strength,
            Scale::Log => Way::Ratio,
        }
    }

    /// Start and end of a closure are bends of the head, and these come back with every wave. A grid shows a bend to a
    /// time step: moved by less, its two steps change by what the grid makes of it, differently where the curve is read
    /// later (the start) and where it is simulated anew (the closing time). What both leave alone, an end that stays
    /// where it is, would seem to be seen well. So both move by one time step, unless the closure takes less than 2L/a:
    /// then the front shows its start and its end.
    fn difference_step(&self, j: usize) -> f64 {
        if let Some((own, closing)) = self.run_of(j).map(|r| (j - self.run_offsets[r], self.closing_time_variable(r))) {
            let closing_s = self.parameters[closing].start;
            let period_s = self.model.period_s(&self.start_values()[..self.model.shared.len()]);
            let step_s = 0.25 * period_s / self.window.reaches as f64;
            match own {
                CLOSING_TIME if closing_s > 0.5 * period_s => return (step_s / closing_s).ln_1p(),
                CLOSURE_START if closing_s > 0.5 * period_s => return step_s,
                _ => {}
            }
        }
        match self.parameters[j].scale {
            Scale::Log => 1e-5,
            // Heads and offsets in m, times in s: small against noise and fronts, large against rounding.
            Scale::Linear => 1e-5 * (1.0 + self.parameters[j].start.abs()).min(10.0),
        }
    }
}

mod simulated;
#[cfg(test)]
mod tests;
