//! What a column of a table looks like by its cells alone, and units that stand in columns of their own.

use crate::robust::median;
use crate::storage::import::csv::cell::Cell;
use crate::storage::import::csv::heading::{heading_unit, is_known_unit, is_time_name, time_unit};
use crate::storage::import::csv::layout::{Column, Layout};
use crate::storage::import::csv::stamp::Stamp;

/// Steps of an even column differ from their median by less than this share of it, in nineteen of twenty.
pub(crate) const EVEN: f64 = 0.1;

/// A logger of water hammer takes so many samples a second, and runs no longer than so many seconds.
const RATES_HZ: [f64; 2] = [50.0, 2e5];
const LASTS_S: f64 = 7200.0;
/// Samples of a period `4L/a` at least.
const LEAST_A_PERIOD: f64 = 20.0;
/// Units that a time without one may have: name and seconds.
pub(crate) const UNITS: [(&str, f64); 6] =
    [("s", 1.0), ("ms", 1e-3), ("d", 86_400.0), ("us", 1e-6), ("min", 60.0), ("ns", 1e-9)];

/// What a column looks like.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Looks {
    Empty,
    Words,
    /// One and the same unit in every row.
    Unit(String),
    /// Several: two of them.
    Units(String, String),
    Stamps(Stamp),
    Numbers {
        even: bool,
        values: Vec<f64>,
    },
}

impl Looks {
    /// Of one column, from its cells.
    pub(crate) fn of(layout: &Layout<'_>, column: usize) -> Looks {
        let cells: Vec<(Cell, &str)> =
            layout.column(column).map(|c| (Cell::of(c), c)).filter(|(c, _)| *c != Cell::Empty).collect();
        let count = |is: fn(&Cell) -> bool| cells.iter().filter(|(c, _)| is(c)).count();
        let (words, numbers) = (count(|c| c.is_word()), count(|c| c.is_number()));
        let stamps = count(|c| matches!(c, Cell::Stamp(_)));
        let missing = count(|c| *c == Cell::Missing);
        let first = || cells.iter().find_map(|(c, _)| if let Cell::Stamp(stamp) = c { Some(*stamp) } else { None });
        match cells.first() {
            None => Looks::Empty,
            Some((_, unit)) if is_known_unit(unit) && cells.iter().all(|(_, c)| c == unit) => {
                Looks::Unit((*unit).to_owned())
            }
            // of several units no number has a known one
            Some((_, unit)) if is_known_unit(unit) && cells.iter().all(|(_, c)| is_known_unit(c)) => Looks::Units(
                (*unit).to_owned(),
                cells.iter().find(|(_, c)| c != unit).map_or(String::new(), |(_, c)| (*c).to_owned()),
            ),
            _ if words > numbers.max(stamps) => Looks::Words,
            _ if numbers + stamps == 0 && missing > 0 => Looks::Words,
            _ if stamps >= numbers => first().map_or(Looks::Words, Looks::Stamps),
            _ => {
                let values: Vec<f64> = cells.iter().map(|(c, _)| c.value()).filter(|v| !v.is_nan()).collect();
                Looks::Numbers { even: is_even(&values), values }
            }
        }
    }
}

/// A unit in a column of its own is that of the values beside it: of those on its left, or, where one of these columns
/// has no values there, as in `Time;Unit;Valve;Unit;Middle`, of those on the right.
pub(crate) fn take_unit_columns(layout: &mut Layout<'_>, looks: &[Looks]) {
    let is_unit = |i: usize| matches!(looks[i], Looks::Unit(_) | Looks::Units(..));
    let units: Vec<usize> = (0..looks.len()).filter(|&i| is_unit(i)).collect();
    let values = |i: Option<usize>| i.filter(|&at| matches!(looks[at], Looks::Numbers { .. }));
    let passes = |at: &usize| !is_unit(*at) && !matches!(looks[*at], Looks::Empty | Looks::Words);
    let left = |i: usize| values((0..i).rev().find(passes));
    let right = |i: usize| values((i + 1..looks.len()).find(passes));
    // the unit of a time is that of times; others are of what is neither a time nor a counter
    let is_time = |layout: &Layout<'_>, i: usize| {
        let Column { heading, name, unit, .. } = &layout.columns[i];
        matches!(looks[i], Looks::Numbers { even: true, .. })
            || unit.as_deref().and_then(time_unit).or_else(|| heading_unit(heading)).is_some()
            || is_time_name(name)
    };
    let fits = |layout: &Layout<'_>, unit: usize, column: Option<usize>| {
        let of_time = matches!(&looks[unit], Looks::Unit(unit) if time_unit(unit).is_some());
        column.is_some_and(|column| of_time || !is_time(layout, column))
    };
    let is_right = units.iter().any(|&i| !fits(layout, i, left(i))) && units.iter().all(|&i| fits(layout, i, right(i)));
    for &i in &units {
        let Some(column) = (if is_right { right(i) } else { left(i) }) else { continue };
        match &looks[i] {
            Looks::Unit(unit) => {
                let mut found = layout.contradiction.take();
                layout.columns[column].state(unit, None, &mut found);
                layout.contradiction = found;
            }
            Looks::Units(one, other) => {
                let heading = layout.columns[column].heading.clone();
                layout.contradiction.get_or_insert((None, [heading, one.clone(), other.clone()]));
            }
            _ => {}
        }
    }
}

/// How one channel stands in several columns: in the first as it is, in the others made of it.
const MEANS: [&str; 6] = ["avg", "mean", "average", "ave", "raw", "unfiltered"];
const LARGEST: [&str; 2] = ["max", "maximum"];
const LEAST: [&str; 2] = ["min", "minimum"];
const MADE: [&str; 11] =
    ["min", "max", "std", "sd", "minimum", "maximum", "filtered", "filt", "smoothed", "smooth", "lowpass"];

/// The channel of a column whose name ends in one of some words.
fn channel_of(column: &Column, words: &[&str]) -> Option<String> {
    let name = column.name.trim_end_matches(')').to_lowercase();
    let (base, word) = name.rsplit_once([' ', '_', '.', '-', '('])?;
    words.contains(&word).then(|| base.trim_end().to_owned())
}

/// Two columns that hold the largest and the least value of one channel in each interval.
pub(crate) fn ends_of_one(columns: &[Column], values: &[usize]) -> Option<[usize; 2]> {
    let of = |i: usize, words: &[&str]| channel_of(&columns[i], words);
    values.iter().find_map(|&i| {
        let largest = of(i, &LARGEST)?;
        let least = values.iter().find(|&&j| of(j, &LEAST).is_some_and(|least| least == largest))?;
        Some([i, *least])
    })
}

/// Of columns of the least, the mean and the largest value of one channel in each interval, those that are not the
/// mean; and those of a channel that was filtered, where it stands beside as it was.
pub(crate) fn extremes(columns: &[Column], values: &[usize]) -> Vec<usize> {
    let is = |i: usize, words: &[&str]| channel_of(&columns[i], words);
    let plain = |i: usize| is(i, &MEANS).unwrap_or_else(|| columns[i].name.to_lowercase());
    let bases: Vec<String> = values.iter().filter(|&&i| is(i, &MADE).is_none()).map(|&i| plain(i)).collect();
    values.iter().copied().filter(|&i| is(i, &MADE).is_some_and(|base| bases.contains(&base))).collect()
}

/// The usual step of times that rise.
pub(crate) fn median_step(values: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
    (!steps.is_empty()).then(|| median(&mut steps))
}

/// Steps of one size, all but a few.
fn is_even(values: &[f64]) -> bool {
    let mut steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.len() < 2 || steps.iter().filter(|s| **s < 0.0).count() > steps.len() / 20 {
        return false;
    }
    let median = median(&mut steps);
    let even = steps.iter().filter(|s| (**s - median).abs() <= EVEN * median).count();
    median > 0.0 && 20 * even >= 19 * steps.len()
}

/// The units in which times are those of a water-hammer test, the likeliest first.
pub(crate) fn likely_units(values: &[f64], period_s: Option<f64>) -> Vec<&'static str> {
    let (Some(first), Some(last)) = (values.first(), values.last()) else { return Vec::new() };
    let Some(step) = median_step(values) else { return Vec::new() };
    let lasts_s = |unit_s: f64| (last - first) * unit_s;
    let fits = |unit_s: f64| {
        let rate_hz = 1.0 / (step * unit_s);
        let usual = (RATES_HZ[0]..=RATES_HZ[1]).contains(&rate_hz) && lasts_s(unit_s) <= LASTS_S;
        usual && period_s.is_none_or(|p| rate_hz * p > LEAST_A_PERIOD)
    };
    let mut likely: Vec<(&str, f64)> = UNITS.iter().copied().filter(|(_, unit_s)| fits(*unit_s)).collect();
    if likely.len() > 1 {
        // a test is longer than a period
        likely.retain(|(_, unit_s)| period_s.is_none_or(|p| lasts_s(*unit_s) > p));
    }
    likely.into_iter().map(|(name, _)| name).collect()
}

/// Never falls, but for a few lines out of place, and does rise.
pub(crate) fn rises(values: &[f64]) -> bool {
    let falls = values.windows(2).filter(|w| w[1] < w[0]).count();
    20 * falls <= values.len() && values.windows(2).any(|w| w[1] > w[0]) || values.len() < 2
}

pub(crate) fn distinct(values: &[f64]) -> usize {
    1 + values.windows(2).filter(|w| w[0] != w[1]).count()
}

/// More than a few times stand twice.
pub(crate) fn repeats(values: &[f64]) -> bool {
    5 * (values.len() - distinct(values).min(values.len())) > values.len()
}
