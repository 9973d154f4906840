//! The page of a creep test: curve, band and residual, the elements, the number of them, and the shift with
//! temperature.

use std::fmt::Write;

use crate::creep::outcome::{CreepFit, Noise, TestFit};
use crate::report::creep::text::{COMPLIANCE_UNIT, curve, elements, headline, shift_lines, temperature, tried};
use crate::report::html::page::{footer, minus, remarks, still_head, table};
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::report::text::number::{significant, with_error};

/// Most points of a measurement that are drawn.
const POINTS: usize = 1500;

/// The page as one HTML document, without scripts.
pub fn html(fit: &CreepFit) -> String {
    let files: Vec<&str> = fit.tests.iter().map(|t| t.test.file.as_str()).collect();
    let mark = if fit.remarks.is_empty() { ("✓", "good") } else { ("≈", "near") };
    let mut out = still_head(&format!("Creep test: {}", files.join(", ")), "creep", "creep test", mark, &headline(fit));
    out.push_str(&remarks(&fit.remarks));
    let at = fit.reference_degc.map_or(String::new(), |t| format!(" at {t} °C"));
    let _ = write!(
        out,
        "<section id=\"curve\"><h2>Compliance</h2>\n<figure>{}</figure>\n<figure>{}</figure>\n<p class=\"note\">Circles: measured{}. Line: J(t) = J0 + Σ J<sub>k</sub> (1 − exp(−t/τ<sub>k</sub>)){at}, with its 95% confidence band, which accounts for noise, correlated elements and autocorrelated residuals (variances {} times). Upright lines: the retardation times. Below: measured − fitted, and ±2 × noise.</p></section>\n",
        compliance(fit).to_svg(900.0, 380.0),
        residual(fit).to_svg(900.0, 230.0),
        if fit.shifts.is_empty() { "" } else { ", times divided by each temperature's shift factor" },
        significant(fit.inflation, 2),
    );
    out.push_str("<section id=\"elements\"><h2>Elements</h2>\n");
    let rows = elements(fit).into_iter().map(|row| row.map(|cell| minus(&escape(&cell))).to_vec());
    let headings = ["element", "J, 1/GPa", "95%", "τ, s", "95%"];
    out.push_str(&table("Elements", &headings, &[1, 2, 3, 4], rows));
    out.push_str(
        "<p class=\"note\">0.1034(21) stands for 0.1034 ± 0.0021, one standard error in the last digits. Element 0 is J0: all strain before the first reading, faster elements included.</p>\n",
    );
    if !fit.creep.elements.is_empty() {
        let _ =
            writeln!(out, "<h4>Contribution of each element</h4><figure>{}</figure>", parts(fit).to_svg(900.0, 280.0));
    }
    out.push_str("</section>\n");
    let rows = tried(fit).into_iter().map(|row| row.map(|cell| escape(&cell)).to_vec());
    let _ = write!(
        out,
        "<section id=\"number\"><h2>How many elements</h2>\n{}<p class=\"note\">BIC: Bayesian information criterion; each additional element must justify its two parameters. A difference of 6 is strong; below 2 the smaller number is taken.</p></section>\n",
        table("How many elements", &["elements", "rms / noise", "BIC above the best"], &[0, 1, 2], rows)
    );
    tests(&mut out, fit);
    if !fit.shifts.is_empty() {
        shift(&mut out, fit);
    }
    out.push_str(&footer(""));
    out.push_str("</body>\n</html>\n");
    out
}

/// Samples of a test, thinned in log time: reduced time, s, and their indices.
fn drawn(test: &TestFit, most: usize) -> Vec<(f64, usize)> {
    let times = &test.test.time_s;
    let (first, last) = (times.iter().copied().find(|t| *t > 0.0).unwrap_or(1.0), times.last().copied().unwrap_or(1.0));
    let cell = |t: f64| ((t / first).ln() / (last / first).ln().max(1e-9) * most as f64).floor();
    let (mut kept, mut before) = (Vec::new(), f64::NEG_INFINITY);
    for (i, &t) in times.iter().enumerate().filter(|(_, t)| **t > 0.0) {
        if times.len() <= most || cell(t) > before {
            kept.push((t / test.factor, i));
            before = cell(t);
        }
    }
    kept
}

fn label(fit: &CreepFit, test: &TestFit) -> String {
    if fit.tests.len() == 1 { "measured".into() } else { temperature(test).unwrap_or_else(|| test.test.file.clone()) }
}

fn circles(n: usize, tests: usize) -> Style {
    if tests == 1 { Style { points: true, ..Style::measured() } } else { Style::points(n + 1) }
}

fn compliance(fit: &CreepFit) -> LineChart {
    let most = POINTS / fit.tests.len().max(1);
    let mut series: Vec<Series> = Vec::new();
    for (n, test) in fit.tests.iter().enumerate() {
        let points = drawn(test, most).into_iter().map(|(t, i)| (t, test.test.compliance_per_pa[i] * 1e9)).collect();
        series.push(Series { label: label(fit, test), points, style: circles(n, fit.tests.len()) });
    }
    let curve = curve(fit);
    let upper = curve.iter().map(|p| (p.0, p.3));
    let outline = upper.chain(curve.iter().rev().map(|p| (p.0, p.2))).collect();
    series.push(Series { label: "95% band of the curve".into(), points: outline, style: Style::area(0) });
    let line = curve.iter().map(|p| (p.0, p.1)).collect();
    series.push(Series { label: "fit".into(), points: line, style: Style::line(0) });
    let marks = fit.creep.elements.iter().enumerate().map(|(k, e)| (e.tau_s, format!("τ{}", k + 1))).collect();
    LineChart { series, marks, ..chart(fit, &format!("compliance, {COMPLIANCE_UNIT}")) }
}

fn chart(fit: &CreepFit, y_label: &str) -> LineChart {
    let x_label = if fit.shifts.is_empty() { "time after loading, s" } else { "time after loading / shift factor, s" };
    LineChart { x_label: x_label.into(), y_label: y_label.into(), log_x: true, ..LineChart::default() }
}

fn residual(fit: &CreepFit) -> LineChart {
    let most = POINTS / fit.tests.len().max(1);
    let mut series: Vec<Series> = Vec::new();
    for (n, test) in fit.tests.iter().enumerate() {
        let left = |i: usize| (test.test.compliance_per_pa[i] - test.fitted_per_pa[i]) * 1e9;
        let points = drawn(test, most).into_iter().map(|(t, i)| (t, left(i))).collect();
        series.push(Series { label: label(fit, test), points, style: circles(n, fit.tests.len()) });
    }
    let curve = curve(fit);
    let mean_square = curve.iter().map(|p| p.1 * p.1).sum::<f64>() / curve.len() as f64;
    let level = |j: f64| match fit.noise {
        Noise::Constant => 2e9 * fit.noise_per_pa(),
        Noise::Proportional => 2e9 * fit.noise_per_pa() * j / mean_square.sqrt(),
    };
    let upper = curve.iter().map(|p| (p.0, level(p.1)));
    let points = upper.chain([(f64::NAN, f64::NAN)]).chain(curve.iter().map(|p| (p.0, -level(p.1)))).collect();
    let style = Style { class: "limit", colour: "#222", dash: "5 4", ..Style::line(0) };
    series.push(Series { label: "±2 × noise".into(), points, style });
    LineChart { series, ..chart(fit, &format!("residual, {COMPLIANCE_UNIT}")) }
}

/// Each element's own share of the compliance.
fn parts(fit: &CreepFit) -> LineChart {
    let times: Vec<f64> = curve(fit).iter().map(|p| p.0).collect();
    let parts = fit.creep.elements.iter().enumerate().map(|(k, e)| Series {
        label: format!("element {}", k + 1),
        points: times.iter().map(|t| (*t, -1e9 * e.compliance_per_pa * (-t / e.tau_s).exp_m1())).collect(),
        style: Style::line(k),
    });
    LineChart { series: parts.collect(), ..chart(fit, &format!("J − J0, {COMPLIANCE_UNIT}")) }
}

fn tests(out: &mut String, fit: &CreepFit) {
    let rows = fit.tests.iter().map(|t| {
        vec![
            escape(&t.test.file),
            temperature(t).unwrap_or_else(|| "–".into()),
            t.test.time_s.len().to_string(),
            significant(t.rms_per_pa * 1e9, 2),
            significant(t.noise_per_pa * 1e9, 2),
        ]
    });
    let headings = ["file", "temperature", "samples", "rms, 1/GPa", "noise, 1/GPa"];
    let _ = write!(
        out,
        "<section id=\"tests\"><h2>Tests</h2>\n{}<p class=\"note\">Noise: scatter from one reading to the next, independent of the model. An rms well above it is misfit or drift.</p></section>\n",
        table("Tests", &headings, &[2, 3, 4], rows)
    );
}

fn shift(out: &mut String, fit: &CreepFit) {
    out.push_str("<section id=\"shift\"><h2>Shift of times with temperature</h2>\n");
    let rows = fit
        .shifts
        .iter()
        .map(|s| vec![format!("{} °C", s.temperature_degc), minus(&with_error(s.factor, s.factor * s.relative_error))]);
    out.push_str(&table("Shift factors", &["temperature", "shift factor"], &[1], rows));
    for line in shift_lines(fit) {
        let _ = writeln!(out, "<p>{}</p>", minus(&escape(&line)));
    }
    out.push_str("</section>\n");
}
