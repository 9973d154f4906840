//! Heat maps: a value over two axes, in the colours of the pages' tables.

use std::fmt::Write;

use crate::report::svg::Scale;
use crate::report::svg::axis;
use crate::report::svg::axis::{Area, Labelled};
use crate::report::text::escape::escape;
use crate::report::text::number::significant;

/// A map of values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HeatMap {
    /// What it is called, for those who cannot see it.
    pub title: String,
    /// Quantity and unit along x.
    pub x_label: String,
    /// Quantity and unit along y.
    pub y_label: String,
    /// Values along x, in increasing order, even in ratio if `log_x`.
    pub x: Vec<f64>,
    /// Values along y, likewise.
    pub y: Vec<f64>,
    /// Logarithmic x axis.
    pub log_x: bool,
    /// Logarithmic y axis.
    pub log_y: bool,
    /// Row by row from the least y, a value for each x; those that are not finite are left empty.
    pub values: Vec<Vec<f64>>,
}

/// Class and colour where no style sheet says otherwise, from low to high.
const RISING: [(&str, &str); 8] = [
    ("h0", "#e3f1ea"),
    ("h1", "#fdf1d6"),
    ("h2", "#fbdba8"),
    ("h3", "#f5b673"),
    ("h4", "#e88b45"),
    ("h5", "#b4480f"),
    ("h6", "#86290b"),
    ("h7", "#561005"),
];
/// The same from negative to positive.
const SIGNED: [(&str, &str); 7] = [
    ("n3", "#ad450c"),
    ("n2", "#f8bd8c"),
    ("n1", "#fde8d6"),
    ("r0", "#f5f6f8"),
    ("p1", "#deecf8"),
    ("p2", "#a9cfec"),
    ("p3", "#1b6ba3"),
];
/// Ends of the signed classes, as parts of the largest absolute value.
const PARTS: [f64; 3] = [0.02, 0.15, 0.5];
/// Values this far below zero, as a part of the largest, make a map signed.
const NEGATIVE: f64 = 0.01;

const LEFT: f64 = 64.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 44.0;
const BOTTOM: f64 = 42.0;

/// Colours and the values between them.
struct Classes {
    colours: &'static [(&'static str, &'static str)],
    ends: Vec<f64>,
}

impl Classes {
    fn of(values: impl Iterator<Item = f64> + Clone) -> Option<Classes> {
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        if low > high {
            return None;
        }
        let most = low.abs().max(high.abs());
        if low < -NEGATIVE * most && high > NEGATIVE * most {
            let ends = PARTS.iter().rev().map(|p| -p * most).chain(PARTS.iter().map(|p| p * most)).collect();
            return Some(Classes { colours: &SIGNED, ends });
        }
        let n = RISING.len();
        Some(Classes { colours: &RISING, ends: (1..n).map(|i| low + (high - low) * i as f64 / n as f64).collect() })
    }

    fn colour(&self, value: f64) -> (&'static str, &'static str) {
        self.colours[self.ends.iter().filter(|end| value > **end).count()]
    }
}

impl HeatMap {
    /// The map as an SVG element of `width` × `height` px.
    pub fn to_svg(&self, width: f64, height: f64) -> String {
        let mut out = String::new();
        let _ = write!(
            out,
            r##"<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width} {height}" role="img" aria-label="{}" font-family="system-ui, sans-serif" font-size="12" fill="#222">"##,
            escape(&format!("{} ({} over {})", self.title, self.y_label, self.x_label))
        );
        let finite = self.values.iter().flatten().copied().filter(|v| v.is_finite());
        match Classes::of(finite).filter(|_| self.x.len() > 1 && self.y.len() > 1) {
            Some(classes) => self.draw(&mut out, &classes, width, height),
            None => {
                let _ = write!(out, r#"<text x="{LEFT}" y="{}">no data</text>"#, TOP + 30.0);
            }
        }
        out.push_str("</svg>");
        out
    }

    fn draw(&self, out: &mut String, classes: &Classes, width: f64, height: f64) {
        let (right, bottom) = (width - RIGHT, height - BOTTOM);
        let (x_edges, y_edges) = (edges(&self.x, self.log_x), edges(&self.y, self.log_y));
        let ends = |e: &[f64]| (e[0], e[e.len() - 1]);
        let x = Scale::new(ends(&x_edges), LEFT, right, self.log_x);
        let y = Scale::new(ends(&y_edges), bottom, TOP, self.log_y);
        for (j, row) in self.values.iter().enumerate() {
            for (i, &value) in row.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                let (class, colour) = classes.colour(value);
                let (x0, x1) = (x.px(x_edges[i]), x.px(x_edges[i + 1]));
                let (y0, y1) = (y.px(y_edges[j + 1]), y.px(y_edges[j]));
                // A little wider than the cell: no seams between them.
                let _ = write!(
                    out,
                    r#"<rect class="{class}" x="{x0:.1}" y="{y0:.1}" width="{:.1}" height="{:.1}" fill="{colour}"><title>{}, {}: {}</title></rect>"#,
                    x1 - x0 + 0.4,
                    y1 - y0 + 0.4,
                    significant(self.x[i], 2),
                    significant(self.y[j], 2),
                    significant(value, 3)
                );
            }
        }
        self.key(out, classes, right);
        let (xs, ys) = (x.ticks(((right - LEFT) / 55.0) as usize), y.ticks(((bottom - TOP) / 30.0) as usize));
        axis::draw(
            out,
            Area { left: LEFT, top: TOP, right, bottom },
            &Labelled { scale: &x, ticks: &xs, label: &self.x_label },
            &Labelled { scale: &y, ticks: &ys, label: &self.y_label },
        );
    }

    /// The colours with the values between them.
    fn key(&self, out: &mut String, classes: &Classes, right: f64) {
        let step = (right - LEFT) / classes.colours.len() as f64;
        for (i, (class, colour)) in classes.colours.iter().enumerate() {
            let x = LEFT + i as f64 * step;
            let _ = write!(
                out,
                r#"<rect class="{class}" x="{x:.1}" y="6" width="{:.1}" height="10" fill="{colour}"/>"#,
                step - 1.0
            );
        }
        out.push_str(r#"<g class="label" font-size="10">"#);
        for (i, end) in classes.ends.iter().enumerate() {
            let x = LEFT + (i + 1) as f64 * step - 0.5;
            let _ = write!(
                out,
                r#"<text x="{x:.1}" y="28" text-anchor="middle">{}</text>"#,
                significant(*end, 2).replace('-', "−")
            );
        }
        out.push_str("</g>");
    }
}

/// Half-way between values, and as far beyond the first and the last.
fn edges(values: &[f64], log: bool) -> Vec<f64> {
    let place = |v: f64| if log { v.ln() } else { v };
    let back = |v: f64| if log { v.exp() } else { v };
    let places: Vec<f64> = values.iter().map(|v| place(*v)).collect();
    let n = places.len();
    let inner = places.windows(2).map(|w| 0.5 * (w[0] + w[1]));
    let first = 1.5 * places[0] - 0.5 * places[1];
    let last = 1.5 * places[n - 1] - 0.5 * places[n - 2];
    std::iter::once(first).chain(inner).chain([last]).map(back).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(values: Vec<Vec<f64>>) -> HeatMap {
        HeatMap {
            title: "a <map>".into(),
            x: vec![0.01, 0.1, 1.0],
            y: vec![1.0, 2.0],
            log_x: true,
            values,
            ..HeatMap::default()
        }
    }

    #[test]
    fn each_value_has_a_cell_of_its_colour() {
        let svg = map(vec![vec![0.0, 1.0, 2.0], vec![3.0, f64::NAN, 8.0]]).to_svg(400.0, 300.0);
        assert_eq!(svg.matches("<title>").count(), 5);
        assert!(svg.contains("<title>1.0, 2.0: 8.00</title>") && svg.contains("a &lt;map&gt;") && !svg.contains("NaN"));
        let last = svg.split("<rect ").find(|r| r.contains(": 8.00")).unwrap();
        assert!(last.starts_with("class=\"h7\""), "{last}");
    }

    #[test]
    fn signs_have_colours_of_their_own() {
        let classes = Classes::of([-4.0, 0.01, 4.0].into_iter()).unwrap();
        assert_eq!([-4.0, -1.0, 0.0, 0.3, 3.0].map(|v| classes.colour(v).0), ["n3", "n2", "r0", "p1", "p3"]);
        assert_eq!(Classes::of([1.0, 1.0].into_iter()).unwrap().colour(1.0).0, "h0");
        assert!(Classes::of(std::iter::empty()).is_none());
        assert!(map(vec![vec![f64::NAN; 3]; 2]).to_svg(400.0, 300.0).contains("no data"));
    }

    #[test]
    fn edges_lie_half_way_in_ratio_on_a_logarithmic_axis() {
        let log = edges(&[0.01, 1.0], true);
        assert!(log.iter().zip([0.001, 0.1, 10.0]).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{log:?}");
        assert_eq!(edges(&[1.0, 2.0], false), [0.5, 1.5, 2.5]);
    }
}
