//! Edges of trigger channels, and the matching of the edges of two files.

use crate::extent::ends;
use crate::recording::Series;
use crate::robust::{median, sd_about};
use crate::signal::Estimate;

/// An edge of a trigger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    /// Time at which it passes half of the swing, s on the file's clock, with its standard error.
    pub time_s: Estimate,
    pub rising: bool,
}

/// Most edges that are used: more add nothing.
const MOST_EDGES: usize = 200;
/// Clocks of acquisition systems drift apart by less than this.
const MOST_DRIFT: f64 = 2e-4;
/// Error of a time interpolated on a flank with samples in it, in sample steps.
const INTERPOLATED: f64 = 0.05;

/// The edges of a trigger, whether it is 0 and 1 or a voltage: by linear interpolation at half of the swing. A flank
/// without a sample lies anywhere in its step: its error is step/√12.
pub(crate) fn edges(series: &Series) -> Vec<Edge> {
    let (low, high) = ends(&series.value);
    let swing = high - low;
    if !(swing > 0.0 && swing.is_finite()) {
        return Vec::new();
    }
    let level = |v: f64| (v - low) / swing;
    // the median deviation, because the low part of a slow flank is not noise
    let mut lows: Vec<f64> = series.value.iter().map(|v| level(*v)).filter(|l| *l < 0.25).collect();
    let middle = median(&mut lows);
    let noise = sd_about(middle, &lows);
    let mut edges = Vec::new();
    // the last sample that was clearly low or clearly high
    let mut settled: Option<(usize, bool)> = None;
    for (i, &value) in series.value.iter().enumerate() {
        let up = match level(value) {
            l if l > 0.75 => true,
            l if l < 0.25 => false,
            _ => continue,
        };
        if let Some((from, was_up)) = settled
            && was_up != up
        {
            edges.push(edge(series, from, i, up, level, noise));
            if edges.len() == MOST_EDGES {
                break;
            }
        }
        settled = Some((i, up));
    }
    edges
}

fn edge(series: &Series, from: usize, to: usize, rising: bool, level: impl Fn(f64) -> f64, noise: f64) -> Edge {
    let (time, value) = (&series.time_s, &series.value);
    let beyond = |v: f64| (level(v) >= 0.5) == rising;
    let after = (from + 1..=to).find(|&i| beyond(value[i])).unwrap_or(to);
    let before = after - 1;
    let (a, b) = (level(value[before]), level(value[after]));
    let step_s = time[after] - time[before];
    let at = time[before] + step_s * ((0.5 - a) / (b - a)).clamp(0.0, 1.0);
    let standard_error = match to - from {
        1 => step_s / 12f64.sqrt(),
        _ => (INTERPOLATED * step_s)
            .hypot(noise * (time[to] - time[from]) / (level(value[to]) - level(value[from])).abs()),
    };
    Edge { time_s: Estimate { value: at, standard_error }, rising }
}

/// The matched edges of two files.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Matched {
    /// Indices of the edge in the first file and in the second.
    pub pairs: Vec<(usize, usize)>,
    /// One of the two triggers is active low.
    pub inverted: bool,
}

/// Why edges do not match.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoMatch {
    /// One file has no edge.
    NoEdge,
    /// Several matches are equally good.
    Ambiguous,
}

/// Finds the shift of the second clock at which most edges coincide. `shift_s`, if known from elsewhere, decides
/// between equally good matches.
pub(crate) fn matched(first: &[Edge], second: &[Edge], shift_s: Option<f64>) -> Result<Matched, NoMatch> {
    if first.is_empty() || second.is_empty() {
        return Err(NoMatch::NoEdge);
    }
    let upright = best(first, second, shift_s);
    let turned: Vec<Edge> = second.iter().map(|e| Edge { rising: !e.rising, ..*e }).collect();
    let inverted = best(first, &turned, shift_s);
    let count = |m: &Option<Found>| m.as_ref().map_or(0, |f| f.pairs.len());
    let turn = count(&inverted) > count(&upright);
    let found = if turn { inverted } else { upright }.ok_or(NoMatch::NoEdge)?;
    if found.ambiguous { Err(NoMatch::Ambiguous) } else { Ok(Matched { pairs: found.pairs, inverted: turn }) }
}

/// An edge of the first file and one of the second, by their indices.
type Pairs = Vec<(usize, usize)>;

struct Found {
    pairs: Pairs,
    ambiguous: bool,
}

fn best(first: &[Edge], second: &[Edge], shift_s: Option<f64>) -> Option<Found> {
    let mut all: Vec<(Pairs, f64, f64)> = Vec::new();
    for a in first {
        for b in second.iter().filter(|b| b.rising == a.rising) {
            let shift = a.time_s.value - b.time_s.value;
            let (pairs, misfit) = pairs_at(first, second, shift, b.time_s.value);
            all.push((pairs, misfit, shift));
        }
    }
    let most = all.iter().map(|(pairs, ..)| pairs.len()).max()?;
    all.retain(|(pairs, ..)| pairs.len() == most);
    match shift_s {
        Some(expected) => all.sort_by(|x, y| (x.2 - expected).abs().total_cmp(&(y.2 - expected).abs())),
        None => all.sort_by(|x, y| x.1.total_cmp(&y.1)),
    }
    // the same pairs come back once for each of them; other pairs of the same number are another solution
    let ambiguous = shift_s.is_none() && all.iter().any(|(pairs, ..)| *pairs != all[0].0);
    let (pairs, ..) = all.swap_remove(0);
    Some(Found { pairs, ambiguous })
}

/// Pairs of edges that coincide after the second clock is shifted, and their mean square residual in standard errors.
fn pairs_at(first: &[Edge], second: &[Edge], shift: f64, anchor_s: f64) -> (Vec<(usize, usize)>, f64) {
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    let mut misfit = 0.0;
    for (j, b) in second.iter().enumerate() {
        let at = b.time_s.value + shift;
        let distance = |a: &Edge| (a.time_s.value - at).abs();
        let candidates = first.iter().enumerate().filter(|(_, a)| a.rising == b.rising);
        let Some((i, a)) = candidates.min_by(|x, y| distance(x.1).total_cmp(&distance(y.1))) else { continue };
        let error = a.time_s.standard_error.hypot(b.time_s.standard_error);
        let tolerance = 5.0 * error + MOST_DRIFT * (b.time_s.value - anchor_s).abs();
        if distance(a) <= tolerance && pairs.last().is_none_or(|(last, _)| *last < i) {
            misfit += (distance(a) / error.max(f64::MIN_POSITIVE)).powi(2);
            pairs.push((i, j));
        }
    }
    let count = pairs.len().max(1) as f64;
    (pairs, misfit / count)
}

/// A straight line from the second clock to the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    /// First clock at the second's zero, s.
    pub offset_s: f64,
    /// Fraction by which the second clock is slow.
    pub drift: f64,
    /// Standard error of the drift; none from one edge.
    pub drift_error: Option<f64>,
    /// Root mean square of the residuals about the line, s; none if the line passes through all edges by construction.
    pub residual_s: Option<f64>,
    /// The middle of the edges on the second clock, s, and the standard error of the first clock's time there, s.
    pub middle_s: f64,
    pub error_s: f64,
}

/// If the edges lie closer to the line than this fraction of their errors, they all fell between samples in the same
/// way (pulses at a whole number of samples). Their error is then common and does not average out.
const COMMON: f64 = 0.5;

/// Fits the clocks of matched edges by weighted least squares. A drift within three standard errors of 0 counts as 0.
pub(crate) fn line(first: &[Edge], second: &[Edge], pairs: &[(usize, usize)]) -> Line {
    let points: Vec<(f64, f64, f64)> = pairs
        .iter()
        .map(|&(i, j)| {
            let (a, b) = (first[i].time_s, second[j].time_s);
            let error = a.standard_error.hypot(b.standard_error).max(1e-12);
            (b.value, a.value - b.value, error.powi(-2))
        })
        .collect();
    let total: f64 = points.iter().map(|p| p.2).sum();
    let mean = |of: fn(&(f64, f64, f64)) -> f64| points.iter().map(|p| p.2 * of(p)).sum::<f64>() / total;
    let (middle, shift) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = points.iter().map(|p| p.2 * (p.0 - middle).powi(2)).sum();
    let (slope, slope_error) = match spread > 0.0 {
        true => {
            (points.iter().map(|p| p.2 * (p.0 - middle) * (p.1 - shift)).sum::<f64>() / spread, Some(spread.powf(-0.5)))
        }
        false => (0.0, None),
    };
    let drift = if slope_error.is_some_and(|e| slope.abs() > 3.0 * e) { slope } else { 0.0 };
    let residual = |p: &(f64, f64, f64)| p.1 - shift - drift * (p.0 - middle);
    let count = points.len() as f64;
    let freedom = count - if drift == 0.0 { 1.0 } else { 2.0 };
    let chi2: f64 = points.iter().map(|p| p.2 * residual(p).powi(2)).sum();
    let excess = if freedom > 0.0 { (chi2 / freedom).max(1.0) } else { 1.0 };
    let is_common = freedom > 0.0 && chi2 / freedom < COMMON * COMMON;
    Line {
        offset_s: shift - drift * middle,
        drift,
        drift_error: slope_error,
        residual_s: (freedom > 0.0).then(|| (points.iter().map(|p| residual(p).powi(2)).sum::<f64>() / count).sqrt()),
        middle_s: middle,
        error_s: (if is_common { count } else { excess } / total).sqrt(),
    }
}
