//! Even grids of times, and the times missing from them.

use crate::recording::Gap;
use crate::robust::median;

/// Steps within this of the median, as a part of it, are the same step.
pub(crate) const SAME_STEP: f64 = 0.1;
/// A step of more than so many of the grid's is a hole.
pub(crate) const HOLE_STEPS: f64 = 2.0 - SAME_STEP;

/// Times missing from an even grid.
pub struct Hole {
    /// The row before it.
    pub before: usize,
    /// From the time of that row to that of the next.
    pub gap: Gap,
}

/// The step of an even grid, s; `None` where fewer than four of five steps are it.
pub(crate) fn even_step(time_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.len() < 2 {
        return None;
    }
    let middle = steps.len() / 2;
    let step = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let even = steps.iter().filter(|s| (**s / step - 1.0).abs() < SAME_STEP).count();
    (step > 0.0 && even as f64 >= 0.8 * steps.len() as f64).then_some(step)
}

/// The holes of an even grid of increasing times; none where the grid is not even.
pub fn even_holes(time_s: &[f64]) -> Vec<Hole> {
    even_step(time_s).map_or(Vec::new(), |step_s| holes(time_s, step_s))
}

/// A step of so many usual ones is a gap where the times stand on no even grid.
const LONG_STEPS: f64 = 20.0;

/// Gaps among increasing times that stand on no even grid, as where only what changes is written: nobody knows how many
/// samples they lack.
pub(crate) fn uneven_gaps(time_s: &[f64]) -> Vec<Gap> {
    let steps = || time_s.windows(2).map(|w| w[1] - w[0]);
    if even_step(time_s).is_some() || time_s.len() < ENOUGH {
        return Vec::new();
    }
    let usual_s = median(&mut steps().collect::<Vec<_>>());
    let long = time_s.windows(2).filter(|w| w[1] - w[0] > LONG_STEPS * usual_s);
    long.map(|w| Gap { from_s: w[0], to_s: w[1], samples: None }).collect()
}

/// So many times show that they stand on no grid.
const ENOUGH: usize = 20;

fn holes(time_s: &[f64], step_s: f64) -> Vec<Hole> {
    let pairs = time_s.windows(2).enumerate();
    let wide = pairs.filter(|(_, w)| w[1] - w[0] > HOLE_STEPS * step_s);
    wide.map(|(before, w)| {
        let samples = Some((((w[1] - w[0]) / step_s).round() as u64).saturating_sub(1));
        Hole { before, gap: Gap { from_s: w[0], to_s: w[1], samples } }
    })
    .collect()
}
