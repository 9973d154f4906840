//! The `frames` protocol against a reading of its description that shares no code with the program's.

use surgescope::record::wire::frames;
use surgescope::record::wire::frames::{Decoder, Event, FrameCounts, Taken};

use super::wire::{self, crc16};

impl wire::Decoder for Decoder {
    type Event = Event;
    type Counts = FrameCounts;
    fn feed(&mut self, at_ns: i64, bytes: &[u8], events: &mut Vec<Event>) {
        let from = events.len();
        Decoder::feed(self, at_ns, bytes, events);
        // which of those that agree came earliest hangs on the split
        for event in &mut events[from..] {
            if let Event::Frame(taken) = event {
                taken.jump = taken.jump.map(|_| frames::Sent { sent_ns: 0, began_ns: 0 });
            }
        }
    }
    fn cut(&mut self) {
        Decoder::cut(self);
    }
    fn counts(&self) -> FrameCounts {
        Decoder::counts(self)
    }
    fn began_ns(event: &mut Event) -> Option<&mut i64> {
        if let Event::Frame(taken) = event { Some(&mut taken.began_ns) } else { None }
    }
}

/// The input as it came, and as a recipe: frames that get their check sum and their COBS here (kind 1), bytes between
/// them.
pub fn frames(input: &[u8]) {
    wire::whole_and_cut(input, against_oracle);
    let mut sent = Vec::new();
    for (kind, piece) in wire::recipe(input) {
        if kind == 1 {
            let sealed = [piece, &crc16(piece, 0x1021, false).to_le_bytes()].concat();
            sent.extend(stuffed(&sealed));
            sent.push(0);
        } else {
            sent.extend(piece);
        }
    }
    wire::whole_and_cut(&sent, against_oracle);
}

/// A frame as its description has it.
#[derive(Debug)]
struct Sent {
    at: usize,
    sequence: u16,
    first_us: u64,
    period_ns: u32,
    channels: u8,
    counts: Vec<i16>,
}

/// What comes out was sent, in order, each frame once and whole; all that was sent is counted.
fn against_oracle(sent: &[u8], cuts: &[usize]) {
    let (events, counts) = wire::decoded::<Decoder>(sent, cuts);
    let (good, bad) = read(sent, cuts);
    // What is off its place, and nothing behind it agrees, is one of the bad, and so is what waits for that at the end.
    let refuted = counts.bad.checked_sub(bad).expect("pieces that are no frames");
    assert_eq!(counts.frames + counts.duplicated + refuted, good.len() as u64, "each frame is counted once");
    let mut moved = 0;
    let mut left = good.iter().enumerate();
    let mut before: Option<(usize, &Sent)> = None;
    for event in &events {
        let Event::Frame(Taken { frame, lost_before, began_ns, anew, .. }) = event else {
            before = None;
            continue;
        };
        let (index, of) =
            left.find(|(_, of)| of.at as i64 == *began_ns).expect("a frame that was sent, and not before");
        assert_eq!((frame.sequence(), frame.channels()), (of.sequence, of.channels), "the header");
        assert!(
            frame.period_ns() == of.period_ns || good.len() > 8,
            "the period is the stated one, unless eight stamps deny it"
        );
        moved += u64::from(frame.first_us() != of.first_us);
        let width = usize::from(of.channels);
        assert_eq!(frame.samples() * width, of.counts.len(), "the length");
        assert!(!of.counts.is_empty(), "samples");
        for channel in 0..width + 1 {
            let column: Vec<i16> =
                of.counts.iter().enumerate().filter(|(i, _)| i % width == channel).map(|(_, &count)| count).collect();
            assert!(frame.channel(channel).eq(column), "the counts of channel {channel}");
        }
        if let Some((last_index, last)) = before
            && (index == last_index + 1 && *lost_before < u32::MAX && !anew)
        {
            // a device whose number stands still has its times to go by
            let step = of.sequence.wrapping_sub(last.sequence).max(1);
            assert_eq!(step - 1, *lost_before as u16, "frames missing by the sequence");
        }
        before = Some((index, of));
    }
    // after eight stamps their scatter may be known, and those that scatter are smoothed
    assert!(moved <= counts.restamped || good.len() > 8, "{moved} times changed, {} counted", counts.restamped);
    let lost_of = |event: &Event| if let Event::Frame(taken) = event { u64::from(taken.lost_before) } else { 0 };
    let lost: u64 = events.iter().map(lost_of).sum();
    assert!(lost <= counts.lost, "{lost} frames said to be missing, {} counted", counts.lost);
}

/// The frames in a stream, and how many pieces are none; what a stretch begins with may be the rest of a frame, and is
/// not counted.
fn read(sent: &[u8], cuts: &[usize]) -> (Vec<Sent>, u64) {
    let (mut good, mut bad) = (Vec::new(), 0);
    let stretches = wire::stretches(sent, cuts);
    for (index, (start, stretch)) in stretches.iter().enumerate() {
        let (pieces, rest) = wire::ended_pieces(stretch, 0);
        for (number, (at, piece)) in pieces.iter().enumerate() {
            match unstuffed(piece).as_deref().map(|raw| frame(raw, start + at)) {
                Some(Shape::Frame(frame)) => good.push(frame),
                Some(Shape::Damaged) => bad += 1,
                _ => bad += u64::from(number > 0 && !piece.is_empty()),
            }
        }
        // A cut in a frame makes it a bad one.
        bad += u64::from(index + 1 < stretches.len() && !pieces.is_empty() && !rest.is_empty());
    }
    (good, bad)
}

enum Shape {
    Frame(Sent),
    /// Version and length are those of a frame.
    Damaged,
    None,
}

fn frame(raw: &[u8], at: usize) -> Shape {
    let number = |from: usize, to: usize| raw[from..to].iter().rev().fold(0u64, |n, &byte| n << 8 | u64::from(byte));
    if raw.len() < 20 || raw[0] != 1 || raw.len() as u64 != 20 + 2 * u64::from(raw[1]) * number(16, 18) {
        return Shape::None;
    }
    let end = raw.len() - 2;
    let right = number(end, raw.len()) == u64::from(crc16(&raw[..end], 0x1021, false));
    let (period_ns, first_us) = (number(12, 16) as u32, number(4, 12));
    // no channels, no period, and a time beyond half the range of ns in 64 bits are refused
    if !right || raw[1] == 0 || period_ns == 0 || first_us > i64::MAX as u64 / 2000 {
        return Shape::Damaged;
    }
    let counts = (18..end).step_by(2).map(|i| number(i, i + 2) as u16 as i16).collect();
    Shape::Frame(Sent { at, sequence: number(2, 4) as u16, first_us, period_ns, channels: raw[1], counts })
}

/// Consistent Overhead Byte Stuffing (Cheshire and Baker, 1999): a code says where the next zero is.
fn stuffed(raw: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    for run in raw.split(|&byte| byte == 0) {
        let mut blocks = run.chunks(254).peekable();
        if run.is_empty() {
            out.push(1);
        }
        while let Some(block) = blocks.next() {
            out.push(block.len() as u8 + 1);
            out.extend(block);
            // a full block has no zero behind it
            if block.len() == 254 && blocks.peek().is_none() {
                out.push(1);
            }
        }
    }
    out
}

fn unstuffed(mut piece: &[u8]) -> Option<Vec<u8>> {
    let mut raw = Vec::new();
    while let Some((&code, rest)) = piece.split_first() {
        let (block, rest) = rest.split_at_checked(usize::from(code).checked_sub(1)?)?;
        raw.extend(block);
        piece = rest;
        if code < 255 && !piece.is_empty() {
            raw.push(0);
        }
    }
    Some(raw)
}
