//! Still charts side by side.

use crate::fit::outcome::{Fit, SensorFit};

/// Size of a chart, px.
pub(super) const WIDTH: f64 = 540.0;
pub(super) const HEIGHT: f64 = 290.0;

/// What a chart is called: its sensor, with the run where there are several.
pub(super) fn title(fit: &Fit, file: &str, sensor: &SensorFit) -> String {
    if fit.runs.len() > 1 { format!("{} · {file}", sensor.name) } else { sensor.name.clone() }
}

/// Charts, two a line where there is room.
pub(super) fn plates(charts: &[String]) -> String {
    let each: Vec<String> = charts
        .iter()
        .map(|svg| format!("<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"chart\">{svg}</div>\n"))
        .collect();
    format!("<div class=\"plates\">\n{}</div>\n", each.concat())
}
