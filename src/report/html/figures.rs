//! Still charts side by side.

use std::fmt::Write;

use crate::fit::outcome::fit::{Fit, SensorFit};
use crate::report::svg::LineChart;
use crate::report::text::escape::escape;

/// Size of a chart, px: small, so that its letters stay readable where a phone shrinks it.
const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 300.0;

/// What a chart is called: its sensor, with the run where there are several.
pub(crate) fn title(fit: &Fit, file: &str, sensor: &SensorFit) -> String {
    if fit.runs.len() > 1 { format!("{} · {file}", sensor.name) } else { sensor.name.clone() }
}

/// Charts under their captions, two a line where there is room.
pub(crate) fn plates(charts: &[(String, LineChart)]) -> String {
    let mut out = String::from("<div class=\"plates\">\n");
    for (caption, chart) in charts {
        let _ = writeln!(
            out,
            "<figure><figcaption>{}</figcaption>{}</figure>",
            escape(caption),
            chart.to_svg(WIDTH, HEIGHT)
        );
    }
    out.push_str("</div>\n");
    out
}
