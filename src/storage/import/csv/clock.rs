//! The times of rows: numbers in a unit, times since 1970, days, date-times in up to three columns, or counted samples.

use crate::storage::error::CsvProblem;
use crate::storage::import::csv::cell::Cell;
use crate::storage::import::csv::layout::Column;
use crate::storage::import::csv::missing::is_missing;
use crate::storage::import::csv::numbers::Numbers;
use crate::storage::import::csv::roles::{Clock as Columns, Form};
use crate::storage::import::csv::row::Row;
use crate::storage::import::csv::stamp;
use crate::storage::import::csv::stamp::Stamp;
use crate::storage::import::source::Order;
use crate::storage::import::source::{Repair, SourceOptions, Start};
use crate::storage::layout::{to_ns, to_s};

/// A counter of four bytes begins anew.
const FOUR_BYTES: f64 = 4_294_967_296.0;
/// Spreadsheets count days from the end of 1899; these are of this century.
const SPREADSHEET_DAYS: std::ops::Range<f64> = 36_526.0..73_051.0;
const DAYS_BEFORE_1970: f64 = 25_569.0;
const DAY_NS: i64 = 86_400_000_000_000;
const HOUR_NS: i64 = 3_600_000_000_000;
/// A clock that is set back by an hour in autumn is back by so much of it at least: the next sample comes a moment
/// later.
const MOST_OF_AN_HOUR_NS: i64 = HOUR_NS - 60_000_000_000;

/// Reads the times of rows.
pub(crate) struct Clock {
    columns: Columns,
    /// The column's heading, and that of the dates.
    name: String,
    date_name: Option<String>,
    order: Order,
    /// Digits of fractions that no zeros fill up.
    unpadded: Option<usize>,
    zone_s: i32,
    zone_assumed: bool,
    repairs: Vec<Repair>,
    /// The first time, ns, and days of the first row.
    first_ns: Option<i64>,
    first_days: Option<f64>,
    digit_s: f64,
    last_ns: i64,
    /// What midnights, full hours and the end of summer time have added, ns.
    added_ns: i64,
    has_date: bool,
    summer_ended: bool,
    /// The last count of a counter, and what its beginnings anew have added.
    last_count: f64,
    added_counts: f64,
    /// Whether the next row begins a block, how late that began, what is added to its times, and the last time, s.
    segment: bool,
    segment_late_s: Option<f64>,
    segment_s: f64,
    last_s: f64,
    /// Rows so far, and the row and time at which the present stretch of counted samples begins.
    rows: u64,
    stretch: Option<(f64, f64)>,
    host_ns: Option<i64>,
    host_digit_s: f64,
}

impl Clock {
    /// The clock of some columns of a table; `shown` are the cells of a column, which may tell how date-times are
    /// written.
    ///
    /// # Errors
    /// A date that may be two, and nothing shows which.
    pub(crate) fn new<'c, I: Iterator<Item = &'c str>>(
        columns: Columns,
        table: &[Column],
        shown: impl Fn(usize) -> I,
        all_dates: impl Fn(usize) -> Option<Order>,
        options: &SourceOptions,
    ) -> Result<Clock, CsvProblem> {
        let name = columns.time.map_or(String::new(), |i| table[i].heading.clone());
        let date = columns.date.or(columns.host).or(columns.time.filter(|_| columns.form == Form::Stamps));
        let mut repairs = Vec::new();
        let mut order = options.order();
        if let Some((column, cell)) = date.and_then(|column| Some((column, shown(column).next()?)))
            && order == Order::Unknown
        {
            order = stamp::order_shown(cell).or_else(|| all_dates(column)).unwrap_or(Order::Unknown);
            if order == Order::Unknown && stamp::is_ambiguous(cell) {
                if !options.guess {
                    return Err(CsvProblem::WhichDay(cell.into()));
                }
                order = stamp::likely_order(cell);
                if let Some(read) = Stamp::parse(cell, order) {
                    let text = format!("'{cell}' is of {} (change that with option `date_order`)", read.date());
                    repairs.push(Repair::guess("date-order", text));
                }
            }
        }
        let zone = date.and_then(|i| stamp::zone_of_heading(&table[i].heading));
        let zone_s = options.zone_s.or(zone);
        Ok(Clock {
            date_name: columns.date.map(|i| table[i].heading.clone()),
            unpadded: columns.time.and_then(|i| Stamp::unpadded(shown(i))),
            columns,
            name,
            order,
            zone_s: zone_s.unwrap_or(0),
            zone_assumed: zone_s.is_none(),
            repairs,
            first_ns: None,
            first_days: None,
            digit_s: 1.0,
            last_ns: i64::MIN,
            added_ns: 0,
            has_date: false,
            summer_ended: false,
            segment: false,
            segment_late_s: None,
            segment_s: 0.0,
            last_s: f64::NEG_INFINITY,
            last_count: f64::NEG_INFINITY,
            added_counts: 0.0,
            rows: 0,
            stretch: None,
            host_ns: None,
            host_digit_s: 1.0,
        })
    }

    /// Whether one of the columns that hold the time of a row is empty there.
    pub(crate) fn is_timeless(&self, row: &Row<'_>, is_no_time: impl Fn(&str) -> bool) -> bool {
        let Columns { time, date, fraction, form, .. } = &self.columns;
        let date = date.filter(|_| *form == Form::Stamps);
        [*time, date, fraction.map(|(i, _)| i)]
            .into_iter()
            .flatten()
            .any(|i| is_no_time(row.get(i).unwrap_or_default()))
    }

    /// Whether a row has something that looks like its time.
    pub(crate) fn is_timed(&self, row: &Row<'_>) -> bool {
        self.columns.time.is_some() && matches!(Cell::of(self.cell(row)), Cell::Number(_) | Cell::Stamp(_))
    }

    /// The time of a row, s: the column's own numbers, or seconds since the first time where they are those of the day.
    pub(crate) fn seconds(&mut self, row: &Row<'_>, numbers: &mut Numbers) -> Result<f64, CsvProblem> {
        if let Some(host) = self.columns.host
            && self.host_ns.is_none()
            && let Some(stamp) = self.stamp(row, host).filter(|s| s.has_date)
        {
            self.host_ns = Some(stamp.unix_ns(self.zone_s));
            self.zone_assumed &= stamp.zone_s.is_none();
            self.host_digit_s = stamp.digit_s;
        }
        let time_s = match self.columns.form {
            Form::Numbers(unit_s) => {
                let value = self.unwrapped(self.number(row, numbers)?);
                // a division keeps decimal numbers what they are: 12.5 ms are 12.5/1000 s
                if unit_s < 1.0 { value / (1.0 / unit_s).round() } else { value * unit_s }
            }
            Form::Days => {
                let days = self.number(row, numbers)?;
                // seven decimals of a second are what a day in eight bytes holds
                ((days - *self.first_days.get_or_insert(days)) * 86_400e7).round() / 1e7
            }
            Form::Since1970(unit_s) => {
                let cell = self.cell(row);
                let ns = ns_of_decimal(cell, unit_s).ok_or_else(|| CsvProblem::NotATime(cell.into()))?;
                self.has_date = true;
                (self.zone_assumed, self.digit_s) = (false, self.digit_s.min(last_digit_s(cell, unit_s)));
                to_s(ns - *self.first_ns.get_or_insert(ns))
            }
            Form::Stamps => to_s(self.stamped(row, numbers)?),
            Form::Counted { interval_s, wraps_at } => self.counted(row, numbers, interval_s, wraps_at)?,
        };
        let time_s = self.in_segment(time_s);
        to_ns(time_s).map(|_| time_s).ok_or_else(|| CsvProblem::TimeOutOfRange(self.cell(row).into()))
    }

    fn cell<'r>(&self, row: &'r Row<'_>) -> &'r str {
        self.columns.time.and_then(|i| row.get(i)).unwrap_or_default()
    }

    fn number(&self, row: &Row<'_>, numbers: &mut Numbers) -> Result<f64, CsvProblem> {
        let value = numbers.read(self.cell(row), &self.name)?;
        if value.is_nan() && !is_missing(value) { Err(CsvProblem::NoTime) } else { Ok(value) }
    }

    /// Begins a block of rows whose own times may begin anew; `late_s` is how much later it began than the first, where
    /// the file says so.
    pub(crate) fn begin_segment(&mut self, late_s: Option<f64>) {
        (self.segment, self.segment_late_s) = (true, late_s);
    }

    /// The time of a block in that of the first one.
    fn in_segment(&mut self, time_s: f64) -> f64 {
        // a block whose times go on needs no start of its own
        if std::mem::take(&mut self.segment) {
            self.segment_s = self
                .segment_late_s
                .filter(|late_s| time_s < self.last_s && time_s + late_s > self.last_s)
                .unwrap_or(0.0);
        }
        self.last_s = time_s + self.segment_s;
        self.last_s
    }

    /// Counts on where a counter of four bytes begins anew.
    fn unwrapped(&mut self, value: f64) -> f64 {
        let wraps = self.last_count - value > 0.5 * FOUR_BYTES && self.last_count < FOUR_BYTES;
        self.counted_on(value, wraps.then_some(FOUR_BYTES))
    }

    /// Counts on where a counter begins anew at some count.
    fn counted_on(&mut self, value: f64, wraps_at: Option<f64>) -> f64 {
        if let Some(wraps_at) = wraps_at {
            if self.added_counts == 0.0 {
                let text = format!("'{}' counts to {} and begins anew: the times go on", self.name, wraps_at - 1.0);
                self.repairs.push(Repair::new("counter-wrap", 1, None, text));
            }
            self.added_counts += wraps_at;
        }
        self.last_count = value;
        value + self.added_counts
    }

    fn stamp(&self, row: &Row<'_>, column: usize) -> Option<Stamp> {
        let unpadded = self.unpadded.filter(|_| self.columns.time == Some(column));
        let stamp = Stamp::parse(row.get(column)?, self.order)?.with_fraction(unpadded)?;
        match self.columns.date.filter(|date| *date != column) {
            Some(date) if !stamp.has_date => Some(Stamp::parse(row.get(date)?, self.order)?.joined(stamp)),
            _ => Some(stamp),
        }
    }

    /// Nanoseconds since the first date-time.
    fn stamped(&mut self, row: &Row<'_>, numbers: &mut Numbers) -> Result<i64, CsvProblem> {
        let bad = || CsvProblem::NotATime(self.cell(row).into());
        let stamp = self.columns.time.and_then(|i| self.stamp(row, i)).ok_or_else(bad)?;
        // a date alone is no time among date-times
        if self.first_ns.is_some() && stamp.has_date != self.has_date {
            return Err(bad());
        }
        if stamp.is_buddhist && self.first_ns.is_none() {
            let year = stamp.date().format("%Y");
            let text =
                format!("the years of '{}' count from the Buddha, as in Thailand: the first is {year}", self.name);
            self.repairs.push(Repair::new("era", 1, None, text));
        }
        self.has_date = stamp.has_date;
        self.zone_assumed &= stamp.zone_s.is_none();
        self.digit_s = self.digit_s.min(stamp.digit_s);
        let mut ns = stamp.unix_ns(self.zone_s);
        if let Some((column, unit_s)) = self.columns.fraction {
            let part = numbers.read(row.get(column).unwrap_or_default(), "")?;
            ns = ns.saturating_add((part * unit_s * 1e9).round() as i64);
            self.digit_s = self.digit_s.min(unit_s);
        }
        ns = ns.saturating_add(self.added_ns);
        let back_ns = self.last_ns.saturating_sub(ns);
        let local = stamp.zone_s.is_none() && self.has_date;
        let (wraps_ns, what, text) = match () {
            () if stamp.in_hour => (HOUR_NS, "hour", "run past the full hour"),
            () if !stamp.has_date => (DAY_NS, "midnight", "run past midnight"),
            () => (0, "", ""),
        };
        if wraps_ns > 0 && back_ns > wraps_ns / 2 {
            self.added_ns = self.added_ns.saturating_add(wraps_ns);
            ns = ns.saturating_add(wraps_ns);
            self.repairs.push(Repair::new(what, 1, None, format!("the times of '{}' {text}", self.name)));
        } else if local && !self.summer_ended && (MOST_OF_AN_HOUR_NS..=HOUR_NS).contains(&back_ns) {
            (self.summer_ended, self.added_ns) = (true, self.added_ns.saturating_add(HOUR_NS));
            ns = ns.saturating_add(HOUR_NS);
            let text = format!(
                "the clock of '{}' is set back by an hour at {}, as when summer time ends: the times go on",
                self.name,
                self.cell(row)
            );
            self.repairs.push(Repair::new("summer-time", 1, None, text));
        }
        self.last_ns = ns;
        let since = i128::from(ns) - i128::from(*self.first_ns.get_or_insert(ns));
        i64::try_from(since).map_err(|_| CsvProblem::TimeOutOfRange(self.cell(row).into()))
    }

    /// The time of a counted sample. Where there are date-times beside it, too coarse for its rate, a pause in them is
    /// one in the samples, and a rate that contradicts them is refused.
    fn counted(
        &mut self,
        row: &Row<'_>,
        numbers: &mut Numbers,
        interval_s: f64,
        wraps_at: Option<f64>,
    ) -> Result<f64, CsvProblem> {
        let place = self.rows as f64;
        self.rows += 1;
        let per_s = 1.0 / interval_s;
        // a rate of whole samples a second keeps decimal times what they are
        let after = |samples: f64| {
            if (per_s - per_s.round()).abs() < 1e-9 * per_s { samples / per_s.round() } else { samples * interval_s }
        };
        let is_stamped = self.columns.fraction.is_some()
            || self.columns.date.is_some()
            || self.columns.time.is_some_and(|i| row.get(i).is_some_and(|c| Stamp::parse(c, self.order).is_some()));
        match self.columns.time {
            None => Ok(after(place)),
            Some(_) if is_stamped => {
                let clock_s = to_s(self.stamped(row, numbers)?);
                let (from, began_s) = *self.stretch.get_or_insert((0.0, clock_s));
                let time_s = began_s + after(place - from);
                let slack_s = self.digit_s + 2.0 * interval_s;
                if clock_s > time_s + slack_s {
                    self.stretch = Some((place, clock_s));
                    return Ok(clock_s);
                }
                if time_s > clock_s + 2.0 * slack_s {
                    return Err(CsvProblem::RateContradicted { rate_hz: per_s, time: self.cell(row).into() });
                }
                Ok(time_s)
            }
            Some(_) => {
                let count = self.number(row, numbers)?;
                Ok(after(self.counted_on(count, wraps_at.filter(|_| count < self.last_count))))
            }
        }
    }

    /// Whether its times are those of a wall clock that gives no zone, and may jump with daylight saving time.
    pub(crate) fn is_local(&self) -> bool {
        self.zone_assumed && self.has_date
    }

    /// Wall-clock time of time 0, where a column gives dates; `first_s` is the first time.
    pub(crate) fn start(&self, first_s: f64) -> Option<Start> {
        let by_days = || {
            let days = self.first_days.filter(|days| SPREADSHEET_DAYS.contains(days))?;
            to_ns((days - DAYS_BEFORE_1970) * 86_400.0)
        };
        let (ns, digit_s) = match self.host_ns.or_else(by_days) {
            Some(ns) if self.host_ns.is_none() => (ns, self.host_digit_s),
            Some(ns) => (ns.saturating_sub(to_ns(first_s)?), self.host_digit_s),
            None => (self.first_ns.filter(|_| self.has_date)?, self.digit_s),
        };
        u64::try_from(ns).ok().filter(|ns| *ns > 0).map(|unix_ns| Start { unix_ns, digit_s })
    }

    /// How the times are written, where they are not plain seconds.
    pub(crate) fn repairs(&mut self) -> Vec<Repair> {
        let mut repairs = std::mem::take(&mut self.repairs);
        let zone = if self.zone_assumed { ", taken as UTC (change that with option `zone`)" } else { "" };
        let name = &self.name;
        let (what, text) = match self.columns.form {
            Form::Numbers(unit_s) if unit_s != 1.0 => {
                ("time-unit", format!("the times of '{name}' are in units of {unit_s} s"))
            }
            Form::Numbers(_) if name != "time_s" => ("time-column", format!("the times are in '{name}', in seconds")),
            Form::Numbers(_) | Form::Days => return repairs,
            Form::Counted { .. } if !self.has_date => return repairs,
            Form::Since1970(_) => ("date-times", format!("'{name}' counts from 1970; time 0 is the first time")),
            _ if self.columns.date.is_some() => (
                "date-times",
                format!(
                    "the times of the day are in '{name}', their dates in a column of their own{zone}; time 0 is the first"
                ),
            ),
            _ if self.has_date => ("date-times", format!("'{name}' holds date-times{zone}; time 0 is the first")),
            _ => ("date-times", format!("'{name}' holds times of the day; time 0 is the first")),
        };
        repairs.push(Repair::new(what, 1, None, text));
        if let Some(date) = &self.date_name {
            repairs.push(Repair::new(
                "time-column",
                1,
                None,
                format!("the times are in '{name}', their dates in '{date}'"),
            ));
        }
        repairs
    }
}

/// Nanoseconds of a decimal number in a unit of time, exactly.
fn ns_of_decimal(cell: &str, unit_s: f64) -> Option<i64> {
    let cell = cell.replace(',', ".");
    if cell.contains(['e', 'E']) {
        return to_ns(cell.parse::<f64>().ok()? * unit_s);
    }
    let (whole, fraction) = cell.split_once('.').unwrap_or((&cell, ""));
    let unit_ns = (unit_s * 1e9).round() as i64;
    let digits = &fraction[..fraction.len().min(9)];
    let part = if digits.is_empty() {
        0
    } else {
        digits.parse::<i64>().ok()?.checked_mul(unit_ns)? / 10i64.pow(digits.len() as u32)
    };
    whole.parse::<i64>().ok()?.checked_mul(unit_ns)?.checked_add(part)
}

fn last_digit_s(cell: &str, unit_s: f64) -> f64 {
    let decimals = cell.split_once(['.', ',']).map_or(0, |(_, fraction)| fraction.len());
    unit_s * 0.1f64.powi(i32::try_from(decimals).unwrap_or(9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_since_1970_lose_no_digit() {
        for (cell, unit_s, ns) in [
            ("1773480413.25", 1.0, 1_773_480_413_250_000_000),
            ("1773480413250", 1e-3, 1_773_480_413_250_000_000),
            ("1773480413250000.125", 1e-6, 1_773_480_413_250_000_125),
            ("1773480413250000001", 1e-9, 1_773_480_413_250_000_001),
        ] {
            assert_eq!(ns_of_decimal(cell, unit_s), Some(ns), "{cell}");
        }
    }
}
