//! How finely a forcing is resolved in time: as what the model leaves asks for.

use crate::diagnose::rest::cells::{CELLS, Run, Times};
use crate::model::ModelError;

/// Knots a period, from the coarsest on.
const PER_PERIOD: [f64; 3] = [16.0, 32.0, 64.0];
/// Most knots: cost. A finer forcing is looked at for a shorter time.
const MOST_KNOTS: usize = 400;
/// What knots may be too coarse for, over what noise does to the same samples, mean square.
const LOST: f64 = 0.2;
/// Share of what is left that the knots cover in time.
const COVERED_SHARE: f64 = 0.9;
/// Periods before the closure in which a forcing makes up for what moves in the pipe then: a wave goes there and back
/// in half a period.
const BEFORE_PERIODS: f64 = 0.5;

/// The coarsest knots that show what the model leaves.
///
/// # Errors
/// As [`Run::left_in`].
pub(crate) fn times(run: &Run) -> Result<Times, ModelError> {
    let period_s = run.period_s();
    let with_all = |per_period: f64| {
        let knot_s = period_s / per_period;
        let before = (BEFORE_PERIODS * per_period).ceil() as usize + 1;
        Times { knot_s, before, knots: before + ((run.duration_s() / knot_s) as usize).max(2) }
    };
    let with = |per_period: f64| {
        let all = with_all(per_period);
        Times { knots: all.knots.min(all.before + MOST_KNOTS), ..all }
    };
    let finest = with(PER_PERIOD[PER_PERIOD.len() - 1]);
    let cells = run.rows(&finest);
    let left_m = run.left_in(&run.x, &cells, true)?;
    let mut lost = [(0.0, 0.0); PER_PERIOD.len()];
    for s in 0..run.data().sensors.len() {
        let own: Vec<f64> = cells
            .0
            .iter()
            .zip(&left_m)
            .filter(|(row, _)| row.sensor == s && row.cell.is_some())
            .map(|(row, left)| *left / row.sd_m)
            .collect();
        for ((lost, of_noise), per_period) in lost.iter_mut().zip(PER_PERIOD) {
            // What the mean over half a knot does not follow.
            let size = ((PER_PERIOD[PER_PERIOD.len() - 1] / per_period) * CELLS as f64 / 2.0).round() as usize;
            for block in own.chunks_exact(size.max(1)) {
                let mean = block.iter().sum::<f64>() / block.len() as f64;
                *lost += block.iter().map(|b| (b - mean).powi(2)).sum::<f64>();
                *of_noise += (block.len() - 1) as f64;
            }
        }
    }
    // Finer knots cover less of the record: as fine as it takes, and as most of what is left allows.
    let all = with_all(PER_PERIOD[0]);
    let cells = run.rows(&all);
    let left_m = run.left_in(&run.x, &cells, true)?;
    let energy = |until_s: f64| -> f64 {
        let own = cells.0.iter().zip(&left_m);
        let early = own.filter(|(row, _)| row.cell.is_some_and(|c| c as f64 * all.cell_s() < until_s));
        early.map(|(row, left)| (left / row.sd_m).powi(2) - 1.0).sum::<f64>().max(0.0)
    };
    let suits = (0..PER_PERIOD.len()).position(|i| {
        let (lost, of_noise) = lost[i];
        let covers_less = PER_PERIOD
            .get(i + 1)
            .is_none_or(|finer| energy(with(*finer).end_s()) < COVERED_SHARE * energy(f64::INFINITY));
        lost - of_noise < LOST * of_noise || covers_less
    });
    Ok(with(PER_PERIOD[suits.unwrap_or_default()]))
}
