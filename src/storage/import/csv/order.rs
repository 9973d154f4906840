//! Lines out of order, times that stand twice, times that are missing.

use crate::extent::ends;
use crate::number::significant;
use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::csv::grid::{Hole, even_holes, even_step};
use crate::storage::import::csv::table::Table;
use crate::storage::import::source::{Repair, counted, is_no_order};

/// Part of the lines that may repeat a time: above it the times are written too coarsely to be of use.
const MOST_REPEATED: f64 = 0.2;

/// So many lines on end may be out of place.
const LONGEST_DISPLACED: usize = 2;

/// A wall clock jumps by so much when daylight saving time begins, s.
const SAVED_S: f64 = 3600.0;

/// Brings the table into order; `local` times are those of a wall clock without a zone.
pub(crate) fn put_in_order(table: &mut Table, repairs: &mut Vec<Repair>, local: bool) -> Result<Vec<Hole>, CsvFault> {
    if table.time_s.len() > 2 && table.time_s.windows(2).all(|w| w[1] < w[0]) {
        turn(table);
        repairs.push(Repair::new(
            "reversed",
            1,
            None,
            "the lines stand from the last to the first: they are turned around",
        ));
    }
    let displaced = displaced(table)?;
    let in_order = displaced.and_then(|_| even_step(&in_order(&table.time_s)));
    if let Some((count, line)) = displaced {
        sort(table);
        repairs.push(Repair::new(
            "order",
            count,
            Some(line),
            counted(count, "line was out of order and was sorted in", "lines were out of order and were sorted in"),
        ));
    }
    join_repeats(table, repairs)?;
    if let (Some((_, line)), Some(step_s)) = (displaced, in_order)
        && let Some(i) = table.time_s.windows(2).position(|w| w[1] - w[0] < 0.5 * step_s)
    {
        // sorted in, it falls between the times of an even grid: a wrong time rather than a line out of place
        let at = if table.line[i] > table.line[i + 1] { i } else { i + 1 };
        let problem = CsvProblem::OffTheGrid { time_s: table.time_s[at], step_s };
        return Err((Some(table.line[at].max(line)), Box::new(problem)));
    }
    let holes = even_holes(&table.time_s);
    if let Some(first) = holes.first() {
        let missing: u64 = holes.iter().filter_map(|h| h.gap.samples).sum();
        let mut text = match holes.len() {
            1 if missing == 1 => "one time is missing: recorded as a gap".to_string(),
            1 => format!("{missing} times are missing in one place: recorded as a gap"),
            n => format!("{missing} times are missing in {n} places: recorded as gaps"),
        };
        let saved = |hole: &Hole| {
            let (length_s, missing) = (hole.gap.to_s - hole.gap.from_s, hole.gap.samples.unwrap_or(0));
            (length_s - SAVED_S).abs() <= 1.5 * length_s / (missing + 1) as f64
        };
        if let Some(jump) = holes.iter().find(|hole| local && saved(hole)) {
            text += &format!(
                "; the gap before line {} is an hour long: if daylight saving time began there, nothing is missing; write the times with \
                 their zone, or in UTC",
                table.line[jump.before + 1]
            );
        }
        // more is missing than is there, here and there: a log of what changes, or of a device that could not keep up
        let lost = holes.len() > 1 && missing as usize > table.time_s.len();
        let missing = Repair::new("missing-times", missing as usize, Some(table.line[first.before]), text);
        repairs.push(Repair { lost, ..missing });
    }
    Ok(holes)
}

/// Number of lines whose time comes before that of a line above them, and the first of them.
fn displaced(table: &Table) -> Result<Option<(usize, usize)>, CsvFault> {
    let (mut latest, mut latest_line) = (f64::NEG_INFINITY, 0);
    let (mut count, mut first) = (0, None);
    // lines that go on in an order of their own are no lines out of place: a clock was set back, or another run begins
    let (mut run, mut longest) = (0, 0);
    for (&time_s, &line) in table.time_s.iter().zip(&table.line) {
        if time_s < latest {
            (count, run) = (count + 1, run + 1);
            longest = longest.max(run);
            first.get_or_insert((time_s, line, latest, latest_line));
        } else {
            (latest, latest_line, run) = (time_s, line, 0);
        }
    }
    let Some((time_s, line, previous_s, previous_line)) = first else { return Ok(None) };
    if longest > LONGEST_DISPLACED || is_no_order(count, table.time_s.len()) {
        let (time, previous) = (time_s.to_string(), previous_s.to_string());
        return Err((Some(line), Box::new(CsvProblem::TimeNotIncreasing { time, previous, previous_line })));
    }
    Ok(Some((count, line)))
}

/// The times that come after all before them.
fn in_order(time_s: &[f64]) -> Vec<f64> {
    let mut latest = f64::NEG_INFINITY;
    let later = |t: &f64| {
        let is_later = *t > latest;
        latest = latest.max(*t);
        is_later
    };
    time_s.iter().copied().filter(later).collect()
}

fn turn(table: &mut Table) {
    std::iter::once(&mut table.time_s).chain(&mut table.columns).for_each(|column| column.reverse());
    table.line.reverse();
}

fn sort(table: &mut Table) {
    let mut order: Vec<usize> = (0..table.time_s.len()).collect();
    order.sort_by(|&a, &b| table.time_s[a].total_cmp(&table.time_s[b]));
    for column in std::iter::once(&mut table.time_s).chain(&mut table.columns) {
        *column = order.iter().map(|&i| column[i]).collect();
    }
    table.line = order.iter().map(|&i| table.line[i]).collect();
}

/// The rate that times to the second, or the like, show by how many of them stand between the first change and the
/// last; in words.
fn likely_rate(time_s: &[f64]) -> String {
    let changes: Vec<usize> = (1..time_s.len()).filter(|&i| time_s[i] != time_s[i - 1]).collect();
    let (Some(&first), Some(&last)) = (changes.first(), changes.last()) else { return String::new() };
    let rate_hz = (last - first) as f64 / (time_s[last] - time_s[first]);
    if first < last && rate_hz.is_finite() {
        format!(" (it seems to be {})", significant(rate_hz, 4))
    } else {
        String::new()
    }
}

/// Makes one line of those of one time: what they agree in stays, of what they differ in the mean is taken.
fn join_repeats(table: &mut Table, repairs: &mut Vec<Repair>) -> Result<(), CsvFault> {
    let rows = table.time_s.len();
    let repeated = |i: &usize| table.time_s[*i] == table.time_s[i + 1];
    if !(0..rows.saturating_sub(1)).any(|i| repeated(&i)) {
        return Ok(());
    }
    // Lines that repeat all of the line above say nothing of how finely the times are written.
    let differs = |i: &usize| table.columns.iter().any(|c| c[*i].to_bits() != c[i + 1].to_bits());
    let contradicting = || (0..rows - 1).filter(repeated).filter(differs);
    let (first, repeats) = (contradicting().next().unwrap_or(0), contradicting().count());
    if repeats > 2 && repeats as f64 > MOST_REPEATED * rows as f64 {
        let likely = likely_rate(&table.time_s);
        return Err((Some(table.line[first + 1]), Box::new(CsvProblem::TimesTooCoarse { repeats, rows, likely })));
    }
    let (mut same, mut same_line) = (0, None);
    let (mut differing, mut differing_line, mut most) = (0, None, 0.0f64);
    let mut kept = 0;
    let mut from = 0;
    while from < rows {
        let to = from + table.time_s[from..].partition_point(|&t| t == table.time_s[from]);
        let mut spread = 0.0f64;
        for column in &mut table.columns {
            let present = || column[from..to].iter().copied().filter(|v| !v.is_nan());
            let (low, high) = ends(present());
            let mean = match present().count() {
                0 => f64::NAN,
                _ if low == high => low,
                n => present().map(|v| v / n as f64).sum(),
            };
            spread = spread.max(if high > low { high - low } else { 0.0 });
            column[kept] = mean;
        }
        if to > from + 1 {
            let line = table.line[from + 1];
            if spread > 0.0 {
                differing += 1;
                differing_line.get_or_insert(line);
                most = most.max(spread);
            } else {
                same += to - from - 1;
                same_line.get_or_insert(line);
            }
        }
        table.time_s[kept] = table.time_s[from];
        table.line[kept] = table.line[from];
        kept += 1;
        from = to;
    }
    table.time_s.truncate(kept);
    table.line.truncate(kept);
    table.columns.iter_mut().for_each(|c| c.truncate(kept));
    if same > 0 {
        let text = counted(same, "line repeats a time and adds", "lines repeat a time and add") + " nothing: left out";
        repairs.push(Repair::new("duplicate-times", same, same_line, text));
    }
    if differing > 0 {
        let text = format!(
            "{} more than once with different values: the mean was taken; they differ by up to {most:.4}",
            counted(differing, "time occurs", "times occur")
        );
        repairs.push(Repair { lost: true, ..Repair::new("contradicting-times", differing, differing_line, text) });
    }
    Ok(())
}
