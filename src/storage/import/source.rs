//! A source file: named tracks of numbers with times, the repairs it needed, and what the user says about it.

use std::fmt;
use std::str::FromStr;

use encoding_rs::Encoding;
use serde::Serialize;

use crate::number::duration;
use crate::recording::{Gap, Series};
use crate::rig::spelled_unit;
use crate::storage::layout::to_s;
use crate::units::{Quantity, Unit};

/// What a file of another program holds.
#[derive(Debug, Clone, Default)]
pub struct SourceFile {
    /// Its columns, channels or fields.
    pub tracks: Vec<Track>,
    /// Wall-clock time of its time 0, where it says so.
    pub start: Option<Start>,
    /// What it says of itself: comments, properties.
    pub notes: Vec<(String, String)>,
    /// What was repaired on the way.
    pub repairs: Vec<Repair>,
    /// Tracks that no sensor wants are left out silently (a table's columns are not: one may be misspelt).
    pub spare_tracks: bool,
    /// Names of what it holds besides and is no track: times, counters, words, arrays without times.
    pub others: Vec<String>,
}

impl SourceFile {
    /// What several tables of one run hold, on one clock: that of the earliest where all tell the date, else their own.
    pub(crate) fn joined(files: Vec<SourceFile>, repairs: Vec<Repair>) -> SourceFile {
        let start = files.iter().filter_map(|file| file.start).min_by_key(|start| start.unix_ns);
        let mut whole = SourceFile { start, repairs, ..SourceFile::default() };
        let alone = files.len() == 1;
        for file in files {
            let late_s = match (file.start, start) {
                (Some(own), Some(first)) => to_s((own.unix_ns - first.unix_ns) as i64),
                _ => 0.0,
            };
            for mut track in file.tracks {
                track.place = track.place.filter(|_| alone);
                track.series.time_s.iter_mut().for_each(|t| *t += late_s);
                let gaps = track.series.gaps.iter_mut();
                gaps.for_each(|gap| (gap.from_s, gap.to_s) = (gap.from_s + late_s, gap.to_s + late_s));
                whole.tracks.push(track);
            }
            let notes = file.notes.into_iter().filter(|note| !whole.notes.contains(note));
            whole.notes.extend(notes.collect::<Vec<_>>());
            whole.others.extend(file.others);
            whole.spare_tracks |= file.spare_tracks;
            let news = file.repairs.into_iter().filter(|repair| !whole.repairs.contains(repair));
            whole.repairs.extend(news.collect::<Vec<_>>());
        }
        whole
    }

    /// The files of one run: its sensors, or parts of it, one after the other.
    ///
    /// # Errors
    /// Two files hold one track at the same times.
    pub fn continued(files: Vec<SourceFile>) -> Result<SourceFile, String> {
        let alone = files.len() == 1;
        let repairs = Vec::new();
        let mut whole = SourceFile::joined(files, repairs);
        if alone {
            return Ok(whole);
        }
        let begins_s = |track: &Track| track.series.time_s.first().copied().unwrap_or(f64::INFINITY);
        let mut parts: Vec<(usize, Track)> = std::mem::take(&mut whole.tracks).into_iter().enumerate().collect();
        parts.sort_by(|(_, a), (_, b)| begins_s(a).total_cmp(&begins_s(b)));
        let mut tracks: Vec<(usize, Track)> = Vec::new();
        for (order, part) in parts {
            let Some((place, track)) = tracks.iter_mut().find(|(_, track)| track.name == part.name) else {
                tracks.push((order, part));
                continue;
            };
            // the last row may stand again at the beginning of the next file
            if track.series.time_s.last().is_some_and(|end_s| begins_s(&part) < *end_s) {
                return Err(format!(
                    "it holds '{}' at the same times as another of these files: if these are two runs, name the files of one of them",
                    part.name
                ));
            }
            if track.series.time_s.last() == part.series.time_s.first() {
                track.series.time_s.pop();
                track.series.value.pop();
            }
            *place = order.min(*place);
            track.series.time_s.extend(part.series.time_s);
            track.series.value.extend(part.series.value);
            track.series.gaps.extend(part.series.gaps);
        }
        tracks.sort_by_key(|(order, _)| *order);
        whole.tracks = tracks.into_iter().map(|(_, track)| track).collect();
        Ok(whole)
    }
}

/// A wall-clock time, and how finely it was written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Nanoseconds since 1970 UTC.
    pub unix_ns: u64,
    /// Value of its last digit, s.
    pub digit_s: f64,
}

/// One column, channel or field.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Its full name.
    pub name: String,
    /// A shorter name that it may be known by.
    pub short: String,
    /// Its unit, as written.
    pub unit: Option<String>,
    /// Its samples, in that unit.
    pub series: Series,
    /// Its repairs, reported if it becomes a sensor.
    pub repairs: Vec<Repair>,
    /// The name that it shares with a column before it; its own is numbered.
    pub shares: Option<String>,
    /// Which column of its table it is, from 1, where it is one.
    pub place: Option<usize>,
}

impl Track {
    /// Whether a user who writes `name` means it: by its full name, the short one, or its place, as in `column 3`.
    pub fn is_called(&self, name: &str) -> bool {
        self.name == name || self.short == name || self.place.is_some_and(|place| is_place(name, place))
    }
}

/// Whether a name is that of a column by its place: `column 3`.
pub(crate) fn is_place(name: &str, place: usize) -> bool {
    name.strip_prefix(NAMELESS).and_then(|number| number.parse().ok()) == Some(place)
}

/// How columns are called by their places.
pub(crate) const NAMELESS: &str = "column ";

/// Which of two numbers below 13 is the day.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Unknown,
    DayFirst,
    MonthFirst,
}

/// Something about a file that was put right, or could not be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Repair {
    /// What it was, in one word: `separator`, `duplicate-times`, `unit`, ….
    pub what: &'static str,
    /// How often.
    pub count: usize,
    /// Where first, as a line of the file from 1.
    pub line: Option<usize>,
    /// The sentence for a user.
    pub text: String,
    /// Data was lost by it.
    pub lost: bool,
    /// The file does not say so: it was guessed.
    pub guessed: bool,
}

impl Repair {
    /// Samples that are missing from even grids of times.
    pub(crate) fn missing_times(samples: u64) -> Repair {
        let text = format!("{samples} samples are missing from even grids of times: recorded as gaps");
        Repair::new("missing-times", samples as usize, None, text)
    }

    /// Times that stand on no even grid, and leave gaps of unknown length.
    pub(crate) fn uneven(name: &str, series: &Series) -> Option<Repair> {
        let gaps: Vec<&Gap> = series.gaps.iter().filter(|gap| gap.samples.is_none()).collect();
        let longest = gaps.iter().map(|gap| gap.to_s - gap.from_s).reduce(f64::max)?;
        let text = format!(
            "the times of '{name}' are uneven, as where only what changes is written: {} recorded, the longest of {}",
            counted(gaps.len(), "gap is", "gaps are"),
            duration(longest)
        );
        Some(Repair { lost: true, ..Repair::new("uneven-times", gaps.len(), None, text) })
    }

    pub(crate) fn new(what: &'static str, count: usize, line: Option<usize>, text: impl Into<String>) -> Repair {
        Repair { what, count, line, text: text.into(), lost: false, guessed: false }
    }

    /// Something that the file does not say.
    pub(crate) fn guess(what: &'static str, text: String) -> Repair {
        Repair { guessed: true, ..Repair::new(what, 1, None, text) }
    }
}

/// A count with the words for one, or for several.
pub(crate) fn counted(count: usize, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// Part of a file's times that may come before earlier ones.
const MOST_DISPLACED: f64 = 0.01;

/// True where more stand out of order than can be sorted in: several runs were joined, or a clock was set back.
pub(crate) fn is_no_order(displaced: usize, all: usize) -> bool {
    displaced > 2 && displaced as f64 > MOST_DISPLACED * all as f64
}

/// What the user says about a plain time series.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ImportOptions {
    /// Wall-clock time of time 0, ns since 1970 UTC; 0 if unknown.
    pub start_unix_ns: u64,
    /// Sensors of the rig that were not recorded: they need no column.
    pub without: Vec<String>,
}

/// What a file does not say of itself.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SourceOptions {
    /// Columns, channels or fields and the sensors that they are.
    pub map: Vec<(String, String)>,
    /// Columns that are no sensors; `*` is every one that is not named otherwise.
    pub ignore: Vec<String>,
    /// Zone of date-times without one, seconds east of UTC; UTC if not given.
    pub zone_s: Option<i32>,
    /// Whether 03/04/2026 is the third of April.
    pub day_first: Option<bool>,
    /// Seconds of the unit that times are written in, where their heading does not say.
    pub time_unit_s: Option<f64>,
    /// Which time of an MCAP message counts.
    pub message_time: MessageTime,
    /// Samples per second of a column that counts samples.
    pub rate_hz: Option<f64>,
    /// What a column's numbers stand for: sensor or column, and the line `a x + b`.
    pub scales: Vec<(String, Line)>,
    /// The flow before the closure, measured by hand (a bucket and a clock), in its unit.
    pub flow: Option<(f64, Unit)>,
    /// What its text is encoded in.
    pub encoding: Option<&'static Encoding>,
    /// What the file does not say is guessed.
    pub guess: bool,
    /// Sensors that another file of the record holds: no column is guessed to be one of them.
    pub elsewhere: Vec<String>,
    /// The test's period `4L/a`, s, about: a guess of the unit of time goes by it.
    pub period_s: Option<f64>,
}

impl SourceOptions {
    /// The order of day and month, where it is given.
    pub(crate) fn order(&self) -> Order {
        match self.day_first {
            Some(true) => Order::DayFirst,
            Some(false) => Order::MonthFirst,
            None => Order::Unknown,
        }
    }

    /// Nothing is given that a plain time series does not need.
    pub(crate) fn is_plain(&self) -> bool {
        self.map.is_empty()
            && self.ignore.is_empty()
            && self.scales.is_empty()
            && self.flow.is_none()
            && self.encoding.is_none()
    }
}

/// A straight line `a x + b`: what a logger's numbers stand for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Slope `a`.
    pub scale: f64,
    /// Value `b` at 0.
    pub offset: f64,
    /// Unit of the result; that of the sensor where none is given.
    pub unit: Option<Unit>,
}

impl Line {
    /// Whether it changes no number, but says its unit.
    pub(crate) fn is_unit_alone(&self) -> bool {
        self.scale == 1.0 && self.offset == 0.0
    }
}

impl FromStr for Line {
    type Err = String;

    /// The line of a transducer, with its unit behind it: `250*x-125 kPa`, or by its two ranges, `1..5 -> 0..10 bar`;
    /// or the unit alone, `psi`.
    fn from_str(text: &str) -> Result<Self, String> {
        line_of(text).ok_or_else(|| format!("'{text}': write it like 1..5 -> 0..10 bar, or 2.5*x-2.5 bar, or psi"))
    }
}

fn line_of(text: &str) -> Option<Line> {
    let is_unit = |word: &str| word.starts_with(|c: char| c.is_alphabetic() && c != 'x');
    let known = |unit: &str| {
        let quantities = [Quantity::Pressure, Quantity::Flow, Quantity::Temperature, Quantity::Ratio];
        quantities.into_iter().find_map(|q| spelled_unit(unit, q))
    };
    let text = text.trim();
    if let Some(unit) = known(text) {
        return Some(Line { scale: 1.0, offset: 0.0, unit: Some(unit) });
    }
    let (line, unit) = text.rsplit_once(' ').filter(|(_, word)| is_unit(word)).unwrap_or((text, ""));
    let unit = if unit.is_empty() { None } else { Some(known(unit)?) };
    let line = line.replace(' ', "");
    let (scale, offset) = match line.split_once("->") {
        Some((from, to)) => {
            let ends = |range: &str| {
                let (low, high) = range.split_once("..")?;
                Some((low.parse::<f64>().ok()?, high.parse::<f64>().ok()?))
            };
            let ((low, high), (least, most)) = (ends(from)?, ends(to)?);
            let scale = (most - least) / (high - low);
            (scale, least - scale * low)
        }
        None => {
            let (factor, rest) = line.split_once('x')?;
            let scale = match factor.trim_end_matches('*') {
                "" | "+" => 1.0,
                "-" => -1.0,
                number => number.parse().ok()?,
            };
            (scale, if rest.is_empty() { 0.0 } else { rest.parse().ok()? })
        }
    };
    (f64::is_finite(scale) && f64::is_finite(offset) && scale != 0.0).then_some(Line { scale, offset, unit })
}

impl fmt::Display for Line {
    /// `250*x-125 kPa`, as it is written.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}*x{:+}", self.scale, self.offset)?;
        self.unit.map_or(Ok(()), |unit| write!(f, " {unit}"))
    }
}

/// Which time of an MCAP message counts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum MessageTime {
    /// When it was logged.
    #[default]
    Log,
    /// When it was published.
    Publish,
    /// What this field of it says.
    Field(String),
}
