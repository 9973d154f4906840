//! Bars side by side, with whiskers for their errors.

use std::fmt::Write;

use crate::report::svg::Scale;
use crate::report::svg::Style;
use crate::report::text::escape::escape;

/// Horizontal bars in groups.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BarChart {
    /// What it is called, for those who cannot see it.
    pub title: String,
    /// Quantity and unit of the bars.
    pub x_label: String,
    /// Names of the bars of a group, in the legend; not in it where there is one.
    pub series: Vec<String>,
    /// Label of each group, and its bars.
    pub groups: Vec<(String, Vec<Bar>)>,
}

/// One bar from zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// Its end.
    pub value: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

const RIGHT: f64 = 16.0;
const BOTTOM: f64 = 40.0;
const BAR: f64 = 9.0;

impl BarChart {
    /// The chart as an SVG element of `width` px, as high as it needs to be.
    pub fn to_svg(&self, width: f64) -> String {
        let per_group = BAR * self.series.len().max(1) as f64 + 9.0;
        let top = if self.series.len() > 1 { 26.0 } else { 6.0 };
        let bottom = top + per_group * self.groups.len() as f64;
        let letters = self.groups.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
        let left = 12.0 + 6.6 * letters as f64;
        let height = bottom + BOTTOM;
        let mut out = String::new();
        let _ = write!(
            out,
            r##"<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width} {height}" role="img" aria-label="{}" font-family="system-ui, sans-serif" font-size="12" fill="#222">"##,
            escape(&format!("{} ({})", self.title, self.x_label))
        );
        let all = || {
            let ends = self.groups.iter().flat_map(|(_, bars)| bars).flat_map(|b| [b.value, b.low, b.high]);
            ends.filter(|v| v.is_finite())
        };
        let (low, high) = (all().fold(0.0, f64::min), all().fold(0.0, f64::max));
        if high - low <= 0.0 {
            let _ = write!(out, r#"<text x="12" y="20">no data</text></svg>"#);
            return out;
        }
        if self.series.len() > 1 {
            let mut x = left;
            for (i, name) in self.series.iter().enumerate() {
                let style = Style::line(i);
                let _ = write!(
                    out,
                    r#"<rect class="{}" x="{x}" y="6" width="14" height="9" fill="{}"/><text x="{}" y="15">{}</text>"#,
                    style.class,
                    style.colour,
                    x + 20.0,
                    escape(name)
                );
                x += 44.0 + 7.0 * name.chars().count() as f64;
            }
        }
        let x = Scale::new((low, high * 1.02), left, width - RIGHT, false);
        let ticks = x.ticks(((width - RIGHT - left) / 65.0) as usize);
        out.push_str(r##"<g class="grid" stroke="#ddd" fill="none"><path d=""##);
        for t in &ticks.at {
            let _ = write!(out, "M{:.1} {top:.1}V{bottom:.1}", x.px(*t));
        }
        out.push_str(r#""/></g><g class="label">"#);
        for t in &ticks.at {
            let _ = write!(
                out,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
                x.px(*t),
                bottom + 15.0,
                ticks.label(*t)
            );
        }
        let _ = write!(
            out,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text></g>"#,
            0.5 * (left + width - RIGHT),
            bottom + 33.0,
            escape(&self.x_label)
        );
        for (g, (label, bars)) in self.groups.iter().enumerate() {
            let y = top + per_group * g as f64 + 4.5;
            let middle = y + 0.5 * BAR * bars.len() as f64;
            let _ = write!(
                out,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
                left - 6.0,
                middle + 4.0,
                escape(label)
            );
            for (i, bar) in bars.iter().enumerate().filter(|(_, b)| b.value.is_finite()) {
                draw(&mut out, *bar, i, y + BAR * i as f64, &x);
            }
        }
        let zero = x.px(0.0);
        let _ = write!(
            out,
            r##"<path class="axis" d="M{zero:.1} {top:.1}V{bottom:.1}" stroke="#666" fill="none"/></svg>"##
        );
        out
    }
}

fn draw(out: &mut String, bar: Bar, series: usize, y: f64, x: &Scale) {
    let style = Style::line(series);
    let (a, b) = (x.px(bar.value.min(0.0)), x.px(bar.value.max(0.0)));
    let _ = write!(
        out,
        r#"<rect class="{}" x="{a:.1}" y="{y:.1}" width="{:.1}" height="{}" fill="{}"/>"#,
        style.class,
        b - a,
        BAR - 1.0,
        style.colour
    );
    if bar.low.is_finite() && bar.high.is_finite() {
        let _ = write!(
            out,
            r##"<path class="whisker" d="M{:.1} {:.1}H{:.1}" stroke="#222" fill="none"/>"##,
            x.px(bar.low),
            y + 0.5 * (BAR - 1.0),
            x.px(bar.high)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar(value: f64) -> Bar {
        Bar { value, low: value - 0.1, high: value + 0.1 }
    }

    #[test]
    fn bars_are_as_long_as_their_values() {
        let chart = BarChart {
            x_label: "share".into(),
            series: vec!["first".into(), "total".into()],
            groups: vec![("a<b".into(), vec![bar(0.2), bar(0.4)]), ("c".into(), vec![bar(-0.05), bar(f64::NAN)])],
            ..BarChart::default()
        };
        let svg = chart.to_svg(400.0);
        let widths: Vec<f64> = svg
            .split("<rect ")
            .skip(3)
            .map(|r| r.split("width=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap())
            .collect();
        assert_eq!(widths.len(), 3);
        assert!(
            (widths[1] / widths[0] - 2.0).abs() < 0.01 && (widths[2] / widths[0] - 0.25).abs() < 0.01,
            "{widths:?}"
        );
        assert_eq!(svg.matches("whisker").count(), 3);
        assert!(svg.contains("a&lt;b") && !svg.contains("NaN"));
        assert!(BarChart::default().to_svg(300.0).contains("no data"));
    }
}
