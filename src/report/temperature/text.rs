//! A family of runs at several temperatures as text, JSON and CSV.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::report::text::number::{error_m, grouped, significant, times, with_error};
use crate::report::text::table::Table;
use crate::temperature::apart::{Form, Quantity, Trend};
use crate::temperature::chance;
use crate::temperature::{Family, Together, Verdict};

/// First line of the CSV.
pub const CSV_HEADER: &str = "quantity,unit,source,file,temperature_degC,value,lower,upper";

/// Everything `family` prints: headline, errors by run, laws, values by run, trends, remarks.
pub fn text(family: &Family) -> String {
    let mut parts = vec![headline(family) + "\n", table(&RUN_HEADINGS, errors(family))];
    if let Some(together) = &family.together {
        parts.push(table(&LAW_HEADINGS, laws(together)));
        parts.push(comparison(together).map_or(String::new(), |line| line + "\n"));
    }
    let (headings, rows) = values(family);
    parts.push(table(&headings.iter().map(String::as_str).collect::<Vec<_>>(), rows));
    parts.push(format!(
        "Trends of the runs fitted separately, at {} °C:\n{}",
        family.reference_degc,
        table(&TREND_HEADINGS, trends(family))
    ));
    parts.push(family.remarks.iter().map(|r| format!("Note: {r}.\n")).collect());
    parts.retain(|p| !p.trim().is_empty());
    parts.join("\n")
}

fn table<R: Into<Vec<String>>>(headings: &[&str], rows: impl IntoIterator<Item = R>) -> String {
    let mut table = Table::new(headings);
    rows.into_iter().for_each(|row| table.row(row));
    table.without_empty_columns().to_string()
}

/// The result in a sentence.
pub(crate) fn headline(family: &Family) -> String {
    let degrees = || family.members.iter().map(|m| m.temperature_degc);
    let (low, high) = (degrees().fold(f64::INFINITY, f64::min), degrees().fold(f64::NEG_INFINITY, f64::max));
    let runs = format!("{} runs from {low:.1} to {high:.1} °C", family.members.len());
    let Some(together) = &family.together else { return format!("{runs}, each fitted by itself.") };
    let law = match together.laws.shift {
        crate::temperature::law::Shift::Arrhenius => "Arrhenius' law of the retardation times",
        crate::temperature::law::Shift::Wlf => "the law of Williams, Landel and Ferry",
        crate::temperature::law::Shift::Free => "one free factor per run for the retardation times",
    };
    let modulus =
        if together.laws.modulus_free { "one modulus per run" } else { "a modulus log-linear in temperature" };
    let verdict = match together.comparison.map(|c| c.verdict) {
        Some(Verdict::Describe) => "describe them",
        Some(Verdict::Nearly) => "nearly describe them",
        Some(Verdict::Fail) => "do not describe them",
        None => "cannot be contradicted by them",
    };
    format!("{runs}: {law} and {modulus} {verdict}.")
}

/// Headings of [`errors`].
pub(crate) const RUN_HEADINGS: [&str; 7] =
    ["run", "<temperature, °C", "from", "<RMSE separate, m", "<RMSE together, m", "<noise, m", "<together/noise"];

/// Each run's errors.
pub(crate) fn errors(family: &Family) -> Vec<[String; 7]> {
    let row = |(r, m): (usize, &crate::temperature::Member)| {
        let together = family.together.as_ref().map(|t| &t.runs[r]);
        let (apart_m, noise_m) = together.map_or_else(
            || (family.fits[r].runs[0].rmse_m, family.fits[r].runs[0].noise_m),
            |t| (t.apart_m, t.noise_m),
        );
        [
            m.data.file.clone(),
            format!("{:.2}", m.temperature_degc),
            m.source.name().to_owned(),
            error_m(apart_m),
            together.map_or(String::new(), |t| error_m(t.together_m)),
            error_m(noise_m),
            together.map_or(String::new(), |t| times(t.together_m, t.noise_m)),
        ]
    };
    family.members.iter().enumerate().map(row).collect()
}

/// Headings of [`laws`].
pub(crate) const LAW_HEADINGS: [&str; 5] = ["law's parameter", "<value", "<95%", "unit", ""];

/// The laws' parameters.
pub(crate) fn laws(together: &Together) -> Vec<[String; 5]> {
    let row = |p: &crate::temperature::LawParameter| {
        [
            p.name.clone(),
            with_error(p.value, p.standard_error),
            interval(p.interval),
            p.unit.to_owned(),
            if p.at_bound { "at its bound".to_owned() } else { String::new() },
        ]
    };
    together.parameters.iter().map(row).collect()
}

fn interval((low, high): (f64, f64)) -> String {
    if low.is_finite() && high.is_finite() {
        format!("{} to {}", significant(low, 4), significant(high, 4))
    } else {
        "open".into()
    }
}

/// Together against apart, in a line.
pub(crate) fn comparison(together: &Together) -> Option<String> {
    let c = together.comparison?;
    let preferred = if c.bic_difference < 0.0 { "together" } else { "apart" };
    Some(format!(
        "Together against separately: {} parameters saved; F({}, {}) = {}, chance {}; BIC {}, in favour of the fit {preferred}.",
        c.freedom.0,
        c.freedom.0,
        c.freedom.1,
        significant(c.f, 3),
        chance(c.chance),
        grouped(c.bic_difference)
    ))
}

/// Values of the runs fitted apart, a quantity a line.
pub(crate) fn values(family: &Family) -> (Vec<String>, Vec<Vec<String>>) {
    let mut headings = vec!["apart".to_owned()];
    headings.extend(family.members.iter().map(|m| format!("<{:.1} °C", m.temperature_degc)));
    let row = |q: &Quantity| {
        let cell = |r: usize| q.points.iter().find(|p| p.run == r);
        let own =
            (0..family.members.len()).map(|r| cell(r).map_or("open".into(), |p| with_error(p.value, p.standard_error)));
        std::iter::once(q.name.clone()).chain(own).collect()
    };
    (headings, family.quantities.iter().map(row).collect())
}

/// Headings of [`trends`].
pub(crate) const TREND_HEADINGS: [&str; 6] =
    ["quantity", "<at reference", "<95%", "<slope", "<95%", "unit of the slope"];

/// Trends of the runs fitted apart.
pub(crate) fn trends(family: &Family) -> Vec<[String; 6]> {
    let row = |q: &Quantity| {
        let t = q.trend?;
        let mid = t.at(family.reference_degc);
        let (scale, unit) = slope_unit(&t, q.unit);
        let (low, high) = t.line.slope_interval();
        Some([
            q.name.clone(),
            significant(mid.value, 4),
            interval(mid.interval),
            with_error(t.line.slope * scale, t.line.slope_error * scale),
            interval((low * scale, high * scale)),
            unit,
        ])
    };
    family.quantities.iter().filter_map(row).collect()
}

/// What a slope is multiplied by to be displayed, and its unit then.
fn slope_unit(trend: &Trend, unit: &str) -> (f64, String) {
    match trend.form {
        Form::Plain => (1.0, format!("{unit}/K")),
        Form::Exponential => (100.0, "%/K".into()),
        Form::Arrhenius => (1e-3, "kJ/mol".into()),
    }
}

/// The values of the runs, the trends' lines and the laws' lines, one row a value: source is `run`, `trend` or `law`.
pub fn csv(family: &Family) -> String {
    let mut out = format!("{CSV_HEADER}\n");
    for q in &family.quantities {
        let mut row = |source: &str, file: &str, degc: f64, value: f64, (low, high): (f64, f64)| {
            let quoted =
                if file.contains([',', '"']) { format!("\"{}\"", file.replace('"', "\"\"")) } else { file.into() };
            let _ = writeln!(out, "{},{},{source},{quoted},{degc},{value},{low},{high}", q.name, q.unit);
        };
        for p in &q.points {
            row("run", &family.members[p.run].data.file, p.temperature_degc, p.value, p.interval);
        }
        for degc in degrees(family) {
            if let Some(b) = q.trend.map(|t| t.at(degc)) {
                row("trend", "", degc, b.value, b.interval);
            }
        }
        for b in &q.law {
            row("law", "", b.temperature_degc, b.value, b.interval);
        }
    }
    out
}

/// Temperatures of a line over the runs, °C.
pub(crate) fn degrees(family: &Family) -> Vec<f64> {
    const POINTS: usize = 41;
    let own = || family.members.iter().map(|m| m.temperature_degc);
    let (low, high) = (own().fold(f64::INFINITY, f64::min), own().fold(f64::NEG_INFINITY, f64::max));
    (0..POINTS).map(|i| low + (high - low) * i as f64 / (POINTS - 1) as f64).collect()
}

/// The document of `family --json`. Intervals are 95% ones, `null` where they are open.
///
/// `effects`, `reference_degC`; `runs`: list of `file`, `temperature_degC`, `temperature_from`, `rmse_m` (fitted
/// apart), `together_rmse_m` and `together_temperature_degC` (as it suits the laws) or `null`, `noise_m`, `parameters`
/// (list of `name`, `value`, `standard_error`, `unit`, `at_bound`); `trends`: list of `name`, `unit`, `form`,
/// `at_reference`, `at_reference_interval`, `slope`, `slope_standard_error`, `slope_interval`, `slope_unit`, `chance`
/// (that the line holds, of scatter as large), `contradicted`; `together`, or `null`: `shift`, `modulus`, `vertical`,
/// `parameters` (list of `name`, `value`, `standard_error`, `interval`, `unit`, `at_bound`), `comparison` (`f`,
/// `parameters_saved`, `effective_samples_left`, `chance`, `bic_difference`, `verdict`: `describe`, `nearly` or `fail`)
/// or `null`, `converged`; `remarks`.
pub fn document(family: &Family) -> Value {
    let runs = family.members.iter().zip(&family.fits).enumerate().map(|(r, (m, fit))| {
        let (together, moved) =
            family.together.as_ref().map(|t| (t.runs[r].together_m, t.runs[r].temperature_degc)).unzip();
        let own = fit.parameters.iter().map(|p| {
            json!({ "name": p.name, "value": p.value, "standard_error": p.standard_error(), "unit": p.unit, "at_bound": p.at_bound })
        });
        json!({
            "file": m.data.file, "temperature_degC": m.temperature_degc, "temperature_from": m.source.name(),
            "rmse_m": fit.runs[0].rmse_m, "together_rmse_m": together, "together_temperature_degC": moved, "noise_m": fit.runs[0].noise_m,
            "parameters": own.collect::<Vec<_>>(),
        })
    });
    let trends = family.quantities.iter().filter_map(|q| {
        let t = q.trend?;
        let mid = t.at(family.reference_degc);
        let (scale, unit) = slope_unit(&t, q.unit);
        let (low, high) = t.line.slope_interval();
        Some(json!({
            "name": q.name, "unit": q.unit, "form": t.form.name(),
            "at_reference": mid.value, "at_reference_interval": [mid.interval.0, mid.interval.1],
            "slope": t.line.slope * scale, "slope_standard_error": t.line.slope_error * scale,
            "slope_interval": [low * scale, high * scale], "slope_unit": unit,
            "chance": t.line.chance, "contradicted": t.line.is_contradicted(),
        }))
    });
    json!({
        "effects": family.effects, "reference_degC": family.reference_degc,
        "runs": runs.collect::<Vec<_>>(), "trends": trends.collect::<Vec<_>>(),
        "together": family.together.as_ref().map(of_together), "remarks": family.remarks,
    })
}

fn of_together(together: &Together) -> Value {
    let parameters = together.parameters.iter().map(|p| {
        json!({
            "name": p.name, "value": p.value, "standard_error": p.standard_error, "interval": [p.interval.0, p.interval.1],
            "unit": p.unit, "at_bound": p.at_bound,
        })
    });
    json!({
        "shift": together.laws.shift.name(),
        "modulus": if together.laws.modulus_free { "free" } else { "log-linear" },
        "vertical": together.laws.vertical,
        "parameters": parameters.collect::<Vec<_>>(),
        "comparison": together.comparison.map(|c| json!({
            "f": c.f, "parameters_saved": c.freedom.0, "effective_samples_left": c.freedom.1, "chance": c.chance,
            "bic_difference": c.bic_difference, "verdict": c.verdict.name(),
        })),
        "converged": together.converged,
    })
}
