//! The curves as compact JSON for the page's script.

use std::fmt::Write;

use crate::report::Stage;
use crate::report::html::page::colour;
use crate::report::text::number::decimals_for;
use crate::report::view::panel::Panel;

/// `{"ahead_from": time after which a model predicts or null, "stages": [{"title", "colour"}], "panels": [{"x", "measured", "models", "band", "noise", "unit", "overlays"}]}`;
/// `unit` is how the sensor shows a head, `{"name", "per_m", "zero"}`, or null where it shows the head itself.
pub(crate) fn json(stages: &[Stage], panels: &[Panel], ahead_from_s: Option<f64>) -> String {
    let mut out = String::from(r#"{"ahead_from":"#);
    number(&mut out, ahead_from_s.unwrap_or(f64::NAN), 6);
    out.push_str(r#","stages":"#);
    list(&mut out, stages.iter().enumerate(), |out, (i, stage)| {
        let _ = write!(out, r#"{{"title":{},"colour":{}}}"#, text(&stage.title), colour(i, stages.len()));
    });
    out.push_str(r#","panels":"#);
    list(&mut out, panels.iter(), panel);
    out.push('}');
    out
}

fn panel(out: &mut String, panel: &Panel) {
    let c = &panel.curves;
    let span = |v: &[f64]| {
        let finite = || v.iter().copied().filter(|v| v.is_finite());
        finite().fold(f64::NEG_INFINITY, f64::max) - finite().fold(f64::INFINITY, f64::min)
    };
    // Resolutions that no eye can tell from the full number, zoomed in as far as the samples and the noise allow.
    let samples = c.samples.max(1) as f64;
    let time = decimals_for(span(&c.time_s) / samples / 20.0);
    let noise = if panel.fit.noise_m > 0.0 { panel.fit.noise_m } else { f64::INFINITY };
    let head = decimals_for((span(&c.measured_m) * 1e-4).min(noise * 0.1));
    out.push_str(r#"{"x":"#);
    numbers(out, &c.time_s, time);
    out.push_str(r#","measured":"#);
    numbers(out, &c.measured_m, head);
    out.push_str(r#","models":"#);
    list(out, c.models_m.iter(), |out, model| numbers(out, model, head));
    out.push_str(r#","band":"#);
    numbers(out, &c.band_m, head + 1);
    out.push_str(r#","noise":"#);
    number(out, panel.fit.noise_m, 9);
    out.push_str(r#","unit":"#);
    match &panel.unit {
        Some(unit) => {
            let _ = write!(out, r#"{{"name":{},"per_m":{:e},"zero":{:e}}}"#, text(unit.symbol), unit.per_m, unit.zero);
        }
        None => out.push_str("null"),
    }
    out.push_str(r#","overlays":"#);
    list(out, panel.overlays.iter(), |out, overlay| {
        let mut points: Vec<(f64, f64)> = overlay
            .time_s
            .iter()
            .copied()
            .zip(overlay.head_m.iter().copied())
            .filter(|(t, h)| t.is_finite() && h.is_finite())
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by_key(|p| p.0);
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let _ = write!(out, r#"{{"label":{},"x":"#, text(&overlay.label));
        numbers(out, &x, time.max(4));
        out.push_str(r#","y":"#);
        numbers(out, &y, head);
        out.push('}');
    });
    out.push('}');
}

fn list<T>(out: &mut String, items: impl Iterator<Item = T>, mut write: impl FnMut(&mut String, T)) {
    out.push('[');
    for (i, item) in items.enumerate() {
        if i > 0 {
            out.push(',');
        }
        write(out, item);
    }
    out.push(']');
}

fn numbers(out: &mut String, values: &[f64], decimals: usize) {
    list(out, values.iter(), |out, &v| number(out, v, decimals));
}

/// A number without trailing zeros, `null` where it is not finite.
fn number(out: &mut String, value: f64, decimals: usize) {
    if !value.is_finite() {
        out.push_str("null");
        return;
    }
    let start = out.len();
    let _ = write!(out, "{value:.decimals$}");
    if decimals > 0 {
        let short = start + out[start..].trim_end_matches('0').trim_end_matches('.').len();
        out.truncate(short);
    }
    if &out[start..] == "-0" {
        out.replace_range(start.., "0");
    }
}

fn text(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_valid() {
        let mut out = String::new();
        numbers(&mut out, &[1.0, -0.0001, 0.25, f64::NAN, 1200.0, -2.51559, f64::INFINITY], 3);
        assert_eq!(out, "[1,0,0.25,null,1200,-2.516,null]");
        out.clear();
        numbers(&mut out, &[1200.0, 0.4], 0);
        assert_eq!(out, "[1200,0]");
    }
}
