//! The first column: seconds, another unit of time, date-times, or a date and a time of day in two columns.

use crate::storage::error::CsvProblem;
use crate::storage::import::csv::heading::{heading_unit, hint_on_time, time_unit};
use crate::storage::import::csv::numbers::Numbers;
use crate::storage::import::csv::row::Row;
use crate::storage::import::csv::stamp;
use crate::storage::import::csv::stamp::{Order, Stamp};
use crate::storage::import::source::{Repair, SourceOptions, Start};
use crate::storage::layout::{to_ns, to_s};

/// Reads the times of a table.
pub(crate) struct Clock {
    kind: Kind,
    repairs: Vec<Repair>,
    /// Column's heading.
    name: String,
    first_ns: Option<i64>,
    digit_s: f64,
    last_ns: i64,
    /// What midnights have added, ns.
    days_ns: i64,
    zone_s: i32,
    zone_assumed: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// Numbers of this many seconds.
    Numbers(f64),
    /// Date-times, or dates alone.
    Stamps { order: Order, has_time: bool },
    /// A date, and the time of day in the next column.
    TwoColumns(Order),
    /// A time of day alone.
    TimeOfDay,
}

const DAY_NS: i64 = 86_400_000_000_000;

impl Clock {
    /// The clock of a column of plain seconds.
    pub(crate) fn of_seconds(name: &str) -> Clock {
        Clock::of(Kind::Numbers(1.0), name, Vec::new(), &SourceOptions::default())
    }

    fn of(kind: Kind, name: &str, repairs: Vec<Repair>, options: &SourceOptions) -> Clock {
        let zone_s = options.zone_s.or_else(|| stamp::zone_of_heading(name));
        Clock {
            kind,
            repairs,
            name: name.to_owned(),
            first_ns: None,
            digit_s: 1.0,
            last_ns: i64::MIN,
            days_ns: 0,
            zone_s: zone_s.unwrap_or(0),
            zone_assumed: zone_s.is_none(),
        }
    }

    /// Finds out from the headings, the units under them and the first row.
    pub(crate) fn find(
        header: &[String],
        units: Option<&[String]>,
        row: &Row<'_>,
        text: &str,
        separator: char,
        options: &SourceOptions,
    ) -> Result<Clock, CsvProblem> {
        let name = header.first().cloned().unwrap_or_default();
        let cell = row.get(0).unwrap_or_default();
        let mut repairs = Vec::new();
        let number = Numbers::new(separator, false).read(cell, &name).is_ok_and(|v| !v.is_nan());
        let kind = if number {
            let unit = units.and_then(|u| u.first()).and_then(|u| time_unit(u));
            let heading = heading_unit(&name).or(unit).or(options.time_unit_s);
            let seconds = heading.ok_or_else(|| no_time_column(&name, header))?;
            if seconds != 1.0 {
                repairs.push(Repair::new(
                    "time-unit",
                    1,
                    None,
                    format!("the times of '{name}' are in units of {seconds} s"),
                ));
            } else if name != "time_s" {
                repairs.push(Repair::new("time-column", 1, None, format!("the times are in '{name}', in seconds")));
            }
            Kind::Numbers(seconds)
        } else {
            let mut order = order(cell, text, separator, options);
            if order == Order::Unknown && options.guess && stamp::is_ambiguous(cell) {
                order = stamp::likely_order(cell);
                if let Some(read) = Stamp::parse(cell, order) {
                    let text = format!("'{cell}' is of {} (change that with option `date-order`)", read.date());
                    repairs.push(Repair::guess("date-order", text));
                }
            }
            match Stamp::parse(cell, order) {
                Some(s) if s.has_date && s.has_time => Kind::Stamps { order, has_time: true },
                Some(s) if s.has_time => Kind::TimeOfDay,
                Some(_) => match row.get(1).and_then(|c| Stamp::parse(c, order)) {
                    Some(s) if s.has_time && !s.has_date => Kind::TwoColumns(order),
                    _ => Kind::Stamps { order, has_time: false },
                },
                None if stamp::is_ambiguous(cell) => return Err(CsvProblem::WhichDay(cell.into())),
                None if heading_unit(&name).is_none() => return Err(no_time_column(&name, header)),
                None => return Err(CsvProblem::NotANumber { column: name, cell: cell.into() }),
            }
        };
        Ok(Clock::of(kind, &name, repairs, options))
    }

    /// Number of columns that hold the time.
    pub(crate) fn columns(&self) -> usize {
        if matches!(self.kind, Kind::TwoColumns(_)) { 2 } else { 1 }
    }

    /// The time of a row, s: the column's own numbers, or seconds since the first date-time.
    pub(crate) fn seconds(
        &mut self,
        row: &Row<'_>,
        numbers: &mut Numbers,
        header: &[String],
    ) -> Result<f64, CsvProblem> {
        let cell = row.get(0).unwrap_or_default();
        let bad = || CsvProblem::NotATime(cell.into());
        let stamp = match self.kind {
            Kind::Numbers(unit_s) => {
                let value = numbers.read(cell, &header[0])?;
                if value.is_nan() {
                    return Err(CsvProblem::NoTime);
                }
                // a division keeps decimal numbers what they are: 12.5 ms are 12.5/1000 s
                let time_s = if unit_s < 1.0 { value / (1.0 / unit_s).round() } else { value * unit_s };
                return to_ns(time_s).map(|_| time_s).ok_or_else(|| CsvProblem::TimeOutOfRange(cell.into()));
            }
            // a date alone is no time among date-times
            Kind::Stamps { order, has_time } => {
                Stamp::parse(cell, order).filter(|s| s.has_date && (s.has_time || !has_time))
            }
            Kind::TimeOfDay => Stamp::parse(cell, Order::Unknown).filter(|s| !s.has_date),
            Kind::TwoColumns(order) => {
                let time = Stamp::parse(row.get(1).unwrap_or_default(), Order::Unknown).filter(|s| s.has_time);
                Stamp::parse(cell, order).zip(time).map(|(date, time)| date.joined(time))
            }
        };
        let stamp = stamp.ok_or_else(bad)?;
        self.zone_assumed &= stamp.zone_s.is_none();
        self.digit_s = self.digit_s.min(stamp.digit_s);
        let mut ns = stamp.unix_ns(self.zone_s);
        if self.kind == Kind::TimeOfDay {
            ns = ns.saturating_add(self.days_ns);
            if ns < self.last_ns.saturating_sub(DAY_NS / 2) {
                self.days_ns = self.days_ns.saturating_add(DAY_NS);
                ns = ns.saturating_add(DAY_NS);
                self.repairs.push(Repair::new(
                    "midnight",
                    1,
                    None,
                    format!("the times of '{}' run past midnight", self.name),
                ));
            }
            self.last_ns = ns;
        }
        let since = i128::from(ns) - i128::from(*self.first_ns.get_or_insert(ns));
        let since = i64::try_from(since).map_err(|_| CsvProblem::TimeOutOfRange(cell.into()))?;
        to_ns(to_s(since)).map(|_| to_s(since)).ok_or_else(|| CsvProblem::TimeOutOfRange(cell.into()))
    }

    /// Whether its times are those of a wall clock that gives no zone, and may jump with daylight saving time.
    pub(crate) fn is_local(&self) -> bool {
        self.zone_assumed && !matches!(self.kind, Kind::Numbers(_))
    }

    /// Wall-clock time of time 0, where the column gives dates.
    pub(crate) fn start(&self) -> Option<Start> {
        let dated = matches!(self.kind, Kind::Stamps { .. } | Kind::TwoColumns(_));
        let unix_ns = self.first_ns.filter(|_| dated).and_then(|ns| u64::try_from(ns).ok()).filter(|ns| *ns > 0)?;
        Some(Start { unix_ns, digit_s: self.digit_s })
    }

    /// How the times are written, where they are not plain seconds.
    pub(crate) fn repairs(&mut self) -> Vec<Repair> {
        let mut repairs = std::mem::take(&mut self.repairs);
        let zone = if self.zone_assumed { ", taken as UTC (change that with option `zone`)" } else { "" };
        let text = match self.kind {
            Kind::Numbers(_) => return repairs,
            Kind::Stamps { .. } => format!("'{}' holds date-times{zone}; time 0 is the first", self.name),
            Kind::TwoColumns(_) => format!("the first two columns hold dates and times{zone}; time 0 is the first"),
            Kind::TimeOfDay => format!("'{}' holds times of the day; time 0 is the first", self.name),
        };
        repairs.push(Repair::new("date-times", 1, None, text));
        repairs
    }
}

/// The order of day and month: from the options, or from the first date that has a number above 12.
fn order(cell: &str, text: &str, separator: char, options: &SourceOptions) -> Order {
    match options.day_first {
        Some(true) => Order::DayFirst,
        Some(false) => Order::MonthFirst,
        None if stamp::is_ambiguous(cell) => {
            let first = |line: &str| line.split(separator).next().map(|c| c.trim().trim_matches('"').to_string());
            text.lines().filter_map(first).find_map(|c| stamp::order_shown(&c)).unwrap_or(Order::Unknown)
        }
        // the first date's own order holds for all
        None => stamp::order_shown(cell).unwrap_or(Order::Unknown),
    }
}

fn no_time_column(name: &str, header: &[String]) -> CsvProblem {
    let hint = if header.len() > 1 && name.parse::<f64>().is_ok() {
        ": the header line is missing".to_string()
    } else {
        hint_on_time(name)
    };
    CsvProblem::NoTimeColumn { found: name.into(), hint }
}
