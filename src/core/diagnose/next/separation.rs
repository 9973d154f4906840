//! How well a test is expected to tell two answers apart.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::baseline::{Baseline, window};
use crate::diagnose::evidence::tempered;
use crate::diagnose::limits::{DESIGN, MOST_REPEATS};
use crate::diagnose::next::answer::{Answer, Known};
use crate::diagnose::next::change::{Change, Stage};
use crate::fit::data::run_data::{RunData, ShownClosing};
use crate::fit::numeric::least_squares::{Problem, Way, minimise};
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::effects::Chosen;
use crate::model::{ModelError, RunValues};
use crate::product::dot;

/// A test, and what it is expected to bring.
#[derive(Debug, Clone)]
pub struct Separation {
    /// What to do.
    pub instruction: String,
    /// What it changes in the first run.
    pub change: Change,
    /// The settings of the test.
    pub run: RunValues,
    /// Logarithm of the odds that one such test is expected to bring for the answer that is true, whichever it is: the
    /// lesser of both.
    pub log_odds: f64,
    /// Such tests until the odds are 20:1; none where it would take too many.
    pub repeats: Option<usize>,
    /// Highest head that either answer expects, m.
    pub peak_m: f64,
    /// What each sensor would show.
    pub curves: Vec<Curve>,
}

/// What a sensor would show under both answers.
#[derive(Debug, Clone)]
pub struct Curve {
    /// The sensor.
    pub sensor: String,
    /// After the start of the closure, s.
    pub time_s: Vec<f64>,
    /// Under the first answer, m.
    pub one_m: Vec<f64>,
    /// Under the other, fitted to the first's record, m.
    pub other_m: Vec<f64>,
}

impl Curve {
    /// Where the curves differ most: the time after the closure, s, and by how much, m, averaged over a hundredth of
    /// the record.
    pub fn most(&self) -> (f64, f64) {
        let n = (self.time_s.len() / 100).max(1);
        let means = self
            .one_m
            .chunks(n)
            .zip(self.other_m.chunks(n))
            .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).sum::<f64>() / a.len() as f64);
        let times = self.time_s.chunks(n).map(|t| t.iter().sum::<f64>() / t.len() as f64);
        times.zip(means).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or((0.0, 0.0))
    }
}

/// What a test is expected to bring, averaged over some draws of the parameters; none where it cannot be simulated.
pub(crate) fn of(
    baseline: &Baseline,
    answers: [&Answer; 2],
    known: [&Known; 2],
    change: Change,
    unit: f64,
    draws: u32,
) -> Option<Separation> {
    let stage = change.stage(baseline.rig, &baseline.runs[0]);
    let remedy = if change.remedied { remedy(baseline, answers)? } else { String::new() };
    // Put right, the first answer's record is that of a model without what it blames.
    let without: Vec<Chosen> = match change.remedied {
        true => answers[0].effects.split_last()?.1.to_vec(),
        false => answers[0].effects.clone(),
    };
    let effects = [&without[..], &answers[1].effects[..]];
    let mut of_both = [0.0; 2];
    let mut curves = Vec::new();
    for (truth, rival) in [(0, 1), (1, 0)] {
        let mut sum = 0.0;
        for draw in 0..draws {
            let values = drawn(known[truth], draw, unit);
            let record = record(baseline, &stage, known[truth], &values, effects[truth], change).ok()?;
            let test = Test { baseline, stage: &stage, known: known[rival], effects: effects[rival], change };
            let (cost, followed) = test.fitted(&record).ok()?;
            sum += cost;
            if draw == 0 && truth == 0 {
                curves = compared(&record, &followed, known[0].closure_s);
            }
        }
        of_both[truth] = tempered(sum / f64::from(draws) / unit);
    }
    let log_odds = f64::min(of_both[0], of_both[1]);
    let repeats = (STRONG_EVIDENCE / log_odds).ceil();
    let heads = curves.iter().flat_map(|c: &Curve| c.one_m.iter().chain(&c.other_m));
    Some(Separation {
        instruction: change.instruction(&known[0].runs[0], baseline.rig, &remedy),
        change,
        run: change.of(&known[0].runs[0]),
        log_odds,
        repeats: (repeats <= MOST_REPEATS).then_some(repeats as usize),
        peak_m: heads.copied().fold(f64::NEG_INFINITY, f64::max),
        curves,
    })
}

/// What puts right what the first answer blames and the other does not, in words for the lab; none where nothing can be
/// put right.
fn remedy(baseline: &Baseline, [one, other]: [&Answer; 2]) -> Option<String> {
    let blamed = one.effects.last()?;
    if other.effects.iter().any(|c| c.effect.name() == blamed.effect.name()) {
        return None;
    }
    let model = baseline.model(&one.effects);
    let mut own = model.parameters_of(one.effects.len() - 1);
    let at = own.find(|&j| model.shared[j].name.contains("position_m")).map(|j| one.values[j]);
    let line = blamed.line(baseline.rig);
    let at = at.map(|position_m| baseline.rig.place_words(crate::rig::Place { line, position_m }));
    blamed.effect.remedy(at.as_deref(), blamed.sensor.as_deref())
}

/// Values of the shared variables: the centre first, then draws from what the records leave open.
fn drawn(known: &Known, draw: u32, unit: f64) -> DVector<f64> {
    if draw == 0 {
        return known.centre.clone();
    }
    let mut random = fastrand::Rng::with_seed(u64::from(draw));
    let normal = |random: &mut fastrand::Rng| (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
    let z = DVector::from_fn(known.centre.len(), |_, _| normal(&mut random));
    let step = known.root.solve_upper_triangular(&z).unwrap_or_else(|| DVector::zeros(known.centre.len()));
    &known.centre + unit.sqrt() * step
}

/// The values of a test's variables: those of the `shared` ones by their names, the first run's own, changed.
pub(crate) fn values_of(problem: &FitProblem, known: &Known, shared: &DVector<f64>, change: Change) -> Vec<f64> {
    let run = change.of(&known.runs[0]);
    let mut values = problem.start_values();
    let shared_values = values.iter_mut().zip(&problem.parameters).take(problem.place_variables().end);
    for (j, (value, parameter)) in shared_values.enumerate() {
        if let Some(i) = known.names.iter().position(|name| *name == parameter.name) {
            *value = problem.value(j, shared[i]);
        }
    }
    let own = [run.initial_velocity_m_s, run.valve_head_m, run.closing_time_s, run.friction_scale, known.closure_s];
    problem.run_variables(0).into_iter().zip(own).for_each(|(j, value)| values[j] = value);
    let within = |(value, p): (f64, &crate::model::parameter::Parameter)| value.clamp(p.lower, p.upper);
    values.into_iter().zip(&problem.parameters).map(within).collect()
}

/// The run as it would be prepared, without heads: what instruments and signals would say of it.
pub(crate) fn prepared(stage: &Stage, known: &Known, change: Change) -> RunData {
    let (mut run, own) = (stage.run.clone(), change.of(&known.runs[0]));
    run.start.velocity_m_s.0 = own.initial_velocity_m_s;
    run.start.valve_head_m.0 = own.valve_head_m;
    let known_s = own.closing_time_s;
    run.start.closing_time = Some(ShownClosing { seen_s: (known_s, 0.0), said_s: (known_s, None) });
    run.start.closure_s.0 = known.closure_s;
    run.start.wave_speed_ratio = None;
    run
}

/// The record of a test under an answer, without noise.
fn record(
    baseline: &Baseline,
    stage: &Stage,
    known: &Known,
    shared: &DVector<f64>,
    effects: &[Chosen],
    change: Change,
) -> Result<RunData, ModelError> {
    let runs = [prepared(stage, known, change)];
    let model = stage.model(effects);
    let problem = FitProblem::new(&model, &runs, window(baseline.reaches));
    let values = values_of(&problem, known, shared, change);
    let modelled = problem.modelled(0, &values, baseline.reaches)?;
    let (start, mut run) = (problem.closure_start_s(0, &values), runs[0].clone());
    for (sensor, trace) in run.sensors.iter_mut().zip(&modelled.traces) {
        sensor.head_m = sensor.time_s.iter().map(|t| trace.at(t - start)).collect();
    }
    if let (Some(meter), Some(flow)) = (&mut run.meter, modelled.meter_flow_m3_s) {
        meter.flow_m3_s = flow;
    }
    Ok(run)
}

/// An answer that is to follow another's record.
struct Test<'a> {
    baseline: &'a Baseline<'a>,
    stage: &'a Stage,
    known: &'a Known,
    effects: &'a [Chosen],
    change: Change,
}

impl Test<'_> {
    /// Half the square that the answer leaves of a record's samples and of what the records before knew, and the heads
    /// that it comes to.
    fn fitted(&self, record: &RunData) -> Result<(f64, Vec<Vec<f64>>), ModelError> {
        let runs = std::slice::from_ref(record);
        let model = self.stage.model(self.effects);
        let problem = FitProblem::new(&model, runs, window(self.baseline.reaches));
        let informed = Informed::new(&problem, self.known);
        let mut start = values_of(&problem, self.known, &self.known.centre, self.change);
        // velocity and head are what instruments say of this record
        for j in &problem.run_variables(0)[..2] {
            start[*j] = problem.parameters[*j].start;
        }
        let solution = minimise(&informed, &problem.variables(&start), DESIGN, |_, _| {})?;
        let told = informed.evidence_rows(&solution.residuals);
        let values = problem.values(&solution.x);
        let traces = problem.modelled(0, &values, self.baseline.reaches)?.traces;
        let from = problem.closure_start_s(0, &values);
        let heads = record.sensors.iter().zip(&traces).enumerate().map(|(s, (sensor, trace))| {
            let offset = problem.offset_m(0, s, &values);
            sensor.time_s.iter().map(|t| offset + trace.at(t - from)).collect()
        });
        Ok((0.5 * told, heads.collect()))
    }
}

/// The problem of a test, with what earlier records know of the shared variables.
pub(crate) struct Informed<'a> {
    problem: &'a FitProblem<'a>,
    known: &'a Known,
    /// Where each known variable is among the problem's.
    pub(crate) place: Vec<Option<usize>>,
    /// Priors of shared variables, which are part of what is known.
    told: std::ops::Range<usize>,
}

impl<'a> Informed<'a> {
    pub(crate) fn new(problem: &'a FitProblem<'a>, known: &'a Known) -> Self {
        let shared = &problem.parameters[..problem.place_variables().end];
        let place = known.names.iter().map(|name| shared.iter().position(|p| p.name == *name)).collect();
        let first = problem.prior_rows().start;
        let told = shared.iter().filter(|p| p.prior.is_some() && known.names.contains(&p.name)).count();
        Informed { problem, known, place, told: first..first + told }
    }

    /// The residuals of the problem alone, without the priors that are known from earlier records.
    pub(crate) fn own(&self, mut all: Vec<f64>) -> Vec<f64> {
        all.drain(self.told.clone());
        all
    }

    /// The square of what counts as evidence: samples, and what earlier records know. What instruments say of the test
    /// itself does not.
    fn evidence_rows(&self, residuals: &[f64]) -> f64 {
        let known = residuals.len() - self.known.centre.len();
        let square = |rows: &[f64]| dot(rows, rows);
        square(&residuals[..self.problem.samples()]) + square(&residuals[known..])
    }
}

impl Problem for Informed<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        let mut residuals = self.own(self.problem.residuals(x)?);
        let moved = self.place.iter().zip(self.known.centre.iter());
        let moved = moved.map(|(place, centre)| place.map_or(0.0, |j| x[j] - centre));
        let moved = DVector::from_iterator(self.place.len(), moved);
        residuals.extend((&self.known.root * moved).iter());
        Ok(residuals)
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        self.problem.bounds()
    }

    fn difference_step(&self, j: usize) -> f64 {
        self.problem.difference_step(j)
    }

    fn way(&self, j: usize) -> Way {
        match self.problem.way(j) {
            // what is known of one is known of its logarithm
            Way::Strength if self.place.contains(&Some(j)) => Way::Ratio,
            way => way,
        }
    }
}

/// What the sensors would show, from the start of the closure.
fn compared(record: &RunData, followed: &[Vec<f64>], closure_s: f64) -> Vec<Curve> {
    let of = |(sensor, other_m): (&crate::fit::data::run_data::SensorData, &Vec<f64>)| {
        let from = sensor.time_s.partition_point(|&t| t < closure_s);
        Curve {
            sensor: sensor.sensor.name.clone(),
            time_s: sensor.time_s[from..].iter().map(|t| t - closure_s).collect(),
            one_m: sensor.head_m[from..].to_vec(),
            other_m: other_m[from..].to_vec(),
        }
    };
    record.sensors.iter().zip(followed).map(of).collect()
}

/// Information that a test adds on the known variables and its own, the known ones at `place`.
pub(crate) fn with_known(mut information: DMatrix<f64>, known: &Known, place: &[Option<usize>]) -> DMatrix<f64> {
    let before = known.root.transpose() * &known.root;
    for (a, i) in place.iter().enumerate() {
        for (b, j) in place.iter().enumerate() {
            if let (Some(i), Some(j)) = (i, j) {
                information[(*i, *j)] += before[(a, b)];
            }
        }
    }
    information
}
