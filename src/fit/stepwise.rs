//! Stepwise calibration: one parameter after the other, each from the feature of the record that it moves most.
//!
//! The order is that of Tjuatja et al. (2023) as the paper has it: wave speed, closure, creep by the phase and the damping of the late
//! cycles, then all in turn until nothing is gained. A person can follow it, stop it, change a value and go on.

use super::approach::{FIRST_REACHES, Fitter, State};
use super::calibrate::Progress;
use super::compare::Pair;
use super::least_squares::{Limits, Problem, minimise};
use super::outcome::StepTaken;
use super::problem::Calibration;
use crate::model::{Model, ModelError};

const LIMITS: Limits = Limits { iterations: 12, cost_tolerance: 1e-3, step_tolerance: 1e-6, thorough: false };
/// Rounds after the first, at most, and the relative fall of the error below which one more is not worth it.
const ROUNDS: usize = 12;
const SETTLED: f64 = 0.005;
/// What a crossing's time is known to, as a share of the period.
const PHASE_SHARE: f64 = 1e-3;

/// What of the record a step looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Feature {
    /// All samples before the first reflection is back.
    FirstRise,
    /// When the level between extrema is crossed, in the first half of the cycles.
    EarlyPhase,
    /// The same in the second half.
    LatePhase,
    /// Heights of the extrema of the second half.
    LatePeaks,
    /// Everything.
    Record,
}

impl Feature {
    fn name(self) -> &'static str {
        match self {
            Feature::FirstRise => "first rise",
            Feature::EarlyPhase => "phase of the early cycles",
            Feature::LatePhase => "phase of the late cycles",
            Feature::LatePeaks => "heights of the late peaks",
            Feature::Record => "whole record",
        }
    }
}

/// One step: which variables it moves, and by what.
struct Step {
    which: Vec<usize>,
    feature: Feature,
    why: &'static str,
}

/// The steps of a round, in their order; those that would move nothing are left out.
fn steps(problem: &Calibration) -> Vec<Step> {
    let model = problem.model;
    let (pipes, shared) = (model.rig.pipes.len(), model.shared.len());
    let named = |names: &[&str]| -> Vec<usize> {
        (shared..problem.parameters.len())
            .filter(|&j| names.iter().any(|n| problem.parameters[j].name.starts_with(n)))
            .collect()
    };
    let mut at = pipes;
    let (mut compliances, mut times, mut valve, mut others) = (vec![], vec![], vec![], vec![]);
    for (chosen, &size) in model.effects.iter().zip(model.effect_sizes()) {
        for j in at..at + size {
            match problem.parameters[j].unit {
                "1/GPa" => compliances.push(j),
                "s" if chosen.effect.elements().is_some() => times.push(j),
                _ if chosen.effect.name().starts_with("valve-law") => valve.push(j),
                _ => others.push(j),
            }
        }
        at += size;
    }
    let slow = if compliances.len() > 1 { compliances.split_off(compliances.len() - 1) } else { compliances.clone() };
    let closure = [named(&["initial_velocity", "closing_time", "closure_start"]), valve].concat();
    let plan = [
        (
            (0..pipes).collect(),
            Feature::EarlyPhase,
            "the wave speed sets the period before creep has had time to change it",
        ),
        (
            closure,
            Feature::FirstRise,
            "nothing but the closure shapes the pressure before the first reflection is back",
        ),
        (named(&["valve_head", "offset", "friction_scale"]), Feature::Record, "levels before and after the surge"),
        (compliances, Feature::LatePhase, "the quicker elements delay the late cycles most"),
        (slow, Feature::LatePeaks, "the slowest element damps the late peaks most"),
        (times, Feature::Record, "the retardation times share the creep out over the record"),
        (others, Feature::Record, "what else the model has"),
    ];
    let steps = plan.into_iter().map(|(which, feature, why): (Vec<usize>, _, _)| Step { which, feature, why });
    steps.filter(|s| !s.which.is_empty()).collect()
}

/// A feature as a problem of a few variables, the others at rest.
struct Aspect<'p> {
    problem: &'p Calibration<'p>,
    step: &'p Step,
    /// All variables.
    still: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Period with which the step began, s: what is compared stays the same while it moves.
    period_s: f64,
}

impl<'p> Aspect<'p> {
    fn new(problem: &'p Calibration, step: &'p Step, values: &[f64]) -> Self {
        let (lower, upper) = problem.bounds();
        let of = |all: &[f64]| step.which.iter().map(|&j| all[j]).collect();
        Aspect {
            lower: of(lower),
            upper: of(upper),
            still: problem.variables(values),
            period_s: problem.model.period_s(&values[..problem.model.shared.len()]),
            problem,
            step,
        }
    }

    fn start(&self) -> Vec<f64> {
        self.step.which.iter().map(|&j| self.still[j]).collect()
    }

    fn whole(&self, x: &[f64]) -> Vec<f64> {
        let mut all = self.still.clone();
        self.step.which.iter().zip(x).for_each(|(&j, &v)| all[j] = v);
        all
    }

    /// What of measurement and model run `r` shows of the feature.
    fn of_run(&self, r: usize, values: &[f64]) -> Result<Vec<f64>, ModelError> {
        let run = &self.problem.runs[r];
        let traces = self.problem.modelled(r, values, self.problem.window().reaches)?.traces;
        let start = self.problem.closure_start_s(r, values);
        let known_start = run.start.closure_s.0;
        let mut residuals = Vec::new();
        for (s, (sensor, trace)) in run.sensors.iter().zip(&traces).enumerate() {
            let offset = self.problem.offset_m(r, s, values);
            let from = sensor.time_s.partition_point(|&t| t < known_start);
            let to = match self.step.feature {
                Feature::FirstRise => sensor.time_s.partition_point(|&t| t < known_start + 0.5 * self.period_s),
                _ => sensor.time_s.len(),
            };
            let time_s: Vec<f64> = sensor.time_s[from..to].iter().map(|t| t - known_start).collect();
            let model_m: Vec<f64> = sensor.time_s[from..to].iter().map(|t| offset + trace.at(t - start)).collect();
            let measured_m = &sensor.head_m[from..to];
            if self.step.feature == Feature::FirstRise {
                residuals.extend(measured_m.iter().zip(&model_m).map(|(a, b)| (a - b) / sensor.noise_m));
                continue;
            }
            let pair = Pair {
                time_s: &time_s,
                measured_m,
                model_m: &model_m,
                noise_m: sensor.noise_m,
                period_s: self.period_s,
            };
            let found: Vec<_> = run.extrema[s].iter().map(|&(t, c, p)| (t - known_start, c, p)).collect();
            let middle = found.len() / 2;
            let extrema = pair.extrema(&found);
            let late = matches!(self.step.feature, Feature::LatePhase | Feature::LatePeaks);
            let half = if late { &extrema[middle.min(extrema.len())..] } else { &extrema[..middle.min(extrema.len())] };
            let zero_if_lost = |v: f64| if v.is_finite() { v } else { 0.0 };
            residuals.extend(half.iter().map(|e| match self.step.feature {
                Feature::LatePeaks => zero_if_lost((e.model_m - e.measured_m) / sensor.noise_m),
                _ => zero_if_lost(e.phase_s / (PHASE_SHARE * self.period_s)),
            }));
        }
        Ok(residuals)
    }
}

impl Problem for Aspect<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        let all = self.whole(x);
        if self.step.feature == Feature::Record {
            return self.problem.residuals(&all);
        }
        let values = self.problem.values(&all);
        let runs = (0..self.problem.runs.len()).map(|r| self.of_run(r, &values));
        Ok(runs.collect::<Result<Vec<_>, _>>()?.concat())
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    fn difference_step(&self, j: usize) -> f64 {
        self.problem.difference_step(self.step.which[j])
    }
}

impl Fitter<'_> {
    /// A model on the coarse grid, from the starts that the signals and its effects give, and the steps that were taken.
    pub(super) fn stepped(&self, model: &Model) -> Result<(State, Vec<StepTaken>), ModelError> {
        let problem = Calibration::new(model, self.runs, self.window(FIRST_REACHES, f64::INFINITY));
        let n = problem.samples().max(1) as f64;
        let cost = |values: &[f64]| {
            problem.residuals(&problem.variables(values)).map(|r| 0.5 * r.iter().map(|r| r * r).sum::<f64>())
        };
        let over_noise = |cost: f64| (2.0 * cost / n).sqrt();
        let plan = steps(&problem);
        let mut values = problem.values(&problem.start());
        let mut now = cost(&values)?;
        let (mut best, mut taken) = (State { values: values.clone(), cost: now }, Vec::new());
        for round in 1..=ROUNDS {
            let before_round = best.cost;
            for step in &plan {
                if taken.len() >= self.options.most_steps {
                    return Ok((State { values, cost: now }, taken));
                }
                let aspect = Aspect::new(&problem, step, &values);
                let solution = minimise(&aspect, &aspect.start(), LIMITS, |_, _| {})?;
                self.count(solution.evaluations + 1);
                values = problem.values(&aspect.whole(&solution.x));
                let before = now;
                now = cost(&values)?;
                taken.push(StepTaken {
                    round,
                    parameters: step.which.iter().map(|&j| (problem.parameters[j].name.clone(), values[j])).collect(),
                    feature: step.feature.name(),
                    why: step.why,
                    before_over_noise: over_noise(before),
                    after_over_noise: over_noise(now),
                });
                (self.progress)(&Progress {
                    stage: format!("round {round}, {}", step.feature.name()),
                    reaches: problem.window().reaches,
                    iteration: taken.len(),
                    error_over_noise: over_noise(now),
                });
                if now < best.cost {
                    best = State { values: values.clone(), cost: now };
                }
            }
            if best.cost > (1.0 - SETTLED) * before_round {
                break;
            }
        }
        Ok((best, taken))
    }
}
