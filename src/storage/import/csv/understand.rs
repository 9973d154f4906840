//! A table however a logger wrote it becomes one that the parser reads: lines before the headings, no headings, columns separated by blanks,
//! times in any column, in days or in no stated unit, counted samples. What is not written in the file is guessed, and reported as a guess.

use std::borrow::Cow;

use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::csv::heading::{header_unit, heading_unit, time_unit};
use crate::storage::import::csv::numbers::Numbers;
use crate::storage::import::csv::row::{Row, is_row};
use crate::storage::import::csv::stamp::{Order, Stamp};
use crate::storage::import::kinds::{NAMELESS, is_electric, is_unit};
use crate::storage::import::source::{Repair, SourceOptions};

/// Lines from which the separator and the time column are judged.
const JUDGED: usize = 2000;
/// Units and their like have no more letters.
const SHORT: usize = 8;
/// Steps of an even column differ from their median by less than this share of it, in nineteen of twenty.
const EVEN: f64 = 0.1;
/// A logger of water hammer takes so many samples a second, and runs no longer than so many seconds.
const RATES_HZ: [f64; 2] = [50.0, 2e5];
const LASTS_S: f64 = 7200.0;
/// Samples of a period `4L/a` at least.
const LEAST_A_PERIOD: f64 = 20.0;
/// Units that a time without one may have, the likeliest first: name and seconds.
const UNITS: [(&str, f64); 6] = [("s", 1.0), ("ms", 1e-3), ("d", 86_400.0), ("us", 1e-6), ("min", 60.0), ("ns", 1e-9)];
/// Names of times, and of counted samples, in lower case.
const TIMES: [&str; 13] = [
    "time",
    "t",
    "times",
    "zeit",
    "temps",
    "tempo",
    "tiempo",
    "elapsed time",
    "relative time",
    "timestamp",
    "date/time",
    "x_value",
    "seconds",
];
const COUNTERS: [&str; 12] =
    ["#", "sample", "samples", "index", "n", "no", "nr", "i", "scan", "count", "counter", "sample number"];

/// The text anew, with the headings first and the times in the first column; none where it is so already, or where no table is found.
///
/// # Errors
/// No column holds times.
pub(crate) fn understand(
    text: &str,
    options: &SourceOptions,
    repairs: &mut Vec<Repair>,
) -> Result<Option<String>, CsvFault> {
    let lines: Vec<&str> = text.lines().collect();
    let Some(table) = Table::find(&lines) else { return Ok(None) };
    let time = table.time(options).ok_or_else(|| table.without_time())?;
    let first_row = lines.iter().position(|l| is_row(l));
    let is_plain =
        time.column == Some(0) && time.date.is_none() && time.change == Change::None && table.header_at == first_row;
    if is_plain && table.separator != ' ' && table.units.is_empty() && table.words.is_empty() {
        return Ok(None);
    }
    repairs.extend(table.repairs(first_row));
    repairs.extend(time.repairs(&table));
    Ok(Some(table.written(&lines, &time)))
}

/// Where a table stands among the lines of a file.
struct Table<'t> {
    /// A blank stands for any number of them.
    separator: char,
    /// The line of headings, from 0.
    header_at: Option<usize>,
    headings: Vec<String>,
    /// The lines under it that belong to it: units, kinds of values.
    units: Vec<usize>,
    /// The first line of numbers, from 0.
    first: usize,
    /// The first rows.
    rows: Vec<Vec<Cow<'t, str>>>,
    /// Columns that hold words or nothing.
    words: Vec<usize>,
}

/// The column of times.
struct Time {
    /// None where each line is the next sample.
    column: Option<usize>,
    /// The column of the dates, where this one holds times of the day.
    date: Option<usize>,
    heading: String,
    change: Change,
}

/// What becomes of the times.
#[derive(Clone, Copy, PartialEq)]
enum Change {
    None,
    /// They are in this unit, which nothing states.
    Unit(&'static str),
    /// Days become seconds since the first, in days.
    Days(f64),
    /// Counted samples become seconds at this rate, Hz.
    Counter(f64),
}

impl<'t> Table<'t> {
    fn find(lines: &[&'t str]) -> Option<Table<'t>> {
        let judged = |separator: char, words: bool| {
            let from = lines.len().saturating_sub(JUDGED + 1);
            let rows = || lines[from..].iter().filter(|l| is_row(l));
            let fits = |cells: Vec<Cow<str>>| {
                cells.len() > 1 && is_numbers(&cells) && (words || !cells.iter().any(|c| is_word(c)))
            };
            let good = rows().filter(|l| fits(cells(l, separator))).count();
            good > 1 && 10 * good > 9 * rows().count().saturating_sub(2)
        };
        // A comma may be a decimal one: remarks are looked for only where no separator leaves numbers alone.
        let found = |words| [';', '\t', ',', ' '].into_iter().find(|&s| judged(s, words));
        let separator = found(false).or_else(|| found(true))?;
        let of = |line: &'t str| cells(line, separator);
        // The second half of a file is rows, and shows which columns hold words.
        let rows: Vec<&'t str> = lines.iter().copied().filter(|l| is_row(l)).collect();
        let late = worded(rows[(rows.len() / 2).max(rows.len().saturating_sub(JUDGED))..].iter().map(|l| of(l)));
        let is_data = |line: &&'t str| {
            let cells = of(line);
            let at_home = cells.iter().enumerate().all(|(i, c)| !is_word(c) || late.contains(&i));
            !line.starts_with('#') && cells.len() > 1 && is_numbers(&cells) && at_home
        };
        let first = lines.windows(2).position(|w| is_data(&w[0]) && is_data(&w[1]))?;
        let columns = of(lines[first]).len();
        let rows: Vec<Vec<Cow<str>>> =
            lines[first..].iter().take(JUDGED).filter(|l| is_data(l)).map(|l| of(l)).collect();
        // Headings may stand in a comment, as numpy writes them.
        let headings = |at: usize| {
            let line = lines[at].trim_start_matches(['#', '%']).trim_start_matches(|c| c == ' ' && separator != ' ');
            let found = joined_units(cells(line, separator));
            let words = found.iter().any(|c| !c.is_empty()) && found.iter().all(|c| c.is_empty() || !is_number(c));
            (found.len() == columns && words).then_some(found)
        };
        let above = (0..first).rev().find(|&at| lines[at].starts_with('#') || is_row(lines[at]));
        let mut header_at = above.filter(|&at| headings(at).is_some());
        let mut units = Vec::new();
        let mut names = header_at.and_then(headings);
        // Under the names may stand a line of units, and one that says how each value was taken.
        if let Some(last) = header_at {
            let is_short = |at: usize| headings(at).is_some_and(|h| h.iter().all(|c| c.chars().count() <= SHORT));
            let filled = |at: usize| headings(at).map_or(0, |h| h.iter().filter(|c| !c.is_empty()).count());
            let under = |at: usize| at > 0 && filled(at) > 0 && filled(at - 1) >= filled(at);
            let in_units = |at: usize| headings(at).map_or(0, |h| h.iter().filter(|c| is_known_unit(bare(c))).count());
            let below =
                |at: &usize| under(*at) && (is_short(*at) && in_units(*at) > 0 || 2 * in_units(*at) > filled(*at));
            let below = [last.saturating_sub(1), last].into_iter().find(below);
            if let Some(at) = below.or(Some(last).filter(|&at| under(at) && is_short(at))) {
                names = with_units(headings(at - 1), headings(at));
                (header_at, units) = (Some(at - 1), (at..=last).collect());
            }
        }
        // LabVIEW writes the units above them, in a line that says so.
        let labelled = (0..header_at.unwrap_or(0)).rev().find_map(|at| {
            headings(at).filter(|h| h[0].to_lowercase().contains("unit") && h.iter().any(|c| is_known_unit(bare(c))))
        });
        if let (Some(mut labels), true) = (labelled, units.is_empty()) {
            labels[0].clear();
            names = with_units(names, Some(labels));
        }
        let headings = names.unwrap_or_else(|| (1..=columns).map(|i| format!("{NAMELESS}{i}")).collect());
        // Remarks may stand anywhere in the file.
        let words = worded(lines[first..].iter().filter(|l| is_row(l)).map(|l| of(l)));
        let words = words.into_iter().filter(|i| *i < columns).collect();
        Some(Table { separator, header_at, headings, units, first, rows, words })
    }

    /// The column of times; none where nothing looks like one.
    fn time(&self, options: &SourceOptions) -> Option<Time> {
        let name =
            |i: usize| header_unit(&self.headings[i]).map_or(self.headings[i].clone(), |(name, _)| name).to_lowercase();
        let all = (0..self.headings.len()).filter(|i| !self.words.contains(i));
        let heading = |column: usize| self.headings[column].clone();
        let as_is =
            |column: usize| Time { column: Some(column), date: None, heading: heading(column), change: Change::None };
        let is_time = |i: &usize| TIMES.contains(&name(*i).as_str());
        let values = |i: usize| self.numbers(i);
        // Date-times and stated units need no guess, but days and counted samples become seconds.
        if let Some(column) = all.clone().find(|&i| heading_unit(&self.headings[i]).is_some()) {
            let days = header_unit(&self.headings[column]).is_some_and(|(_, unit)| time_unit(&unit) == Some(86_400.0));
            let change = if days { Change::Days(*values(column)?.first()?) } else { Change::None };
            return Some(Time { change, ..as_is(column) });
        }
        let shown = |i: usize| self.rows.first().and_then(|r| r.get(i)).map(|c| &**c).filter(|c| stamped(c));
        if let Some(column) = all.clone().find(|&i| shown(i).is_some_and(|c| c.contains(':'))) {
            // The date of a time of day stands in a column of its own.
            let is_date = |&i: &usize| shown(i).is_some_and(|c| !c.contains(':') && !is_number(c));
            let has_date = stamp_of(shown(column)?)?.has_date;
            return Some(Time { date: all.clone().find(is_date).filter(|_| !has_date), ..as_is(column) });
        }
        if let Some(rate_hz) = options.rate_hz {
            let is_counter = |i: &usize| {
                COUNTERS.contains(&name(*i).as_str())
                    || values(*i).is_some_and(|v| v.windows(2).all(|w| w[1] - w[0] == 1.0))
            };
            let change = Change::Counter(rate_hz);
            let lines = Time { column: None, date: None, heading: "line".into(), change };
            return Some(all.clone().find(is_counter).map_or(lines, |column| Time { change, ..as_is(column) }));
        }
        let even = |i: &usize| values(*i).is_some_and(|v| is_even(&v));
        let column = all.clone().filter(is_time).find(even).or_else(|| all.clone().find(is_time));
        let column = column.or_else(|| all.clone().find(|i| even(i) && !COUNTERS.contains(&name(*i).as_str())))?;
        let values = values(column)?;
        let unit = match options.time_unit_s {
            Some(unit_s) => UNITS.iter().find(|(_, s)| *s == unit_s)?.0,
            None => likeliest(&values, options.period_s)?,
        };
        let change = if unit == "d" { Change::Days(*values.first()?) } else { Change::Unit(unit) };
        Some(Time { change, ..as_is(column) })
    }

    fn without_time(&self) -> CsvFault {
        let called = |names: &[&str]| self.headings.iter().find(|h| names.contains(&h.to_lowercase().as_str()));
        let times = called(&TIMES);
        let named = match (times, called(&COUNTERS)) {
            (Some(name), _) => {
                format!(" in a unit that can be guessed: give the unit of '{name}' with option `time-unit`")
            }
            (None, Some(name)) => format!(": '{name}' counts samples; give their rate with option `rate`"),
            (None, None) => {
                String::from("; if there is one sample after the other, give their rate with option `rate`")
            }
        };
        let problem = CsvProblem::NoTimes { named, counted: times.is_none(), columns: self.headings.join(", ") };
        (self.header_at.map(|at| at + 1), Box::new(problem))
    }

    fn numbers(&self, column: usize) -> Option<Vec<f64>> {
        self.rows.iter().map(|row| number(row.get(column)?)).collect()
    }

    fn repairs(&self, first_row: Option<usize>) -> Vec<Repair> {
        let mut repairs = Vec::new();
        let named = [(' ', "blanks"), (';', "semicolons"), ('\t', "tabs")];
        if let Some((_, name)) = named.iter().find(|(separator, _)| *separator == self.separator) {
            repairs.push(Repair::new("separator", 1, None, format!("columns are separated by {name}")));
        }
        match self.header_at {
            None => repairs.push(Repair::guess(
                "headings",
                "no line names the columns: they are numbered (name them with option `map`)".into(),
            )),
            Some(at) if first_row.is_some_and(|row| row < at) => {
                let text = format!("the headings stand in line {}; the lines above are kept as a note", at + 1);
                repairs.push(Repair::new("preamble", at, Some(at + 1), text));
            }
            _ => {}
        }
        let words: Vec<&str> =
            self.words.iter().map(|&i| self.headings[i].as_str()).filter(|h| !h.is_empty()).collect();
        if !words.is_empty() {
            let text = format!("left out, because they hold words or nothing: {}", words.join(", "));
            repairs.push(Repair::new("words", words.len(), None, text));
        }
        repairs
    }

    /// The table anew, line by line: what stands above the headings becomes comments.
    fn written(&self, lines: &[&str], time: &Time) -> String {
        let mut out = String::new();
        let row = |cells: &[Cow<str>], first: Option<String>| {
            let own = || time.column.and_then(|i| cells.get(i)).map_or(String::new(), |c| c.to_string());
            let first = first.unwrap_or_else(|| match time.date.and_then(|i| cells.get(i)) {
                Some(date) => format!("{date} {}", own()),
                None => own(),
            });
            let rest = cells
                .iter()
                .enumerate()
                .filter(|(i, _)| Some(*i) != time.column && Some(*i) != time.date && !self.words.contains(i))
                .map(|(_, c)| c.replace(['\t', '"'], " "));
            std::iter::once(first).chain(rest).collect::<Vec<_>>().join("\t")
        };
        let headings: Vec<Cow<str>> = self.headings.iter().map(|h| Cow::Borrowed(h.as_str())).collect();
        let headed = row(&headings, Some(time.written_heading()));
        if self.header_at.is_none() {
            out += &headed;
            out.push('\n');
        }
        // What is written anew has the decimal mark of the rest.
        let commas = self
            .rows
            .iter()
            .flatten()
            .any(|c| number(c).is_some() && c.rfind([',', '.']).is_some_and(|at| &c[at..=at] == ","));
        let mut samples = 0;
        for (at, line) in lines.iter().enumerate() {
            if Some(at) == self.header_at {
                out += &headed;
            } else if at < self.first {
                let keep = if is_row(line) { "# " } else { "" };
                if !self.units.contains(&at) {
                    out += keep;
                    out += line;
                }
            } else if !is_row(line) {
                out += line;
            } else {
                let cells = cells(line, self.separator);
                let own = time.column.map_or(Some(samples.to_string()), |i| cells.get(i).map(|c| c.to_string()));
                samples += 1;
                let changed = own.and_then(|cell| time.changed(&cell));
                out += &row(&cells, if commas { changed.map(|t| t.replace('.', ",")) } else { changed });
            }
            out.push('\n');
        }
        out
    }
}

impl Time {
    fn written_heading(&self) -> String {
        let name = header_unit(&self.heading).map_or(self.heading.clone(), |(name, _)| name);
        let unit = match self.change {
            Change::None => return self.heading.clone(),
            Change::Unit(unit) => unit,
            Change::Days(_) | Change::Counter(_) => "s",
        };
        // A name that the parser takes for a time.
        let name = if TIMES[..7].contains(&name.to_lowercase().as_str()) { name } else { "time".into() };
        format!("{name} ({unit})")
    }

    /// The time in seconds of a cell in days, or of a counted sample.
    fn changed(&self, cell: &str) -> Option<String> {
        let value = number(cell)?;
        match self.change {
            Change::Days(first) => Some(format!("{:.7}", (value - first) * 86_400.0)),
            Change::Counter(rate_hz) => Some(format!("{}", value / rate_hz)),
            Change::None | Change::Unit(_) => None,
        }
    }

    fn repairs(&self, table: &Table) -> Vec<Repair> {
        let named = format!("'{}'", self.heading);
        let mut repairs = Vec::new();
        let stated = table.header_at.is_some() && heading_unit(&self.heading).is_some();
        match self.change {
            Change::None => {}
            Change::Unit(unit) => {
                repairs.push(Repair::guess("time-unit", format!("the times are in {named}, in {unit}")))
            }
            Change::Days(_) => {
                let text = format!("the times are in {named}, in days; time 0 is the first");
                repairs.push(Repair { guessed: !stated, ..Repair::new("time-unit", 1, None, text) });
            }
            Change::Counter(hz) if self.column.is_none() => {
                let text = format!("each line is a sample, {hz} a second");
                repairs.push(Repair::new("time-counter", 1, None, text));
            }
            Change::Counter(hz) => {
                let text = format!("{named} counts samples, {hz} a second");
                repairs.push(Repair::new("time-counter", 1, None, text));
            }
        }
        if let Some(date) = self.date {
            let text = format!("the times are in {named}, their dates in '{}'", table.headings[date]);
            repairs.push(Repair::new("time-column", 1, None, text));
        } else if self.column.is_some_and(|column| column > 0) && repairs.is_empty() {
            repairs.push(Repair::new("time-column", 1, None, format!("the times are in {named}")));
        }
        repairs
    }
}

/// The unit in which times are those of a water-hammer test; none where they are in no unit.
fn likeliest(values: &[f64], period_s: Option<f64>) -> Option<&'static str> {
    let (first, last) = (*values.first()?, *values.last()?);
    let step = (last - first) / (values.len() - 1) as f64;
    let fits = |unit_s: f64| {
        let (rate_hz, lasts_s) = (1.0 / (step * unit_s), (last - first) * unit_s);
        let usual = (RATES_HZ[0]..=RATES_HZ[1]).contains(&rate_hz) && lasts_s <= LASTS_S;
        usual && period_s.is_none_or(|p| rate_hz * p > LEAST_A_PERIOD)
    };
    UNITS.iter().find(|(_, unit_s)| fits(*unit_s)).map(|(name, _)| *name)
}

fn is_even(values: &[f64]) -> bool {
    let mut steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.len() < 2 || steps.iter().any(|s| *s < 0.0) {
        return false;
    }
    let middle = steps.len() / 2;
    let median = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let even = steps.iter().filter(|s| (**s - median).abs() <= EVEN * median).count();
    median > 0.0 && 20 * even >= 19 * steps.len()
}

fn cells(line: &str, separator: char) -> Vec<Cow<'_, str>> {
    if separator == ' ' {
        return line.split_whitespace().map(Cow::Borrowed).collect();
    }
    let mut row = Row::default();
    row.read(line, separator);
    row.into_cells()
}

/// The columns that hold more words than numbers.
fn worded<'c>(rows: impl Iterator<Item = Vec<Cow<'c, str>>>) -> Vec<usize> {
    let mut counts: Vec<(usize, usize)> = Vec::new();
    for cells in rows {
        counts.resize(counts.len().max(cells.len()), (0, 0));
        for ((said, counted), cell) in counts.iter_mut().zip(&cells).filter(|(_, c)| !c.is_empty()) {
            *(if is_word(cell) { said } else { counted }) += 1;
        }
    }
    (0..counts.len()).filter(|&i| counts[i].1 <= counts[i].0).collect()
}

/// A text without brackets around it.
fn bare(text: &str) -> &str {
    text.trim_matches(|c| matches!(c, '(' | ')' | '[' | ']')).trim()
}

/// A unit of what loggers record, also that of a transducer without its line.
fn is_known_unit(text: &str) -> bool {
    is_electric(text) || time_unit(text).is_some() || is_unit("", text)
}

/// Names with the units that stand in another line.
fn with_units(names: Option<Vec<String>>, units: Option<Vec<String>>) -> Option<Vec<String>> {
    let with_unit = |(name, unit): (&String, &String)| match bare(unit) {
        "" | "-" => name.clone(),
        unit => format!("{name} ({unit})"),
    };
    Some(names?.iter().zip(&units?).map(with_unit).collect())
}

/// `Time`, `(s)` is one heading where blanks separate the columns.
fn joined_units(cells: Vec<Cow<'_, str>>) -> Vec<String> {
    let mut joined: Vec<String> = Vec::new();
    for cell in cells {
        match joined.last_mut() {
            Some(last) if cell.starts_with(['(', '[']) && !last.is_empty() && !last.ends_with([')', ']']) => {
                last.push(' ');
                last.push_str(&cell);
            }
            _ => joined.push(cell.into_owned()),
        }
    }
    joined
}

/// Numbers and date-times, at least one number, and more of them than words, as in a column of remarks.
fn is_numbers(cells: &[Cow<str>]) -> bool {
    let words = cells.iter().filter(|c| is_word(c)).count();
    let filled = cells.iter().filter(|c| !c.is_empty()).count();
    cells.iter().any(|c| is_number(c)) && 2 * words < filled
}

/// Neither empty, nor a number, nor a date-time.
fn is_word(cell: &str) -> bool {
    !cell.is_empty() && !is_number(cell) && !stamped(cell)
}

fn is_number(cell: &str) -> bool {
    number(cell).is_some()
}

/// The number of a cell, as the parser will read it.
fn number(cell: &str) -> Option<f64> {
    Numbers::new(',', false).read(cell, "").ok().filter(|v| !v.is_nan())
}

fn stamped(cell: &str) -> bool {
    stamp_of(cell).is_some()
}

/// A date, a time of day or both, whichever of day and month stands first.
fn stamp_of(cell: &str) -> Option<Stamp> {
    let begins = cell.starts_with(|c: char| c.is_ascii_digit());
    let read = |order| Stamp::parse(cell, order).filter(|_| begins);
    read(Order::DayFirst).or_else(|| read(Order::MonthFirst))
}
