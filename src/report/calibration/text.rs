//! Tables of a calibration for the terminal: plain text, aligned, no colour.

use crate::fit::outcome::fit::{Fit, FittedParameter, RunFit, SensorFit};
use crate::fit::problem::compare::ExtremumError;
use crate::fit::problem::compare::mape_percent;
use crate::report::Stage;
use crate::report::calibration::posterior;
use crate::report::calibration::steps::steps;
use crate::report::text::number::{decimals_for, duration, error_m, fixed, interval, signed, significant, times};
use crate::report::text::table::Table;
use crate::report::text::value::fitted;
use crate::report::view::curves::find;
use crate::report::view::summary;

/// Everything `calibrate` prints: verdict, errors, parameters, extrema, and why the fit stopped.
pub fn calibration(stages: &[Stage]) -> String {
    let mut parts = vec![summary::verdict(stages) + "\n"];
    if let Some(last) = stages.last() {
        parts.extend([
            errors(stages),
            parameters(last.fit),
            posterior::text(last.fit),
            unseen(last.fit),
            extrema(last.fit),
            steps(&last.fit.steps),
            stop(last.fit),
        ]);
    }
    parts.retain(|p| !p.trim().is_empty());
    parts.join("\n")
}

/// Fitted parameters as value(error in the last digits), unit, and a flag where a bound stopped them.
pub fn parameters(fit: &Fit) -> String {
    let mut table = Table::new(&["parameter", "<value", "unit", "95%", "rig file", "run", ""]);
    for p in &fit.parameters {
        table.row([
            p.name.clone(),
            fitted(fit, p),
            p.unit.into(),
            interval(p.interval_95) + from(fit, p),
            p.rig_error.filter(|_| !p.held).map_or(String::new(), |sd| format!("± {}", significant(sd, 2))),
            p.run.clone().unwrap_or_default(),
            if p.held {
                "held".into()
            } else if p.at_bound {
                "at its bound".into()
            } else {
                String::new()
            },
        ]);
    }
    table.without_empty_columns().to_string()
}

/// Where an interval comes from, if not from the standard error.
fn from(fit: &Fit, p: &FittedParameter) -> &'static str {
    let sampled = fit.posterior.as_ref().is_some_and(|posterior| posterior.converged) && p.posterior.is_some();
    match (p.profile.is_some(), sampled) {
        (true, _) => " (profile)",
        (_, true) => " (posterior)",
        _ => "",
    }
}

/// What the recordings do not see, a line each.
pub fn unseen(fit: &Fit) -> String {
    fit.unidentifiable.iter().map(|u| format!("{}\n", u.in_words)).collect()
}

/// RMSE of what came before (`before`: the first stage; `start`: the unfitted start values, where there is one stage
/// only), RMSE, noise, their ratio and the error over extrema, for each run and sensor; then what the columns mean.
pub fn errors(stages: &[Stage]) -> String {
    let Some(last) = stages.last() else { return String::new() };
    let first = stages.first().filter(|_| stages.len() > 1);
    let before = |run: &RunFit, s: &SensorFit| match first {
        Some(first) => find(first.fit, &run.file, &s.name).map_or(f64::NAN, |s| s.rmse_m),
        None => s.start_rmse_m,
    };
    let mape = |percent: f64| if percent.is_finite() { significant(percent, 2) } else { String::new() };
    let earlier = if first.is_some() { "<before" } else { "<start" };
    let mut table =
        Table::new(&["run", "sensor", earlier, "<RMSE, m", "<noise, m", "<RMSE/noise", "<inside 95%", "<MAPE, %"]);
    for run in &last.fit.runs {
        for s in &run.sensors {
            table.row([
                run.file.clone(),
                s.name.clone(),
                error_m(before(run, s)),
                error_m(s.rmse_m),
                error_m(s.noise_m),
                times(s.rmse_m, s.noise_m),
                s.inside_band().map_or(String::new(), |share| format!("{}%", fixed(100.0 * share, 1))),
                mape(mape_percent(s.extrema.iter())),
            ]);
        }
        let samples: usize = run.sensors.iter().map(|s| s.time_s.len()).sum();
        let square: f64 = run.sensors.iter().map(|s| s.time_s.len() as f64 * before(run, s).powi(2)).sum();
        table.row([
            run.file.clone(),
            "all".into(),
            error_m((square / samples as f64).sqrt()),
            error_m(run.rmse_m),
            error_m(run.noise_m),
            times(run.rmse_m, run.noise_m),
            String::new(),
            mape(run.mape_extrema_percent),
        ]);
    }
    let earlier = match first {
        Some(first) => format!("before: RMSE of the first model ({}), m", first.title),
        None => "start: RMSE of the start values, before any fit, m".into(),
    };
    let banded = last.fit.runs.iter().flat_map(|r| &r.sensors).any(|s| s.inside_band().is_some());
    let band = if banded { INSIDE } else { "" };
    format!("{}{earlier}. {band}{MAPE}\n", table.without_empty_columns())
}

const INSIDE: &str = "inside 95%: share of the samples inside the band of model and noise, 95% if nothing is missing. ";

const MAPE: &str = "MAPE: mean absolute error of the peaks and troughs, in percent of the measured head.";

/// Model − measured at the peak and the trough of every cycle: head in m, phase in ms.
pub fn extrema(fit: &Fit) -> String {
    fit.runs
        .iter()
        .filter(|r| r.sensors.iter().any(|s| !s.extrema.is_empty()))
        .map(extrema_of)
        .collect::<Vec<_>>()
        .join("\n")
}

fn extrema_of(run: &RunFit) -> String {
    let mut table = Table::new(&[
        "sensor",
        "<cycle",
        "<peak, m",
        "<error, m",
        "<phase, ms",
        "<trough, m",
        "<error, m",
        "<phase, ms",
    ]);
    for sensor in &run.sensors {
        let decimals = decimals_for(sensor.noise_m);
        let mut cycles: Vec<usize> = sensor.extrema.iter().map(|e| e.cycle).collect();
        cycles.sort_unstable();
        cycles.dedup();
        for cycle in cycles {
            let at = |peak| sensor.extrema.iter().find(|e| e.cycle == cycle && e.peak == peak);
            let [peak, trough] = [cells(at(true), decimals), cells(at(false), decimals)];
            let mut row = vec![sensor.name.clone(), cycle.to_string()];
            row.extend(peak);
            row.extend(trough);
            table.row(row);
        }
    }
    format!("{}: model − measured at each extremum\n{table}", run.file)
}

fn cells(extremum: Option<&ExtremumError>, decimals: usize) -> [String; 3] {
    extremum.map_or_else(Default::default, |e| {
        [fixed(e.measured_m, decimals), signed(e.model_m - e.measured_m, decimals), signed(e.phase_s * 1e3, 1)]
    })
}

/// Effort and reason of the stop, one line.
pub fn stop(fit: &Fit) -> String {
    let effects = if fit.effects.is_empty() { "base model".into() } else { fit.labels().join(", ") };
    let end = if fit.converged { "done" } else { "stopped early" };
    format!("{effects}: {} simulations in {}; {end}: {}\n", fit.evaluations, duration(fit.seconds), fit.stopped_because)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::uncertainty::Uncertainty;
    use crate::model::effects::parse_list;

    fn fit(rmse_m: f64) -> Fit {
        let extremum = |cycle, peak, error| ExtremumError {
            cycle,
            peak,
            time_s: 0.1,
            measured_m: 50.0,
            model_m: 50.0 + error,
            phase_s: 0.0012,
        };
        Fit {
            effects: parse_list("viscoelastic-wall:1").unwrap(),
            runs: vec![RunFit {
                file: "run.mcap".into(),
                rmse_m,
                noise_m: 0.03,
                mape_extrema_percent: 0.41,
                noise_dies_away: false,
                meter_flow_m3_s: None,
                sensors: vec![SensorFit {
                    name: "P1".into(),
                    position_m: 10.0,
                    time_s: vec![0.0; 4],
                    measured_m: vec![0.0; 4],
                    model_m: vec![0.0; 4],
                    band_m: Vec::new(),
                    noise_m: 0.03,
                    white_noise_m: 0.03,
                    rmse_m,
                    start_rmse_m: 2.0,
                    before_m: None,
                    extrema: vec![extremum(1, true, 0.123), extremum(1, false, -0.2), extremum(2, true, 0.001)],
                }],
            }],
            parameters: vec![
                FittedParameter {
                    about: "speed of pressure waves",
                    name: "wave_speed_m_s".into(),
                    run: None,
                    value: 395.12,
                    uncertainty: Uncertainty::Known(0.4),
                    unit: "m/s",
                    at_bound: false,
                    ..FittedParameter::default()
                },
                FittedParameter {
                    about: "speed of pressure waves",
                    name: "tau1_s".into(),
                    run: None,
                    value: 0.5,
                    uncertainty: Uncertainty::Open,
                    unit: "s",
                    at_bound: true,
                    ..FittedParameter::default()
                },
            ],
            correlation: vec![],
            unidentifiable: vec![],
            reaches: 64,
            grid_error_m: 0.001,
            evaluations: 312,
            seconds: 0.41,
            steps: vec![],
            stopped_because: "the error no longer falls".into(),
            converged: true,
            cost: 0.0,
            predicted_reduction: 0.0,
            posterior: None,
            features_left: vec![],
            method: crate::fit::problem::method::Method::default(),
        }
    }

    #[test]
    fn parameters_line_up_with_their_errors_and_flags() {
        let text = parameters(&fit(0.05));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[2].split_whitespace().collect::<Vec<_>>(), ["wave_speed_m_s", "395.1(4)", "m/s"]);
        assert!(lines[3].contains("0.5000 (undetermined)") && lines[3].ends_with("at its bound"), "{text}");
        assert!(!lines[0].contains("run"), "a column without content is left out");
    }

    #[test]
    fn errors_are_compared_with_before_and_with_the_noise() {
        let (start, end) = (fit(1.92), fit(0.05));
        let stages = [Stage { title: "a".into(), fit: &start }, Stage { title: "b".into(), fit: &end }];
        let text = errors(&stages);
        let lines: Vec<&str> = text.lines().collect();
        let all: Vec<&str> = lines[lines.len() - 2].split_whitespace().collect();
        assert!(
            lines[0].contains("before")
                && text.contains("before: RMSE of the first model (a), m. MAPE: mean absolute error"),
            "{text}"
        );
        assert_eq!(all, ["run.mcap", "all", "1.92", "0.050", "0.030", "1.7", "0.41"]);
        let alone = errors(&stages[1..]);
        assert!(alone.contains("2.00") && alone.contains("start: RMSE of the start values"), "{alone}");
        assert!(!alone.contains("before  "), "{alone}");
    }

    #[test]
    fn each_cycle_has_peak_and_trough_in_one_line() {
        let text = extrema(&fit(0.05));
        let cells: Vec<&str> = text.lines().nth(3).unwrap().split_whitespace().collect();
        assert_eq!(cells, ["P1", "1", "50.00", "+0.12", "+1.2", "50.00", "-0.20", "+1.2"]);
        assert!(text.lines().nth(4).unwrap().ends_with("+1.2"));
    }

    #[test]
    fn the_whole_text_is_plain_and_safe_without_data() {
        let end = fit(0.05);
        let text = calibration(&[Stage { title: "b".into(), fit: &end }]);
        assert!(text.contains("312 simulations in 410 ms; done: the error no longer falls"));
        assert!(!text.contains('\u{1b}'));
        assert!(calibration(&[]).contains("Nothing has been calibrated"));
        let mut empty = end;
        empty.runs.clear();
        empty.parameters.clear();
        assert!(calibration(&[Stage { title: "b".into(), fit: &empty }]).contains("no samples"));
    }
}
