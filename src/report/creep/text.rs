//! A creep test as text and as JSON.

use serde_json::json;

use crate::creep::outcome::{CreepFit, TestFit};
use crate::creep::thresholds::OPEN_ERROR;
use crate::report::text::number::{grouped, significant, with_error};
use crate::report::text::table::Table;

/// Unit of compliances as displayed.
pub(crate) const COMPLIANCE_UNIT: &str = "1/GPa";
const PER_GPA: f64 = 1e9;
/// Points of the curve.
const POINTS: usize = 121;

/// Everything `creep` prints: headline, elements, tests, shift, numbers of elements tried, remarks.
pub fn text(fit: &CreepFit) -> String {
    let mut parts = vec![headline(fit) + "\n"];
    let mut table = Table::new(&["element", "<J, 1/GPa", "<95%", "<tau, s", "<95%"]);
    elements(fit).into_iter().for_each(|row| table.row(row));
    parts.push(table.to_string());
    let mut table = Table::new(&["test", "temperature", "<samples", "<rms, 1/GPa", "<noise, 1/GPa", "<shift"]);
    for t in &fit.tests {
        let shift = fit.shifts.iter().find(|s| Some(s.temperature_degc) == t.test.temperature_degc);
        table.row([
            t.test.file.clone(),
            temperature(t).unwrap_or_default(),
            t.test.time_s.len().to_string(),
            significant(t.rms_per_pa * PER_GPA, 2),
            significant(t.noise_per_pa * PER_GPA, 2),
            match shift {
                Some(s) => with_error(s.factor, s.factor * s.relative_error),
                None if fit.shifts.is_empty() => String::new(),
                None => "1".into(),
            },
        ]);
    }
    parts.push(table.without_empty_columns().to_string());
    parts.push(shift_lines(fit).iter().map(|l| format!("{l}\n")).collect());
    let mut table = Table::new(&["<elements", "<rms/noise", "<BIC above the best"]);
    tried(fit).into_iter().for_each(|row| table.row(row));
    parts.push(table.to_string());
    parts.push(fit.remarks.iter().map(|r| format!("Note: {r}.\n")).collect());
    parts.retain(|p| !p.is_empty());
    parts.join("\n")
}

/// The result in a sentence.
pub(crate) fn headline(fit: &CreepFit) -> String {
    let samples: usize = fit.tests.iter().map(|t| t.test.time_s.len()).sum();
    let (from, to) = fit.span_s();
    let plural = |n: usize, word: &str| format!("{n} {word}{}", if n == 1 { "" } else { "s" });
    let at = fit.reference_degc.map_or(String::new(), |t| format!(" at {t} °C"));
    format!(
        "{}{at} from {}, {samples} samples, {} s to {} s: rms {} 1/GPa, noise {} 1/GPa, {}.",
        plural(fit.creep.elements.len(), "Kelvin-Voigt element"),
        plural(fit.tests.len(), "test"),
        significant(from, 3),
        significant(to, 3),
        significant(fit.rms_per_pa() * PER_GPA, 2),
        significant(fit.noise_per_pa() * PER_GPA, 2),
        match fit.noise {
            crate::creep::outcome::Noise::Constant => "the same at all times",
            crate::creep::outcome::Noise::Proportional => "in proportion to the reading",
        }
    )
}

/// Element, J, its interval, τ, its interval; the first is J0.
pub(crate) fn elements(fit: &CreepFit) -> Vec<[String; 5]> {
    let cell = |value: f64, j: usize| {
        let error = fit.relative_errors[j];
        let (low, high) = fit.interval(value, error);
        let interval = match (fit.at_bound[j], error <= OPEN_ERROR) {
            (true, _) => "at its bound".to_owned(),
            (_, true) => format!("{} to {}", significant(low, 4), significant(high, 4)),
            _ => "open".to_owned(),
        };
        [with_error(value, if error <= OPEN_ERROR { value * error } else { f64::INFINITY }), interval]
    };
    let mut rows = Vec::new();
    let [value, interval] = cell(fit.creep.instantaneous_per_pa * PER_GPA, 0);
    rows.push([format!("0 ({})", first(fit)), value, interval, String::new(), String::new()]);
    for (k, e) in fit.creep.elements.iter().enumerate() {
        let [j, j_interval] = cell(e.compliance_per_pa * PER_GPA, 1 + 2 * k);
        let [tau, tau_interval] = cell(e.tau_s, 2 + 2 * k);
        rows.push([(k + 1).to_string(), j, j_interval, tau, tau_interval]);
    }
    rows
}

/// What J0 includes, in words: all that the wall does before the first reading.
pub(crate) fn first(fit: &CreepFit) -> String {
    match fit.first_reading_s() {
        0.0 => "at once".to_owned(),
        first_s => format!("within {} s", significant(first_s, 3)),
    }
}

/// Numbers of elements tried, what they leave over the noise, and their evidence.
pub(crate) fn tried(fit: &CreepFit) -> Vec<[String; 3]> {
    let row = |t: &crate::creep::outcome::Tried| {
        let mark = if t.elements == fit.creep.elements.len() { "*" } else { "" };
        [format!("{mark}{}", t.elements), significant(t.rms_over_noise, 3), grouped(t.bic_above_best)]
    };
    fit.tried.iter().map(row).collect()
}

/// A test's temperature in words.
pub(crate) fn temperature(test: &TestFit) -> Option<String> {
    test.test.temperature_degc.map(|t| format!("{t} °C"))
}

/// The laws of the shift in words.
pub(crate) fn shift_lines(fit: &CreepFit) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(a) = fit.arrhenius {
        let kilojoules = with_error(a.activation_j_mol * 1e-3, a.standard_error_j_mol * 1e-3);
        let verdict = match a.describes {
            None => "one factor determines the energy and cannot contradict it".to_owned(),
            Some(true) => {
                format!("describes the factors within their errors; leaves {} decades", significant(a.rms_decades, 2))
            }
            Some(false) => format!("does not describe the factors; leaves {} decades", significant(a.rms_decades, 2)),
        };
        lines.push(format!("Arrhenius: activation energy {kilojoules} kJ/mol; {verdict}."));
    }
    if let Some(w) = fit.wlf {
        lines.push(format!(
            "Williams, Landel and Ferry: C1 {}, C2 {} K; {}.",
            with_error(w.c1, w.standard_errors[0]),
            with_error(w.c2_k, w.standard_errors[1]),
            if fit.shifts.len() == 2 {
                "two constants, which two factors cannot contradict".to_owned()
            } else {
                format!("leaves {} decades", significant(w.rms_decades, 2))
            }
        ));
    }
    lines
}

/// Time, s, J and the bounds of its band, 1/GPa: at times in equal ratios over the tests.
pub(crate) fn curve(fit: &CreepFit) -> Vec<(f64, f64, f64, f64)> {
    let (from, to) = fit.span_s();
    let at = |i: usize| from * (to / from).powf(i as f64 / (POINTS - 1) as f64);
    let point = |t: f64| {
        let (mid, low, high) = fit.band_per_pa(t);
        (t, mid * PER_GPA, low * PER_GPA, high * PER_GPA)
    };
    (0..POINTS).map(|i| point(at(i))).collect()
}

/// The document of `creep --json`. Compliances in 1/GPa, times in s, all at `reference_degC`; standard errors are
/// `null` where the test does not determine a value; `interval` is the 95% one.
///
/// `J0_per_GPa`, `J0_standard_error`, `J0_interval`: with all elements faster than `J0_within_s`, the time of the first
/// reading; `elements`: list of `J_per_GPa`, `J_standard_error`, `J_interval`, `tau_s`, `tau_standard_error`,
/// `tau_interval`, `at_bound`; `curve`: `time_s`, `compliance_per_GPa`, `lower_per_GPa`, `upper_per_GPa`; `shift`:
/// `factors` (list of `temperature_degC`, `factor`, `standard_error`), `arrhenius` and `wlf`, or `null`; `rms_per_GPa`,
/// `noise_per_GPa`, `noise_kind`, `variance_inflation`; `tests`: list of `file`, `temperature_degC`, `samples`,
/// `rms_per_GPa`, `noise_per_GPa`, `shift_factor`; `tried`: list of `elements`, `rms_over_noise`, `bic_above_best`;
/// `remarks`.
pub fn document(fit: &CreepFit) -> serde_json::Value {
    let error = |value: f64, j: usize| value * fit.relative_errors[j];
    let interval = |value: f64, j: usize| {
        let (low, high) = fit.interval(value, fit.relative_errors[j]);
        json!([low, high])
    };
    let j0 = fit.creep.instantaneous_per_pa * PER_GPA;
    let elements = fit.creep.elements.iter().enumerate().map(|(k, e)| {
        let (j, i) = (e.compliance_per_pa * PER_GPA, 1 + 2 * k);
        json!({
            "J_per_GPa": j, "J_standard_error": error(j, i), "J_interval": interval(j, i),
            "tau_s": e.tau_s, "tau_standard_error": error(e.tau_s, i + 1), "tau_interval": interval(e.tau_s, i + 1),
            "at_bound": fit.at_bound[i] || fit.at_bound[i + 1],
        })
    });
    let curve = curve(fit);
    let column = |of: fn(&(f64, f64, f64, f64)) -> f64| curve.iter().map(of).collect::<Vec<_>>();
    let factors = fit.shifts.iter().map(|s| {
        json!({ "temperature_degC": s.temperature_degc, "factor": s.factor, "standard_error": s.factor * s.relative_error })
    });
    let shift = (!fit.shifts.is_empty()).then(|| {
        json!({
            "factors": factors.collect::<Vec<_>>(),
            "arrhenius": fit.arrhenius.map(|a| json!({
                "activation_kJ_mol": a.activation_j_mol * 1e-3, "standard_error": a.standard_error_j_mol * 1e-3,
                "rms_decades": a.rms_decades, "describes": a.describes,
            })),
            "wlf": fit.wlf.map(|w| json!({
                "C1": w.c1, "C2_K": w.c2_k, "C1_standard_error": w.standard_errors[0], "C2_standard_error": w.standard_errors[1],
                "rms_decades": w.rms_decades,
            })),
        })
    });
    let tests = fit.tests.iter().map(|t| {
        json!({
            "file": t.test.file, "temperature_degC": t.test.temperature_degc, "samples": t.test.time_s.len(),
            "rms_per_GPa": t.rms_per_pa * PER_GPA, "noise_per_GPa": t.noise_per_pa * PER_GPA, "shift_factor": t.factor,
        })
    });
    let tried = fit.tried.iter().map(
        |t| json!({ "elements": t.elements, "rms_over_noise": t.rms_over_noise, "bic_above_best": t.bic_above_best }),
    );
    json!({
        "J0_per_GPa": j0, "J0_standard_error": error(j0, 0), "J0_interval": interval(j0, 0),
        "J0_within_s": fit.first_reading_s(),
        "elements": elements.collect::<Vec<_>>(),
        "reference_degC": fit.reference_degc,
        "curve": {
            "time_s": column(|p| p.0), "compliance_per_GPa": column(|p| p.1),
            "lower_per_GPa": column(|p| p.2), "upper_per_GPa": column(|p| p.3),
        },
        "shift": shift,
        "rms_per_GPa": fit.rms_per_pa() * PER_GPA, "noise_per_GPa": fit.noise_per_pa() * PER_GPA,
        "noise_kind": fit.noise.name(), "variance_inflation": fit.inflation,
        "tests": tests.collect::<Vec<_>>(), "tried": tried.collect::<Vec<_>>(), "remarks": fit.remarks,
    })
}
