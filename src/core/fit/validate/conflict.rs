//! Where a fit contradicts what was known before it: a fit may reach the noise with a velocity that contradicts the
//! meter.

use crate::fit::data::run_data::{RunData, ShownClosing};
use crate::fit::data::thresholds::CLOSING_TIME_FACTOR;
use crate::fit::outcome::fit::{Fit, FittedParameter, RunFit};
use crate::fit::problem::parameters::placed_sensor;
use crate::fit::validate::thresholds::{CONFLICT_SD, LACKING_RATIO, PRIOR_CONFLICT_SD};
use crate::number::{error_m, significant, to_error};

/// One sentence for each conflict of the recordings or of the fit.
pub fn conflicts(fit: &Fit, runs: &[RunData]) -> Vec<String> {
    [of_records(runs), of_fit(fit, runs)].concat()
}

/// One sentence for each conflict of a fit; none for one that did not end at an optimum.
pub fn of_fit(fit: &Fit, runs: &[RunData]) -> Vec<String> {
    if !fit.converged {
        return Vec::new();
    }
    runs.iter().flat_map(|run| of_run(fit, run)).map(|conflict| conflict.says).chain(of_values(fit)).collect()
}

/// Conflicts of the values with what the rig file, the grid and creep tests say.
fn of_values(fit: &Fit) -> Vec<String> {
    let mut sentences = Vec::new();
    sentences.extend(fit.parameters.iter().filter(|p| beyond_tolerance(p)).filter_map(stands));
    let noise = fit.runs.iter().map(|r| r.noise_m).fold(f64::INFINITY, f64::min);
    if fit.grid_error_m > 0.5 * noise {
        sentences.push(format!(
            "the grid's own error, {} m at {} reaches, is not small against the noise, {} m: raise option `most_reaches` before \
             looking for missing physics",
            error_m(fit.grid_error_m),
            fit.reaches,
            error_m(noise)
        ));
    }
    for parameter in &fit.parameters {
        let Some((mean, sd)) = parameter.prior else { continue };
        let away = (parameter.value / mean).ln() / sd;
        if away.abs() > PRIOR_CONFLICT_SD {
            sentences.push(format!(
                "{} = {:.4} {unit} lies {:.1} standard deviations from the prior, {mean:.4} {unit} to {:.0}%: this record \
                 contradicts the creep test; look for another temperature or specimen, or for an effect that creep stands in for",
                parameter.name,
                parameter.value,
                away.abs(),
                100.0 * sd,
                unit = parameter.unit
            ));
        }
    }
    sentences
}

/// A contradiction between a fit and the instruments of a run.
struct Conflict {
    says: String,
    /// It as a part of a sentence, where all that it says is that the model lacks something.
    pulled: Option<String>,
}

/// Where a fit contradicts what the instruments of a run say.
fn of_run(fit: &Fit, run: &RunData) -> Vec<Conflict> {
    let mut sentences = Vec::new();
    let of_several = if fit.runs.len() > 1 { format!(" of {}", run.file) } else { String::new() };
    let own = |name: &str| {
        fit.parameters.iter().find(|p| p.name == name && p.run.as_ref().is_none_or(|r| *r == run.file)).map(|p| p.value)
    };
    let fitted_flow = fit.runs.iter().find(|r| r.file == run.file).and_then(|r| r.meter_flow_m3_s);
    if let (Some(fitted), Some(meter)) = (fitted_flow, &run.meter)
        && (fitted / meter.flow_m3_s - 1.0).abs() > (CONFLICT_SD * meter.relative_sd).max(0.05)
    {
        let says = format!(
            "{}: at the flow meter the model has {} L/s, which contradicts the measured {} L/s: check the meter's unit and range, the \
             diameter, and whether an effect is missing",
            run.file,
            significant(1e3 * fitted, 4),
            significant(1e3 * meter.flow_m3_s, 4)
        );
        sentences.push(Conflict { says, pulled: None });
    }
    let (known_head, guessed) = run.start.valve_head_m;
    let head_sd = run.sensors.iter().map(|s| s.offset_sd_m).fold(0.0, f64::max);
    if let Some(fitted) = own("valve_head_m")
        && guessed.is_none()
        && (fitted - known_head).abs() > CONFLICT_SD * head_sd
    {
        let says = format!(
            "{}: the fitted head before the valve, {fitted:.2} m, contradicts the sensors' {known_head:.2} m: the fit \
             shifts the mean level to make up for something that the model lacks",
            run.file
        );
        let pulled =
            format!("the head before the valve{of_several} is {fitted:.2} m where the sensors show {known_head:.2} m");
        sentences.push(Conflict { says, pulled: Some(pulled) });
    }
    let (known_start, se) = run.start.closure_s;
    if let (Some(fitted), Some(closing)) = (own("closure_start_s"), own("closing_time_s"))
        && (fitted - known_start).abs() > (CONFLICT_SD * se).max(0.25 * closing)
    {
        let side = if fitted < known_start { "before" } else { "after" };
        let away_ms = to_error(1e3 * (fitted - known_start).abs(), 1e3 * se);
        let says = format!("{}: the fitted closure starts {away_ms} ms {side} the pressure starts to rise", run.file);
        let pulled = format!("the closure{of_several} starts {away_ms} ms {side} the pressure starts to rise");
        sentences.push(Conflict { says, pulled: Some(pulled) });
    }
    let own_friction = |p: &&FittedParameter| is_strange_friction(p) && p.run.as_ref().is_none_or(|r| *r == run.file);
    if let Some(friction) = fit.parameters.iter().find(own_friction) {
        let at_bound = if friction.at_bound { ", its bound" } else { "" };
        let scale = format!("{:.2} times that of the pipe{at_bound}", friction.value);
        let says = format!(
            "{}: the fitted friction is {scale}: an effect that dissipates energy is missing, or there is one too many",
            run.file
        );
        sentences.push(Conflict { says, pulled: Some(format!("the friction{of_several} is {scale}")) });
    }
    sentences
}

/// A friction that no wall of the rig's has.
fn is_strange_friction(p: &FittedParameter) -> bool {
    p.name == "friction_scale" && !(0.5..=2.0).contains(&p.value)
}

/// One sentence for each sensor that stands elsewhere than the rig file says, within its tolerance: no conflict.
pub fn moved_sensors(fit: &Fit) -> Vec<String> {
    fit.parameters.iter().filter(|p| !beyond_tolerance(p)).filter_map(stands).collect()
}

fn beyond_tolerance(place: &FittedParameter) -> bool {
    place.belief.is_some_and(|(said_m, sd_m)| (place.value - said_m).abs() > CONFLICT_SD * sd_m)
}

/// Where a sensor stands, if that is elsewhere than the rig file says beyond what the record leaves open.
fn stands(place: &FittedParameter) -> Option<String> {
    let (sensor, (said_m, _)) = (placed_sensor(&place.name)?, place.belief?);
    let (off_m, error_m) = ((place.value - said_m).abs(), place.standard_error());
    let digits = (-error_m.log10().floor()).clamp(2.0, 4.0) as usize;
    let hint = match beyond_tolerance(place) {
        true => "; that is far beyond its tolerance: measure the place, or look for an effect that stands behind it",
        false => "",
    };
    (off_m > PRIOR_CONFLICT_SD * error_m).then(|| {
        format!(
            "{sensor} stands at {:.digits$} ± {error_m:.digits$} m, the rig file says {said_m} m{hint}",
            place.value
        )
    })
}

/// One sentence for each conflict of the recordings with the rig file, whatever the model.
pub fn of_records(runs: &[RunData]) -> Vec<String> {
    runs.iter().flat_map(of_record).collect()
}

/// Where a run's record contradicts the rig file.
fn of_record(run: &RunData) -> Vec<String> {
    let saturated = run.sensors.iter().filter(|sensor| sensor.saturated > 0).map(|sensor| {
        format!(
            "{}: {} samples of {} stand at the end of what it can show and are left out: the true pressure went beyond",
            run.file, sensor.saturated, sensor.sensor.name
        )
    });
    let closing = run.start.closing_time.filter(contradicts_rig_file).map(|shown| {
        format!(
            "{}: the record shows that the valve closes in about {} s: closing_time_s of the rig file is far from it",
            run.file,
            significant(shown.seen_s.0, 3)
        )
    });
    saturated.chain(closing).collect()
}

/// Whether a closing time lies farther from the rig file's than its tolerance and what the record leaves open; where
/// the file gives no tolerance, by a factor.
fn contradicts_rig_file(closing: &ShownClosing) -> bool {
    let ((seen_s, error_s), (said_s, sd_s)) = (closing.seen_s, closing.said_s);
    match sd_s {
        Some(sd_s) => (seen_s - said_s).abs() > CONFLICT_SD * sd_s.hypot(error_s),
        None => (seen_s / said_s).ln().abs() > CLOSING_TIME_FACTOR.ln(),
    }
}

/// One sentence for each run whose [noise dies away](RunFit::noise_dies_away): no conflict, but its errors are those of
/// the noise before the closure.
pub fn faded_noise(fit: &Fit) -> Vec<String> {
    let shared = if fit.runs.len() > 1 { ", as may those of what it shares with other runs" } else { "" };
    let faded = fit.runs.iter().filter(|run| run.noise_dies_away);
    faded.map(|run| dies_away(run, shared)).collect()
}

fn dies_away(run: &RunFit, shared: &str) -> String {
    format!(
        "{}: the fit leaves {:.2} of the noise before the closure: noise dies away after it. Errors and intervals of this run take it as it was \
         before, for the first rise is seen in that; they may be too wide{shared}",
        run.file,
        run.rmse_m / run.noise_m
    )
}

/// Whether a model leaves more than the noise and its grid's own error: then the errors of its values are lower bounds.
pub fn lacks_something(rmse_m: f64, noise_m: f64, grid_error_m: f64) -> bool {
    rmse_m > LACKING_RATIO * noise_m.hypot(2.0 * grid_error_m)
}

/// A sentence where the model leaves more than the noise and its grid's own error, with where what it lacks has
/// `pulled` its values as far as that shows. Its intervals take account of how large and how slow that error is, not of
/// where the missing effect pulls the parameters.
fn lacking(rmse_m: f64, noise_m: f64, pulled: &[String]) -> String {
    let shown = if pulled.is_empty() { String::new() } else { format!(" ({})", pulled.join("; ")) };
    format!(
        "the model leaves {} times the noise: what it lacks pulls its parameters away, by how much nobody knows{shown}. The 95% intervals are \
         lower bounds of what is uncertain, those of creep and wave speed among them",
        significant(rmse_m / noise_m, 2)
    )
}

/// All warnings of a fit: conflicts with what was known, sensors that stand elsewhere, parameters at their bounds,
/// noise that dies away, and intervals that are too narrow because an effect is missing. What says no more than that is
/// part of that sentence.
pub fn warnings(fit: &Fit, runs: &[RunData]) -> Vec<String> {
    let records = of_records(runs).into_iter();
    // Values away from an optimum contradict nothing.
    if !fit.converged {
        return records.chain(faded_noise(fit)).collect();
    }
    let (rmse_m, noise_m) = fit.pooled();
    let lacks = lacks_something(rmse_m, noise_m, fit.grid_error_m);
    let of_runs = runs.iter().flat_map(|run| of_run(fit, run));
    let (pulled, own): (Vec<Conflict>, Vec<Conflict>) =
        of_runs.partition(|conflict| lacks && conflict.pulled.is_some());
    let (pulled, own) = (pulled.into_iter().filter_map(|c| c.pulled), own.into_iter().map(|c| c.says));
    let (beside, bounds) = if lacks { (at_bounds(fit), Vec::new()) } else { (Vec::new(), at_bounds(fit)) };
    let pulled: Vec<String> = pulled.chain(beside).collect();
    let lacking = lacks.then(|| lacking(rmse_m, noise_m, &pulled));
    let of_values = of_values(fit).into_iter().chain(moved_sensors(fit)).chain(bounds);
    records.chain(own).chain(of_values).chain(faded_noise(fit)).chain(lacking).collect()
}

/// One sentence for each parameter that ended at a bound, unless it is [unidentifiable](Fit::unidentifiable), or a
/// friction whose conflict says so.
pub fn at_bounds(fit: &Fit) -> Vec<String> {
    let explained = |name: &String| fit.unidentifiable.iter().any(|u| u.parameters.contains(name));
    let at_bound = fit.parameters.iter().filter(|p| p.at_bound && !explained(&p.name) && !is_strange_friction(p));
    at_bound.map(|p| ended(p, fit.runs.len())).collect()
}

fn ended(p: &FittedParameter, runs: usize) -> String {
    // Five digits, without trailing zeros.
    let value: f64 = format!("{:.4e}", p.value).parse().unwrap_or(p.value);
    let run = p.run.as_ref().filter(|_| runs > 1).map_or(String::new(), |run| format!(" of {run}"));
    let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
    format!("{}{run} ended at its bound, {value:?}{unit}", p.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_that_dies_away_is_said() {
        let (file, sensors) = ("a.mcap".to_owned(), Vec::new());
        let run = RunFit {
            file,
            rmse_m: 0.013,
            noise_m: 0.05,
            mape_extrema_percent: 0.0,
            noise_dies_away: true,
            meter_flow_m3_s: None,
            sensors,
        };
        assert!(dies_away(&run, "").starts_with("a.mcap: the fit leaves 0.26 of the noise before the closure"));
    }

    /// A valve of 2 s that is seen to close in 2.013 s is no conflict, however well that is seen; one that is stated to
    /// 1% and seen to close in 2.3 s is.
    #[test]
    fn a_closing_time_is_judged_by_what_the_rig_file_leaves_open() {
        let closing = |seen_s, said_s| contradicts_rig_file(&ShownClosing { seen_s, said_s });
        assert!(!closing((2.013, 1e-4), (2.0, None)));
        assert!(!closing((2.013, 1e-4), (2.0, Some(0.02))));
        assert!(closing((2.3, 0.02), (2.0, Some(0.02))));
        // 0.1 s is no more than five standard deviations of what the record leaves open
        assert!(!closing((2.1, 0.025), (2.0, Some(0.0))));
        assert!(closing((2.1, 0.01), (2.0, Some(0.0))));
        assert!(
            closing((4.1, 1e-4), (2.0, None))
                && closing((0.9, 1e-4), (2.0, None))
                && !closing((3.9, 1e-4), (2.0, None))
        );
    }

    /// Twice the noise is too much, a tenth more is not; nor is anything where the grid's own error explains it.
    #[test]
    fn intervals_beside_a_missing_effect_are_lower_bounds() {
        assert!(lacks_something(0.1, 0.05, 0.0));
        assert!(!lacks_something(0.054, 0.05, 0.0) && !lacks_something(0.1, 0.05, 0.05));
        let said = lacking(0.1, 0.05, &["the friction is 5.00 times that of the pipe, its bound".to_owned()]);
        assert!(said.starts_with("the model leaves 2.0 times the noise") && said.contains("lower bounds"), "{said}");
        assert!(said.contains("nobody knows (the friction is 5.00 times that of the pipe, its bound). The"), "{said}");
    }

    #[test]
    fn a_bound_is_said_in_the_values_own_digits_and_of_which_run() {
        let of = |name: &str, value, unit, run: Option<&str>| FittedParameter {
            name: name.into(),
            value,
            unit,
            run: run.map(Into::into),
            ..FittedParameter::default()
        };
        assert_eq!(ended(&of("friction_scale", 5.0, "1", Some("a")), 1), "friction_scale ended at its bound, 5.0");
        let start = ended(&of("closure_start_s", 0.482_267_77, "s", Some("b.mcap")), 2);
        assert_eq!(start, "closure_start_s of b.mcap ended at its bound, 0.48227 s");
        assert_eq!(ended(&of("J1", 3.990_71e-7, "1/GPa", None), 2), "J1 ended at its bound, 3.9907e-7 1/GPa");
    }
}
