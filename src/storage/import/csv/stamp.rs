//! Date-times as programs write them, by chrono.

use chrono::{NaiveDate, NaiveTime};

/// Which of two numbers below 13 is the day.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Unknown,
    DayFirst,
    MonthFirst,
}

/// A date, a time of day, or both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stamp {
    date: NaiveDate,
    ns_of_day: i64,
    pub has_date: bool,
    pub has_time: bool,
    /// Seconds east of UTC, where it says so.
    pub zone_s: Option<i32>,
    /// Value of its last digit, s.
    pub digit_s: f64,
}

const DAY_NS: i64 = 86_400_000_000_000;

impl Stamp {
    /// Reads `2026-03-14T09:26:53.5Z`, `2026/03/14 09:26:53`, `14.03.2026 09:26:53,5`, `3/14/2026 9:26:53 PM +01:00`,
    /// `09:26:53.123` and `14.03.2026`. Slashes and dashes before the year need an order.
    pub(crate) fn parse(text: &str, order: Order) -> Option<Stamp> {
        let (date, time) = match text.split_once(['T', ' ']) {
            Some((date, time)) if !date.contains(':') => (Some(date), Some(time.trim())),
            _ if text.contains(':') => (None, Some(text)),
            _ => (Some(text), None),
        };
        let (has_date, has_time) = (date.is_some(), time.is_some());
        let date = date.map_or(NaiveDate::from_ymd_opt(1970, 1, 1), |d| parse_date(d, order))?;
        let (ns_of_day, zone_s, digit_s) = time.map_or(Some((0, None, 1.0)), parse_time)?;
        Some(Stamp { date, ns_of_day, has_date, has_time, zone_s, digit_s })
    }

    /// The date as it was read.
    pub(crate) fn date(&self) -> NaiveDate {
        self.date
    }

    /// Nanoseconds since 1970 UTC; `zone_s` is for stamps that give no zone. Saturates some 290 years from 1970.
    pub(crate) fn unix_ns(&self, zone_s: i32) -> i64 {
        let days = self.date.signed_duration_since(NaiveDate::default()).num_days();
        let zone_ns = i64::from(self.zone_s.unwrap_or(zone_s)) * 1_000_000_000;
        days.saturating_mul(DAY_NS).saturating_add(self.ns_of_day - zone_ns)
    }

    /// The date of one cell and the time of the next.
    pub(crate) fn joined(self, time: Stamp) -> Stamp {
        Stamp { ns_of_day: time.ns_of_day, has_time: true, zone_s: time.zone_s, digit_s: time.digit_s, ..self }
    }
}

/// The three numbers of a date and whether the year stands first.
fn date_parts(text: &str) -> Option<([u32; 3], char)> {
    let mark = text.chars().find(|c| !c.is_ascii_digit()).filter(|c| matches!(c, '-' | '/' | '.'))?;
    let mut parts = text.split(mark).map(|p| (p.len() <= 4).then(|| p.parse().ok()).flatten());
    let numbers = [parts.next()??, parts.next()??, parts.next()??];
    parts.next().is_none().then_some((numbers, mark))
}

fn parse_date(text: &str, order: Order) -> Option<NaiveDate> {
    let ([a, b, c], mark) = date_parts(text)?;
    let (year, month, day) = match order {
        _ if a > 999 => (a, b, c),
        // points are German, and Germans put the day first
        Order::Unknown if mark == '.' || a > 12 => (c, b, a),
        Order::Unknown if b > 12 || a == b => (c, a, b),
        Order::Unknown => return None,
        Order::DayFirst => (c, b, a),
        Order::MonthFirst => (c, a, b),
    };
    // Behind slashes and points stands the year, and loggers write it with two digits.
    let is_short = year < 100 && matches!(mark, '/' | '.') && text.rsplit(mark).next().is_some_and(|y| y.len() == 2);
    let year = if is_short { 2000 + year } else { year };
    NaiveDate::from_ymd_opt(i32::try_from(year).ok().filter(|y| (1000..=9999).contains(y))?, month, day)
}

/// Is this a date that only an order would tell apart from another one?
pub(crate) fn is_ambiguous(text: &str) -> bool {
    let date = text.split(['T', ' ']).next().unwrap_or_default();
    parse_date(date, Order::Unknown).is_none() && parse_date(date, Order::DayFirst).is_some()
}

/// The order that a date which leaves it open most likely has: who writes AM and PM puts the month first.
pub(crate) fn likely_order(text: &str) -> Order {
    let american = text.trim_end().to_ascii_uppercase().ends_with(['M']);
    if american { Order::MonthFirst } else { Order::DayFirst }
}

/// The order that a date shows by having a number above 12.
pub(crate) fn order_shown(text: &str) -> Option<Order> {
    let ([a, b, _], mark) = date_parts(text.split(['T', ' ']).next()?)?;
    match () {
        _ if a > 999 || mark == '.' => None,
        _ if a > 12 => Some(Order::DayFirst),
        _ if b > 12 => Some(Order::MonthFirst),
        _ => None,
    }
}

/// Nanoseconds of the day, the zone, and the value of the last digit.
fn parse_time(text: &str) -> Option<(i64, Option<i32>, f64)> {
    let (text, zone_s) = split_zone(text.trim())?;
    let upper = text.to_ascii_uppercase();
    let (clock, half) = match upper.strip_suffix("AM").or_else(|| upper.strip_suffix("PM")) {
        Some(clock) => (clock.trim_end(), Some(upper.ends_with("PM"))),
        None => (upper.as_str(), None),
    };
    let mut parts = clock.split(':');
    let whole = |p: &str| (1..=2).contains(&p.len()).then(|| p.parse::<u32>().ok()).flatten();
    let (mut hour, minute) = (whole(parts.next()?)?, whole(parts.next()?)?);
    let (second, fraction) = match parts.next() {
        Some(seconds) => {
            let (second, fraction) = seconds.split_once(['.', ',']).unwrap_or((seconds, ""));
            if fraction.len() > 18 || !fraction.bytes().all(|b| b.is_ascii_digit()) {
                return None;
            }
            (whole(second)?, &fraction[..fraction.len().min(9)])
        }
        None => (0, ""),
    };
    if parts.next().is_some() {
        return None;
    }
    if let Some(after_noon) = half {
        hour = (1..=12).contains(&hour).then_some(hour % 12 + if after_noon { 12 } else { 0 })?;
    }
    let digit_ns = 10u32.pow(9 - fraction.len() as u32);
    let nano = format!("0{fraction}").parse::<u32>().ok()? * digit_ns;
    let time = NaiveTime::from_hms_nano_opt(hour, minute, second, nano)?;
    Some((time.signed_duration_since(NaiveTime::MIN).num_nanoseconds()?, zone_s, f64::from(digit_ns) * 1e-9))
}

/// Cuts `Z`, `UTC` or `+01:00` off.
fn split_zone(text: &str) -> Option<(&str, Option<i32>)> {
    for name in ["Z", "UTC", "GMT"] {
        if let Some(clock) = text.strip_suffix(name) {
            return Some((clock.trim_end(), Some(0)));
        }
    }
    let Some(at) = text.rfind(['+', '-']) else { return Some((text, None)) };
    Some((text[..at].trim_end(), Some(zone_seconds(&text[at..])?)))
}

/// Seconds east of UTC that a column's heading states: `Date Time, GMT+01:00`.
pub(crate) fn zone_of_heading(heading: &str) -> Option<i32> {
    let upper = heading.to_ascii_uppercase();
    let rest = ["GMT", "UTC"].iter().find_map(|name| upper.split_once(name).map(|(_, rest)| rest.trim_start()))?;
    let end = rest.find(|c: char| !(c.is_ascii_digit() || "+-:".contains(c))).unwrap_or(rest.len());
    if end == 0 { Some(0) } else { zone_seconds(&rest[..end]) }
}

/// Seconds east of UTC of `+01:00`, `+0100` or `-5`.
pub fn zone_seconds(text: &str) -> Option<i32> {
    let sign = if text.starts_with('-') { -1 } else { 1 };
    let digits = text.strip_prefix(['+', '-'])?;
    let (hours, minutes) = match digits.split_once(':') {
        Some(pair) => pair,
        None if digits.len() == 4 && digits.is_ascii() => digits.split_at(2),
        None => (digits, "0"),
    };
    let number = |t: &str| (!t.is_empty() && t.len() <= 2).then(|| t.parse::<i32>().ok()).flatten();
    let (hours, minutes) = (number(hours)?, number(minutes)?);
    (hours <= 14 && minutes < 60).then_some(sign * (3600 * hours + 60 * minutes))
}
