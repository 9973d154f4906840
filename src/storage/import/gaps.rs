//! Gaps of a track where its file says that there is no number.

use crate::recording::Gap;

/// Gaps over the times at which there is none, from the sample before to the one after; before the first sample and
/// after the last, from or to such a time itself. Both in order, s; where there is a sample at the time as well,
/// nothing is missing.
pub(crate) fn gaps(time_s: &[f64], missing_s: &[f64]) -> Vec<Gap> {
    let place = |t: f64| time_s.partition_point(|s| *s < t);
    let missing_s: Vec<f64> = missing_s.iter().copied().filter(|t| time_s.get(place(*t)) != Some(t)).collect();
    let runs = missing_s.chunk_by(|a, b| place(*a) == place(*b));
    runs.map(|run| {
        let (first_s, last_s, after) = (run[0], run[run.len() - 1], place(run[0]));
        let before_s = after.checked_sub(1).and_then(|i| time_s.get(i));
        Gap {
            from_s: before_s.copied().unwrap_or(first_s),
            to_s: time_s.get(after).copied().unwrap_or(last_s),
            samples: Some(run.len() as u64),
        }
    })
    .collect()
}
