//! What each column of a table is: a time, a part of one, a counter, words, units, or values on the clock of one of the
//! times.

use crate::number::significant;
use crate::storage::error::CsvProblem;
use crate::storage::import::csv::cell::Cell;
use crate::storage::import::csv::heading::{
    heading_unit, is_counter_name, is_factored, is_time_name, time_unit, unit_of_name,
};
use crate::storage::import::csv::layout::{Column, Layout};
use crate::storage::import::csv::looks::{
    EVEN, Looks, UNITS, distinct, likely_units, median_step, repeats, rises, take_unit_columns,
};
use crate::storage::import::csv::stamp::Stamp;
use crate::storage::import::kinds::{is_electric, is_unit, kind_of_name};
use crate::storage::import::source::{NAMELESS, Repair, SourceOptions};
use crate::storage::nearest::listed;

/// No logger of a test waits longer between two samples, s.
const LONGEST_STEP_S: f64 = 60.0;
/// Two clocks whose lengths differ by this factor are in two units: the nearest two of time are 24 apart.
const OTHER_UNIT: f64 = 5.0;
/// A clock that runs for fewer of its digits says nothing of its unit.
const LEAST_DIGITS: f64 = 2.0;
/// Counters of one, two, three and four bytes, and of a few decimal digits, begin anew at these, and come near to them
/// before.
const COUNTERS_WRAP: [f64; 8] = [100.0, 256.0, 1e3, 1e4, 65_536.0, 1e6, 16_777_216.0, 4_294_967_296.0];
const LAST_BEFORE: f64 = 0.9;
/// Times since 1970 lie between 2001 and 2100, s.
const SINCE_1970_S: [f64; 2] = [1e9, 4.1e9];

/// What the times of a clock are written as.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Form {
    /// Numbers of this many seconds.
    Numbers(f64),
    /// The same, since 1970 UTC.
    Since1970(f64),
    /// Days since the first.
    Days,
    /// Date-times, dates and times of the day in two columns, or times of the day.
    Stamps,
    /// One sample after the other.
    Counted {
        /// Time from one to the next, s.
        interval_s: f64,
        /// Where the column that counts them begins anew at 0, if it does.
        wraps_at: Option<f64>,
    },
}

/// Columns that give times, and those whose values they give them for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Clock {
    /// The column of times; none where each row is the next sample.
    pub(crate) time: Option<usize>,
    pub(crate) form: Form,
    /// The column of the dates of times of the day.
    pub(crate) date: Option<usize>,
    /// A column of parts of a second, and its unit, s.
    pub(crate) fraction: Option<(usize, f64)>,
    pub(crate) values: Vec<usize>,
    /// Another clock whose first date-time is the start.
    pub(crate) host: Option<usize>,
}

/// The columns of a table by what they are.
#[derive(Debug)]
pub(crate) struct Roles {
    pub(crate) clocks: Vec<Clock>,
    /// Columns of words, which no sensor gives.
    pub(crate) words: Vec<usize>,
    /// Columns that count samples, or give the times of others a second time.
    pub(crate) counters: Vec<usize>,
    /// What was found out about it.
    pub(crate) repairs: Vec<Repair>,
}

/// Finds out what each column is, and takes units that stand in a column of their own into the columns.
///
/// # Errors
/// No column holds times, and nothing states the time between samples.
pub(crate) fn roles(layout: &mut Layout<'_>, options: &SourceOptions) -> Result<Roles, CsvProblem> {
    let looks: Vec<Looks> = (0..layout.columns.len()).map(|i| Looks::of(layout, i)).collect();
    take_unit_columns(layout, &looks);
    Finder { layout, looks, options }.roles()
}

struct Finder<'a, 't> {
    layout: &'a Layout<'t>,
    looks: Vec<Looks>,
    options: &'a SourceOptions,
}

impl Finder<'_, '_> {
    fn column(&self, i: usize) -> &Column {
        &self.layout.columns[i]
    }

    fn is_given(&self, i: usize) -> bool {
        self.column(i).is_given(i + 1, self.options)
    }

    fn is_ignored(&self, i: usize) -> bool {
        self.column(i).is_ignored(i + 1, self.options)
    }

    /// Columns that may tell the time: not what the user says to be something else.
    fn may_be_time(&self, i: usize) -> bool {
        !self.is_given(i) && !self.is_ignored(i)
    }

    /// Times with a factor, which nobody can undo, tell no time.
    fn is_factored(&self, i: usize) -> bool {
        self.column(i).unit.as_deref().is_some_and(is_factored)
    }

    /// Whether unit or name say that it is a quantity of a test. What a letter alone says, an evenly rising column is
    /// not.
    fn is_quantity(&self, i: usize) -> bool {
        let name = &self.column(i).name;
        let lettered =
            name.chars().next().is_some_and(|c| matches!(c, 't' | 'T')) && !name.to_lowercase().contains("temp");
        self.is_measured(i) || (kind_of_name(name).is_some() && !lettered)
    }

    /// Whether its unit says so.
    fn is_measured(&self, i: usize) -> bool {
        let Column { name, unit, .. } = self.column(i);
        unit.as_deref().is_some_and(|unit| is_unit(name, unit) || is_electric(unit))
    }

    /// The time from sample to sample that stands around the table, s, and what says so; that of the device is not that
    /// of the lines where it did not write each of its samples.
    fn interval_s(&self) -> Option<(f64, String)> {
        self.layout.settings.interval_s().filter(|_| self.thinned().is_none())
    }

    /// What shows that not every sample of the device was written: a line that says so, or a counter that rises by more
    /// than one.
    fn thinned(&self) -> Option<String> {
        let steps = |i: usize| median_step(self.values(i)).filter(|step| *step >= 2.0 && self.is_even(i));
        let is_counter = |i: &usize| !self.column(*i).name.is_empty() && is_counter_name(&self.column(*i).name);
        let counted = || {
            let (i, step) = self.numbers().filter(is_counter).find_map(|i| Some((i, steps(i)?)))?;
            Some(format!("'{}' rises by {step} from line to line", self.column(i).heading))
        };
        self.layout.settings.thinned().or_else(counted)
    }

    /// The unit of a column's times, s, where its heading or the line of units states it.
    fn stated_unit(&self, i: usize) -> Option<f64> {
        let Column { heading, name, unit, .. } = self.column(i);
        let by_unit = unit.as_deref().and_then(time_unit);
        // what rises evenly needs no other word of a time: `device_ms`
        let last =
            || name.rsplit_once(['_', ' ', '.']).and_then(|(_, unit)| time_unit(unit)).filter(|_| self.is_even(i));
        by_unit.or_else(|| heading_unit(heading)).or_else(|| unit_of_name(name)).or_else(last)
    }

    fn values(&self, i: usize) -> &[f64] {
        if let Looks::Numbers { values, .. } = &self.looks[i] { values } else { &[] }
    }

    fn numbers(&self) -> impl Iterator<Item = usize> {
        let is_number = |i: usize| matches!(self.looks[i], Looks::Numbers { .. }) && !self.is_factored(i);
        (0..self.looks.len()).filter(move |&i| is_number(i) && self.may_be_time(i))
    }

    fn roles(&self) -> Result<Roles, CsvProblem> {
        let mut repairs = Vec::new();
        let stamps: Vec<usize> = (0..self.looks.len())
            .filter(|&i| matches!(self.looks[i], Looks::Stamps(_)) && self.may_be_time(i))
            .collect();
        let host = self.stamps_clock(&stamps);
        let fraction = host.as_ref().and_then(|clock| clock.fraction.map(|(column, _)| column));
        if let Some(column) = fraction.filter(|i| self.fraction_unit(*i).is_none()) {
            let heading = &self.column(column).heading;
            let name = if heading.is_empty() { format!("{NAMELESS}{}", column + 1) } else { heading.clone() };
            let text = format!("'{name}' counts parts of the second of the time before it");
            repairs.push(Repair::guess("fraction", text));
        }
        // what is called a time is one, in whatever order its rows stand
        let changes = |i: usize| self.values(i).windows(2).any(|w| w[0] != w[1]) || self.values(i).len() < 2;
        let is_time = |i: usize| changes(i) && (is_time_name(&self.column(i).name) || rises(self.values(i)));
        let device: Vec<usize> =
            self.numbers().filter(|&i| Some(i) != fraction && self.stated_unit(i).is_some() && is_time(i)).collect();
        let mut clocks = if let Some(rate_hz) = self.options.rate_hz {
            if let Some(problem) = self.rate_contradicted(rate_hz, &device, host.as_ref()) {
                return Err(problem);
            }
            vec![self.counted(1.0 / rate_hz, host.as_ref(), None, &mut repairs)]
        } else if !device.is_empty() {
            if let Some(problem) = self.clocks_apart(&device, host.as_ref()) {
                return Err(problem);
            }
            self.device_clocks(&device, host.as_ref(), &mut repairs)
        } else if let Some(clock) = self.since_1970().filter(|_| self.options.time_unit_s.is_none()) {
            vec![clock]
        } else if let Some(host) = host {
            match self.interval_s().filter(|_| self.repeats_stamps(&host)) {
                Some((interval_s, said)) => vec![self.counted(interval_s, Some(&host), Some(said), &mut repairs)],
                None => vec![host],
            }
        } else if let Some(clock) = self.unstated() {
            clock
        } else if let Some((interval_s, said)) = self.interval_s() {
            vec![self.counted(interval_s, None, Some(said), &mut repairs)]
        } else {
            vec![self.guessed(&mut repairs)?]
        };
        let words: Vec<usize> = (0..self.looks.len()).filter(|&i| self.looks[i] == Looks::Words).collect();
        // what has a unit of a test was meant to be numbers
        if let Some(&i) = words.iter().find(|&&i| self.is_measured(i) && !self.is_ignored(i))
            && let Some(cell) = self.layout.column(i).find(|c| Cell::of(c).is_word())
        {
            return Err(CsvProblem::NotANumber { column: self.column(i).heading.clone(), cell: cell.to_owned() });
        }
        let counters = self.assign(&mut clocks, fraction);
        if let [Clock { time: Some(time), form: Form::Numbers(unit_s), .. }] = clocks[..] {
            repairs.extend(self.interval_contradicted(time, unit_s));
        }
        Ok(Roles { clocks, words, counters, repairs })
    }

    /// The clock of the computer, or the only one: a date-time, or a date and a time of the day, with parts of a second
    /// in a column of their own.
    fn stamps_clock(&self, stamps: &[usize]) -> Option<Clock> {
        let stamp = |i: usize| if let Looks::Stamps(stamp) = self.looks[i] { Some(stamp) } else { None };
        // of several the finest, and of equals the first
        let changes = |i: usize| {
            let cells: Vec<&str> = self.layout.column(i).collect();
            cells.windows(2).filter(|w| w[0] != w[1]).count()
        };
        let timed = stamps.iter().copied().filter(|&i| stamp(i).is_some_and(|s| s.has_time)).rev();
        let time = timed.max_by_key(|&i| changes(i)).or(stamps.first().copied())?;
        let has_date = stamp(time)?.has_date;
        let date = stamps
            .iter()
            .copied()
            .find(|&i| i != time && stamp(i).is_some_and(|s| s.has_date && !s.has_time))
            .filter(|_| !has_date);
        let fraction = stamp(time).filter(|s| s.has_time).and_then(|_| {
            let right = (time + 1..self.looks.len()).find(|&i| self.looks[i] != Looks::Empty)?;
            let unit_s = self.fraction_unit(right).or_else(|| self.counts_within(right, time))?;
            let fits = self.values(right).iter().all(|v| (0.0..1.0).contains(&(v * unit_s)));
            (fits && self.begins_anew(right, time)).then_some((right, unit_s))
        });
        Some(Clock { time: Some(time), form: Form::Stamps, date, fraction, values: Vec::new(), host: None })
    }

    /// Seconds of the unit of a column that nothing names, if it holds fractions, thousandths or millionths of a
    /// second: it falls where the second changes, and nowhere else.
    fn counts_within(&self, part: usize, time: usize) -> Option<f64> {
        let most = self.values(part).iter().copied().fold(0.0, f64::max);
        let unit_s = [1.0, 1e-3, 1e-6].into_iter().find(|unit_s| (0.5..1.0).contains(&(most * unit_s)))?;
        let whole = self.values(part).iter().all(|v| (unit_s == 1.0 || v.fract() == 0.0) && *v >= 0.0);
        let rows: Vec<(&str, f64)> =
            self.layout.column(time).zip(self.layout.column(part)).map(|(t, p)| (t, Cell::of(p).value())).collect();
        let changes = rows.windows(2).filter(|w| w[0].0 != w[1].0).count();
        // the rows that are judged are those at both ends of the table
        let odd = rows.windows(2).filter(|w| (w[0].0 != w[1].0) != (w[1].1 < w[0].1)).count();
        (whole && changes > 0 && odd <= changes / 3 && !self.is_quantity(part)).then_some(unit_s)
    }

    /// Parts of a second fall where the second changes; what only rises across is a clock of its own.
    fn begins_anew(&self, part: usize, time: usize) -> bool {
        let rows: Vec<(&str, f64)> =
            self.layout.column(time).zip(self.layout.column(part)).map(|(t, p)| (t, Cell::of(p).value())).collect();
        let mut changes = rows.windows(2).filter(|w| w[0].0 != w[1].0).peekable();
        !rows.is_empty() && (changes.peek().is_none() || changes.any(|w| w[1].1 < w[0].1))
    }

    /// Seconds of the unit of parts of a second: a column that is called by it, or in a line of units.
    fn fraction_unit(&self, i: usize) -> Option<f64> {
        let Column { name, unit, .. } = self.column(i);
        if is_time_name(name) && unit_of_name(name).is_none() {
            return None;
        }
        let unit_s = unit_of_name(name).or_else(|| time_unit(name)).or_else(|| unit.as_deref().and_then(time_unit))?;
        (unit_s <= 1.0).then_some(unit_s)
    }

    /// The clocks of devices. Of two with no values between them the finer one counts, and of a host's clock the start.
    fn device_clocks(&self, device: &[usize], host: Option<&Clock>, repairs: &mut Vec<Repair>) -> Vec<Clock> {
        let value_between = |a: usize, b: usize| {
            (a + 1..b).any(|i| matches!(self.looks[i], Looks::Numbers { .. }) && !self.is_counting(i))
        };
        let mut kept: Vec<usize> = Vec::new();
        for &i in device {
            let finer = |last: usize| distinct(self.values(i)) > distinct(self.values(last));
            match kept.last_mut() {
                Some(last) if !value_between(*last, i) => {
                    if finer(*last) {
                        *last = i;
                    }
                }
                _ => kept.push(i),
            }
        }
        // a clock to the second beside a finer one of the computer is none
        if let (&[only], Some(host)) = (&kept[..], host)
            && repeats(self.values(only))
            && !self.repeats_stamps(host)
        {
            return vec![host.clone()];
        }
        let host_at = host.and_then(|clock| clock.time);
        kept.into_iter()
            .map(|i| {
                let unit_s = self.stated_unit(i).unwrap_or(1.0);
                let form = if unit_s == 86_400.0 {
                    Form::Days
                } else {
                    self.absolute(i, unit_s).unwrap_or(Form::Numbers(unit_s))
                };
                if form == Form::Days {
                    repairs.push(Repair::new(
                        "time-unit",
                        1,
                        None,
                        format!("the times are in '{}', in days; time 0 is the first", self.column(i).heading),
                    ));
                }
                Clock {
                    time: Some(i),
                    form,
                    date: host.and_then(|c| c.date),
                    fraction: host.and_then(|c| c.fraction),
                    values: Vec::new(),
                    host: host_at,
                }
            })
            .collect()
    }

    fn repeats_stamps(&self, host: &Clock) -> bool {
        let Some(time) = host.time else { return true };
        let cells: Vec<&str> = self.layout.column(time).collect();
        let same = cells.windows(2).filter(|w| w[0] == w[1]).count();
        host.fraction.is_none() && 5 * same > cells.len()
    }

    /// Numbers of a size that only times since 1970 have.
    fn absolute(&self, i: usize, unit_s: f64) -> Option<Form> {
        let is_recent = self.values(i).iter().all(|v| (SINCE_1970_S[0]..SINCE_1970_S[1]).contains(&(v * unit_s)));
        let is_test = median_step(self.values(i)).is_none_or(|step| step * unit_s < LONGEST_STEP_S);
        (is_recent && is_test && !self.values(i).is_empty()).then_some(Form::Since1970(unit_s))
    }

    fn form_since_1970(&self, i: usize) -> Option<Form> {
        let forms = || [1.0, 1e-3, 1e-6, 1e-9].into_iter().find_map(|unit_s| self.absolute(i, unit_s));
        Some(i).filter(|&i| rises(self.values(i)) && !self.is_quantity(i)).and_then(|_| forms())
    }

    fn since_1970(&self) -> Option<Clock> {
        // the device's own steps are even, those of a host's clock are not
        let found = || self.numbers().filter_map(|i| Some((i, self.form_since_1970(i)?)));
        let found = found().find(|(i, _)| self.is_even(*i)).or_else(|| found().next());
        found.map(|(i, form)| Clock { time: Some(i), form, date: None, fraction: None, values: Vec::new(), host: None })
    }

    /// Named times whose unit stands around the table, or is given by the user.
    fn unstated(&self) -> Option<Vec<Clock>> {
        let named: Vec<usize> = self.time_columns();
        let first = *named.first()?;
        // a stated interval is that of the steps in one unit
        let by_interval = || {
            let (stated_s, _) = self.interval_s()?;
            let step = median_step(self.values(first))?;
            UNITS.iter().map(|(_, unit_s)| *unit_s).find(|unit_s| (step * unit_s / stated_s).ln().abs() < EVEN)
        };
        let unit_s = self.options.time_unit_s.or_else(|| self.layout.settings.time_unit_s()).or_else(by_interval)?;
        let form = if unit_s == 86_400.0 { Form::Days } else { Form::Numbers(unit_s) };
        let clock =
            |i: usize| Clock { time: Some(i), form, date: None, fraction: None, values: Vec::new(), host: None };
        Some(named.into_iter().map(clock).collect())
    }

    /// Columns that are called times, otherwise the first that rises evenly and is neither a quantity nor a counter.
    fn time_columns(&self) -> Vec<usize> {
        let rising = |i: &usize| rises(self.values(*i));
        let named: Vec<usize> = self
            .numbers()
            .filter(rising)
            .filter(|&i| is_time_name(&self.column(i).name) && !self.is_quantity(i))
            .collect();
        if !named.is_empty() {
            return named;
        }
        let even = self.numbers().find(|&i| {
            self.is_counting(i) && !(is_counter_name(&self.column(i).name) && self.layout.names_at.is_some())
        });
        even.into_iter().collect()
    }

    fn is_even(&self, i: usize) -> bool {
        matches!(self.looks[i], Looks::Numbers { even: true, .. })
    }

    /// Rises evenly, and nothing says that it is a quantity.
    fn is_counting(&self, i: usize) -> bool {
        self.is_even(i) && !self.is_quantity(i) && !self.is_given(i)
    }

    /// One sample after the other; the column that counts them, if there is one, counts what is missing, too.
    fn counted(&self, interval_s: f64, host: Option<&Clock>, said: Option<String>, repairs: &mut Vec<Repair>) -> Clock {
        let rate = significant(1.0 / interval_s, 6);
        let by = said.map_or(String::new(), |said| format!(", as {said} says"));
        // a counter counts what is missing, too
        let counts = |i: usize| {
            let values = self.values(i);
            let most = values.iter().copied().fold(0.0, f64::max);
            let falls = values.windows(2).any(|w| w[1] < w[0]);
            let wraps_at =
                COUNTERS_WRAP.into_iter().find(|wrap| most < *wrap && most > LAST_BEFORE * wrap).filter(|_| falls);
            let steps =
                || values.windows(2).map(|w| w[1] - w[0]).map(|s| wraps_at.map_or(s, |wrap| s.rem_euclid(wrap)));
            let ones = steps().filter(|step| *step == 1.0).count();
            let whole = steps().all(|step| step >= 1.0 && step.fract() == 0.0);
            let is_counter = whole && 20 * ones >= 19 * steps().count() && ones > 0 && !self.is_quantity(i);
            is_counter.then_some((i, wraps_at))
        };
        let counter = self.numbers().find_map(counts).filter(|_| host.is_none());
        let wraps_at = counter.and_then(|(_, wraps_at)| wraps_at);
        let counter = counter.map(|(i, _)| i);
        let text = match counter {
            Some(i) => format!("'{}' counts samples, {rate} a second{by}", self.column(i).heading),
            None => format!("each line is a sample, {rate} a second{by}"),
        };
        repairs.push(Repair::new("time-counter", 1, None, text));
        let form = Form::Counted { interval_s, wraps_at };
        match host {
            Some(host) => Clock { form, ..host.clone() },
            None => Clock { time: counter, form, date: None, fraction: None, values: Vec::new(), host: None },
        }
    }

    /// A rate is for what has no times, or times that repeat: those that tell another one are not passed over.
    fn rate_contradicted(&self, rate_hz: f64, device: &[usize], host: Option<&Clock>) -> Option<CsvProblem> {
        let of_device = |i: usize| Some((i, self.stated_unit(i)? * median_step(self.values(i))?));
        let of_host = |clock: &Clock| {
            let time = clock.time.filter(|_| !self.repeats_stamps(clock) && clock.fraction.is_none())?;
            let second = |cell: &str| match Cell::of(cell) {
                Cell::Stamp(stamp) if stamp.has_time && !stamp.in_hour => Some(stamp.seconds_of_day()),
                _ => None,
            };
            Some((time, median_step(&self.layout.column(time).filter_map(second).collect::<Vec<_>>())?))
        };
        let usable = device.iter().copied().find(|&i| !repeats(self.values(i))).and_then(of_device);
        let (time, step_s) = usable.or_else(|| of_host(host?))?;
        ((step_s * rate_hz).ln().abs() > EVEN).then(|| CsvProblem::RateBesideTimes {
            rate_hz,
            column: self.column(time).heading.clone(),
            step_s: format!("{}", (1e9 * step_s).round() / 1e9),
        })
    }

    /// The device's clock and the computer's run for the same time, or one of them is in another unit.
    fn clocks_apart(&self, device: &[usize], host: Option<&Clock>) -> Option<CsvProblem> {
        let time = host?.time?;
        let stamps: Vec<Stamp> = self
            .layout
            .column(time)
            .filter_map(|cell| match Cell::of(cell) {
                Cell::Stamp(stamp) if stamp.has_time && !stamp.in_hour => Some(stamp),
                _ => None,
            })
            .collect();
        let [first, .., last] = &stamps[..] else { return None };
        let host_s = last.seconds_of_day() - first.seconds_of_day();
        let lasts = |&i: &usize| Some((i, self.stated_unit(i)? * (self.values(i).last()? - self.values(i).first()?)));
        let (device, device_s) = device.iter().filter_map(lasts).next()?;
        let is_fine = host_s > LEAST_DIGITS * first.digit_s && device_s > 0.0;
        (is_fine && (device_s / host_s).ln().abs() > OTHER_UNIT.ln()).then(|| CsvProblem::ClocksApart {
            device: self.column(device).heading.clone(),
            device_s: significant(device_s, 3),
            host: self.column(time).heading.clone(),
            host_s: significant(host_s, 3),
        })
    }

    /// A stated interval that is not that of the times: of two statements the times count.
    fn interval_contradicted(&self, time: usize, unit_s: f64) -> Option<Repair> {
        let (stated_s, said) = self.interval_s()?;
        let step_s = unit_s * median_step(self.values(time))?;
        let text = format!("{said} is not what the times say, which are {step_s} s apart: the times count");
        ((step_s / stated_s).ln().abs() > EVEN).then(|| Repair::new("interval", 1, None, text))
    }

    /// Times in the one unit that makes a test of water hammer of them.
    fn guessed(&self, repairs: &mut Vec<Repair>) -> Result<Clock, CsvProblem> {
        let columns = self.time_columns();
        let first = columns.first().copied().ok_or_else(|| self.without_time())?;
        // a unit that is stated and not understood is none to guess
        if self.column(first).unit.is_some() {
            return Err(self.without_time());
        }
        let units = likely_units(self.values(first), self.options.period_s);
        let [unit] = units[..] else { return Err(self.without_time()) };
        let heading = &self.column(first).heading;
        let text = match unit {
            "d" => format!("the times are in '{heading}', in days; time 0 is the first"),
            unit => format!("the times are in '{heading}', in {unit}"),
        };
        repairs.push(Repair::guess("time-unit", text));
        let form = if unit == "d" { Form::Days } else { Form::Numbers(time_unit(unit).unwrap_or(1.0)) };
        Ok(Clock { time: Some(first), form, date: None, fraction: None, values: Vec::new(), host: None })
    }

    fn without_time(&self) -> CsvProblem {
        let named =
            |is: &dyn Fn(usize) -> bool| (0..self.looks.len()).find(|&i| is(i)).map(|i| self.column(i).heading.clone());
        let is_time = |i: usize| is_time_name(&self.column(i).name) && matches!(self.looks[i], Looks::Numbers { .. });
        let factored = named(&|i| is_time(i) && self.is_factored(i));
        let times = named(&|i| is_time(i) && !self.is_factored(i));
        let counter = named(&|i| !self.column(i).name.is_empty() && is_counter_name(&self.column(i).name));
        // what is called a time, or has colons in it, and is not understood
        let unread =
            (0..self.looks.len()).filter(|&i| self.looks[i] == Looks::Words && !self.is_ignored(i)).find_map(|i| {
                let cell = self.layout.column(i).find(|c| !c.is_empty())?;
                let is_clock = cell.contains(|c: char| c.is_ascii_digit()) && cell.matches(':').count() > 1;
                (is_clock || is_time_name(&self.column(i).name))
                    .then(|| (self.column(i).heading.clone(), cell.to_owned()))
            });
        let text = match (&times, counter) {
            (None, _) if let Some((name, cell)) = unread => {
                return CsvProblem::TimesUnread { column: name, cell };
            }
            (None, _) if let Some(name) = &factored => format!(
                " that can be read: nobody can tell which way the factor in '{name}' is meant; write a unit alone in the heading, or give the rate of the samples with option `rate`"
            ),
            (Some(name), _) => {
                format!(" in a unit that can be guessed: give the unit of '{name}' with option `time_unit`")
            }
            (None, _) if let (Some((_, said)), Some(thinned)) = (self.layout.settings.interval_s(), self.thinned()) => {
                format!(": {said} is stated, but {thinned}; give the rate of the lines with option `rate`")
            }
            (None, Some(name)) => format!(": '{name}' counts samples; give their rate with option `rate`"),
            (None, None) => {
                String::from("; if there is one sample after the other, give their rate with option `rate`")
            }
        };
        let columns = listed(&self.layout.columns.iter().map(|c| c.heading.clone()).collect::<Vec<_>>());
        CsvProblem::NoTimes { named: text, counted: times.is_none(), columns }
    }

    /// Gives each column of values its clock, the nearest on its left, and returns the columns that count.
    fn assign(&self, clocks: &mut [Clock], fraction: Option<usize>) -> Vec<usize> {
        let times: Vec<usize> = clocks.iter().filter_map(|c| c.time).collect();
        let parts: Vec<usize> = clocks
            .iter()
            .flat_map(|c| [c.date, c.fraction.map(|(i, _)| i), c.host])
            .flatten()
            .chain(times.iter().copied())
            .chain(fraction)
            .collect();
        let mut counters = Vec::new();
        // of several, each may stand behind its values
        let is_value = |i: usize| self.is_quantity(i) || self.is_given(i);
        let is_behind =
            clocks.len() > 1 && times.iter().all(|&time| time > 0 && is_value(time - 1)) && (0..times[0]).any(is_value);
        for i in (0..self.looks.len()).filter(|i| matches!(self.looks[*i], Looks::Numbers { .. }) && !parts.contains(i))
        {
            let counts = self.stated_unit(i).is_some()
                || self.form_since_1970(i).is_some()
                || self.is_counting(i)
                || (is_time_name(&self.column(i).name) && rises(self.values(i)) && !self.is_quantity(i));
            if counts && !self.is_given(i) {
                counters.push(i);
                continue;
            }
            let nearest = if is_behind {
                clocks.iter().position(|c| c.time.is_some_and(|time| time > i))
            } else {
                clocks.iter().rposition(|c| c.time.is_some_and(|time| time < i))
            };
            clocks[nearest.unwrap_or(0)].values.push(i);
        }
        counters
    }
}
