//! Start of the closure: the bend where the head leaves its steady level, between samples.

use crate::signal::front::Front;
use crate::signal::project::{Projector, profile_minimum};
use crate::signal::trace::Trace;

/// Where the head starts to rise, in (fractional) grid points, and its standard error.
///
/// Fits a level that turns into a parabola to the lower part of the flank, for every place of the bend. The error
/// includes noise (profile likelihood) and how far the place moves with the part of the flank that is fitted.
pub(crate) fn bend(trace: &Trace, front: &Front, white_sd_m: f64) -> Option<(f64, f64)> {
    let places: Vec<(f64, f64)> =
        [0.3, 0.45, 0.6].into_iter().filter_map(|part| bend_over(trace, front, white_sd_m, part)).collect();
    let (at, noise) = *places.get(places.len() / 2)?;
    let spread = places.iter().map(|p| (p.0 - at).abs()).fold(0.0, f64::max);
    Some((at, noise.hypot(spread)))
}

fn bend_over(trace: &Trace, front: &Front, white_sd_m: f64, part: f64) -> Option<(f64, f64)> {
    let from = (front.onset - front.rise.max(10.0)).max(0.0) as usize;
    let to = ((front.onset + part * front.rise).ceil().max(front.onset + 4.0) as usize + 1).min(trace.len());
    if to < from + 5 || !trace.intact(from..to) {
        return None;
    }
    let head = &trace.head_m[from..to];
    let step = (front.rise / 200.0).max(0.1);
    let first = (front.onset - 0.6 * front.rise - 3.0).max(from as f64);
    let last = (front.onset + 0.4 * part * front.rise).min(to as f64 - 4.0);
    let steps = ((last - first) / step).floor();
    if steps.is_nan() || steps < 2.0 {
        return None;
    }
    let sums: Vec<f64> = (0..=steps as usize)
        .map(|k| {
            let place = first + k as f64 * step;
            let since = |i: usize| ((from + i) as f64 - place).max(0.0);
            let columns = vec![
                vec![1.0; head.len()],
                (0..head.len()).map(since).collect(),
                (0..head.len()).map(|i| since(i).powi(2)).collect(),
            ];
            Projector::new(columns).map_or(f64::INFINITY, |p| p.residual(head, 1).all)
        })
        .collect();
    let lowest = (0..sums.len()).min_by(|&a, &b| sums[a].total_cmp(&sums[b]))?;
    let freedom = (head.len() as f64 - 4.0).max(1.0);
    let variance = (sums[lowest] / freedom).max(white_sd_m * white_sd_m);
    // a record that starts with the closure has no level before it: the first sample is the best estimate
    let lowest = if front.quiet.len() < 3 && sums[0] < sums[lowest] + 4.0 * variance { 0 } else { lowest };
    let (at, width) = profile_minimum(&sums, lowest, variance);
    Some((first + at * step, (width * step).max(0.1)))
}
