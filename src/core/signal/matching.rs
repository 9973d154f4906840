//! The delay with which a front comes back or reaches another sensor, by matching the first rise with the later one.
//!
//! A front returns with another height, on a level that drifts (friction), and followed by a slow tail (creep of the
//! wall, unsteady friction). Over the short time of a front all of these amount to a level, a slope, the front times a
//! gain, and the integral of the front times another gain (the first terms of the tail's kernel); a longer window also
//! needs the second integral. These enter linearly; the delay does not, so all delays are tried. The simpler way, equal
//! levels of the two fronts, is late because of the tail: by a tenth of the wave speed if the wall creeps.

use crate::robust::median;
use crate::signal::front::Front;
use crate::signal::project::{Projector, profile_minimum};
use crate::signal::trace::Trace;

/// A delay between two fronts, in grid points.
#[derive(Debug, Clone)]
pub(crate) struct Delay {
    /// Median over the windows.
    pub value: f64,
    /// From noise and the disagreement of the windows.
    pub standard_error: f64,
    /// The delay from each window that gave one, ascending.
    pub windows: Vec<f64>,
}

/// Direction of the later front relative to the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Sense {
    /// It falls: it has come back from the supply.
    Falls,
    /// It rises: the same front at another sensor.
    Rises,
}

/// Length of a window beyond the onset, in rises, and whether it needs the second integral.
const WINDOWS: [(f64, bool); 5] = [(0.5, false), (0.75, false), (1.0, false), (1.3, true), (1.7, true)];
/// Length of the window before the onset, in rises.
const BEFORE: f64 = 0.3;
/// Noise that averaging may leave, as a share of the rise over the averaged points; these are at most that share of the
/// whole rise.
const NOISE_OF_RISE: f64 = 0.05;
const MOST_OF_RISE: f64 = 0.25;
/// Error of a bend's place between grid points, in grid steps: a front of few points is not a smooth curve.
const GRID: f64 = 0.15;

/// Matches the first rise of `source` with `target` (on the same grid) at every delay from `lags.0` to `lags.1`.
/// `reach` scales the windows: 1 if the front stands alone, less if the next one follows before it is over.
pub(crate) fn delay(
    source: &Trace,
    front: &Front,
    target: &Trace,
    lags: (f64, f64),
    sense: Sense,
    reach: f64,
    white_sd_m: f64,
) -> Option<Delay> {
    let quiet = Quiet::of(front, white_sd_m);
    let (source, target) = (source.averaged(quiet.half), target.averaged(quiet.half));
    let mut found: Vec<(f64, f64)> = WINDOWS
        .iter()
        .filter_map(|&(part, long)| window_delay(&source, front, &target, lags, sense, (part * reach, long), quiet))
        .collect();
    if found.is_empty() {
        return None;
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let middle = found.len() / 2;
    let value = if found.len() % 2 == 1 { found[middle].0 } else { 0.5 * (found[middle - 1].0 + found[middle].0) };
    // median deviation, so one window that caught another front does not spoil the error
    let mut deviations: Vec<f64> = found.iter().map(|f| (f.0 - value).abs()).collect();
    let spread = median(&mut deviations);
    let noise = found[middle].1;
    Some(Delay { value, standard_error: noise.hypot(spread), windows: found.into_iter().map(|f| f.0).collect() })
}

/// How far both records are averaged. Both are averaged alike, so the delay stays the same. Without averaging, if the
/// slope drowns in noise from point to point, the sum of squares over the delays is as ragged as the noise and its
/// minimum is arbitrary.
#[derive(Debug, Clone, Copy)]
struct Quiet {
    /// Points on either side that are averaged.
    half: usize,
    /// Standard deviation of the remaining white noise, m.
    sd_m: f64,
}

impl Quiet {
    /// Averages over enough points to bring the noise down to a small share of the front's rise over them.
    fn of(front: &Front, white_sd_m: f64) -> Self {
        let over_slope = white_sd_m * front.rise / front.height_m();
        let points = (over_slope / NOISE_OF_RISE).powf(2.0 / 3.0).min(MOST_OF_RISE * front.rise);
        let half = (0.5 * points) as usize;
        Quiet { half, sd_m: white_sd_m / Quiet::points(half).sqrt() }
    }

    fn points(half: usize) -> f64 {
        (2 * half + 1) as f64
    }

    /// Increase of the sum of squares at one standard error of the delay: neighbours that share their noise count once.
    fn rise(self, mean_square: f64) -> f64 {
        mean_square.max(self.sd_m * self.sd_m) * Quiet::points(self.half)
    }
}

fn window_delay(
    source: &Trace,
    front: &Front,
    target: &Trace,
    (shortest, longest): (f64, f64),
    sense: Sense,
    (part, long): (f64, bool),
    quiet: Quiet,
) -> Option<(f64, f64)> {
    let before = (BEFORE * front.rise).max(3.0).ceil() as usize;
    let onset = front.onset as usize;
    let to = onset + (part * front.rise).max(5.0) as usize + 2;
    if to > source.len() || !source.intact(onset.saturating_sub(before)..to) {
        return None;
    }
    // a record that begins with the closure lacks the level before it, but that level is known
    let missing = before.saturating_sub(onset);
    let recorded = source.head_m[onset.saturating_sub(before)..to].iter().map(|h| h - front.base_m);
    let template: Vec<f64> = std::iter::repeat_n(0.0, missing).chain(recorded).collect();
    let n = template.len();
    let integral = |values: &[f64]| -> Vec<f64> {
        let mut sum = 0.0;
        values
            .iter()
            .map(|v| {
                sum += v;
                sum - 0.5 * v
            })
            .collect()
    };
    let once = integral(&template);
    let slope = (0..n).map(|i| i as f64 - 0.5 * (n - 1) as f64).collect();
    let mut columns = vec![vec![1.0; n], slope];
    if long {
        columns.push(integral(&once));
    }
    columns.extend([once, template]);
    let unknowns = columns.len();
    if n < unknowns + 3 {
        return None;
    }
    let projector = Projector::new(columns)?;
    // with different clocks the later front may stand earlier in its record: search the whole record
    let (from, to) = (to as i64 - n as i64, to as i64);
    let first = (shortest.floor() as i64).max(-from);
    let last = (longest.ceil() as i64).min(target.len() as i64 - to);
    let mut shares = Vec::new();
    let mut sums = Vec::new();
    for lag in first..=last.max(first) {
        let start = (from + lag) as usize;
        let place = start..start + n;
        if !target.intact(place.clone()) {
            sums.push(f64::INFINITY);
            shares.push(f64::INFINITY);
            continue;
        }
        let residual = projector.residual(&target.head_m[place], 2);
        let right_way = match sense {
            Sense::Falls => residual.gain < -0.1,
            Sense::Rises => residual.gain > 0.1,
        };
        sums.push(residual.both);
        // share left unexplained, so that plateaus, where everything fits, do not win
        shares.push(if right_way { residual.both / residual.background } else { f64::INFINITY });
    }
    let lowest = (0..shares.len()).min_by(|&a, &b| shares[a].total_cmp(&shares[b]))?;
    if shares[lowest] > 0.2 {
        return None; // no front like it
    }
    if lowest == 0 || lowest + 1 >= sums.len() {
        return None; // still falling at the edge of the search: not a match
    }
    let freedom = (n - unknowns) as f64;
    let variance = quiet.rise(sums[lowest] / freedom);
    let scale = sums[lowest] / shares[lowest].max(f64::MIN_POSITIVE);
    let scaled: Vec<f64> = shares.iter().map(|s| s * scale).collect();
    let (at, width) = profile_minimum(&scaled, lowest, variance);
    Some((first as f64 + at, width.hypot(GRID)))
}
