//! Small static charts (lines here, [`bars`], [`heat`] maps): what a page shows where no script runs, in print, and any
//! other plot.
//!
//! Every mark carries a class beside its own colour (`chart`, `grid`, `axis`, `series-0` …), so that a page's style
//! sheet can recolour it for dark mode or paper; a file of its own looks right without one.

pub(crate) mod axis;
pub mod bars;
pub mod heat;

use std::fmt::Write;

pub(crate) use crate::report::svg::axis::Scale;
use crate::report::svg::axis::{Area, Labelled, log_range, padded, wide};

use crate::report::text::escape::escape;

/// A line chart with labelled axes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LineChart {
    /// Above the chart; none if empty.
    pub title: String,
    /// Quantity and unit along x.
    pub x_label: String,
    /// Quantity and unit along y.
    pub y_label: String,
    /// The curves, drawn in this order.
    pub series: Vec<Series>,
    /// Logarithmic x axis; places that are not positive are left out.
    pub log_x: bool,
    /// Logarithmic y axis; values that are not positive are left out.
    pub log_y: bool,
    /// Only whole numbers stand along x: it counts something.
    pub whole_x: bool,
    /// Room left and right, where points would stand on the frame; a line runs from edge to edge without it.
    pub room_x: bool,
    /// Places along x that are marked by an upright line with a short word at its top; only those within the curves'
    /// range are.
    pub marks: Vec<(f64, String)>,
}

/// One curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend; not in it if empty.
    pub label: String,
    /// Points (x, y); a point that is not finite interrupts the line.
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub style: Style,
}

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// CSS class, for a page's own colours.
    pub class: &'static str,
    /// Colour where no style sheet says otherwise.
    pub colour: &'static str,
    /// `stroke-dasharray`; solid if empty.
    pub dash: &'static str,
    /// Line width, px.
    pub width: f64,
    /// Points instead of a line.
    pub points: bool,
    /// A band, whose outline the points are, instead of a line.
    pub area: bool,
}

/// Colours told apart by colour-blind readers too (after Okabe and Ito, darkened to 3:1 on white).
const PALETTE: [(&str, &str, &str); 5] = [
    ("series-0", "#0072b2", ""),
    ("series-1", "#c8500a", "6 3"),
    ("series-2", "#00805d", "2 3"),
    ("series-3", "#a8438a", "8 3 2 3"),
    ("series-4", "#8a6500", "10 4"),
];

impl Style {
    /// The n-th of a set of lines; colour and dash both tell them apart. They repeat after five.
    pub fn line(n: usize) -> Self {
        let (class, colour, dash) = PALETTE[n % PALETTE.len()];
        Self { class, colour, dash, width: 1.5, points: false, area: false }
    }

    /// A measurement: broad and light, so that it is seen behind a model that follows it.
    pub fn measured() -> Self {
        Self { class: "measured", colour: "#b0b8c1", dash: "", width: 5.0, points: false, area: false }
    }

    /// A pale band in the n-th colour.
    pub fn area(n: usize) -> Self {
        Self { area: true, ..Self::line(n) }
    }

    /// Separate points in the n-th colour.
    pub fn points(n: usize) -> Self {
        Self { points: true, ..Self::line(n) }
    }
}

/// Room around the plotting area, px.
const LEFT: f64 = 74.0;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 44.0;
const LINE: f64 = 18.0;
/// More points than these are drawn smaller.
const MANY_POINTS: usize = 60;

impl LineChart {
    /// The chart for a page that gives its title itself.
    pub fn untitled(self) -> Self {
        Self { title: String::new(), ..self }
    }

    /// The chart as an SVG element of `width` × `height` px that scales with the room it is given.
    pub fn to_svg(&self, width: f64, height: f64) -> String {
        let mut out = String::new();
        let _ = write!(
            out,
            r##"<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width} {height}" role="img" aria-label="{}" font-family="system-ui, sans-serif" font-size="12" fill="#222">"##,
            escape(&format!("{} ({} over {})", self.title, self.y_label, self.x_label))
        );
        let mut top = 8.0;
        if !self.title.is_empty() {
            let _ =
                write!(out, r#"<text x="{LEFT}" y="{}" font-weight="600">{}</text>"#, top + 11.0, escape(&self.title));
            top += LINE;
        }
        top += self.legend(&mut out, top, width);
        // Words over marks have a line of their own.
        top += if self.marks.is_empty() { 4.0 } else { 16.0 };
        let area = Area { left: LEFT, top, right: width - RIGHT, bottom: height - BOTTOM };
        match self.scales(area) {
            Some((x, y)) => {
                self.axes(&mut out, area, &x, &y);
                self.marked(&mut out, area, &x);
                for series in &self.series {
                    self.curve(&mut out, series, &x, &y);
                }
            }
            None => {
                let _ = write!(out, r#"<text x="{LEFT}" y="{}">no data</text>"#, top + 30.0);
            }
        }
        out.push_str("</svg>");
        out
    }

    fn shown(&self, point: &(f64, f64)) -> bool {
        point.0.is_finite() && point.1.is_finite() && (!self.log_y || point.1 > 0.0) && (!self.log_x || point.0 > 0.0)
    }

    fn scales(&self, area: Area) -> Option<(Scale, Scale)> {
        let points = self.series.iter().flat_map(|s| &s.points).filter(|p| self.shown(p));
        let (mut x, mut y) = ((f64::INFINITY, f64::NEG_INFINITY), (f64::INFINITY, f64::NEG_INFINITY));
        for p in points {
            x = (x.0.min(p.0), x.1.max(p.0));
            y = (y.0.min(p.1), y.1.max(p.1));
        }
        if x.0 > x.1 {
            return None;
        }
        let y = if self.log_y { log_range(y) } else { padded(y) };
        Some((
            Scale::new(
                if self.log_x {
                    log_range(x)
                } else if self.room_x {
                    padded(x)
                } else {
                    wide(x)
                },
                area.left,
                area.right,
                self.log_x,
            ),
            Scale::new(y, area.bottom, area.top, self.log_y),
        ))
    }

    /// Draws the legend, in as many rows as it needs, and returns its height.
    fn legend(&self, out: &mut String, top: f64, width: f64) -> f64 {
        let (mut x, mut row) = (LEFT, 0.0);
        for series in self.series.iter().filter(|s| !s.label.is_empty()) {
            // A letter is about 7 px wide at 12 px; a legend needs no better.
            let room = 44.0 + 7.0 * series.label.chars().count() as f64;
            if x > LEFT && x + room > width - RIGHT {
                (x, row) = (LEFT, row + LINE);
            }
            let y = top + row + 8.0;
            let s = series.style;
            if s.points {
                let _ = write!(
                    out,
                    r#"<circle class="{}" cx="{}" cy="{y}" r="3" fill="{}"/>"#,
                    s.class,
                    x + 11.0,
                    s.colour
                );
            } else if s.area {
                out.push_str(&filled(s, &format!("M{x} {}h22v10h-22", y - 5.0)));
            } else {
                let d = format!("M{x} {y}h22");
                out.push_str(&stroke(s, &d));
            }
            let _ = write!(out, r#"<text x="{}" y="{}">{}</text>"#, x + 27.0, y + 4.0, escape(&series.label));
            x += room;
        }
        if x > LEFT { row + LINE } else { 0.0 }
    }

    fn axes(&self, out: &mut String, area: Area, x: &Scale, y: &Scale) {
        let Area { left, top, right, bottom } = area;
        out.push_str(r##"<g class="grid" stroke="#ddd" stroke-width="1" fill="none"><path d=""##);
        let (mut xs, ys) = (x.ticks(((right - left) / 65.0) as usize), y.ticks(((bottom - top) / 30.0) as usize));
        if self.whole_x {
            xs = xs.whole();
        }
        for t in &xs.at {
            let _ = write!(out, "M{:.1} {top:.1}V{bottom:.1}", x.px(*t));
        }
        for t in &ys.at {
            let _ = write!(out, "M{left:.1} {:.1}H{right:.1}", y.px(*t));
        }
        out.push_str(r#""/></g>"#);
        crate::report::svg::axis::draw(
            out,
            area,
            &Labelled { scale: x, ticks: &xs, label: &self.x_label },
            &Labelled { scale: y, ticks: &ys, label: &self.y_label },
        );
    }

    fn marked(&self, out: &mut String, area: Area, x: &Scale) {
        for (at, word) in &self.marks {
            let px = x.px(*at);
            if !(area.left..=area.right).contains(&px) {
                continue;
            }
            let _ = write!(
                out,
                r##"<path class="mark" d="M{px:.1} {:.1}V{:.1}" stroke="#999" stroke-dasharray="1 3" fill="none"/><g class="label"><text x="{px:.1}" y="{:.1}" text-anchor="middle" font-size="10">{}</text></g>"##,
                area.top,
                area.bottom,
                area.top - 4.0,
                escape(word)
            );
        }
    }

    fn curve(&self, out: &mut String, series: &Series, x: &Scale, y: &Scale) {
        let s = series.style;
        if s.points {
            let radius = if series.points.len() > MANY_POINTS { 2 } else { 3 };
            let _ = write!(out, r#"<g class="{} points" fill="{}">"#, s.class, s.colour);
            for p in series.points.iter().filter(|p| self.shown(p)) {
                let _ = write!(out, r#"<circle cx="{:.1}" cy="{:.1}" r="{radius}"/>"#, x.px(p.0), y.px(p.1));
            }
            out.push_str("</g>");
            return;
        }
        let mut d = String::new();
        let (mut pen_down, mut last) = (false, (f64::NAN, f64::NAN));
        for p in &series.points {
            if !self.shown(p) {
                pen_down = false;
                continue;
            }
            let at = ((x.px(p.0) * 10.0).round() / 10.0, (y.px(p.1) * 10.0).round() / 10.0);
            if !pen_down || at != last {
                let _ = write!(d, "{}{} {}", if pen_down { 'L' } else { 'M' }, at.0, at.1);
            }
            (pen_down, last) = (true, at);
        }
        out.push_str(&if s.area { filled(s, &d) } else { stroke(s, &d) });
    }
}

fn filled(s: Style, d: &str) -> String {
    format!(r#"<path class="{} area" d="{d}Z" fill="{}" fill-opacity="0.22" stroke="none"/>"#, s.class, s.colour)
}

fn stroke(s: Style, d: &str) -> String {
    let dash = if s.dash.is_empty() { String::new() } else { format!(r#" stroke-dasharray="{}""#, s.dash) };
    format!(
        r#"<path class="{}" d="{d}" fill="none" stroke="{}" stroke-width="{}" stroke-linejoin="round"{dash}/>"#,
        s.class, s.colour, s.width
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>, log_y: bool) -> LineChart {
        LineChart {
            title: "a <title>".into(),
            x_label: "time, s".into(),
            y_label: "head, m".into(),
            series: vec![Series { label: "curve & co".into(), points, style: Style::line(0) }],
            log_y,
            ..LineChart::default()
        }
    }

    #[test]
    fn the_curve_reaches_the_right_pixels() {
        let svg = chart(vec![(0.0, 0.0), (10.0, 1.0)], false).to_svg(600.0, 300.0);
        let d = svg.split("series-0\" d=\"").nth(2).unwrap().split('"').next().unwrap();
        let start: Vec<f64> = d[1..].split(['L', ' ']).map(|n| n.parse().unwrap()).collect();
        assert_eq!((start[0], start[2]), (LEFT, 600.0 - RIGHT));
        assert!(start[1] > start[3], "y grows upwards");
    }

    #[test]
    fn marks_stand_where_they_belong_and_only_within_the_curves() {
        let mut marked = chart(vec![(0.0, 0.0), (10.0, 1.0)], false);
        marked.marks = vec![(5.0, "5 <Hz>".into()), (11.0, "beyond".into())];
        let svg = marked.to_svg(600.0, 300.0);
        let middle = format!("d=\"M{:.1} ", 0.5 * (LEFT + 600.0 - RIGHT));
        assert!(svg.contains("5 &lt;Hz&gt;") && svg.contains(&middle) && !svg.contains("beyond"), "{svg}");
    }

    #[test]
    fn text_is_escaped() {
        let svg = chart(vec![(0.0, 0.0), (1.0, 1.0)], false).to_svg(600.0, 300.0);
        assert!(svg.contains("a &lt;title&gt;") && svg.contains("curve &amp; co") && !svg.contains("<title>"));
    }

    #[test]
    fn odd_data_gives_a_chart_without_odd_numbers() {
        let nan = f64::NAN;
        let cases = [
            chart(vec![], false),
            chart(vec![(nan, nan)], false),
            chart(vec![(1.0, 5.0)], false),
            chart(vec![(0.0, 3.0), (1.0, nan), (2.0, 3.0), (3.0, f64::INFINITY)], false),
            chart(vec![(0.0, -1.0), (1.0, 0.0)], true),
            chart(vec![(0.0, 1.0), (1.0, 1.0)], true),
            chart(vec![(0.0, 1e-300), (1.0, 1e300)], true),
            chart(vec![(0.0, 1e12), (1.0, 2e12)], false),
            LineChart::default(),
        ];
        for case in cases {
            let svg = case.to_svg(600.0, 300.0);
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert!(svg.ends_with("</svg>"));
        }
        assert!(chart(vec![(0.0, -1.0)], true).to_svg(600.0, 300.0).contains("no data"));
    }

    #[test]
    fn on_a_logarithmic_axis_equal_ratios_are_equally_far_apart() {
        let points = vec![(0.0, 1.0), (1.0, 1.0), (10.0, 2.0), (100.0, 3.0)];
        let svg = LineChart { log_x: true, ..chart(points, false) }.to_svg(600.0, 300.0);
        let d = svg.split("series-0\" d=\"").nth(2).unwrap().split('"').next().unwrap();
        let x: Vec<f64> = d[1..].split('L').map(|p| p.split(' ').next().unwrap().parse().unwrap()).collect();
        assert_eq!(x.len(), 3, "{d}");
        assert!((x[1] - 0.5 * (x[0] + x[2])).abs() < 0.1 && x[0] > LEFT && x[2] > x[1] + 100.0, "{d}");
    }

    #[test]
    fn a_band_is_filled_and_closed() {
        let mut band = chart(vec![(0.0, 0.0), (1.0, 1.0), (1.0, 0.5)], false);
        band.series[0].style = Style::area(0);
        let svg = band.to_svg(600.0, 300.0);
        assert!(svg.matches("series-0 area").count() == 2 && svg.contains("Z\" fill=\"#0072b2\""), "{svg}");
    }

    #[test]
    fn a_point_that_is_not_finite_interrupts_the_line() {
        let svg =
            chart(vec![(0.0, 0.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 0.0)], false).to_svg(600.0, 300.0);
        let d = svg.split("series-0\" d=\"").nth(2).unwrap().split('"').next().unwrap();
        assert_eq!((d.matches('M').count(), d.matches('L').count()), (2, 2));
    }
}
