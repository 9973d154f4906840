//! Features over two parameters, and what raising a third changes there (the source paper's Figures 11 and 12).

use rayon::prelude::*;
use serde::Serialize;

use crate::model::ModelError;
use crate::sensitivity::error::check_count;
use crate::sensitivity::factor::Factor;
use crate::sensitivity::features::{Features, OUTPUTS, Output, PEAKS};
use crate::sensitivity::subject::Subject;
use crate::sensitivity::{SensitivityError, Tick};

/// Factor by which the third parameter is raised.
pub const RAISED_BY: f64 = 2.0;

/// Changes when a parameter is raised, in the order of [`Response::values`].
pub const CHANGES: [Output; PEAKS + 3] = [
    change("peak1_percent", "%", "contribution to pressure damping at peak 1"),
    change("peak2_percent", "%", "contribution to pressure damping at peak 2"),
    change("peak3_percent", "%", "contribution to pressure damping at peak 3"),
    change("peak4_percent", "%", "contribution to pressure damping at peak 4"),
    change("time2_percent", "%", "delay of the second peak, as a share of 4L/a"),
    change("phase_percent", "%", "delay of the fourth crossing, as a share of 4L/a"),
    change("damping_change", "1", "change of the logarithmic decrement"),
];

const fn change(name: &'static str, unit: &'static str, about: &'static str) -> Output {
    Output { name, unit, about }
}

/// Effect of raising one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// `(P − P′)/P` of each peak, equation 21 of the paper, in percent; P above the head before the closure.
    pub peaks_percent: [f64; PEAKS],
    /// Delay of the second peak, percent of `4L/a`.
    pub time2_percent: f64,
    /// Delay of the fourth crossing, percent of `4L/a`.
    pub phase_percent: f64,
    /// Change of the decrement.
    pub damping: f64,
}

impl Response {
    /// From the features before and after.
    pub fn of(before: &Features, after: &Features) -> Response {
        let of_peak = |k: usize| match (before.peak(k), after.peak(k)) {
            (Some(b), Some(a)) => (100.0 * (b.1 - a.1) / b.1, 100.0 * (a.0 - b.0) / before.period_s),
            _ => (f64::NAN, f64::NAN),
        };
        let nan = |v: Option<f64>| v.unwrap_or(f64::NAN);
        let crossing = |f: &Features| nan(f.crossing_s(crate::sensitivity::features::CROSSING));
        Response {
            peaks_percent: std::array::from_fn(|i| of_peak(i + 1).0),
            time2_percent: of_peak(2).1,
            phase_percent: 100.0 * (crossing(after) - crossing(before)) / before.period_s,
            damping: nan(after.damping()) - nan(before.damping()),
        }
    }

    /// In the order of [`CHANGES`].
    pub fn values(&self) -> [f64; CHANGES.len()] {
        let p = self.peaks_percent;
        [p[0], p[1], p[2], p[3], self.time2_percent, self.phase_percent, self.damping]
    }
}

/// Features of one closure.
type Seen = Result<Features, ModelError>;

/// One axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// Name of the parameter.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// Its values.
    pub values: Vec<f64>,
    /// Whether they are evenly spaced in ratio.
    pub even_in_ratio: bool,
}

/// A map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Map {
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Theoretical period `4L/a` at the values under study, s.
    pub period_s: f64,
    /// The parameters that were raised to [`RAISED_BY`] times their value.
    pub raised: Vec<String>,
    /// Quantities of each cell.
    pub layers: Vec<Layer>,
    /// Number of simulations.
    pub runs: usize,
    /// Number of simulations that failed.
    pub failed: usize,
}

/// One quantity over the map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Layer {
    /// The quantity.
    pub output: Output,
    /// The parameter that is raised; none for the quantity itself.
    pub raised: Option<String>,
    /// Row by row, from the least y: a value for each x. NaN if the quantity does not exist.
    pub values: Vec<Vec<f64>>,
}

/// Number of simulations that a map takes.
pub fn runs(cells: usize, raised: usize) -> usize {
    cells * cells * (1 + raised)
}

/// Computes a map of `cells` × `cells` values of two parameters.
///
/// # Errors
/// Too few or too many cells; if all simulations fail.
pub fn draw(
    subject: &Subject,
    x: &Factor,
    y: &Factor,
    raised: &[Factor],
    cells: usize,
    tick: Tick,
) -> Result<Map, SensitivityError> {
    check_count("cells", cells, 2..=500)?;
    let axis = |f: &Factor| Axis {
        name: f.name.clone(),
        unit: f.unit,
        values: f.levels(cells),
        even_in_ratio: f.even_in_ratio,
    };
    let (x_axis, y_axis) = (axis(x), axis(y));
    let places: Vec<Vec<f64>> = y_axis
        .values
        .iter()
        .flat_map(|&of_y| x_axis.values.iter().map(move |&of_x| (of_x, of_y)))
        .map(|(of_x, of_y)| {
            let mut values = subject.values.clone();
            (values[x.slot], values[y.slot]) = (of_x, of_y);
            values
        })
        .collect();
    let seen: Vec<Vec<Seen>> = places
        .par_iter()
        .map(|values| {
            let here = std::iter::once(values.clone()).chain(raised.iter().map(|factor| {
                let mut more = values.clone();
                more[factor.slot] *= RAISED_BY;
                more
            }));
            here.map(|v| {
                let seen = subject.features(&v);
                tick();
                seen
            })
            .collect()
        })
        .collect();
    let failed = seen.iter().flatten().filter(|r| r.is_err()).count();
    let all = seen.len() * (1 + raised.len());
    if let (true, Some(Err(why))) = (failed == all, seen.first().and_then(|s| s.first())) {
        return Err(SensitivityError::AllFailed { runs: failed, why: why.clone() });
    }
    let rows = |of: &dyn Fn(&[Seen]) -> f64| -> Vec<Vec<f64>> {
        seen.chunks(cells).map(|row| row.iter().map(|cell| of(cell)).collect()).collect()
    };
    let mut layers: Vec<Layer> = OUTPUTS
        .iter()
        .enumerate()
        .map(|(o, &output)| {
            let value = |cell: &[Seen]| cell[0].as_ref().map_or(f64::NAN, |f| f.values()[o]);
            Layer { output, raised: None, values: rows(&value) }
        })
        .collect();
    for (k, factor) in raised.iter().enumerate() {
        for (c, &output) in CHANGES.iter().enumerate() {
            let value = |cell: &[Seen]| match (&cell[0], &cell[1 + k]) {
                (Ok(before), Ok(after)) => Response::of(before, after).values()[c],
                _ => f64::NAN,
            };
            layers.push(Layer { output, raised: Some(factor.name.clone()), values: rows(&value) });
        }
    }
    Ok(Map {
        x: x_axis,
        y: y_axis,
        period_s: subject.period_s(),
        raised: raised.iter().map(|f| f.name.clone()).collect(),
        layers,
        runs: all,
        failed,
    })
}

impl Map {
    /// The map as a table, one row per cell; times are also given in periods `4L/a`.
    pub fn csv(&self) -> String {
        let in_periods = |axis: &Axis| axis.unit == "s";
        let mut header = Vec::new();
        for axis in [&self.x, &self.y] {
            header.push(axis.name.clone());
            if in_periods(axis) {
                header.push(format!("{}_periods", axis.name.trim_end_matches("_s")));
            }
        }
        header.extend(self.layers.iter().map(|l| match &l.raised {
            None => l.output.name.to_owned(),
            Some(raised) => format!("{} by {raised}", l.output.name),
        }));
        let mut out = header.join(",") + "\n";
        for (j, of_y) in self.y.values.iter().enumerate() {
            for (i, of_x) in self.x.values.iter().enumerate() {
                let mut cells = Vec::new();
                for (axis, value) in [(&self.x, *of_x), (&self.y, *of_y)] {
                    cells.push(value);
                    if in_periods(axis) {
                        cells.push(value / self.period_s);
                    }
                }
                cells.extend(self.layers.iter().map(|l| l.values[j][i]));
                // An empty cell for NaN.
                let text = |v: f64| if v.is_finite() { format!("{v}") } else { String::new() };
                out += &cells.into_iter().map(text).collect::<Vec<_>>().join(",");
                out.push('\n');
            }
        }
        out
    }
}
