//! Stepwise calibration: a few parameters at a time, each from the feature of the record that shows it best.
//!
//! The order is that of Tjuatja et al. (2023) as the paper has it: wave speed, closure, creep by the phase and the damping of the late
//! cycles, then all in turn over the whole record until a round gains little. How far a step goes follows from the feature's sensitivity (a
//! Gauss-Newton step). In a valley where parameters stand in for each other steps in turn never quite arrive: the last step moves all together,
//! and is as a descent of least squares from there.
//!
//! A person can follow it, stop it, change a value and go on. Who goes on starts from the values as they are: a feature that has been used is not
//! used again, so that it does not put back what has been changed. Changed values may be out of phase in the late cycles, so the first ones go first.

use std::sync::atomic::Ordering;

use crate::fit::numeric::least_squares::{Limits, Problem, minimise};
use crate::fit::outcome::fit::{Fit, StepTaken};
use crate::fit::problem::feature::{Along, Aspect, Feature};
use crate::fit::problem::fit_problem::Calibration;
use crate::fit::search::calibrate::{FitError, Progress};
use crate::fit::search::coarse_fit::{FIRST_REACHES, Fitter, State};
use crate::fit::search::finish::FINAL_REACHES;
use crate::fit::search::global::keep_seen;
use crate::model::{Model, ModelError};
use crate::valve::curve::{TwoStage, read_back, valve_sensor};

const LIMITS: Limits = Limits { iterations: 12, cost_tolerance: 1e-3, step_tolerance: 1e-6, thorough: false };
/// Most rounds over the features, and over the whole record on each grid.
const FEATURE_ROUNDS: usize = 6;
const ROUNDS: usize = 40;
/// First cycles that a calibration looks at where it goes on from values as they are, in periods: as a fit that locks its phase does.
const FIRST_CYCLES: [f64; 2] = [1.5, 5.0];
/// Relative fall of the sum of squares below which another round is not worth it, over the features and over the record.
const GAINED: f64 = 0.1;
const SETTLED: f64 = 0.003;

/// One step: which variables it moves, and by what.
struct Step {
    which: Vec<usize>,
    feature: Feature,
    why: &'static str,
}

/// The variables of a model, by what a step does with them.
pub(crate) struct Groups {
    wave_speeds: Vec<usize>,
    /// Closing time and start, and the valve's law.
    closure: Vec<usize>,
    velocities: Vec<usize>,
    levels: Vec<usize>,
    friction: Vec<usize>,
    /// Of creep: those of the elements, and their retardation times.
    pub(crate) compliances: Vec<usize>,
    pub(crate) times: Vec<usize>,
    others: Vec<usize>,
}

impl Groups {
    pub(crate) fn of(problem: &Calibration) -> Self {
        let model = problem.model;
        let named = |names: &[&str]| -> Vec<usize> {
            (model.shared.len()..problem.parameters.len())
                .filter(|&j| names.iter().any(|n| problem.parameters[j].name.starts_with(n)))
                .collect()
        };
        let mut groups = Groups {
            wave_speeds: (0..model.rig.pipes.len()).collect(),
            closure: named(&["closing_time", "closure_start"]),
            velocities: named(&["initial_velocity"]),
            levels: named(&["valve_head", "offset"]),
            friction: named(&["friction_scale"]),
            compliances: vec![],
            times: vec![],
            others: vec![],
        };
        let mut at = model.effects_from();
        for (chosen, &size) in model.effects.iter().zip(model.effect_sizes()) {
            for j in at..at + size {
                match problem.parameters[j].unit {
                    "1/GPa" => groups.compliances.push(j),
                    "s" if chosen.effect.elements().is_some() => groups.times.push(j),
                    _ if chosen.effect.name().starts_with("valve-law") => groups.closure.push(j),
                    _ => groups.others.push(j),
                }
            }
            at += size;
        }
        groups
    }

    /// A round over the features.
    fn by_features(&self, problem: &Calibration) -> Vec<Step> {
        let curve = if has_two_stages(problem.model) { self.closure.clone() } else { Vec::new() };
        // What a meter shows is better known than what the rise would say of it while the creep is not.
        let metered = problem.runs.iter().all(|r| r.meter.is_some());
        let rise = if metered { self.closure.clone() } else { [&self.closure[..], &self.velocities].concat() };
        let (quick, slow) = self.compliances.split_at(self.compliances.len().saturating_sub(1));
        let quick = if quick.is_empty() { slow } else { quick };
        let plan = [
            (
                self.wave_speeds.clone(),
                Feature::EarlyPhase,
                "the wave speed sets the period before creep has changed it",
            ),
            (self.levels.clone(), Feature::Steady, "levels stand in the record before anything moves"),
            (curve, Feature::ValveCurve, "two stages nearest to the opening that head and characteristics tell"),
            (rise, Feature::FirstRise, "nothing but the closure shapes the head before the first reflection is back"),
            (quick.to_vec(), Feature::LatePhase, "the quicker elements delay the late cycles most"),
            (slow.to_vec(), Feature::LatePeaks, "the slowest element damps the late peaks most"),
            (self.others.clone(), Feature::Record, "what else the model has"),
        ];
        steps(problem, plan)
    }

    /// A round over all samples of the record, or of its first cycles.
    fn in_turn(&self, problem: &Calibration, seen: Feature) -> Vec<Step> {
        // An element quicker than the closure is not to be told from a softer pipe: the creep takes the wave speed with it.
        let creep = match self.compliances.is_empty() {
            true => vec![],
            false => [&self.wave_speeds[..], &self.compliances, &self.times].concat(),
        };
        let closure = [&self.closure[..], &self.velocities].concat();
        let levels = [&self.levels[..], &self.friction].concat();
        let plan = [
            (self.wave_speeds.clone(), seen, "in turn: the wave speed"),
            (creep, seen, "in turn: the creep; quick creep and wave speed stand in for each other"),
            (closure, seen, "in turn: the valve"),
            (levels, seen, "in turn: levels, and the friction near that of the pipe"),
            (self.others.clone(), seen, "what else the model has"),
        ];
        steps(problem, plan)
    }
}

/// Those of a plan that would move anything: what is held stays.
fn steps<const N: usize>(problem: &Calibration, plan: [(Vec<usize>, Feature, &'static str); N]) -> Vec<Step> {
    let step = |(which, feature, why): (Vec<usize>, _, _)| Step {
        which: which.into_iter().filter(|&j| is_free(problem, j)).collect(),
        feature,
        why,
    };
    plan.into_iter().map(step).filter(|step| !step.which.is_empty()).collect()
}

fn is_free(problem: &Calibration, j: usize) -> bool {
    problem.parameters[j].lower < problem.parameters[j].upper
}

fn has_two_stages(model: &Model) -> bool {
    model.effects.iter().any(|c| c.effect.name() == "valve-law")
}

/// The steps of a stepwise calibration so far, and the features that it had still to use where it was stopped.
pub(crate) struct Walked {
    taken: Vec<StepTaken>,
    features_left: Vec<&'static str>,
}

/// A calibration on its way.
struct Walk<'f> {
    fitter: &'f Fitter<'f>,
    values: Vec<f64>,
    taken: Vec<StepTaken>,
    /// Of the variables, where an element of creep is kept to what a surge shows: one that has vanished shows no way back.
    bounds: (Vec<f64>, Vec<f64>),
}

impl Walk<'_> {
    fn stopped(&self) -> bool {
        self.taken.len() >= self.fitter.options.most_steps
    }

    fn cost(&self, problem: &Calibration) -> Result<f64, ModelError> {
        self.fitter.count(1);
        cost(problem, &problem.variables(&self.values))
    }

    /// Takes the steps of one round.
    fn round(&mut self, problem: &Calibration, plan: &[Step], round: usize) -> Result<(), ModelError> {
        for step in plan {
            if self.stopped() {
                break;
            }
            let before = self.cost(problem)?;
            let moved = match step.feature {
                Feature::ValveCurve => self.by_valve_curve(problem)?,
                _ => {
                    let aspect = Aspect::new(problem, &step.which, step.feature, &self.values, &self.bounds);
                    let solution = minimise(&aspect, &aspect.start(), LIMITS, |_, _| {})?;
                    self.fitter.count(solution.evaluations);
                    aspect.whole(&solution.x)
                }
            };
            self.judge(problem, step, round, before, &moved)?;
        }
        Ok(())
    }

    /// Goes on the way of the last round: wave speed and creep stand in for each other, so that steps in turn go along a valley.
    fn further(&mut self, problem: &Calibration, since: &[f64], round: usize) -> Result<(), ModelError> {
        if self.stopped() {
            return Ok(());
        }
        let before = self.cost(problem)?;
        let from = problem.variables(&self.values);
        let direction: Vec<f64> = from.iter().zip(problem.variables(since)).map(|(now, then)| now - then).collect();
        let which = (0..from.len()).filter(|&j| direction[j] != 0.0).collect();
        let along = Along { problem, from: &from, direction: &direction };
        let solution = minimise(&along, &[0.0], LIMITS, |_, _| {})?;
        self.fitter.count(solution.evaluations);
        let why = "the way that the round went, further: what stands in for each other moves together";
        let step = Step { which, feature: Feature::Record, why };
        self.judge(problem, &step, round, before, &along.whole(solution.x[0]))
    }

    /// Keeps what a step has moved, or takes it back; both are told.
    fn judge(
        &mut self,
        problem: &Calibration,
        step: &Step,
        round: usize,
        before: f64,
        moved: &[f64],
    ) -> Result<(), ModelError> {
        self.fitter.count(1);
        let after = cost(problem, moved).unwrap_or(f64::INFINITY);
        let kept = after <= before;
        let values = problem.values(moved);
        let over_noise = |cost: f64| (2.0 * cost / problem.samples().max(1) as f64).sqrt();
        self.taken.push(StepTaken {
            round,
            parameters: step.which.iter().map(|&j| (problem.parameters[j].name.clone(), values[j])).collect(),
            feature: step.feature.name(),
            why: step.why,
            before_over_noise: over_noise(before),
            after_over_noise: over_noise(after),
            kept,
        });
        if kept {
            self.values = values;
        }
        (self.fitter.progress)(&Progress {
            stage: format!("round {round}, {}", step.feature.name()),
            reaches: problem.window().reaches,
            iteration: self.taken.len(),
            error_over_noise: over_noise(if kept { after } else { before }),
        });
        Ok(())
    }

    /// All variables with the law and closing time that lie nearest to the openings that each run's head at the valve tells; unchanged
    /// where no sensor stands there. What the runs share is their mean.
    fn by_valve_curve(&self, problem: &Calibration) -> Result<Vec<f64>, ModelError> {
        let mut values = self.values.clone();
        let mut laws = Vec::new();
        for (r, run) in problem.runs.iter().enumerate() {
            let Ok(sensor) = valve_sensor(self.fitter.rig, run) else { continue };
            self.fitter.count(1);
            let curve = read_back(problem, r, &self.values, sensor, problem.window().reaches)?;
            let law = TwoStage::nearest(&curve, problem.run_values(r, &self.values).closing_time_s);
            if law.rms.is_finite() {
                values[problem.closing_time_variable(r)] = law.closing_s;
                laws.push(law);
            }
        }
        let mean = |of: &dyn Fn(&TwoStage) -> f64| laws.iter().map(of).sum::<f64>() / laws.len() as f64;
        for (value, parameter) in values.iter_mut().zip(&problem.parameters).filter(|_| !laws.is_empty()) {
            match parameter.name.as_str() {
                "inflection_time_fraction" => *value = mean(&|l| l.inflection_s / l.closing_s),
                "inflection_opening" => *value = mean(&|l| l.inflection_opening),
                _ => {}
            }
            *value = value.clamp(parameter.lower, parameter.upper);
        }
        Ok(problem.variables(&values))
    }
}

/// Half the sum of squares over the whole record.
fn cost(problem: &Calibration, x: &[f64]) -> Result<f64, ModelError> {
    problem.residuals(x).map(|r| 0.5 * r.iter().map(|r| r * r).sum::<f64>())
}

impl Fitter<'_> {
    /// A model from the starts that the signals, its effects and what is known beforehand give, and the steps that were taken: by features on a
    /// coarse grid, then by the whole record there and on a fine one.
    pub(crate) fn stepped(&self, model: &Model) -> Result<(State, Walked), ModelError> {
        let coarse = Calibration::new(model, self.runs, self.window(FIRST_REACHES, f64::INFINITY));
        let groups = Groups::of(&coarse);
        let mut by_features = groups.by_features(&coarse);
        if let Some(left) = &self.options.features_left {
            by_features.retain(|step| left.iter().any(|name| name == step.feature.name()));
        }
        let goes_on = self.options.features_left.is_some();
        let values = coarse.values(&coarse.start());
        let (mut lower, mut upper) = (coarse.bounds().0.to_vec(), coarse.bounds().1.to_vec());
        let period_s = model.period_s(&values[..model.shared.len()]);
        keep_seen(&mut lower, &mut upper, &groups, period_s);
        let mut walk = Walk { fitter: self, values, taken: Vec::new(), bounds: (lower, upper) };
        let mut round = 0;
        let mut rounds = |walk: &mut Walk, problem: &Calibration, plan: &[Step], most: usize, worth: f64, on: bool| {
            for _ in 0..most {
                let (before, since) = (walk.cost(problem)?, walk.values.clone());
                round += 1;
                walk.round(problem, plan, round)?;
                if on {
                    walk.further(problem, &since, round)?;
                }
                if walk.stopped() || walk.cost(problem)? > (1.0 - worth) * before {
                    break;
                }
            }
            Ok::<(), ModelError>(())
        };
        if !by_features.is_empty() {
            rounds(&mut walk, &coarse, &by_features, if goes_on { 1 } else { FEATURE_ROUNDS }, GAINED, false)?;
        }
        for periods in FIRST_CYCLES.into_iter().filter(|_| goes_on) {
            let first = Calibration::new(model, self.runs, self.window(FIRST_REACHES, periods * period_s));
            rounds(&mut walk, &first, &groups.in_turn(&first, Feature::FirstCycles), FEATURE_ROUNDS, GAINED, false)?;
        }
        rounds(&mut walk, &coarse, &groups.in_turn(&coarse, Feature::Record), ROUNDS, SETTLED, true)?;
        let reaches = model.fitting_reaches(&walk.values[..model.shared.len()], 2 * FINAL_REACHES);
        let fine = Calibration::new(model, self.runs, self.window(reaches, f64::INFINITY));
        rounds(&mut walk, &fine, &groups.in_turn(&fine, Feature::Record), ROUNDS, SETTLED, true)?;
        let cost = walk.cost(&coarse)?;
        let mut features_left: Vec<&str> = by_features.iter().map(|step| step.feature.name()).collect();
        features_left
            .retain(|name| *name != Feature::Record.name() && walk.taken.iter().all(|step| step.feature != *name));
        Ok((State { values: walk.values, cost }, Walked { taken: walk.taken, features_left }))
    }

    /// The end of a stepwise calibration: the last step, where there is one left to take, and the fit.
    pub(crate) fn ended(&self, model: &Model, state: State, walked: Walked) -> Result<Fit, FitError> {
        let Walked { taken: mut steps, features_left } = walked;
        if steps.len() >= self.options.most_steps {
            return Ok(Fit { steps, features_left, ..self.as_found(model, state)? });
        }
        let start = state.values.clone();
        let fit = self.finish(model, state)?;
        let problem = Calibration::new(model, self.runs, self.whole(fit.reaches));
        let over_noise = |values: &[f64]| {
            let cost = cost(&problem, &problem.variables(values))?;
            Ok::<f64, ModelError>((2.0 * cost / problem.samples().max(1) as f64).sqrt())
        };
        let free = fit.parameters.iter().filter(|p| !p.held);
        steps.push(StepTaken {
            round: steps.last().map_or(1, |step| step.round + 1),
            parameters: free.map(|p| (p.name.clone(), p.value)).collect(),
            feature: Feature::Record.name(),
            why: "all together: what stands in for each other arrives together only; steps in turn come near",
            before_over_noise: over_noise(&start)?,
            after_over_noise: over_noise(&fit.values())?,
            kept: true,
        });
        self.count(2);
        Ok(Fit { steps, evaluations: self.evaluations.load(Ordering::Relaxed), ..fit })
    }
}
