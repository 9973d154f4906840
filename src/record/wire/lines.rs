//! The `lines` wire protocol: text lines `t_us,v0,v1,…` to rows of values, without any I/O. The time may be in another
//! unit, and then be a decimal number; it is good to a microsecond.
//!
//! Lines carry neither a check sum nor a number. How many values a line has is what the first two of one width agree
//! on; until then they are held back. One that does not parse, or has another width, is counted and kept out; a missing
//! one shows in the times only. A time that jumps is believed when the next line confirms it. A line from the past is
//! dropped: it came again, or else it is lost.

use std::collections::VecDeque;

use crate::record::wire::pieces::Pieces;
use crate::rig::TimeUnit;

/// Longest line taken, bytes.
pub const MAX_LINE: usize = 4096;
/// So many lines in a row from the past, in order among themselves, are a device that restarted.
const RESTART_LINES: usize = 3;
/// So many lines of one number of values say how many there are.
const AGREEING: usize = 2;
/// No more lines are held back until so many agree.
const MOST_HELD: usize = 16;
/// So many of the last lines are remembered, to know them when they come again.
const RECENT: usize = 64;
/// Steps between lines that are remembered: one half longer than the longest of them is a jump.
const STEPS: usize = 16;
/// Steps needed before a jump differs from the device's own rhythm.
const ENOUGH_STEPS: usize = 3;
/// No step across the wrap of a counter is longer than this part of its reach: beyond, it is rather a time that was
/// damaged before a rhythm was known.
const MOST_WRAPPED: u64 = 16;
/// Device times beyond this, µs, would not fit the recording's i64 nanoseconds.
const MAX_DEVICE_US: u64 = (i64::MAX / 2000) as u64;

/// One line.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Device time, µs.
    pub time_us: u64,
    /// The values printed; `None` for one that is no finite number, such as `nan`.
    pub values: Vec<Option<f64>>,
    /// Whether lines are known to be missing before it: bad ones, or a jump of the time.
    pub hole_before: bool,
    /// When its first byte arrived, ns on the clock of [`Decoder::feed`].
    pub began_ns: i64,
}

/// What the decoder hands on.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A line later than the one before it.
    Line(Line),
    /// The device started again: its clock began anew with the next line.
    Restarted,
    /// Lines are missing between two of the first ones, as those after them show; device times, µs.
    Hole {
        /// Of the last line before.
        from_us: u64,
        /// Of the first line after.
        to_us: u64,
    },
}

/// What the decoder has seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LineCounts {
    /// Lines taken.
    pub lines: u64,
    /// Lines that did not parse, were too long, had another number of values, an unconfirmed time, or one from the past
    /// for other values.
    pub bad: u64,
    /// Lines that came again, dropped.
    pub stale: u64,
}

/// Incremental decoder: takes bytes in any split, finds the lines.
#[derive(Debug, Default)]
pub struct Decoder {
    unit: TimeUnit,
    /// The stream is heard from its first byte on: its first line is whole.
    from_the_beginning: bool,
    pieces: Pieces<b'\n', MAX_LINE>,
    width: Option<usize>,
    /// The first lines, until enough of them agree.
    held: Vec<Line>,
    last_us: Option<u64>,
    /// From line to line, µs.
    steps: VecDeque<(u64, u64)>,
    /// Jumps of about one length that came one after the other.
    jumps: Vec<(u64, u64)>,
    /// What a counter of 32 bits has lost by wrapping, µs.
    wrapped_us: u64,
    /// It wraps once more with the first line that is taken at this time or later, µs.
    wrapping_us: Option<u64>,
    /// Bad lines came since the last that parsed.
    hole: bool,
    /// Bad lines came before the stale ones, since the last line taken.
    hole_before_stale: bool,
    /// A line whose time jumps, until the next one confirms it.
    doubtful: Option<Line>,
    /// Lines from the past, in order among themselves: a device that restarted, or nothing of worth.
    stale: Vec<Line>,
    recent: VecDeque<Line>,
    counts: LineCounts,
    /// The first and the last line that is bad for the decimals of its time alone: that time, and its arrival, ns.
    decimal: Option<[(f64, i64); 2]>,
}

impl Decoder {
    /// A decoder at the start of a stream of times in µs.
    pub fn new() -> Decoder {
        Decoder::default()
    }

    /// A decoder at the start of a stream of times in a unit.
    pub fn of(unit: TimeUnit) -> Decoder {
        Decoder { unit, ..Decoder::default() }
    }

    /// What was seen so far.
    pub fn counts(&self) -> LineCounts {
        self.counts
    }

    /// Where lines came that are bad for the decimals of their times alone: the unit that these are likely in, by their
    /// pace, if it is one of ours.
    pub fn decimal_times(&self) -> Option<Option<TimeUnit>> {
        let [first, last] = self.decimal?;
        let unit_s = (last.1 - first.1) as f64 / 1e9 / (last.0 - first.0);
        Some(TimeUnit::ALL.into_iter().find(|unit| (unit_s / unit.seconds()).log10().abs() < 0.5))
    }

    /// Takes the next bytes of the stream, which arrived at `at_ns` on any clock, and appends what they complete to
    /// `events`.
    pub fn feed(&mut self, at_ns: i64, mut bytes: &[u8], events: &mut Vec<Event>) {
        while let Some(piece) = self.pieces.next(at_ns, &mut bytes) {
            let began_ns = piece.began_ns;
            match piece.bytes {
                Some(text) if is_comment(text) => {}
                Some(text) => match parse(text, self.unit) {
                    // A first line could be the rest of one and parse all the same.
                    Some(_) if piece.maybe_rest && !self.from_the_beginning => {}
                    Some((time_us, values)) => self.line(time_us, values, began_ns, events),
                    // The rest of one, or a heading.
                    None if piece.maybe_rest => {}
                    None => {
                        let as_decimal = parse(text, TimeUnit::Seconds).filter(|_| self.unit == TimeUnit::Microseconds);
                        if let Some((time_us, _)) = as_decimal {
                            let at = (TimeUnit::Microseconds.seconds() * time_us as f64, began_ns);
                            self.decimal = Some([self.decimal.map_or(at, |[first, _]| first), at]);
                        }
                        self.bad();
                    }
                },
                None => self.bad(),
            }
        }
    }

    /// The stream was cut off: a line cut with it is a bad one, and what comes next may begin within a line.
    pub fn cut(&mut self) {
        if self.pieces.cut() {
            self.bad();
        }
        // what is missing then shows in the times, but for a rhythm that is not known yet
        self.hole |= self.steps.len() < ENOUGH_STEPS;
    }

    /// Another stream begins, which we hear from its first byte on: its clock begins anew. How many values a line has
    /// stays.
    pub fn begin_anew(&mut self) {
        self.drop_stale();
        self.counts.bad += (self.held.len() + usize::from(self.doubtful.is_some())) as u64;
        let Decoder { unit, width, counts, .. } = *self;
        *self = Decoder { unit, width, counts, from_the_beginning: true, ..Decoder::default() };
    }

    /// How many lines are held back.
    pub fn held(&self) -> usize {
        self.held.len()
    }

    /// No more will come: appends what was held back where nothing speaks against it; the rest is lost.
    pub fn finish(&mut self, events: &mut Vec<Event>) {
        let held = std::mem::take(&mut self.held);
        let width = |line: &Line| line.values.len();
        match held.first().map(width).filter(|first| held.iter().all(|line| width(line) == *first)) {
            Some(_) => held.into_iter().for_each(|line| self.place(line, events)),
            None => held.iter().for_each(|_| self.bad()),
        }
        if self.doubtful.take().is_some() {
            self.bad();
        }
        self.drop_stale();
    }

    fn bad(&mut self) {
        self.counts.bad += 1;
        self.hole = true;
    }

    fn line(&mut self, time_us: u64, values: Vec<Option<f64>>, began_ns: i64, events: &mut Vec<Event>) {
        let line = Line { time_us, values, hole_before: std::mem::take(&mut self.hole), began_ns };
        if self.width.is_some() {
            self.of_width(line, events);
            return;
        }
        let width = line.values.len();
        self.held.push(line);
        if self.held.iter().filter(|held| held.values.len() == width).count() == AGREEING {
            self.width = Some(width);
            std::mem::take(&mut self.held).into_iter().for_each(|line| self.of_width(line, events));
        } else if self.held.len() > MOST_HELD {
            self.held.remove(0);
            self.counts.bad += 1;
            self.held[0].hole_before = true;
        }
    }

    /// A time that goes on where a counter of 32 bits wraps: from the last line, or from one behind a jump, which may
    /// stand on either side. Few lines are lost there: after more it is rather a device that restarted.
    fn unwrapped(&mut self, time_us: u64) -> u64 {
        let time_us = time_us + self.wrapped_us;
        let wrap_us = wrap_us(self.unit);
        let next_us = time_us + wrap_us;
        let most_us = (wrap_us / MOST_WRAPPED).min(STEPS as u64 * self.longest_us());
        let last_us = self.doubtful.as_ref().map(|line| line.time_us).or(self.last_us);
        let goes_on = |last_us| time_us < last_us && (last_us + 1..=last_us + most_us).contains(&next_us);
        if self.steps.len() < ENOUGH_STEPS || !last_us.is_some_and(goes_on) {
            self.wrapping_us = None;
            return time_us;
        }
        self.wrapping_us.get_or_insert(next_us);
        next_us
    }

    fn of_width(&mut self, mut line: Line, events: &mut Vec<Event>) {
        if self.width != Some(line.values.len()) {
            self.bad();
            return;
        }
        line.time_us = self.unwrapped(line.time_us);
        line.hole_before |= std::mem::take(&mut self.hole);
        self.place(line, events);
    }

    /// Puts a line in its place behind the last one, or keeps it aside as one from the past or with a doubtful time.
    fn place(&mut self, mut line: Line, events: &mut Vec<Event>) {
        if let Some(doubtful) = self.doubtful.take() {
            // The line after a jump goes on either from the jump or from before it.
            if line.time_us > doubtful.time_us && self.goes_on(&doubtful, &line) {
                self.learn(doubtful.time_us, line.time_us);
                self.take(Line { hole_before: true, ..doubtful }, events);
            } else {
                self.counts.bad += 1;
                line.hole_before = true;
            }
        }
        match self.last_us {
            Some(last_us) if line.time_us <= last_us => self.stale(line, events),
            Some(last_us) if self.jumps(last_us, line.time_us) => self.doubtful = Some(line),
            _ => self.take(line, events),
        }
    }

    /// True for a step well beyond those before it.
    fn jumps(&self, from_us: u64, to_us: u64) -> bool {
        let longest = self.longest_us();
        self.steps.len() >= ENOUGH_STEPS && to_us - from_us > longest + longest / 2
    }

    fn longest_us(&self) -> u64 {
        self.steps.iter().map(length).max().unwrap_or_default()
    }

    /// True for a step no longer than the jump, or the device's rhythm: it may have slowed down for good.
    fn goes_on(&self, jumped: &Line, next: &Line) -> bool {
        let jump_us = self.last_us.map_or(0, |last_us| jumped.time_us - last_us);
        let step_us = next.time_us - jumped.time_us;
        !self.jumps(jumped.time_us, next.time_us) || step_us <= jump_us + jump_us / 2
    }

    /// One jump after the other are holes at first, then the device's new rhythm.
    fn learn(&mut self, from_us: u64, to_us: u64) {
        if !self.jumps(from_us, to_us) {
            self.jumps.clear();
            return;
        }
        self.jumps.push((from_us, to_us));
        if self.jumps.len() == ENOUGH_STEPS {
            self.steps.clear();
            self.steps.extend(self.jumps.drain(..));
        }
    }

    fn take(&mut self, mut line: Line, events: &mut Vec<Event>) {
        self.drop_stale();
        line.hole_before |= std::mem::take(&mut self.hole_before_stale);
        if let Some(last_us) = self.last_us
            && !line.hole_before
        {
            if self.steps.len() == STEPS {
                self.steps.pop_front();
                self.steps.push_back((last_us, line.time_us));
            } else {
                self.steps.push_back((last_us, line.time_us));
                self.early_holes(events);
            }
        }
        if self.wrapping_us.is_some_and(|from_us| line.time_us >= from_us) {
            self.wrapped_us += wrap_us(self.unit);
            self.wrapping_us = None;
        }
        self.last_us = Some(line.time_us);
        self.recent.push_back(line.clone());
        if self.recent.len() > RECENT {
            self.recent.pop_front();
        }
        self.counts.lines += 1;
        events.push(Event::Line(line));
    }

    /// Of the first steps those are holes that are far longer than the others, where these agree and are more by
    /// enough.
    fn early_holes(&mut self, events: &mut Vec<Event>) {
        let shortest = self.steps.iter().map(length).min().unwrap_or_default();
        let agrees = |step: &(u64, u64)| length(step) <= shortest + shortest / 4;
        let (regular, others): (VecDeque<_>, VecDeque<_>) = self.steps.iter().copied().partition(agrees);
        let longest = regular.iter().map(length).max().unwrap_or_default();
        let are_holes = others.iter().all(|step| length(step) > longest + longest / 2);
        if are_holes && regular.len() >= others.len() + ENOUGH_STEPS {
            events.extend(others.into_iter().map(|(from_us, to_us)| Event::Hole { from_us, to_us }));
            self.steps = regular;
        }
    }

    fn stale(&mut self, line: Line, events: &mut Vec<Event>) {
        self.hole_before_stale |= line.hole_before;
        if self.stale.last().is_none_or(|last| last.time_us >= line.time_us) {
            self.drop_stale();
        }
        self.stale.push(line);
        if self.stale.len() == RESTART_LINES {
            events.push(Event::Restarted);
            self.last_us = None;
            self.hole_before_stale = false;
            self.steps.clear();
            self.recent.clear();
            for line in std::mem::take(&mut self.stale) {
                self.take(line, events);
            }
        }
    }

    /// The lines from the past were no restart: they came again, or else they are lost, as where two have one time.
    fn drop_stale(&mut self) {
        for line in std::mem::take(&mut self.stale) {
            let again = self.recent.iter().any(|taken| taken.time_us == line.time_us && taken.values == line.values);
            self.counts.stale += u64::from(again);
            self.counts.bad += u64::from(!again);
            self.hole_before_stale |= !again;
        }
    }
}

fn length((from_us, to_us): &(u64, u64)) -> u64 {
    to_us - from_us
}

/// A comment or an empty line says nothing.
fn is_comment(line: &[u8]) -> bool {
    let text = line.trim_ascii();
    text.is_empty() || text.starts_with(b"#")
}

/// Where a counter of 32 bits, as a microcontroller's, begins again, µs: every 71.6 min, or every 49.7 days of
/// milliseconds. What counts seconds or nanoseconds has more bits.
fn wrap_us(unit: TimeUnit) -> u64 {
    match unit {
        TimeUnit::Microseconds => 1 << 32,
        TimeUnit::Milliseconds => 1000 << 32,
        TimeUnit::Seconds | TimeUnit::Nanoseconds => 1 << 62,
    }
}

/// Device time, µs.
fn time_us(cell: &str, unit: TimeUnit) -> Option<u64> {
    if unit == TimeUnit::Microseconds {
        return cell.parse().ok();
    }
    let is_decimal = !cell.is_empty() && cell.bytes().all(|b| b.is_ascii_digit() || b == b'.');
    let time: f64 = cell.parse().ok().filter(|_| is_decimal)?;
    Some((time * unit.seconds() / TimeUnit::Microseconds.seconds()).round() as u64)
}

fn parse(line: &[u8], unit: TimeUnit) -> Option<(u64, Vec<Option<f64>>)> {
    let text = std::str::from_utf8(line).ok()?;
    let mut cells = text.split(',').map(str::trim);
    let time_us = time_us(cells.next()?, unit).filter(|time| *time <= MAX_DEVICE_US)?;
    // Words such as inf and nan parse: one sensor has no value then, and the others have theirs.
    let number = |cell: &str| cell.parse().ok().map(|value: f64| Some(value).filter(|value| value.is_finite()));
    let values: Vec<Option<f64>> = cells.map(number).collect::<Option<_>>()?;
    (!values.is_empty()).then_some((time_us, values))
}

#[cfg(test)]
mod tests;
