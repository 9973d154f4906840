//! Date-times as programs write them, by chrono.

use chrono::{NaiveDate, NaiveTime};

use crate::storage::import::source::Order;

/// A date, a time of day, or both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stamp {
    date: NaiveDate,
    ns_of_day: i64,
    pub has_date: bool,
    pub has_time: bool,
    /// Minutes and seconds alone, which begin anew at the full hour.
    pub in_hour: bool,
    /// Seconds east of UTC, where it says so.
    pub zone_s: Option<i32>,
    /// Value of its last digit, s.
    pub digit_s: f64,
    /// Its year counts from the Buddha.
    pub is_buddhist: bool,
    fraction: Option<Fraction>,
}

/// What stands behind the seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Fraction {
    count: i64,
    digits: usize,
    /// Behind a point or a comma; otherwise it counts thousandths or millionths.
    is_decimal: bool,
    /// Begins with a zero, and has more digits.
    leads: bool,
}

const DAY_NS: i64 = 86_400_000_000_000;

impl Stamp {
    /// Reads `2026-03-14T09:26:53.5Z`, `2026/03/14 09:26:53`, `14.03.2026 09:26:53,5`, `3/14/2026 9:26:53 PM +01:00`,
    /// `14-Mar-2026 09:26:53`, `09:26:53.123`, `09:26:53:123`, `26:53.123` (minutes and seconds), `0 days 00:00:01.5`,
    /// `14.03.2026`, and the day of the year as in `2026-073T09:26` and `073:09:26:53`. Slashes and dashes before the
    /// year need an order. Years of Thailand, 543 ahead, are brought to ours.
    pub(crate) fn parse(text: &str, order: Order) -> Option<Stamp> {
        let text = text.trim().strip_prefix("0 days ").unwrap_or(text.trim());
        // `20260314T092653.250`, without signs between the parts
        if let Some((date, time)) = text.split_once(['T', ' ']).filter(|(date, _)| is_digits(date, 8))
            && let Some((clock, rest)) = time.split_at_checked(6).filter(|(clock, _)| is_digits(clock, 6))
        {
            let ([year, month, day], [hour, minute, second]) =
                ([&date[..4], &date[4..6], &date[6..]], [&clock[..2], &clock[2..4], &clock[4..]]);
            return Stamp::parse(&format!("{year}-{month}-{day}T{hour}:{minute}:{second}{rest}"), order);
        }
        // `2026:073:09:26:53`, as instruments on a time code write it
        if let Some((year, rest)) = text.split_once(':').filter(|(year, _)| is_digits(year, 4))
            && let Some((day, time)) = rest.split_once(':').filter(|(day, _)| is_digits(day, 3))
        {
            return Stamp::parse(&format!("{year}-{day}T{time}"), order);
        }
        let (date, time) = match date_end(text) {
            Some(end) => (Some(text[..end].trim_end_matches(',')), Some(text[end + 1..].trim())),
            None if text.contains(':') => (None, Some(text)),
            None => (Some(text), None),
        };
        // the day of a year that is not said
        let (days, date, time) = match (date, time) {
            (Some(day), Some(time)) if is_digits(day, 3) => (day, None, Some(time)),
            (None, Some(time)) => match time.split_once(':') {
                Some((day, time)) if is_digits(day, 3) => (day, None, Some(time)),
                _ => ("1", None, Some(time)),
            },
            other => ("1", other.0, other.1),
        };
        let days = days.parse::<i64>().ok().filter(|day| (1..=366).contains(day))? - 1;
        let (has_date, has_time) = (date.is_some(), time.is_some());
        let (date, is_buddhist) = match date {
            Some(text) => parse_date(text, order)?,
            None => (NaiveDate::default(), false),
        };
        let time = time.map_or(Some(TimeOfDay::MIDNIGHT), parse_time)?;
        let TimeOfDay { ns, zone_s, digit_s, in_hour, fraction } = time;
        let (ns_of_day, in_hour) = (ns + days * DAY_NS, in_hour && !has_date);
        Some(Stamp { date, ns_of_day, has_date, has_time, in_hour, zone_s, digit_s, is_buddhist, fraction })
    }

    /// Digits of a fraction in counts that no zeros fill up, as the cells of a column show: `53.7` is then 7 ms after
    /// `53`. What is written as a decimal fraction never ends in a zero where its length varies, and what is filled up
    /// never varies.
    pub(crate) fn unpadded<'c>(cells: impl Iterator<Item = &'c str>) -> Option<usize> {
        let read = |cell| Stamp::parse(cell, Order::DayFirst).or_else(|| Stamp::parse(cell, Order::MonthFirst));
        let all: Vec<Fraction> = cells.filter_map(read).filter_map(|stamp| stamp.fraction).collect();
        let most = all.iter().map(|f| f.digits).max().filter(|digits| [3, 6].contains(digits))?;
        let varies = all.iter().any(|f| f.digits < most) && !all.iter().any(|f| f.leads);
        let shows = all.iter().any(|f| !f.is_decimal || (f.digits > 1 && f.count % 10 == 0));
        (varies && shows).then_some(most)
    }

    /// With a fraction of so many digits that no zeros fill up; otherwise none that is no fraction without them.
    pub(crate) fn with_fraction(self, unpadded: Option<usize>) -> Option<Stamp> {
        let Some(fraction) = self.fraction else { return Some(self) };
        match unpadded {
            None if !fraction.is_decimal && ![3, 6].contains(&fraction.digits) => None,
            None => Some(self),
            Some(digits) => {
                let ns = |digits: usize| fraction.count * 10i64.pow(9 - digits.min(9) as u32);
                let was = if fraction.is_decimal { fraction.digits } else { fraction.digits.max(3) };
                let digit_s = 0.1f64.powi(digits as i32);
                Some(Stamp { ns_of_day: self.ns_of_day - ns(was) + ns(digits), digit_s, ..self })
            }
        }
    }

    /// The date as it was read.
    pub(crate) fn date(&self) -> NaiveDate {
        self.date
    }

    /// Seconds since midnight.
    pub(crate) fn seconds_of_day(&self) -> f64 {
        self.ns_of_day as f64 * 1e-9
    }

    /// Nanoseconds since 1970 UTC; `zone_s` is for stamps that give no zone. Saturates some 290 years from 1970.
    pub(crate) fn unix_ns(&self, zone_s: i32) -> i64 {
        let days = self.date.signed_duration_since(NaiveDate::default()).num_days();
        let zone_ns = i64::from(self.zone_s.unwrap_or(zone_s)) * 1_000_000_000;
        days.saturating_mul(DAY_NS).saturating_add(self.ns_of_day - zone_ns)
    }

    /// The date of one cell and the time of the next.
    pub(crate) fn joined(self, time: Stamp) -> Stamp {
        let Stamp { ns_of_day, zone_s, digit_s, .. } = time;
        Stamp { ns_of_day, has_time: true, zone_s, digit_s, ..self }
    }
}

/// Where the date ends that stands before a time of day: at a `T` between digits, or at the blank before the first
/// colon.
fn date_end(text: &str) -> Option<usize> {
    let colon = text.find(':')?;
    let digit = |at: Option<usize>| at.and_then(|at| text.as_bytes().get(at)).is_some_and(u8::is_ascii_digit);
    let joint = |at: &usize| digit(at.checked_sub(1)) && digit(Some(at + 1));
    let t = text[..colon].rfind('T').filter(joint);
    t.or_else(|| text[..colon].trim_end().rfind(' ')).filter(|at| text[..*at].contains(|c: char| c.is_ascii_digit()))
}

/// English and German months, as far as they differ.
const MONTHS: [(&str, u32); 15] = [
    ("jan", 1),
    ("feb", 2),
    ("mar", 3),
    ("mär", 3),
    ("apr", 4),
    ("may", 5),
    ("mai", 5),
    ("jun", 6),
    ("jul", 7),
    ("aug", 8),
    ("sep", 9),
    ("oct", 10),
    ("okt", 10),
    ("nov", 11),
    ("dec", 12),
];

fn is_digits(text: &str, count: usize) -> bool {
    text.len() == count && text.bytes().all(|b| b.is_ascii_digit())
}

/// How far the years of Thailand are ahead of ours.
const BUDDHIST: i32 = 543;
/// Years in nanoseconds since 1970, and the years that are none of them, but of Thailand.
const YEARS: std::ops::RangeInclusive<i32> = 1678..=2261;
const BUDDHIST_YEARS: std::ops::RangeInclusive<i32> = 2443..=2643;

/// A date, and whether its year counted from the Buddha.
fn date_of_year(year: i32, date: impl Fn(i32) -> Option<NaiveDate>) -> Option<(NaiveDate, bool)> {
    let is_buddhist = BUDDHIST_YEARS.contains(&year);
    let year = if is_buddhist { year - BUDDHIST } else { year };
    date(year).filter(|_| YEARS.contains(&year)).map(|date| (date, is_buddhist))
}

/// A date with the name of its month: `14-Mar-2026`, `14 March 2026`, `Mar 14, 2026`.
fn named_date(text: &str) -> Option<(NaiveDate, bool)> {
    let words: Vec<&str> = text.split(['-', ' ', '/', '.', ',']).filter(|w| !w.is_empty()).collect();
    let month = |word: &str| {
        let word = word.to_lowercase().replace("dez", "dec").replace("mrz", "mar");
        MONTHS.iter().find(|(name, _)| word.starts_with(name)).map(|(_, number)| *number)
    };
    let at = words.iter().position(|w| month(w).is_some())?;
    let [day, year] = match (&words[..], at) {
        ([day, _, year], 1) | ([_, day, year], 0) => [*day, *year],
        _ => return None,
    };
    let year = year.parse::<i32>().ok().map(|y| if year.len() == 2 { 2000 + y } else { y })?;
    let (month, day) = (month(words[at])?, day.parse().ok()?);
    date_of_year(year, |year| NaiveDate::from_ymd_opt(year, month, day))
}

/// The three numbers of a date and whether the year stands first.
fn date_parts(text: &str) -> Option<([u32; 3], char)> {
    let mark = text.chars().find(|c| !c.is_ascii_digit()).filter(|c| matches!(c, '-' | '/' | '.'))?;
    let mut parts = text.split(mark).map(|p| (p.len() <= 4).then(|| p.parse().ok()).flatten());
    let numbers = [parts.next()??, parts.next()??, parts.next()??];
    parts.next().is_none().then_some((numbers, mark))
}

fn parse_date(text: &str, order: Order) -> Option<(NaiveDate, bool)> {
    if let Some((year, day)) = text.split_once(['-', '/', '.', ' ']).filter(|(y, d)| is_digits(y, 4) && is_digits(d, 3))
    {
        let (year, day) = (year.parse().ok()?, day.parse().ok()?);
        return date_of_year(year, |year| NaiveDate::from_yo_opt(year, day));
    }
    if text.contains(char::is_alphabetic) {
        return named_date(text);
    }
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
    date_of_year(i32::try_from(year).ok()?, |year| NaiveDate::from_ymd_opt(year, month, day))
}

/// What stands before the time of day.
fn date_of(text: &str) -> &str {
    date_end(text).map_or(text, |end| &text[..end])
}

/// Is this a date that only an order would tell apart from another one?
pub(crate) fn is_ambiguous(text: &str) -> bool {
    let date = date_of(text);
    parse_date(date, Order::Unknown).is_none() && parse_date(date, Order::DayFirst).is_some()
}

/// The order that a date which leaves it open most likely has: who writes AM and PM puts the month first.
pub(crate) fn likely_order(text: &str) -> Order {
    let american = text.trim_end().to_ascii_uppercase().ends_with(['M']);
    if american { Order::MonthFirst } else { Order::DayFirst }
}

/// The order that a date shows by having a number above 12.
pub(crate) fn order_shown(text: &str) -> Option<Order> {
    let ([a, b, _], mark) = date_parts(date_of(text))?;
    match () {
        _ if a > 999 || mark == '.' => None,
        _ if a > 12 => Some(Order::DayFirst),
        _ if b > 12 => Some(Order::MonthFirst),
        _ => None,
    }
}

/// A time of day.
struct TimeOfDay {
    /// Since midnight, or since the full hour.
    ns: i64,
    /// Seconds east of UTC.
    zone_s: Option<i32>,
    /// Value of the last digit, s.
    digit_s: f64,
    in_hour: bool,
    fraction: Option<Fraction>,
}

impl TimeOfDay {
    const MIDNIGHT: TimeOfDay = TimeOfDay { ns: 0, zone_s: None, digit_s: 1.0, in_hour: false, fraction: None };
}

/// Marks before thousandths of a second that are no decimal ones; a colon is one, too.
const BEFORE_MS: [char; 4] = [';', '_', ' ', '\''];

fn parse_time(text: &str) -> Option<TimeOfDay> {
    let (text, zone_s) = split_zone(text.trim())?;
    let upper = text.to_ascii_uppercase();
    let (clock, half) = match upper.strip_suffix("AM").or_else(|| upper.strip_suffix("PM")) {
        Some(clock) => (clock.trim_end(), Some(upper.ends_with("PM"))),
        None => (upper.as_str(), None),
    };
    let parts: Vec<&str> = clock.split(':').collect();
    let whole = |p: &str| (1..=2).contains(&p.len()).then(|| p.parse::<u32>().ok()).flatten();
    let cut = |seconds| str::split_once(seconds, ['.', ',']);
    let of_clock = |seconds| match str::split_once(seconds, BEFORE_MS) {
        Some((second, fraction)) => (second, fraction, false),
        None => cut(seconds).map_or((seconds, "", true), |(second, fraction)| (second, fraction, true)),
    };
    let (hour, minute, (second, fraction, is_decimal)) = match parts[..] {
        // minutes and seconds show themselves by decimals
        [minute, seconds] if cut(seconds).is_some() => (None, minute, of_clock(seconds)),
        [hour, minute] => (Some(hour), minute, ("0", "", true)),
        [hour, minute, seconds] => (Some(hour), minute, of_clock(seconds)),
        [hour, minute, second, fraction] => (Some(hour), minute, (second, fraction, false)),
        _ => return None,
    };
    let length = fraction.len();
    if length > 18 || !fraction.bytes().all(|b| b.is_ascii_digit()) || (!is_decimal && ![1, 2, 3, 6].contains(&length))
    {
        return None;
    }
    let leads = length > 1 && fraction.starts_with('0');
    let fraction = &fraction[..length.min(9)];
    // what counts thousandths has three digits
    let digits = if is_decimal || length > 3 { fraction.len() } else { 3 };
    let in_hour = hour.is_none();
    let mut hour = hour.map_or(Some(0), whole)?;
    if let Some(after_noon) = half {
        hour = (1..=12).contains(&hour).then_some(hour % 12 + if after_noon { 12 } else { 0 })?;
    }
    let digit_ns = 10u32.pow(9 - digits as u32);
    let count = format!("0{fraction}").parse::<u32>().ok()?;
    let time = NaiveTime::from_hms_nano_opt(hour, whole(minute)?, whole(second)?, count * digit_ns)?;
    let ns = time.signed_duration_since(NaiveTime::MIN).num_nanoseconds()?;
    let written =
        Fraction { count: i64::from(count), digits: if is_decimal { digits } else { length }, is_decimal, leads };
    let fraction = (length > 0).then_some(written);
    Some(TimeOfDay { ns, zone_s, digit_s: f64::from(digit_ns) * 1e-9, in_hour, fraction })
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds of the day by the digits themselves, and the date as it is written.
    #[test]
    fn stamps_of_many_programs() {
        let at = 9 * 3600 + 26 * 60 + 53;
        for (text, date, ms) in [
            ("2026-03-14T09:26:53.250Z", "2026-03-14", 250),
            ("14-Mar-2026 09:26:53.250", "2026-03-14", 250),
            ("14 March 2026 09:26:53,250", "2026-03-14", 250),
            ("Mar 14, 2026 09:26:53.250", "2026-03-14", 250),
            ("14-Oct-2026 09:26:53.250", "2026-10-14", 250),
            ("14.Okt.26 09:26:53:250", "2026-10-14", 250),
            ("2026/03/14 09:26:53:250", "2026-03-14", 250),
            ("0 days 09:26:53.250000", "1970-01-01", 250),
            ("09:26:53:250", "1970-01-01", 250),
            ("9:26:53.250 AM", "1970-01-01", 250),
            ("9:26:53;250", "1970-01-01", 250),
            ("14/03/2569 09:26:53.250", "2026-03-14", 250),
            ("20260314T092653.250Z", "2026-03-14", 250),
            ("2026-073T09:26:53.250Z", "2026-03-14", 250),
            ("2026:073:09:26:53.250", "2026-03-14", 250),
            ("2026/073 09:26:53.250", "2026-03-14", 250),
        ] {
            let read = Stamp::parse(text, Order::Unknown).unwrap_or_else(|| panic!("{text}"));
            assert_eq!(read.date().to_string(), date, "{text}");
            assert_eq!(read.ns_of_day, (at * 1000 + ms) * 1_000_000, "{text}");
            assert!((read.digit_s - if text.contains("250000") { 1e-6 } else { 1e-3 }).abs() < 1e-12);
        }
        let minutes = Stamp::parse("26:53.250", Order::Unknown).unwrap();
        assert!(
            minutes.in_hour && !minutes.has_date && minutes.ns_of_day == (26 * 60 + 53) * 1_000_000_000 + 250_000_000
        );
        for text in ["073:09:26:53.250", "073 09:26:53.250"] {
            let day = Stamp::parse(text, Order::Unknown).unwrap();
            assert!(!day.has_date && day.ns_of_day == 72 * DAY_NS + (at * 1000 + 250) * 1_000_000, "{text}");
        }
        let hours = Stamp::parse("09:26", Order::Unknown).unwrap();
        assert!(!hours.in_hour && hours.ns_of_day == (9 * 60 + 26) * 60 * 1_000_000_000);
        for text in
            ["P1", "Mar", "1:2:3:4567", "14-Foo-2026", "26:53.25:1", "later", "2026", "Run 7 2026:", "Test 12:30"]
        {
            assert!(Stamp::parse(text, Order::Unknown).is_none(), "{text}");
        }
    }

    /// The other cells of a column show whether a fraction counts thousandths or millionths, or is a decimal without
    /// its last zeros.
    #[test]
    fn a_fraction_that_no_zeros_fill_up_is_a_count() {
        let of = |cells: &[&str]| Stamp::unpadded(cells.iter().copied());
        assert_eq!(of(&["09:26:53.9", "09:26:53.10", "09:26:53.100"]), Some(3));
        assert_eq!(of(&["9:26:53:9", "9:26:53:11", "9:26:53:101"]), Some(3));
        assert_eq!(of(&["9:26:53.500", "9:26:53.1000", "9:26:53.100000"]), Some(6));
        for decimal in [
            &["09:26:53.9", "09:26:53.91", "09:26:53.925"][..],
            &["09:26:53.090", "09:26:53.100"],
            &["09:26:53.05", "09:26:53.100"],
        ] {
            assert_eq!(of(decimal), None, "{decimal:?}");
        }
        let read = |text, unpadded| {
            Stamp::parse(text, Order::Unknown)
                .and_then(|s| s.with_fraction(unpadded))
                .map(|s| s.ns_of_day % 1_000_000_000)
        };
        assert_eq!(
            (read("09:26:53.9", None), read("09:26:53.9", Some(3)), read("9:26:53:11", Some(3))),
            (Some(900_000_000), Some(9_000_000), Some(11_000_000))
        );
        assert_eq!(read("9:26:53:11", None), None, "pictures of a film are no thousandths");
    }
}
