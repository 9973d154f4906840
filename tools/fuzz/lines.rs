//! The `lines` protocol against a reading of its description that shares no code with the program's.

use surgescope::record::wire::lines::{Decoder, Event, LineCounts, MAX_LINE};

use super::wire;

impl wire::Decoder for Decoder {
    type Event = Event;
    type Counts = LineCounts;
    fn feed(&mut self, at_ns: i64, bytes: &[u8], events: &mut Vec<Event>) {
        Decoder::feed(self, at_ns, bytes, events);
    }
    fn cut(&mut self) {
        Decoder::cut(self);
    }
    fn finish(&mut self, events: &mut Vec<Event>) {
        Decoder::finish(self, events);
    }
    fn counts(&self) -> LineCounts {
        Decoder::counts(self)
    }
    fn began_ns(event: &mut Event) -> Option<&mut i64> {
        if let Event::Line(line) = event { Some(&mut line.began_ns) } else { None }
    }
}

pub fn lines(input: &[u8]) {
    wire::whole_and_cut(input, against_oracle);
}

/// Where a counter of 32 bits begins again, µs.
const WRAP_US: u64 = 1 << 32;

/// A line that is no comment; without numbers it is a bad one.
struct Sent {
    at: usize,
    numbers: Option<(u64, Vec<Option<f64>>)>,
}

/// What comes out was sent, in order and each line once; all that was sent is counted; the reader says where a bad line
/// stands between two.
fn against_oracle(sent: &[u8], cuts: &[usize]) {
    let (events, counts) = wire::decoded::<Decoder>(sent, cuts);
    let all = read(sent, cuts);
    assert_eq!(counts.lines + counts.bad + counts.stale, all.len() as u64, "lines that were sent");
    let width = width(&all);
    let (mut next, mut last_us, mut taken, mut wrapped_us) = (0, None, 0, 0);
    for event in &events {
        let line = match event {
            Event::Line(line) => line,
            // of lines that were told of before
            Event::Hole { .. } => continue,
            Event::Restarted => {
                last_us = None;
                continue;
            }
        };
        taken += 1;
        let skipped = all[next..].iter().take_while(|of| (of.at as i64) < line.began_ns).count();
        let of = all.get(next + skipped).filter(|of| of.at as i64 == line.began_ns);
        let (time_us, values) = of.and_then(|of| of.numbers.as_ref()).expect("a line that was sent, and not before");
        // A counter of 32 bits goes on where it wraps, within minutes of its end and of its beginning.
        let before_us = wrapped_us;
        wrapped_us = line.time_us.checked_sub(*time_us).expect("no time is set back");
        assert!(wrapped_us == before_us || wrapped_us == before_us + WRAP_US, "{} for {time_us} µs", line.time_us);
        assert!(
            wrapped_us == before_us || last_us.is_some_and(|last_us: u64| line.time_us - last_us < WRAP_US / 10),
            "a counter wraps at its end"
        );
        assert!(
            values.iter().map(|v| v.map(f64::to_bits)).eq(line.values.iter().map(|v| v.map(f64::to_bits))),
            "the values"
        );
        assert_eq!(Some(values.len()), width, "as many values as the first lines agree on");
        assert!(last_us.is_none_or(|last_us| last_us < line.time_us), "times increase");
        // after a restart all before the first line is unknown anyway
        let bad_between = all[next..next + skipped].iter().any(|of| of.numbers.is_none());
        assert!(last_us.is_none() || !bad_between || line.hole_before, "a bad line before {time_us} µs is a hole");
        last_us = Some(line.time_us);
        next += skipped + 1;
    }
    assert_eq!(counts.lines, taken, "lines handed on");
}

/// What two of the first lines agree on, where no more than 16 had to wait for it; where there are no two, all must.
fn width(all: &[Sent]) -> Option<usize> {
    let widths: Vec<usize> =
        all.iter().filter_map(|line| line.numbers.as_ref()).map(|(_, values)| values.len()).collect();
    let agreed = (1..=widths.len()).find_map(|end| {
        let (width, waiting) = (widths[end - 1], &widths[end.saturating_sub(17)..end]);
        (waiting.iter().filter(|other| **other == width).count() == 2).then_some(width)
    });
    agreed.or_else(|| widths.first().copied().filter(|first| widths.iter().all(|width| width == first)))
}

fn read(sent: &[u8], cuts: &[usize]) -> Vec<Sent> {
    let mut all = Vec::new();
    let stretches = wire::stretches(sent, cuts);
    for (index, (start, stretch)) in stretches.iter().enumerate() {
        let (pieces, rest) = wire::ended_pieces(stretch, b'\n');
        // The first could be the rest of a line, and is only missed where it is too long for any.
        let whole = pieces.iter().enumerate().filter(|(number, (_, text))| *number > 0 || text.len() > MAX_LINE);
        all.extend(whole.filter_map(|(_, &(at, text))| {
            let numbers = if text.len() > MAX_LINE { None } else { numbers(text)? };
            Some(Sent { at: start + at, numbers })
        }));
        if index + 1 < stretches.len() && !pieces.is_empty() && !rest.is_empty() {
            all.push(Sent { at: start + stretch.len() - rest.len(), numbers: None });
        }
    }
    all
}

/// `None` for a comment or nothing, `Some(None)` for what should be numbers and is not.
#[allow(clippy::option_option)]
fn numbers(text: &[u8]) -> Option<Option<(u64, Vec<Option<f64>>)>> {
    let says_something = text.iter().find(|byte| !byte.is_ascii_whitespace())?;
    if *says_something == b'#' {
        return None;
    }
    let Ok(text) = std::str::from_utf8(text) else { return Some(None) };
    let mut cells = text.split(',').map(str::trim);
    let time = cells.next().unwrap_or_default();
    let digits = time.strip_prefix('+').unwrap_or(time);
    let is_time = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    let time_us = digits.parse().unwrap_or(u64::MAX);
    let value = |cell: &str| {
        let number = is_decimal(cell).then(|| cell.parse().unwrap()).filter(|value: &f64| value.is_finite());
        (is_decimal(cell) || is_no_number(cell)).then_some(number)
    };
    let values: Option<Vec<Option<f64>>> = cells.map(value).collect();
    let values = values.filter(|values| !values.is_empty());
    Some(values.filter(|_| is_time && time_us <= i64::MAX as u64 / 2000).map(|values| (time_us, values)))
}

/// What a logger writes where a sensor has no value.
fn is_no_number(cell: &str) -> bool {
    let unsigned = cell.strip_prefix(['+', '-']).unwrap_or(cell);
    ["nan", "inf", "infinity"].iter().any(|word| unsigned.eq_ignore_ascii_case(word))
}

/// Sign, digits with a point or without, exponent.
fn is_decimal(cell: &str) -> bool {
    let unsigned = cell.strip_prefix(['+', '-']).unwrap_or(cell);
    let (mantissa, exponent) = unsigned.split_once(['e', 'E']).map_or((unsigned, None), |(m, e)| (m, Some(e)));
    let all_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let exponent = exponent.map(|text| text.strip_prefix(['+', '-']).unwrap_or(text));
    all_digits(whole)
        && all_digits(part)
        && whole.len() + part.len() > 0
        && exponent.is_none_or(|text| !text.is_empty() && all_digits(text))
}
