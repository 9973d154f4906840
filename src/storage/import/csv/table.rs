//! A table of numbers, and the series of its columns.

use crate::recording::{Gap, Series};
use crate::storage::import::csv::grid::{Hole, uneven_gaps};
use crate::storage::import::csv::missing::is_missing;
use crate::storage::import::gaps::gaps;

/// Times, lines of the file and columns, all of one length; NaN where a cell is empty, and a NaN of its own where it
/// says that a value is missing.
#[derive(Default)]
pub(crate) struct Table {
    pub(crate) time_s: Vec<f64>,
    pub(crate) line: Vec<usize>,
    pub(crate) columns: Vec<Vec<f64>>,
}

/// The samples of a column, and the gaps in it: only one that is sampled on both sides of a hole has lost something in
/// it, and so it has where a cell says that its value is missing.
pub(crate) fn column_series(time_s: &[f64], values: &[f64], holes: &[Hole]) -> Series {
    let present = || time_s.iter().zip(values).filter(|(_, v)| !v.is_nan());
    let lost = holes.iter().filter(|h| !values[h.before].is_nan() && !values[h.before + 1].is_nan());
    let mut series = Series {
        time_s: present().map(|(t, _)| *t).collect(),
        value: present().map(|(_, v)| *v).collect(),
        gaps: lost.map(|h| h.gap).collect(),
    };
    let missing_s: Vec<f64> = time_s.iter().zip(values).filter(|(_, v)| is_missing(**v)).map(|(t, _)| *t).collect();
    if !missing_s.is_empty() {
        series.gaps.extend(gaps(&series.time_s, &missing_s));
    }
    let known = |gap: &Gap| series.gaps.iter().any(|other| other.from_s < gap.to_s && gap.from_s < other.to_s);
    let uneven: Vec<Gap> = uneven_gaps(&series.time_s).into_iter().filter(|gap| !known(gap)).collect();
    series.gaps.extend(uneven);
    series.gaps.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    series
}
