//! Lines that do not say their time: where they are few they are left out, counted, and gaps stand in their places.

use crate::recording::Gap;
use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::csv::grid::Hole;
use crate::storage::import::source::{Repair, counted};

/// Part of the lines that may lack their time: above it the file's clock is not to be relied on.
const MOST_TIMELESS: f64 = 0.1;

/// What programs write where there is no time, in any case of letters.
const NO_TIME: [&str; 6] = ["na", "n/a", "#n/a", "<na>", "null", "none"];

/// Whether a cell of a time says that there is none.
pub(crate) fn is_no_time(cell: &str) -> bool {
    cell.is_empty()
        || NO_TIME.iter().any(|word| cell.eq_ignore_ascii_case(word))
        || cell.parse::<f64>().is_ok_and(f64::is_nan)
}

/// The lines left out so far.
#[derive(Default)]
pub(crate) struct Timeless {
    count: usize,
    first: Option<usize>,
    /// Times of the lines above them, s, and how many stand under each.
    after: Vec<(f64, u64)>,
}

impl Timeless {
    /// Leaves a line out that stands under one of a time.
    pub(crate) fn take(&mut self, line: usize, above_s: Option<f64>) {
        self.count += 1;
        self.first.get_or_insert(line);
        match (self.after.last_mut(), above_s) {
            (Some((last_s, count)), Some(time_s)) if *last_s == time_s => *count += 1,
            (_, Some(time_s)) => self.after.push((time_s, 1)),
            // nothing was recorded before it
            (_, None) => {}
        }
    }

    /// Reports them, beside so many lines with a time; too many are refused.
    pub(crate) fn repair(&self, timed: usize) -> Result<Option<Repair>, CsvFault> {
        let (count, rows) = (self.count, self.count + timed);
        if count as f64 > MOST_TIMELESS * rows as f64 {
            return Err((self.first, Box::new(CsvProblem::TimesMissing { count, rows })));
        }
        let text = counted(count, "line has no time and was left out", "lines have no time and were left out");
        Ok((count > 0).then(|| Repair { lost: true, ..Repair::new("no-time", count, self.first, text) }))
    }

    /// Gaps in their places among the increasing times, where no hole of the grid stands there already.
    pub(crate) fn add_gaps(&self, time_s: &[f64], holes: &mut Vec<Hole>) {
        for &(above_s, samples) in &self.after {
            let after = time_s.partition_point(|t| *t <= above_s);
            let Some((before, &to_s)) = after.checked_sub(1).zip(time_s.get(after)) else { continue };
            if holes.iter().all(|h| h.before != before) {
                holes.push(Hole { before, gap: Gap { from_s: time_s[before], to_s, samples: Some(samples) } });
            }
        }
        holes.sort_by_key(|h| h.before);
    }
}
