//! The stages side by side: the staircase of errors, and how each was computed.

use std::fmt::Write;

use crate::report::Stage;
use crate::report::html::page::{colour, table};
use crate::report::svg::Scale;
use crate::report::text::escape::escape;
use crate::report::text::number::{duration, error_m, times, times_noise};
use crate::report::view::curves::find;
use crate::report::view::summary::{Overall, overall};

/// Error of each stage on a logarithmic axis, with the noise as the floor that no model can pass. Dots, for such an
/// axis has no zero that a bar could start from; the line from the noise to a dot is as long as the error is times the
/// noise.
///
/// `below` is HTML that ends the section.
pub(crate) fn staircase(stages: &[Stage], below: &str) -> String {
    let errors: Vec<Overall> = stages.iter().map(|s| overall(s.fit)).collect();
    let noise = errors.last().map_or(f64::NAN, |e| e.noise_m);
    let Some(axis) = axis(errors.iter().map(|e| e.rmse_m).chain([noise])) else { return String::new() };
    let mut out = String::from("<section id=\"errors\"><h2>Error against the noise</h2>\n<div class=\"stairs\">\n");
    let floor = if noise > 0.0 && noise.is_finite() {
        format!(r#"<i class="floor" style="left:{:.2}%"></i>"#, axis.px(noise))
    } else {
        String::new()
    };
    for (i, (stage, error)) in stages.iter().zip(&errors).enumerate() {
        let colour = colour(i, stages.len());
        let dot = if error.rmse_m > 0.0 && error.rmse_m.is_finite() {
            let at = axis.px(error.rmse_m);
            let from = if floor.is_empty() { at } else { axis.px(noise) };
            format!(
                r#"<i class="reach" style="left:{:.2}%;width:{:.2}%;background:var(--s{colour})"></i><i class="dot" style="left:{at:.2}%;background:var(--s{colour})"></i>"#,
                from.min(at),
                (at - from).abs(),
            )
        } else {
            String::new()
        };
        let _ = writeln!(
            out,
            r#"<div class="step"><span class="name">{}</span><span class="track">{floor}{dot}</span><span class="value"><strong>{} m</strong> <small>{}</small></span></div>"#,
            escape(&stage.title),
            error_m(error.rmse_m),
            times_noise(error.rmse_m, error.noise_m),
        );
    }
    out.push_str(r#"<div class="step scale" aria-hidden="true"><span class="name"></span><span class="track">"#);
    let ticks = axis.ticks(8);
    // Marks at the very ends have no room for their numbers.
    for &tick in ticks.at.iter().filter(|t| (2.0..=98.0).contains(&axis.px(**t))) {
        let _ = write!(out, r#"<b style="left:{:.2}%">{}</b>"#, axis.px(tick), ticks.label(tick));
    }
    out.push_str("</span><span class=\"value\">RMSE, m</span></div>\n</div>\n");
    if !floor.is_empty() {
        let _ = writeln!(
            out,
            r#"<p class="note"><i class="floor-key"></i> Noise of the sensors, {} m: no model can be expected to fall below it. Logarithmic axis; RMSE over all samples of all pressure sensors from the start of the closure.</p>"#,
            error_m(noise)
        );
    }
    out.push_str(below);
    out.push_str("</section>\n");
    out
}

/// Error of each stage as numbers: over all samples, and at each sensor (or, of several runs, in each run) in units of
/// its noise.
pub(crate) fn errors(stages: &[Stage]) -> String {
    let Some(last) = stages.last() else { return String::new() };
    let places: Vec<(String, &str, Option<&str>)> = match last.fit.runs.as_slice() {
        [run] => run.sensors.iter().map(|s| (s.name.clone(), run.file.as_str(), Some(s.name.as_str()))).collect(),
        runs => runs.iter().map(|r| (r.file.clone(), r.file.as_str(), None)).collect(),
    };
    let rows = stages.iter().map(|stage| {
        let all = overall(stage.fit);
        let mut row =
            vec![escape(&stage.title), error_m(all.rmse_m), error_m(all.noise_m), times(all.rmse_m, all.noise_m)];
        row.extend(places.iter().map(|(_, file, sensor)| match sensor {
            Some(sensor) => find(stage.fit, file, sensor).map_or("–".into(), |s| times(s.rmse_m, s.noise_m)),
            None => {
                let run = stage.fit.runs.iter().find(|r| r.file == *file);
                run.map_or("–".into(), |r| times(r.rmse_m, r.noise_m))
            }
        }));
        row
    });
    let names: Vec<String> = places.iter().map(|(name, _, _)| escape(&format!("{name}, × noise"))).collect();
    let mut headings = vec!["model", "RMSE, m", "noise, m", "RMSE, × noise"];
    headings.extend(names.iter().map(String::as_str));
    let numbers: Vec<usize> = (1..headings.len()).collect();
    table("Error of each model", &headings, &numbers, rows)
}

/// How each stage was computed.
pub(crate) fn computation(stages: &[Stage]) -> String {
    if stages.is_empty() {
        return String::new();
    }
    // The models of a diagnosis have no times of their own.
    let timed = stages.iter().any(|s| s.fit.seconds > 0.0);
    let rows = stages.iter().map(|stage| {
        let fit = stage.fit;
        let effects = if fit.effects.is_empty() { "none".into() } else { escape(&fit.labels().join(", ")) };
        let done = if fit.converged { "" } else { r#"<span class="flag">stopped early</span> "# };
        let mut row = vec![
            escape(&stage.title),
            effects,
            format!("<span class=\"prose\">{done}{}</span>", escape(&fit.stopped_because)),
            fit.parameters.len().to_string(),
            fit.reaches.to_string(),
            fit.evaluations.to_string(),
        ];
        row.extend(timed.then(|| duration(fit.seconds)));
        row
    });
    let mut headings = vec!["model", "effects", "why it stopped", "parameters", "reaches", "simulations"];
    headings.extend(timed.then_some("time"));
    format!(
        "<section id=\"computation\"><h2>How it was computed</h2>\n{}<p class=\"note\">Method of characteristics, calibrated by {}; program version {}.</p></section>\n",
        table("How each stage was computed", &headings, &[3, 4, 5, 6], rows),
        methods(stages),
        env!("CARGO_PKG_VERSION")
    )
}

/// How the stages were searched for, in words.
fn methods(stages: &[Stage]) -> String {
    let mut all: Vec<&str> = stages.iter().map(|s| s.fit.method.in_words()).collect();
    all.dedup();
    all.join("; ")
}

/// A logarithmic axis in percent of its width, with room left of the smallest value; `None` without a positive one.
fn axis(values: impl Iterator<Item = f64>) -> Option<Scale> {
    let (mut lo, mut hi) = (f64::INFINITY, 0.0f64);
    for v in values.filter(|v| v.is_finite() && *v > 1e-12) {
        (lo, hi) = (lo.min(v), hi.max(v));
    }
    (lo <= hi).then(|| Scale::new((lo / 2.5, hi * 1.15), 0.0, 100.0, true))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_factors_are_equal_lengths() {
        let axis = axis([0.03, 2.0, f64::NAN, 0.0].into_iter()).unwrap();
        let step = |a: f64, b: f64| axis.px(b) - axis.px(a);
        assert!((step(0.03, 0.3) - step(0.2, 2.0)).abs() < 1e-9);
        assert!(super::axis([f64::NAN, 0.0].into_iter()).is_none());
    }
}
