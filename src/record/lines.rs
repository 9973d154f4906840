//! The `lines` wire protocol: text lines `t_us,v0,v1,…` to rows of values, without any I/O.
//!
//! Lines carry neither a check sum nor a number. How many values a line has is what the first two of one width agree on; until then
//! they are held back. One that does not parse, or has another width, is counted and kept out; a missing one shows in the times only. A
//! time that jumps is believed when the next line confirms it. A line from the past is dropped: it came again, or else it is lost.

use std::collections::VecDeque;

use super::pieces::Pieces;

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
/// Steps needed before a jump can be told from the device's own rhythm.
const ENOUGH_STEPS: usize = 3;
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
}

/// What the decoder has seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LineCounts {
    /// Lines taken.
    pub lines: u64,
    /// Lines that did not parse, were too long, had another number of values, an unconfirmed time, or one from the past for other values.
    pub bad: u64,
    /// Lines that came again, dropped.
    pub stale: u64,
}

/// Incremental decoder: takes bytes in any split, finds the lines.
#[derive(Debug, Default)]
pub struct Decoder {
    pieces: Pieces<b'\n', MAX_LINE>,
    width: Option<usize>,
    /// The first lines, until enough of them agree.
    held: Vec<Line>,
    last_us: Option<u64>,
    steps: VecDeque<u64>,
    /// Jumps of about one length that came one after the other.
    jumps: Vec<u64>,
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
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new() -> Decoder {
        Decoder::default()
    }

    /// What was seen so far.
    pub fn counts(&self) -> LineCounts {
        self.counts
    }

    /// Takes the next bytes of the stream, which arrived at `at_ns` on any clock, and appends what they complete to `events`.
    pub fn feed(&mut self, at_ns: i64, mut bytes: &[u8], events: &mut Vec<Event>) {
        while let Some(piece) = self.pieces.next(at_ns, &mut bytes) {
            let began_ns = piece.began_ns;
            match piece.bytes {
                // A first line could be the rest of one and parse all the same: it is never taken.
                Some(text) if piece.maybe_rest || is_comment(text) => {}
                Some(text) => match parse(text) {
                    Some((time_us, values)) => self.line(time_us, values, began_ns, events),
                    None => self.bad(),
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

    fn of_width(&mut self, mut line: Line, events: &mut Vec<Event>) {
        if self.width != Some(line.values.len()) {
            self.bad();
            return;
        }
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
        let longest = self.steps.iter().max().copied().unwrap_or_default();
        self.steps.len() >= ENOUGH_STEPS && to_us - from_us > longest + longest / 2
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
        self.jumps.push(to_us - from_us);
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
            }
            self.steps.push_back(line.time_us - last_us);
        }
        self.last_us = Some(line.time_us);
        self.recent.push_back(line.clone());
        if self.recent.len() > RECENT {
            self.recent.pop_front();
        }
        self.counts.lines += 1;
        events.push(Event::Line(line));
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

/// A comment or an empty line says nothing.
fn is_comment(line: &[u8]) -> bool {
    let text = line.trim_ascii();
    text.is_empty() || text.starts_with(b"#")
}

fn parse(line: &[u8]) -> Option<(u64, Vec<Option<f64>>)> {
    let text = std::str::from_utf8(line).ok()?;
    let mut cells = text.split(',').map(str::trim);
    let time_us = cells.next()?.parse().ok().filter(|time| *time <= MAX_DEVICE_US)?;
    // Words such as inf and nan parse: one sensor has no value then, and the others have theirs.
    let number = |cell: &str| cell.parse().ok().map(|value: f64| Some(value).filter(|value| value.is_finite()));
    let values: Vec<Option<f64>> = cells.map(number).collect::<Option<_>>()?;
    (!values.is_empty()).then_some((time_us, values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn decode(decoder: &mut Decoder, text: &str) -> Vec<Event> {
        let mut events = Vec::new();
        decoder.feed(0, text.as_bytes(), &mut events);
        decoder.finish(&mut events);
        events
    }

    fn times(events: &[Event]) -> Vec<(u64, bool)> {
        let of = |event: &Event| match event {
            Event::Line(line) => (line.time_us, line.hole_before),
            Event::Restarted => (u64::MAX, false),
        };
        events.iter().map(of).collect()
    }

    #[test]
    fn lines_comments_and_bad_lines() {
        let mut decoder = Decoder::new();
        let text = "34,0.5\n# a comment\n\n1000,1.5,-2e3\r\n 2000 , 3 , 4 \n3000,x,1\n4000,1\n6000,7,8\n-1,2,3\n";
        let events = decode(&mut decoder, text);
        let line = |time_us, values: &[f64], hole_before| {
            Event::Line(Line { time_us, values: values.iter().copied().map(Some).collect(), hole_before, began_ns: 0 })
        };
        assert_eq!(
            events,
            [line(1000, &[1.5, -2000.0], false), line(2000, &[3.0, 4.0], false), line(6000, &[7.0, 8.0], true)]
        );
        assert_eq!(decoder.counts(), LineCounts { lines: 3, bad: 3, stale: 0 });
    }

    #[test]
    fn a_cell_without_a_finite_number_costs_its_own_value_only() {
        let mut decoder = Decoder::new();
        let events = decode(&mut decoder, "\n1000,nan,2\n2000,1,-inf\n3000,,2\n4000,1,2\n");
        let values = |event: &Event| if let Event::Line(line) = event { line.values.clone() } else { vec![] };
        let values: Vec<_> = events.iter().map(values).collect();
        assert_eq!(values, [[None, Some(2.0)], [Some(1.0), None], [Some(1.0), Some(2.0)]]);
        assert_eq!(decoder.counts(), LineCounts { lines: 3, bad: 1, stale: 0 }, "an empty cell does not parse");
    }

    #[test]
    fn a_jump_that_the_next_line_confirms_is_a_hole_and_another_is_a_bad_line() {
        let mut decoder = Decoder::new();
        let text = "x\n0,1\n10,1\n20,1\n30,1\n40,1\n90,1\n100,1\n9110,6\n120,1\n130,1\n";
        let events = decode(&mut decoder, text);
        assert_eq!(times(&events[5..]), [(90, true), (100, false), (120, true), (130, false)]);
        assert_eq!(decoder.counts().bad, 1);
    }

    #[test]
    fn a_device_that_slows_down_goes_on() {
        let mut decoder = Decoder::new();
        let events = decode(&mut decoder, "\n0,1\n10,1\n20,1\n30,1\n40,1\n60,1\n80,1\n100,1\n120,1\n");
        assert_eq!(times(&events[4..]), [(40, false), (60, true), (80, true), (100, true), (120, false)]);
        assert_eq!(decoder.counts().bad, 0);
    }

    #[test]
    fn a_bad_line_behind_a_jump_or_in_a_restart_is_a_hole_where_it_was() {
        let mut decoder = Decoder::new();
        let events = decode(&mut decoder, "\n0,1\n10,1\n20,1\n30,1\n70,1\nbad\n90,1\n100,1\n");
        assert_eq!(times(&events[4..]), [(70, true), (90, true), (100, false)]);
        let events = decode(&mut decoder, "bad\n0,1\n10,1\nbad\n20,1\n30,1\n");
        assert_eq!(times(&events[1..]), [(0, true), (10, false), (20, true), (30, false)]);
        let events = decode(&mut decoder, "bad\n25,1\n40,1\n50,1\n");
        assert_eq!(times(&events), [(40, true), (50, false)]);
    }

    #[test]
    fn a_restart_loses_no_line_and_a_late_line_is_lost() {
        let mut decoder = Decoder::new();
        let events = decode(&mut decoder, "\n500,1\n510,1\n505,1\n520,1\n0,1\n10,1\n20,1\n30,1\n");
        let restart = (u64::MAX, false);
        let expected =
            [(500, false), (510, false), (520, true), restart, (0, false), (10, false), (20, false), (30, false)];
        assert_eq!(times(&events), expected);
        assert_eq!(decoder.counts(), LineCounts { lines: 7, bad: 1, stale: 0 });
    }

    /// A logger whose clock is too coarse: what cannot be placed is lost, and not taken for a line that came again.
    #[test]
    fn lines_with_one_time_and_other_values_are_lost() {
        let mut decoder = Decoder::new();
        let events = decode(&mut decoder, "\n0,1\n0,2\n1000,3\n1000,4\n2000,5\n2000,5\n3000,6\n");
        assert_eq!(times(&events), [(0, false), (1000, true), (2000, true), (3000, false)]);
        assert_eq!(decoder.counts(), LineCounts { lines: 4, bad: 2, stale: 1 });
    }

    #[test]
    fn the_first_lines_of_a_restart_at_the_end_are_lost() {
        for (end, bad, stale) in [("0,1\n10,1\n", 2, 0), ("510,2\n520,3\n", 0, 2), ("9520,9\n", 1, 0)] {
            let mut decoder = Decoder::new();
            let events = decode(&mut decoder, &["\n490,0\n500,1\n510,2\n520,3\n", end].concat());
            assert_eq!(times(&events), [(490, false), (500, false), (510, false), (520, false)]);
            assert_eq!(decoder.counts(), LineCounts { lines: 4, bad, stale }, "{end:?}");
        }
    }

    /// No line is evidence of its own width: a first one that is damaged must not make all others bad.
    #[test]
    fn a_damaged_first_line_costs_itself_only() {
        for damaged in ["10,5", "10,5,6,7", "10,5\n11,1,2,3,4"] {
            let mut decoder = Decoder::new();
            let events = decode(&mut decoder, &format!("\n{damaged}\n20,1,2\n30,3,4\n40,5,6\n50,7,8\n"));
            assert_eq!(times(&events), [(20, true), (30, false), (40, false), (50, false)]);
            assert_eq!(decoder.counts().bad, damaged.lines().count() as u64);
        }
        let mut decoder = Decoder::new();
        assert_eq!(
            times(&decode(&mut decoder, "\n10,5,1\n20,1,2\n")),
            [(10, false), (20, false)],
            "few, but all alike"
        );
        let mut decoder = Decoder::new();
        assert_eq!(decode(&mut decoder, "\n10,5\n20,1,2\n"), [], "nobody knows which");
        assert_eq!(decoder.counts().bad, 2);
    }

    proptest! {
        #[test]
        fn any_bytes_in_any_split_are_survived(bytes in prop::collection::vec(prop_oneof![
            Just(b'\n'), Just(b','), Just(b'1'), Just(b'-'), any::<u8>()], 0..600), size in 1usize..50) {
            let (mut whole, mut split) = (Decoder::new(), Decoder::new());
            let (mut expected, mut events) = (Vec::new(), Vec::new());
            whole.feed(0, &bytes, &mut expected);
            bytes.chunks(size).for_each(|piece| split.feed(0, piece, &mut events));
            whole.finish(&mut expected);
            split.finish(&mut events);
            prop_assert_eq!(&events, &expected);
            let mut last = 0;
            for event in events {
                match event {
                    Event::Restarted => last = 0,
                    Event::Line(line) => {
                        prop_assert!(line.time_us >= last && line.values.iter().flatten().all(|v| v.is_finite()));
                        last = line.time_us;
                    }
                }
            }
        }
    }
}
