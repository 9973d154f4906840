//! Stepwise calibration: a few parameters at a time, each from the feature of the record that shows it best.
//!
//! The order is that of Tjuatja et al. (2023) as the paper has it: wave speed, closure, creep by the phase and the
//! damping of the late cycles, then all in turn over the whole record until a round gains little. The length of a step
//! follows from the feature's sensitivity (a Gauss-Newton step). In a valley where parameters stand in for each other,
//! steps in turn never quite arrive. So the last step moves all together: it is a descent of least squares from there.
//!
//! A person can follow it, stop it, change a value and go on. It then goes on from the given values: a feature that has
//! been used is not used again, so that it does not undo the change. Changed values may be out of phase in the late
//! cycles, so the first cycles come first.

use std::sync::atomic::Ordering;

use crate::fit::numeric::least_squares::{Limits, Problem, minimise};
use crate::fit::outcome::fit::{Fit, StepTaken};
use crate::fit::problem::error::FitError;
use crate::fit::problem::feature::{DirectionProblem, Feature, FeatureProblem};
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::problem::groups::Groups;
use crate::fit::problem::valve_curve::{TwoStage, read_back, valve_sensor};
use crate::fit::progress::Progress;
use crate::fit::search::calibrator::{Calibrator, Estimate};
use crate::fit::search::finish::{finish, without_descent};
use crate::fit::search::thresholds::{COARSE, COARSE_REACHES, FINAL_REACHES, LOCKING, LOCKING_PERIODS, SCREENING};
use crate::model::{Model, ModelError};

/// One step: which variables it moves, and by what.
struct Step {
    which: Vec<usize>,
    feature: Feature,
    why: &'static str,
}

/// A round over the features.
fn by_features(groups: &Groups, problem: &FitProblem) -> Vec<Step> {
    let curve = if has_two_stages(problem.model) { groups.closure.clone() } else { Vec::new() };
    // A meter shows the velocity better than the first rise does while the creep is unknown.
    let metered = problem.runs.iter().all(|r| r.meter.is_some());
    let rise = if metered { groups.closure.clone() } else { [&groups.closure[..], &groups.velocities].concat() };
    let (quick, slow) = groups.compliances.split_at(groups.compliances.len().saturating_sub(1));
    let quick = if quick.is_empty() { slow } else { quick };
    let plan = [
        (groups.wave_speeds.clone(), Feature::EarlyPhase, "the wave speed sets the period before creep has changed it"),
        (groups.levels.clone(), Feature::Steady, "the record shows levels before anything moves"),
        (curve, Feature::ValveCurve, "the two stages nearest to the opening that head and characteristics give"),
        (rise, Feature::FirstRise, "nothing but the closure shapes the head before the first reflection is back"),
        (quick.to_vec(), Feature::LatePhase, "the quicker elements delay the late cycles most"),
        (slow.to_vec(), Feature::LatePeaks, "the slowest element damps the late peaks most"),
        (groups.others.clone(), Feature::Record, "everything else in the model"),
    ];
    steps(problem, plan)
}

/// A round over all samples of the record, or of its first cycles.
fn in_turn(groups: &Groups, problem: &FitProblem, seen: Feature) -> Vec<Step> {
    // An element quicker than the closure looks like a softer pipe: so the creep takes the wave speed with it.
    let creep = match groups.compliances.is_empty() {
        true => vec![],
        false => [&groups.wave_speeds[..], &groups.compliances, &groups.times].concat(),
    };
    let closure = [&groups.closure[..], &groups.velocities].concat();
    let levels = [&groups.levels[..], &groups.friction].concat();
    let plan = [
        (groups.wave_speeds.clone(), seen, "in turn: the wave speed"),
        (creep, seen, "in turn: the creep; quick creep and wave speed stand in for each other"),
        (closure, seen, "in turn: the valve"),
        (levels, seen, "in turn: levels, and the friction near that of the pipe"),
        (groups.others.clone(), seen, "everything else in the model"),
    ];
    steps(problem, plan)
}

/// The steps of a plan that move anything; held variables stay.
fn steps<const N: usize>(problem: &FitProblem, plan: [(Vec<usize>, Feature, &'static str); N]) -> Vec<Step> {
    let step = |(which, feature, why): (Vec<usize>, _, _)| Step {
        which: which.into_iter().filter(|&j| is_free(problem, j)).collect(),
        feature,
        why,
    };
    plan.into_iter().map(step).filter(|step| !step.which.is_empty()).collect()
}

fn is_free(problem: &FitProblem, j: usize) -> bool {
    problem.parameters[j].lower < problem.parameters[j].upper
}

fn has_two_stages(model: &Model) -> bool {
    model.effects.iter().any(|c| c.effect.name() == "valve-law" && c.valve(model.rig) == model.rig.graph.valve)
}

/// The steps of a stepwise calibration so far, and the features that were still to be used when it stopped.
pub(crate) struct StepwiseRecord {
    taken: Vec<StepTaken>,
    features_left: Vec<&'static str>,
}

/// A stepwise calibration on its way.
struct StepwiseWalk<'f> {
    ctx: &'f Calibrator<'f>,
    values: Vec<f64>,
    taken: Vec<StepTaken>,
    /// Of the variables; elements of creep stay where a surge shows them, for one that has vanished has no slope to
    /// come back by.
    bounds: (Vec<f64>, Vec<f64>),
}

impl StepwiseWalk<'_> {
    fn stopped(&self) -> bool {
        self.taken.len() >= self.ctx.options.most_steps
    }

    fn cost(&self, problem: &FitProblem) -> Result<f64, ModelError> {
        self.ctx.count(1);
        cost(problem, &problem.variables(&self.values))
    }

    /// Takes the steps of one round.
    fn round(&mut self, problem: &FitProblem, plan: &[Step], round: usize) -> Result<(), ModelError> {
        for step in plan {
            if self.stopped() {
                break;
            }
            let before = self.cost(problem)?;
            let moved = match step.feature {
                Feature::ValveCurve => self.by_valve_curve(problem)?,
                _ => {
                    let aspect = FeatureProblem::new(problem, &step.which, step.feature, &self.values, &self.bounds);
                    let solution = minimise(&aspect, &aspect.start(), COARSE, |_, _| {})?;
                    self.ctx.count(solution.evaluations);
                    aspect.whole(&solution.x)
                }
            };
            self.judge(problem, step, round, before, &moved)?;
        }
        Ok(())
    }

    /// Goes further in the direction of the last round: wave speed and creep stand in for each other, so steps in turn
    /// follow a valley.
    fn further(&mut self, problem: &FitProblem, since: &[f64], round: usize) -> Result<(), ModelError> {
        if self.stopped() {
            return Ok(());
        }
        let before = self.cost(problem)?;
        let from = problem.variables(&self.values);
        let direction: Vec<f64> = from.iter().zip(problem.variables(since)).map(|(now, then)| now - then).collect();
        let which = (0..from.len()).filter(|&j| direction[j] != 0.0).collect();
        let along = DirectionProblem { problem, from: &from, direction: &direction };
        let solution = minimise(&along, &[0.0], COARSE, |_, _| {})?;
        self.ctx.count(solution.evaluations);
        let why = "the direction of the round, further: parameters that stand in for each other move together";
        let step = Step { which, feature: Feature::Record, why };
        self.judge(problem, &step, round, before, &along.whole(solution.x[0]))
    }

    /// Keeps what a step has moved, or takes it back; records either.
    fn judge(
        &mut self,
        problem: &FitProblem,
        step: &Step,
        round: usize,
        before: f64,
        moved: &[f64],
    ) -> Result<(), ModelError> {
        self.ctx.count(1);
        let after = cost(problem, moved).unwrap_or(f64::INFINITY);
        let kept = after <= before;
        let values = problem.values(moved);
        let over_noise = |cost: f64| (2.0 * cost / problem.samples().max(1) as f64).sqrt();
        self.taken.push(StepTaken {
            round,
            parameters: step.which.iter().map(|&j| (problem.parameters[j].name.clone(), values[j])).collect(),
            feature: step.feature.name().to_owned(),
            why: step.why.to_owned(),
            before_over_noise: over_noise(before),
            after_over_noise: over_noise(after),
            kept,
        });
        if kept {
            self.values = values;
        }
        (self.ctx.progress)(&Progress::fitting(
            format!("round {round}, {}", step.feature.name()),
            problem.window().reaches,
            self.taken.len(),
            over_noise(if kept { after } else { before }),
        ));
        Ok(())
    }

    /// All variables, with the law and closing time nearest to the openings read back from each run's head at the
    /// valve; unchanged where no sensor stands there. A shared parameter takes the mean over the runs.
    fn by_valve_curve(&self, problem: &FitProblem) -> Result<Vec<f64>, ModelError> {
        let mut values = self.values.clone();
        let mut laws = Vec::new();
        for (r, run) in problem.runs.iter().enumerate() {
            let Ok(sensor) = valve_sensor(self.ctx.rig, run) else { continue };
            self.ctx.count(1);
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
fn cost(problem: &FitProblem, x: &[f64]) -> Result<f64, ModelError> {
    problem.residuals(x).map(|r| 0.5 * r.iter().map(|r| r * r).sum::<f64>())
}

/// Fits a model from its starts, and records the steps: by features on a
/// coarse grid, then by the whole record there and on a fine one.
pub(crate) fn stepwise(ctx: &Calibrator, model: &Model) -> Result<(Estimate, StepwiseRecord), ModelError> {
    let coarse = FitProblem::new(model, ctx.runs, ctx.window(COARSE_REACHES, f64::INFINITY));
    let groups = Groups::of(&coarse);
    let mut by_features = by_features(&groups, &coarse);
    if let Some(left) = &ctx.options.features_left {
        by_features.retain(|step| left.iter().any(|name| name == step.feature.name()));
    }
    let goes_on = ctx.options.features_left.is_some();
    let values = coarse.values(&coarse.start());
    let (mut lower, mut upper) = (coarse.bounds().0.to_vec(), coarse.bounds().1.to_vec());
    let period_s = model.period_s(&values[..model.shared.len()]);
    groups.keep_visible(&mut lower, &mut upper, period_s);
    let mut walk = StepwiseWalk { ctx, values, taken: Vec::new(), bounds: (lower, upper) };
    let mut round = 0;
    let mut rounds = |walk: &mut StepwiseWalk, problem: &FitProblem, plan: &[Step], limits: Limits, on: bool| {
        for _ in 0..limits.iterations {
            let (before, since) = (walk.cost(problem)?, walk.values.clone());
            round += 1;
            walk.round(problem, plan, round)?;
            if on {
                walk.further(problem, &since, round)?;
            }
            if walk.stopped() || walk.cost(problem)? > (1.0 - limits.cost_tolerance) * before {
                break;
            }
        }
        Ok::<(), ModelError>(())
    };
    if !by_features.is_empty() {
        let once = Limits { iterations: 1, ..SCREENING };
        rounds(&mut walk, &coarse, &by_features, if goes_on { once } else { SCREENING }, false)?;
    }
    for periods in LOCKING_PERIODS.into_iter().filter(|_| goes_on) {
        let first = FitProblem::new(model, ctx.runs, ctx.window(COARSE_REACHES, periods * period_s));
        rounds(&mut walk, &first, &in_turn(&groups, &first, Feature::FirstCycles), SCREENING, false)?;
    }
    rounds(&mut walk, &coarse, &in_turn(&groups, &coarse, Feature::Record), LOCKING, true)?;
    let reaches = model.fitting_reaches(&walk.values[..model.shared.len()], 2 * FINAL_REACHES);
    let fine = FitProblem::new(model, ctx.runs, ctx.window(reaches, f64::INFINITY));
    rounds(&mut walk, &fine, &in_turn(&groups, &fine, Feature::Record), LOCKING, true)?;
    let cost = walk.cost(&coarse)?;
    let mut features_left: Vec<&str> = by_features.iter().map(|step| step.feature.name()).collect();
    features_left.retain(|name| *name != Feature::Record.name() && walk.taken.iter().all(|step| step.feature != *name));
    Ok((Estimate { cost, ..Estimate::unseen(walk.values) }, StepwiseRecord { taken: walk.taken, features_left }))
}

/// The end of a stepwise calibration: the last step, where one is left, and the fit.
pub(crate) fn conclude(
    ctx: &Calibrator,
    model: &Model,
    state: Estimate,
    record: StepwiseRecord,
) -> Result<Fit, FitError> {
    let StepwiseRecord { taken: mut steps, features_left } = record;
    if steps.len() >= ctx.options.most_steps {
        return Ok(Fit { steps, features_left, ..without_descent(ctx, model, state)? });
    }
    let start = state.values.clone();
    let fit = finish(ctx, model, state)?;
    let problem = FitProblem::new(model, ctx.runs, ctx.whole(fit.reaches));
    let over_noise = |values: &[f64]| {
        let cost = cost(&problem, &problem.variables(values))?;
        Ok::<f64, ModelError>((2.0 * cost / problem.samples().max(1) as f64).sqrt())
    };
    let free = fit.parameters.iter().filter(|p| !p.held);
    steps.push(StepTaken {
        round: steps.last().map_or(1, |step| step.round + 1),
        parameters: free.map(|p| (p.name.clone(), p.value)).collect(),
        feature: Feature::Record.name().to_owned(),
        why: "all together: parameters that stand in for each other arrive only together; steps in turn come near"
            .to_owned(),
        before_over_noise: over_noise(&start)?,
        after_over_noise: over_noise(&fit.values())?,
        kept: true,
    });
    ctx.count(2);
    Ok(Fit { steps, evaluations: ctx.evaluations.load(Ordering::Relaxed), ..fit })
}
