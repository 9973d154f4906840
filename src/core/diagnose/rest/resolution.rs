//! How finely a forcing is resolved in time: as what the model leaves asks for.

use realfft::RealFftPlanner;

use crate::diagnose::rest::cells::{Run, Times};
use crate::diagnose::rest::waveform::KNOTS_A_CYCLE;
use crate::model::ModelError;

/// Knots a period, from the coarsest on.
const PER_PERIOD: [f64; 4] = [16.0, 32.0, 64.0, 128.0];
/// Most knots: cost. A finer forcing is looked at for a shorter time.
const MOST_KNOTS: usize = 400;
/// Mean of the logarithm of a noise's power over its mean, where that is above 1: `∫₁^∞ ln(p) exp(-p) dp`.
const OF_NOISE: f64 = 0.219_384;
/// Periods before the closure in which a forcing makes up for what moves in the pipe then: a wave goes there and back
/// in half a period.
const BEFORE_PERIODS: f64 = 0.5;

/// The knots that tell most of what the model leaves: finer ones follow more of it, but not as long.
///
/// # Errors
/// As [`Run::left_in`].
pub(crate) fn times(run: &Run) -> Result<Times, ModelError> {
    let all = PER_PERIOD.map(|per_period| with(run, per_period));
    let finest = all[all.len() - 1];
    let cells = run.rows(&finest);
    let left_m = run.left_in(&run.x, &cells, true)?;
    // In units of the errors, a sensor after the other; cells without a sample hold nothing.
    let mut left = vec![vec![0.0; finest.cells()]; run.data().sensors.len()];
    for (row, left_m) in cells.0.iter().zip(&left_m) {
        if let Some(cell) = row.cell {
            left[row.sensor][cell] = left_m / row.sd_m;
        }
    }
    let all = all.map(|times| Times { knots: times.knots.min(times.before + MOST_KNOTS), ..times });
    let told = |times: &Times| left.iter().map(|left| told(left, finest.cell_s(), times)).sum::<f64>();
    Ok(all.into_iter().max_by(|a, b| told(a).total_cmp(&told(b))).unwrap_or(finest))
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

/// Information in what `left`, in units of white noise, has that is slow enough for the knots, as long as they last:
/// `Σ ln(1 + signal/noise)` over the lines of its spectrum (Shannon 1949, Proc. IRE 37, 10). What is too fast for the
/// knots is noise to them.
fn told(left: &[f64], cell_s: f64, times: &Times) -> f64 {
    let mut series = left[..((times.end_s() / cell_s) as usize).min(left.len())].to_vec();
    let n = series.len() as f64;
    let transform = RealFftPlanner::new().plan_fft_forward(series.len());
    let mut lines = transform.make_output_vec();
    if transform.process(&mut series, &mut lines).is_err() {
        return 0.0;
    }
    let power: Vec<f64> = lines.iter().skip(1).map(|line| line.norm_sqr() / n).collect();
    let (slow, fast) = power.split_at(((n * cell_s / (KNOTS_A_CYCLE * times.knot_s)) as usize).min(power.len()));
    let lost = fast.iter().map(|p| p - 1.0).sum::<f64>() / (slow.len().max(1) as f64);
    slow.iter().map(|p| (p / (1.0 + lost.max(0.0))).max(1.0).ln() - OF_NOISE).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tone, a line of `n a²/4`, tells more the longer it lasts, and nothing where it is too fast. Noise tells
    /// nothing.
    #[test]
    fn knots_tell_what_is_slow_enough_for_them() {
        let cell_s = 0.001;
        let tone = |i: i32| 3.0 * (std::f64::consts::TAU * 10.0 * f64::from(i) * cell_s).sin();
        let mut random = fastrand::Rng::with_seed(5);
        let mut noise = || 12f64.sqrt() * (random.f64() - 0.5);
        let left: Vec<f64> = (0..6000).map(|i| tone(i) + noise()).collect();
        let of = |left: &[f64], knot_s: f64, knots: usize| told(left, cell_s, &Times { knot_s, before: 0, knots });
        let [slow, follows, half] = [of(&left, 0.06, 100), of(&left, 0.03, 200), of(&left, 0.03, 100)];
        assert!(slow < 1.0 && slow < half && half < follows, "{slow} {half} {follows}");
        let noise: Vec<f64> = (0..6000).map(|_| noise()).collect();
        let nothing = of(&noise, 0.006, 1000);
        assert!(nothing.abs() < 30.0, "{nothing}");
        let pure: Vec<f64> = (0..6000).map(tone).collect();
        let line = of(&pure, 0.03, 200) + OF_NOISE * 66.0;
        assert!((line - 13_500f64.ln()).abs() < 0.01, "{line}");
    }
}
