//! One sensor of one run: charts for the script, the same as still pictures, and the table of extrema.

use std::fmt::Write;

use crate::fit::problem::compare::ExtremumError;
use crate::report::Page;
use crate::report::Stage;
use crate::report::html::page::{colour, minus, table};
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::escape::escape;
use crate::report::text::number::{decimals_for, error_m, fixed, signed, significant, times_noise};
use crate::report::view::curves::{BUCKETS, Curves, find};
use crate::report::view::panel::Panel;

const X_LABEL: &str = "time after the start of the closure, s";
const HEAD_LABEL: &str = "head, m";
const RESIDUAL_LABEL: &str = "model − measured, m";
/// Stretches of a still picture: about one a pixel.
const STILL_BUCKETS: usize = 420;

pub(crate) fn section(index: usize, panel: &Panel, page: &Page) -> String {
    let stages = &page.stages;
    let fit = panel.fit;
    let name = escape(&fit.name);
    let line = page.rig.sensors.iter().find(|s| s.name == fit.name).map_or(0, |s| s.line);
    let mut out = format!(
        r#"<section class="sensor" id="sensor-{index}"><h3>{name} <small>{} m {} · {}</small></h3>
<p class="facts">{}</p>
<div class="live" data-panel="{index}" hidden>
<div class="tools"><span class="hint">Drag to zoom, double-click to see all. Click a name to hide its curve.</span><span class="buttons"></span></div>
<h4><span class="quantity">Head</span>, <span class="unit">m</span></h4><div class="legend" data-of="head"></div><div class="plot head" role="img" aria-label="Measured and modelled head at {name} over time"></div>
<h4>Model − measured, <span class="unit">m</span></h4>{}
</div>
<div class="still">
"#,
        significant(fit.position_m, 4),
        escape(&page.rig.along_words(line)),
        escape(panel.file),
        facts(panel, stages),
        residuals(&name, stages),
    );
    out.push_str(&still(panel, stages, page.prediction.map(|p| p.known_until_s)));
    out.push_str("</div>\n");
    let c = &panel.curves;
    if !c.band_m.is_empty() {
        out.push_str("<p class=\"note\">Band: the model expects a sample in it with 95% probability, given the noise and the uncertainty of the parameters. If the model lacks nothing, 95% of the samples lie inside.</p>\n");
    }
    if c.decimated {
        let _ = writeln!(
            out,
            r#"<p class="note">{} of {} samples are drawn: the trace is cut into {BUCKETS} equal stretches, and each keeps the lowest and the highest point of every curve and residual, so no peak is lost. Errors and tables use all samples.</p>"#,
            c.time_s.len(),
            c.samples
        );
    }
    out.push_str(&extrema(&fit.extrema, fit.noise_m, &fit.name));
    out.push_str("</section>\n");
    out
}

/// A place for the residual of each model: each has a scale of its own, for a good model's is a line beside a poor
/// one's.
fn residuals(sensor: &str, stages: &[Stage]) -> String {
    let of = |(i, stage): (usize, &Stage)| {
        format!(
            r#"<div class="legend" data-of="residual-{i}"></div><div class="plot residual" data-stage="{i}" role="img" aria-label="{}, modelled minus measured head at {sensor} over time"></div>"#,
            escape(&stage.title)
        )
    };
    stages.iter().enumerate().map(of).collect::<Vec<_>>().join("\n")
}

/// Figures and still pictures of a sensor.
pub(crate) fn pictures(panel: &Panel, stages: &[Stage]) -> String {
    format!("<p class=\"facts\">{}</p>\n{}", facts(panel, stages), still(panel, stages, None))
}

fn facts(panel: &Panel, stages: &[Stage]) -> String {
    let fit = panel.fit;
    let before = stages.first().filter(|_| stages.len() > 1).and_then(|s| find(s.fit, panel.file, &fit.name));
    let before = before.map_or(String::new(), |s| format!("{} → ", change(s.rmse_m)));
    let inside = fit
        .inside_band()
        .map_or(String::new(), |share| format!(" · {}% of the samples inside the 95% band", fixed(100.0 * share, 1)));
    format!(
        "RMSE {before}<strong>{}</strong> · noise {} · {}{inside}",
        change(fit.rmse_m),
        change(fit.noise_m),
        times_noise(fit.rmse_m, fit.noise_m)
    )
}

/// A difference of heads with its unit, which the page's script turns into the sensor's own.
fn change(value_m: f64) -> String {
    format!("{} <span class=\"unit\">m</span>", head("change", value_m, &error_m(value_m)))
}

/// A head, or a `change` of it, as the page shows it and as its script converts it.
fn head(class: &str, value_m: f64, text: &str) -> String {
    if value_m.is_finite() {
        format!("<data class=\"{class}\" value=\"{value_m}\">{}</data>", minus(text))
    } else {
        text.to_owned()
    }
}

/// Head and residual as still pictures.
fn still(panel: &Panel, stages: &[Stage], ahead_from_s: Option<f64>) -> String {
    let c = &panel.curves;
    let style = |i: usize| Style::line(colour(i, stages.len()));
    let mut head = vec![line("measured", c, &c.measured_m, Style::measured())];
    let last = c.models_m.len().saturating_sub(1);
    if let Some(model) = c.models_m.last().filter(|_| !c.band_m.is_empty()) {
        head.push(band(c, model));
    }
    let mut residuals: Vec<Vec<Series>> = Vec::new();
    for (i, (stage, (model, rest))) in stages.iter().zip(c.models_m.iter().zip(&c.residuals_m())).enumerate() {
        head.push(line(&stage.title, c, model, style(i)));
        let band = (i == last && !c.band_m.is_empty()).then(|| band(c, &vec![0.0; model.len()]));
        residuals.push(band.into_iter().chain([line(&stage.title, c, rest, style(i))]).chain(limits(panel)).collect());
    }
    for overlay in &panel.overlays {
        let points = overlay.time_s.iter().copied().zip(overlay.head_m.iter().copied()).collect();
        head.push(Series {
            label: overlay.label.clone(),
            points,
            style: Style { class: "overlay", ..Style::points(3) },
        });
    }
    let chart = |y_label: &str, series| LineChart {
        x_label: X_LABEL.into(),
        y_label: y_label.into(),
        series,
        marks: ahead_from_s.map(|from| (from, "predicted from here".to_owned())).into_iter().collect(),
        ..LineChart::default()
    };
    let residuals = residuals.into_iter().map(|series| chart(RESIDUAL_LABEL, series).to_svg(900.0, 220.0));
    chart(HEAD_LABEL, head).to_svg(900.0, 330.0) + &residuals.collect::<String>()
}

/// Two standard deviations of the noise, on either side.
fn limits(panel: &Panel) -> Option<Series> {
    let time_s = &panel.curves.time_s;
    let (&from, &to) = (time_s.first()?, time_s.last()?);
    (panel.fit.noise_m > 0.0).then(|| {
        let (level, gap) = (2.0 * panel.fit.noise_m, f64::NAN);
        let points = vec![(from, level), (to, level), (gap, gap), (from, -level), (to, -level)];
        let style = Style { class: "limit", colour: "#222", dash: "5 4", width: 1.5, points: false, area: false };
        Series { label: "±2 × noise".into(), points, style }
    })
}

/// The 95% band around a curve.
fn band(curves: &Curves, middle: &[f64]) -> Series {
    let edge = |sign: f64| {
        let values: Vec<f64> = middle.iter().zip(&curves.band_m).map(|(m, half)| m + sign * half).collect();
        let edge = line("", curves, &values, Style::area(0)).points;
        edge.into_iter().filter(|p| p.1.is_finite()).collect::<Vec<_>>()
    };
    let points = edge(1.0).into_iter().chain(edge(-1.0).into_iter().rev()).collect();
    Series { label: "95% band".into(), points, style: Style::area(0) }
}

fn line(label: &str, curves: &Curves, values: &[f64], style: Style) -> Series {
    let kept = crate::report::view::decimate::keep(&[values], values.len(), STILL_BUCKETS);
    let points = kept.iter().filter_map(|&i| Some((*curves.time_s.get(i)?, *values.get(i)?))).collect();
    Series { label: label.into(), points, style }
}

fn extrema(extrema: &[ExtremumError], noise_m: f64, sensor: &str) -> String {
    if extrema.is_empty() {
        return "<p class=\"note\">No peaks or troughs were found in this trace.</p>\n".into();
    }
    let decimals = decimals_for(noise_m);
    let rows = extrema.iter().map(|e| {
        let error = e.model_m - e.measured_m;
        vec![
            format!("<span class=\"nowrap\">{} {}</span>", e.cycle, if e.peak { "peak" } else { "trough" }),
            fixed(e.time_s, 3),
            head("level", e.measured_m, &fixed(e.measured_m, decimals)),
            head("level", e.model_m, &fixed(e.model_m, decimals)),
            head("change signed", error, &signed(error, decimals)),
            minus(&signed(100.0 * error / e.measured_m.abs(), 2)),
            minus(&signed(e.phase_s * 1e3, 1)),
        ]
    });
    let headings = ["cycle", "time, s", "measured, m", "model, m", "error, m", "error, %", "phase, ms"];
    let caption = format!("Peaks and troughs at {sensor}");
    format!(
        "<details><summary>Peaks and troughs ({})</summary>\n{}<p class=\"note\">Error: model − measured. Phase: how much later the model crosses its mean level before the extremum; positive means that the model is late.</p></details>\n",
        extrema.len(),
        table(&caption, &headings, &[1, 2, 3, 4, 5, 6], rows)
    )
}
