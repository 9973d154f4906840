//! How the valve of a fitted run closed, from the head measured before it, and how well simple laws describe that
//! curve.

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::valve_curve::{TwoStage, effective_closing_s, read_back, valve_sensor};
use crate::model::Model;
use crate::model::effects::{Chosen, parse_list};
use crate::model::valve_from_head::ValveCurve;
use crate::rig::Rig;
use crate::valve::shift::{LawErrors, Shift, errors_of, shifts_of};
use crate::valve::thresholds::LAW_SHARE;

/// The valve of one run.
#[derive(Debug, Clone)]
pub struct ValveClosure {
    /// The run's file.
    pub file: String,
    /// The sensor whose head drives the line.
    pub sensor: String,
    /// The curve, from the start of the closure on.
    pub curve: ValveCurve,
    /// The fitted model's closing time, s.
    pub fitted_closing_s: f64,
    /// The time from nine tenths of the opening to one tenth, extended to the whole, s; none where the curve does not
    /// pass both.
    pub effective_closing_s: Option<f64>,
    /// Opening in two linear stages nearest to the curve.
    pub two_stage: TwoStage,
    /// The error of each law against the measured head.
    pub errors: LawErrors,
    /// The curve again with other wave speeds and creep.
    pub shifts: Vec<Shift>,
}

/// The effect whose law a valve may follow instead of the linear one.
const LAW: &str = "valve-law";

/// A fit whose valve closes by the law that the records support.
#[derive(Debug, Clone)]
pub struct ValveLawChoice {
    /// The fit.
    pub fit: Fit,
    /// Evidence for two stages over a straight line, as a fall of BIC; none where the given effects decide the law.
    pub evidence: Option<f64>,
    /// Whether two stages were taken: strong evidence, and most of what a straight line left beyond the noise.
    pub two_stages: bool,
}

/// The fit of some effects with a linear valve, or with two stages where these remove most of its error; as given where
/// a law is among the effects, or one that excludes it. `fitted` fits.
///
/// # Errors
/// As `fitted`.
pub fn choose_valve_law<E>(
    rig: &Rig,
    effects: &[Chosen],
    fitted: impl Fn(&[Chosen]) -> Result<Fit, E>,
) -> Result<ValveLawChoice, E> {
    let linear = fitted(effects)?;
    let settles =
        |c: &Chosen| c.effect.name().starts_with(LAW) || c.effect.excludes().iter().any(|(name, _)| *name == LAW);
    if effects.iter().any(settles) {
        return Ok(ValveLawChoice { fit: linear, evidence: None, two_stages: false });
    }
    let valves = rig.graph.closing_valves();
    // The command reads the valve that closes first.
    let at_first = |law: Chosen| if valves.len() > 1 { law.at_valve(valves[0]) } else { law };
    let law: Vec<Chosen> = parse_list(LAW).unwrap_or_default().into_iter().map(at_first).collect();
    let staged = fitted(&[&linear.effects[..], &law].concat())?;
    let evidence = staged.evidence_over(&linear);
    // Any law of the valve improves the fit of a pipe that lacks something a little.
    let beyond_noise = |fit: &Fit| {
        let (rmse_m, noise_m) = fit.pooled();
        (rmse_m.powi(2) - noise_m.powi(2)).max(0.0)
    };
    let two_stages = evidence > STRONG_EVIDENCE && beyond_noise(&staged) <= LAW_SHARE * beyond_noise(&linear);
    Ok(ValveLawChoice { fit: if two_stages { staged } else { linear }, evidence: Some(evidence), two_stages })
}

/// The closure of run `r` of a fit, simulated up to the valve by the fit's model with the measured head at its end.
///
/// # Errors
/// No run `r`, no sensor at the valve, or what [`crate::model::valve_from_head::valve_from_head`] refuses.
pub fn closure_of(rig: &Rig, runs: &[RunData], fit: &Fit, r: usize) -> Result<ValveClosure, FitError> {
    let run = runs.get(r).ok_or(FitError::NoRun)?;
    let at_valve = valve_sensor(rig, run)?;
    let model = Model::new(rig, &run.conditions.water, &fit.effects);
    let window = Window { reaches: fit.reaches, horizon_s: f64::INFINITY, stride: 1 };
    let problem = FitProblem::new(&model, runs, window);
    let values = fit.values();
    let own = problem.run_values(r, &values);
    let sensor = &run.sensors[at_valve];
    let curve = read_back(&problem, r, &values, at_valve, fit.reaches)?;
    let two_stage = TwoStage::nearest(&curve, own.closing_time_s);
    Ok(ValveClosure {
        file: run.file.clone(),
        sensor: sensor.sensor.name.clone(),
        fitted_closing_s: own.closing_time_s,
        effective_closing_s: effective_closing_s(&curve),
        errors: errors_of(&problem, r, &values, at_valve, fit.reaches, (&curve, &two_stage))?,
        shifts: shifts_of(&problem, r, fit, at_valve, &curve)?,
        two_stage,
        curve,
    })
}
