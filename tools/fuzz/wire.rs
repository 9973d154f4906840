//! What the targets of the wire protocols share: streams built from inputs, and the same bytes decoded in other splits.

use std::fmt::Debug;

/// A decoder of a stream, which comes in pieces.
pub trait Decoder: Default {
    type Event: Clone + Debug + PartialEq;
    type Counts: Debug + PartialEq;
    fn feed(&mut self, at_ns: i64, bytes: &[u8], events: &mut Vec<Self::Event>);
    fn cut(&mut self);
    /// No more will come.
    fn finish(&mut self, _events: &mut Vec<Self::Event>) {}
    fn counts(&self) -> Self::Counts;
    /// When the event's first byte arrived.
    fn began_ns(event: &mut Self::Event) -> Option<&mut i64>;
}

/// Decodes a stream that was cut off at `cuts`, byte by byte: an event's arrival is then the place of its first byte.
/// Other splits must give the same events and counts, with the arrival of the piece that the first byte came in.
pub fn decoded<D: Decoder>(wire: &[u8], cuts: &[usize]) -> (Vec<D::Event>, D::Counts) {
    let (events, counts) = in_pieces::<D>(wire, cuts, 1);
    let sum: usize = wire.iter().map(|&byte| usize::from(byte)).sum();
    for size in [wire.len().max(1), 2 + sum % 7, 2 + sum % 997] {
        let (mut others, other_counts) = in_pieces::<D>(wire, cuts, size);
        let mut expected = events.clone();
        for event in &mut expected {
            if let Some(began_ns) = D::began_ns(event) {
                let at = *began_ns as usize;
                let start = cuts.iter().copied().filter(|&cut| cut <= at).max().unwrap_or(0);
                *began_ns = (at - (at - start) % size) as i64;
            }
        }
        if others != expected {
            others.truncate(50);
            expected.truncate(50);
            panic!("other events in pieces of {size} bytes: {others:?} for {expected:?}");
        }
        assert_eq!(other_counts, counts, "other counts in pieces of {size} bytes");
    }
    (events, counts)
}

fn in_pieces<D: Decoder>(wire: &[u8], cuts: &[usize], size: usize) -> (Vec<D::Event>, D::Counts) {
    let (mut decoder, mut events) = (D::default(), Vec::new());
    for (start, stretch) in stretches(wire, cuts) {
        if start > 0 {
            decoder.cut();
        }
        for (index, piece) in stretch.chunks(size).enumerate() {
            decoder.feed((start + index * size) as i64, piece, &mut events);
        }
    }
    decoder.finish(&mut events);
    let counts = decoder.counts();
    (events, counts)
}

/// What came before, between and after the cuts, each with its place.
pub fn stretches<'a>(wire: &'a [u8], cuts: &[usize]) -> Vec<(usize, &'a [u8])> {
    let starts = std::iter::once(0).chain(cuts.iter().copied());
    let ends = cuts.iter().copied().chain(std::iter::once(wire.len()));
    starts.zip(ends).map(|(start, end)| (start, &wire[start..end])).collect()
}

/// Checks a stream whole, and cut off at one place anywhere inside where it is long enough.
pub fn whole_and_cut(wire: &[u8], check: impl Fn(&[u8], &[usize])) {
    check(wire, &[]);
    if wire.len() > 1 {
        let sum = wire.iter().fold(0usize, |sum, &byte| sum.wrapping_mul(31).wrapping_add(byte.into()));
        check(wire, &[1 + sum % (wire.len() - 1)]);
    }
}

/// What stands between `end` bytes in one stretch, each with its place; the last of them has not ended.
pub fn ended_pieces(stretch: &[u8], end: u8) -> (Vec<(usize, &[u8])>, &[u8]) {
    let mut at = 0;
    let mut pieces: Vec<_> = Vec::new();
    for piece in stretch.split(|&byte| byte == end) {
        pieces.push((at, piece));
        at += piece.len() + 1;
    }
    let (_, rest) = pieces.pop().unwrap_or_default();
    (pieces, rest)
}

/// An input as a recipe: pieces of a kind (one byte), a length (two, little endian) and so many bytes, as far as they
/// go.
pub fn recipe(mut input: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    std::iter::from_fn(move || {
        let (&[kind, low, high], rest) = input.split_first_chunk()?;
        let (piece, rest) = rest.split_at(rest.len().min(u16::from_le_bytes([low, high]).into()));
        input = rest;
        Some((kind, piece))
    })
}

/// A CRC of 16 bits, bit by bit: as unlike the tables of the program as can be.
pub fn crc16(bytes: &[u8], polynomial: u16, reflected: bool) -> u16 {
    bytes.iter().fold(0xffff, |mut sum, &byte| {
        sum ^= if reflected { u16::from(byte) } else { u16::from(byte) << 8 };
        for _ in 0..8 {
            let out = if reflected { sum & 1 != 0 } else { sum & 0x8000 != 0 };
            sum = if reflected { sum >> 1 } else { sum << 1 };
            sum ^= if out { polynomial } else { 0 };
        }
        sum
    })
}
