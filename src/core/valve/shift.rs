//! How much a valve's curve, read back from the head before it, depends on the model of the pipe, and how well it
//! describes the head.
//!
//! The curve follows from the measured head by the characteristics of the fitted pipe: another wave speed or creep
//! gives another curve from the same record. A law of two stages can follow such errors with three numbers, the curve
//! with one for each time step.

use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::problem::groups::Groups;
use crate::fit::problem::valve_curve::{TwoStage, effective_closing_s, read_back};
use crate::model::valve_from_head::{ValveCurve, head_from_valve};
use crate::model::{Resolution, RunValues};
use crate::valve::thresholds::{CREEP_CHANGE, WAVE_SPEED_CHANGE};

/// The error of a law of the valve against the measured head before it, rms, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawError {
    /// From the start of the closure until the first reflection is back (half a period).
    pub first_rise_m: f64,
    /// Over the whole record.
    pub record_m: f64,
}

/// The errors of several laws, with the rest of the model as fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawErrors {
    /// The fitted model's own.
    pub fitted: LawError,
    /// The two stages nearest to the curve.
    pub two_stage: LawError,
    /// The curve itself.
    pub curve: LawError,
}

/// The curve with something of the pipe changed.
#[derive(Debug, Clone)]
pub struct Shift {
    /// The change, as `wave speed +2%`.
    pub what: String,
    /// The curve then.
    pub curve: ValveCurve,
    /// Largest change of the opening up to the fitted closing time.
    pub largest: f64,
    /// Root mean square of that change.
    pub rms: f64,
    /// See [`crate::valve::curve::ValveClosure::effective_closing_s`].
    pub effective_closing_s: Option<f64>,
    /// The two stages nearest to the curve.
    pub two_stage: TwoStage,
}

/// Reads the curve back again with wave speeds changed by 2% and by their standard errors, and with the creep changed
/// by 20% and left out, where the model has any.
///
/// # Errors
/// As [`read_back`]: the changed model cannot be simulated.
pub(crate) fn shifts_of(
    problem: &FitProblem,
    r: usize,
    fit: &Fit,
    sensor: usize,
    base: &ValveCurve,
) -> Result<Vec<Shift>, FitError> {
    let values = fit.values();
    let closing_s = problem.run_values(r, &values).closing_time_s;
    let pipes = problem.model.effects_from();
    let creep = Groups::of(problem).compliances;
    let percent = |share: f64| format!("{:+.0}%", 100.0 * share);
    let mut changes: Vec<(String, Vec<f64>)> = Vec::new();
    for share in [-WAVE_SPEED_CHANGE, WAVE_SPEED_CHANGE] {
        let changed = values.iter().enumerate().map(|(j, v)| if j < pipes { v * (1.0 + share) } else { *v });
        changes.push((format!("wave speed {}", percent(share)), changed.collect()));
    }
    for sign in [-1.0, 1.0] {
        let error = |j: usize| Some(fit.parameters[j].standard_error()).filter(|e| e.is_finite() && j < pipes);
        let changed = values.iter().enumerate().map(|(j, v)| v + sign * error(j).unwrap_or(0.0));
        changes
            .push((format!("wave speed {} standard error", if sign < 0.0 { "-1" } else { "+1" }), changed.collect()));
    }
    // Almost none: the least compliance that a fit may take.
    let least = |j: usize| problem.parameters[j].lower.min(1e-3 * values[j]);
    let scaled = |share: Option<f64>| -> Vec<f64> {
        let of = |j: usize| share.map_or_else(|| least(j), |share| values[j] * (1.0 + share));
        values.iter().enumerate().map(|(j, v)| if creep.contains(&j) { of(j) } else { *v }).collect()
    };
    if !creep.is_empty() {
        changes.extend(
            [-CREEP_CHANGE, CREEP_CHANGE].map(|share| (format!("creep {}", percent(share)), scaled(Some(share)))),
        );
        changes.push(("creep left out".to_owned(), scaled(None)));
    }
    let shift = |(what, changed): (String, Vec<f64>)| {
        let curve = read_back(problem, r, &changed, sensor, fit.reaches)?;
        let differences: Vec<f64> = curve
            .time_s
            .iter()
            .zip(&curve.opening)
            .filter(|(t, _)| **t <= closing_s)
            .map(|(&t, opening)| opening - opening_at(base, t))
            .filter(|d| d.is_finite())
            .collect();
        let square = differences.iter().map(|d| d * d).sum::<f64>() / differences.len().max(1) as f64;
        Ok(Shift {
            what,
            largest: differences.iter().fold(0.0, |m, d| d.abs().max(m)),
            rms: square.sqrt(),
            effective_closing_s: effective_closing_s(&curve),
            two_stage: TwoStage::nearest(&curve, closing_s),
            curve,
        })
    };
    changes.into_iter().map(shift).collect()
}

/// The errors of the laws against the head of the sensor at the valve in run `r`.
///
/// # Errors
/// As [`crate::model::Model::simulate`].
pub(crate) fn errors_of(
    problem: &FitProblem,
    r: usize,
    values: &[f64],
    sensor: usize,
    reaches: usize,
    (curve, two_stage): (&ValveCurve, &TwoStage),
) -> Result<LawErrors, FitError> {
    let run = &problem.runs[r];
    let own = problem.run_values(r, values);
    let shared = &values[..problem.model.shared.len()];
    let seen = &run.sensors[sensor];
    let (start, offset) = (problem.closure_start_s(r, values), problem.offset_m(r, sensor, values));
    let half_period_s = 0.5 * problem.model.period_s(shared);
    let duration_s = seen.time_s.last().map_or(0.0, |t| t - start);
    let left = |at: &dyn Fn(f64) -> f64| {
        let within = |most_s: f64| {
            let samples = seen.time_s.iter().zip(&seen.head_m).map(|(t, h)| (t - start, h - offset));
            let squares = samples.filter(|(t, _)| (0.0..=most_s).contains(t)).map(|(t, h)| (h - at(t)).powi(2));
            let (sum, n) = squares.fold((0.0, 0usize), |(sum, n), square| (sum + square, n + 1));
            (sum / n.max(1) as f64).sqrt()
        };
        LawError { first_rise_m: within(half_period_s), record_m: within(f64::INFINITY) }
    };
    let closing_by = |closing_time_s: f64, law: Box<dyn Fn(f64) -> f64 + Send>| {
        let run_values = RunValues { closing_time_s, ..own };
        let resolution = Resolution { reaches, duration_s };
        let trace =
            head_from_valve(problem.model, &run.conditions, shared, &run_values, resolution, seen.sensor.place(), law)?;
        let trace = problem.model.sensed(shared, &seen.sensor, trace)?;
        Ok::<_, FitError>(left(&|t| trace.at(t)))
    };
    let modelled = problem.modelled(r, values, reaches)?.traces;
    // As the line was driven: the valve is closed where the curve ends.
    let ends_s = curve.time_s.last().copied().unwrap_or(0.0);
    let (known, law) = (curve.clone(), *two_stage);
    Ok(LawErrors {
        fitted: left(&|t| modelled[sensor].at(t)),
        two_stage: closing_by(law.closing_s, Box::new(move |s| law.opening(s * law.closing_s)))?,
        curve: closing_by(ends_s, Box::new(move |s| if s < 1.0 { opening_at(&known, s * ends_s) } else { 0.0 }))?,
    })
}

/// The curve's opening, linear between its points; where it is not known, that of the point before.
fn opening_at(curve: &ValveCurve, time_s: f64) -> f64 {
    let next = curve.time_s.partition_point(|t| *t <= time_s);
    let known = |i: usize| curve.opening[..=i].iter().rev().find(|o| o.is_finite()).copied().unwrap_or(1.0);
    match next {
        0 => 1.0,
        i if i == curve.time_s.len() => known(i - 1),
        i => {
            let (t0, t1) = (curve.time_s[i - 1], curve.time_s[i]);
            known(i - 1) + (known(i) - known(i - 1)) * (time_s - t0) / (t1 - t0)
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::fit::data::run_data::RunData;
    use crate::fit::problem::method::Method;
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::fit::search::calibrate::calibrate;
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;
    use crate::valve::curve::{choose_valve_law, closure_of};

    const RUN: RunValues =
        RunValues { initial_velocity_m_s: 0.5, valve_head_m: 30.0, closing_time_s: 0.12, friction_scale: 1.0 };
    /// Wave speed, creep, inflection.
    const TRUTH: [f64; 5] = [380.0, 0.12, 0.05, 0.4, 0.2];

    /// From a record whose valve closes in two known stages in a pipe that creeps, the curve, its two stages and their
    /// times come back; a wrong wave speed or creep moves them, the worse the more it is off.
    #[test]
    fn a_known_law_comes_back_and_owes_to_wave_speed_and_creep_what_is_said() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let effects = parse_list("viscoelastic-wall:1,valve-law").unwrap();
        let runs = [record(&rig, &effects, &TRUTH, RUN, 0.01, 6.0)];
        let fit = calibrate(&rig, &runs, &effects, &Options::default(), &|_| {}).unwrap();
        let closure = closure_of(&rig, &runs, &fit, 0).unwrap();
        let law = closure.two_stage;
        assert!((law.inflection_s / (0.4 * 0.12) - 1.0).abs() < 0.03, "{law:?}");
        assert!((law.inflection_opening - 0.2).abs() < 0.01 && (law.closing_s / 0.12 - 1.0).abs() < 0.03, "{law:?}");
        let of = |what: &str| closure.shifts.iter().find(|s| s.what == what).unwrap();
        let (by_two, by_error) = (of("wave speed +2%").largest, of("wave speed +1 standard error").largest);
        assert!(by_error < 0.5 * by_two && by_two > 0.01, "{by_error} {by_two}");
        // V falls by g ΔH/a: a wave speed 2% higher leaves 2% of the velocity to a valve that is shut.
        let moved = of("wave speed +2%");
        let shut = moved.curve.time_s.iter().position(|t| *t >= RUN.closing_time_s).unwrap();
        let left = moved.curve.velocity_m_s[shut] / RUN.initial_velocity_m_s;
        assert!((left / 0.02 - 1.0).abs() < 0.2, "{left}");
        assert!(of("creep left out").largest > 2.0 * of("creep -20%").largest);
        assert!(of("creep -20%").largest > 0.003, "{}", of("creep -20%").largest);
        let errors = closure.errors;
        assert!(errors.two_stage.first_rise_m < 0.05 && errors.fitted.first_rise_m < 0.03, "{errors:?}");
        assert!(errors.curve.first_rise_m < 0.05 && errors.curve.record_m < 0.1, "{errors:?}");
    }

    /// The curve and its two stages remove the linear model's error in the first rise.
    #[test]
    fn where_the_fitted_law_is_wrong_the_curve_and_its_stages_are_better() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let runs = [record(&rig, &parse_list("viscoelastic-wall:1,valve-law").unwrap(), &TRUTH, RUN, 0.01, 6.0)];
        let effects = parse_list("viscoelastic-wall:1").unwrap();
        let fit = calibrate(&rig, &runs, &effects, &Options::default(), &|_| {}).unwrap();
        let errors = closure_of(&rig, &runs, &fit, 0).unwrap().errors;
        assert!(errors.fitted.first_rise_m > 0.1, "{errors:?}");
        assert!(errors.curve.first_rise_m < 0.5 * errors.fitted.first_rise_m, "{errors:?}");
    }

    /// Without a word about the valve: a closure in two stages gets their law, a linear one does not.
    #[test]
    fn the_record_says_by_which_law_the_valve_closes() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let pipe = parse_list("viscoelastic-wall:1").unwrap();
        let lawful = |runs: &[RunData]| {
            choose_valve_law(&rig, &pipe, |effects| calibrate(&rig, runs, effects, &Options::default(), &|_| {}))
                .unwrap()
        };
        let staged = [record(&rig, &parse_list("viscoelastic-wall:1,valve-law").unwrap(), &TRUTH, RUN, 0.01, 6.0)];
        let found = lawful(&staged);
        assert!(found.evidence.unwrap() > 100.0, "{:?}", found.evidence);
        let law = closure_of(&rig, &staged, &found.fit, 0).unwrap().two_stage;
        assert!(!law.straight() && (law.inflection_s / (0.4 * 0.12) - 1.0).abs() < 0.03, "{law:?}");
        let linear = [record(&rig, &pipe, &TRUTH[..3], RUN, 0.01, 6.0)];
        let found = lawful(&linear);
        assert!(found.evidence.unwrap() < 6.0 && found.fit.effects.len() == 1, "{:?}", found.evidence);
        assert!(closure_of(&rig, &linear, &found.fit, 0).unwrap().two_stage.straight());
    }

    /// A stepwise calibration takes the law of two stages from the curve, before any descent.
    #[test]
    fn stepwise_takes_the_law_from_the_curve() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let effects = parse_list("viscoelastic-wall:1,valve-law").unwrap();
        let runs = [record(&rig, &effects, &TRUTH, RUN, 0.01, 6.0)];
        let options = Options { method: Method::Stepwise, ..Options::default() };
        let fit = calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap();
        let step = fit.steps.iter().find(|s| s.feature.starts_with("opening read back")).unwrap();
        let value = |name: &str| step.parameters.iter().find(|(n, _)| n == name).unwrap().1;
        assert!((value("inflection_time_fraction") - 0.4).abs() < 0.1, "{step:?}");
        assert!((value("inflection_opening") - 0.2).abs() < 0.1, "{step:?}");
        assert!((value("closing_time_s") / 0.12 - 1.0).abs() < 0.2, "{step:?}");
        assert!(step.kept && step.after_over_noise < step.before_over_noise, "{step:?}");
        assert!(fit.runs[0].rmse_m < 2.0 * fit.runs[0].noise_m, "{}", fit.runs[0].rmse_m / fit.runs[0].noise_m);
    }
}
