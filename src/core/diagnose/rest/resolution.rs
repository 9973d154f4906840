//! How finely a forcing may be resolved in time.

use crate::diagnose::rest::cells::{Run, Times};

/// Knots a period, from the coarsest on.
const PER_PERIOD: [f64; 4] = [16.0, 32.0, 64.0, 128.0];
/// Most knots: cost. A finer forcing is looked at for a shorter time.
const MOST_KNOTS: usize = 400;
/// Periods before the closure in which a forcing makes up for what moves in the pipe then: a wave goes there and back
/// in half a period.
const BEFORE_PERIODS: f64 = 0.5;

/// Knots that may be chosen, the coarsest first.
pub(crate) fn resolutions(run: &Run) -> [Times; 4] {
    PER_PERIOD.map(|per_period| {
        let times = with(run, per_period);
        Times { knots: times.knots.min(times.before + MOST_KNOTS), ..times }
    })
}

/// The coarsest knots, over the whole record.
pub(crate) fn coarsest(run: &Run) -> Times {
    with(run, PER_PERIOD[0])
}

/// So many knots a period, over the whole record.
fn with(run: &Run, per_period: f64) -> Times {
    let knot_s = run.period_s() / per_period;
    let before = (BEFORE_PERIODS * per_period).ceil() as usize + 1;
    Times { knot_s, before, knots: before + ((run.duration_s() / knot_s) as usize).max(2) }
}
