//! What the `frames` codec promises: what goes in comes out, and noise on the wire never becomes a sample.

pub(crate) mod resequencer;

use proptest::prelude::*;

use crate::record::wire::frames::frame::MAX_DEVICE_US;
use crate::record::wire::frames::*;

fn decode(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Event> {
    let mut events = Vec::new();
    decoder.feed(0, bytes, &mut events);
    events
}

fn frames(events: Vec<Event>) -> Vec<Frame> {
    events
        .into_iter()
        .map(|event| match event {
            Event::Frame(taken) => taken.frame,
            Event::Restarted => panic!("no device restarted here"),
        })
        .collect()
}

/// The `index`-th frame of a device: 3 channels, 4 samples at 2 kHz, told apart by their counts.
fn nth(index: u16) -> Frame {
    let counts = (0..12).map(|i| (i16::from_ne_bytes(index.to_ne_bytes())).wrapping_mul(12).wrapping_add(i)).collect();
    Frame::new(index, 1_000 + u64::from(index) * 2_000, 500_000, 3, counts).unwrap()
}

/// A process that is started again sends the same frames again.
#[test]
fn a_stream_that_begins_anew_repeats_nothing() {
    let mut decoder = Decoder::new();
    let bytes: Vec<u8> = (0..5).flat_map(|index| nth(index).encode()).collect();
    for life in 1..=3 {
        decoder.begin_anew();
        // cut off within the last one
        let taken = frames(decode(&mut decoder, &bytes[..bytes.len() - 3]));
        assert_eq!(taken, [0, 1, 2, 3].map(nth));
        decoder.cut();
        let counts = decoder.counts();
        assert_eq!((counts.frames, counts.bad, counts.lost, counts.duplicated), (4 * life, life, 0, 0));
    }
}

fn any_frame() -> impl Strategy<Value = Frame> {
    (any::<u16>(), 0..MAX_DEVICE_US, 1u32.., 1u8..=255, 1usize..40)
        .prop_flat_map(|(sequence, first_us, period_ns, channels, samples)| {
            let counts = prop::collection::vec(any::<i16>(), samples * usize::from(channels));
            (Just((sequence, first_us, period_ns, channels)), counts)
        })
        .prop_map(|((sequence, first_us, period_ns, channels), counts)| {
            Frame::new(sequence, first_us, period_ns, channels, counts).unwrap()
        })
}

#[derive(Debug, Clone)]
enum Noise {
    Flip(prop::sample::Index, u8),
    Drop(prop::sample::Index),
    Double(prop::sample::Index),
}

fn any_noise() -> impl Strategy<Value = Noise> {
    let place = any::<prop::sample::Index>;
    prop_oneof![
        (place(), 1u8..).prop_map(|(at, mask)| Noise::Flip(at, mask)),
        place().prop_map(Noise::Drop),
        place().prop_map(Noise::Double),
    ]
}

fn disturb(bytes: &mut Vec<u8>, noise: &Noise) {
    match noise {
        Noise::Flip(at, mask) => {
            let at = at.index(bytes.len());
            bytes[at] ^= mask;
        }
        Noise::Drop(at) => {
            bytes.remove(at.index(bytes.len()));
        }
        Noise::Double(at) => {
            let at = at.index(bytes.len());
            bytes.insert(at, bytes[at]);
        }
    }
}

proptest! {
    #[test]
    fn a_frame_comes_back_as_it_went(frame in any_frame()) {
        let mut decoder = Decoder::new();
        prop_assert_eq!(frames(decode(&mut decoder, &frame.encode())), vec![frame]);
        prop_assert_eq!(decoder.counts(), FrameCounts { frames: 1, ..FrameCounts::default() });
    }

    #[test]
    fn the_split_of_the_bytes_does_not_matter(cuts in prop::collection::vec(1usize..30, 1..60), noise in prop::collection::vec(any_noise(), 0..4)) {
        let mut bytes: Vec<u8> = (0..12).flat_map(|i| nth(i).encode()).collect();
        noise.iter().for_each(|n| disturb(&mut bytes, n));
        let mut whole = Decoder::new();
        let expected = decode(&mut whole, &bytes);
        let mut split = Decoder::new();
        let mut events = Vec::new();
        let mut rest = &bytes[..];
        for cut in cuts.into_iter().cycle() {
            let (piece, tail) = rest.split_at(cut.min(rest.len()));
            split.feed(0, piece, &mut events);
            rest = tail;
            if rest.is_empty() { break; }
        }
        prop_assert_eq!(events, expected);
        prop_assert_eq!(split.counts(), whole.counts());
    }

    /// Each disturbed byte costs at most two frames; all that come out are frames that were sent, in their order.
    #[test]
    fn noise_never_becomes_a_sample(noise in prop::collection::vec(any_noise(), 1..8)) {
        let sent: Vec<Frame> = (0..20).map(nth).collect();
        let mut bytes: Vec<u8> = sent.iter().flat_map(Frame::encode).collect();
        noise.iter().for_each(|n| disturb(&mut bytes, n));
        let mut decoder = Decoder::new();
        let received = frames(decode(&mut decoder, &bytes));
        prop_assert!(received.iter().all(|frame| sent.contains(frame)));
        prop_assert!(received.windows(2).all(|pair| pair[0].first_us() < pair[1].first_us()));
        prop_assert!(received.len() + 2 * noise.len() >= sent.len());
        let span = received.last().map_or(0, |l| u64::from(l.sequence())) - received.first().map_or(0, |f| u64::from(f.sequence()));
        let counts = decoder.counts();
        prop_assert_eq!(counts.lost + counts.frames, span + 1);
    }

    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(prop_oneof![Just(0u8), any::<u8>()], 0..600)) {
        let mut decoder = Decoder::new();
        prop_assert!(decode(&mut decoder, &bytes).is_empty());
    }
}

/// A frame put together by hand from the contract, so that encoder and decoder cannot agree on the same mistake.
#[test]
fn the_bytes_are_those_of_the_contract() {
    let mut raw =
        vec![1, 2, 0x34, 0x12, 0x40, 0x42, 0x0F, 0, 0, 0, 0, 0, 0x50, 0xC3, 0, 0, 1, 0, 0xFF, 0xFF, 0x00, 0x80];
    // CRC-16/IBM-3740, bit by bit: polynomial 0x1021, start 0xFFFF, no reflection.
    let mut crc = 0xFFFF_u16;
    for &byte in &raw {
        crc ^= u16::from(byte) << 8;
        for _ in 0..8 {
            crc = if crc & 0x8000 == 0 { crc << 1 } else { (crc << 1) ^ 0x1021 };
        }
    }
    raw.extend(crc.to_le_bytes());
    let frame = Frame::new(0x1234, 1_000_000, 50_000, 2, vec![-1, i16::MIN]).unwrap();
    let encoded = frame.encode();
    assert_eq!(encoded.last(), Some(&0));
    // COBS by hand: a code byte, then that many less one bytes, a zero implied between blocks.
    let mut decoded = Vec::new();
    let mut rest = &encoded[..encoded.len() - 1];
    while let Some((&code, tail)) = rest.split_first() {
        let (block, tail) = tail.split_at(usize::from(code) - 1);
        decoded.extend_from_slice(block);
        rest = tail;
        if code < 0xFF && !rest.is_empty() {
            decoded.push(0);
        }
    }
    assert_eq!(decoded, raw);
    assert_eq!(frames(decode(&mut Decoder::new(), &encoded)), vec![frame]);
}

#[test]
fn the_sequence_wraps_and_its_jumps_are_counted() {
    let at = |sequence: u16, index: u64| Frame::new(sequence, index * 500, 500_000, 1, vec![7]).unwrap();
    let mut decoder = Decoder::new();
    let mut bytes = Vec::new();
    for (sequence, index) in [(65_534, 0), (65_535, 1), (0, 2), (3, 5), (3, 5), (4, 6)] {
        bytes.extend(at(sequence, index).encode());
    }
    let lost: Vec<u32> = decode(&mut decoder, &bytes)
        .iter()
        .map(|event| match event {
            Event::Frame(taken) => taken.lost_before,
            Event::Restarted => panic!("not restarted"),
        })
        .collect();
    assert_eq!(lost, [0, 0, 0, 2, 0]);
    assert_eq!(decoder.counts(), FrameCounts { frames: 5, bad: 0, lost: 2, duplicated: 1, restamped: 0 });
}

#[test]
fn an_empty_frame_is_a_sign_of_life() {
    let empty = Frame::new(1, 3_000, 500_000, 3, vec![]).unwrap();
    let bytes: Vec<u8> = [nth(0), empty, nth(2)].iter().flat_map(Frame::encode).collect();
    let mut decoder = Decoder::new();
    assert_eq!(frames(decode(&mut decoder, &bytes)), vec![nth(0), nth(2)]);
    assert_eq!(decoder.counts(), FrameCounts { frames: 3, ..FrameCounts::default() });
}

#[test]
fn joining_in_the_middle_of_a_frame_is_no_fault() {
    let mut bytes = nth(4).encode().split_off(9);
    bytes.extend(nth(5).encode());
    let mut decoder = Decoder::new();
    assert_eq!(frames(decode(&mut decoder, &bytes)), vec![nth(5)]);
    assert_eq!(decoder.counts().bad, 0);
}

#[test]
fn a_whole_but_damaged_first_frame_is_a_bad_one() {
    let mut bytes = nth(4).encode();
    let last = bytes.len() - 2;
    bytes[last] ^= 0x40;
    let mut decoder = Decoder::new();
    assert!(decode(&mut decoder, &bytes).is_empty());
    assert_eq!(decoder.counts().bad, 1);
}

#[test]
fn a_frame_cut_off_by_the_end_is_a_bad_one() {
    let mut bytes = nth(0).encode();
    bytes.extend(&nth(1).encode()[..10]);
    let mut decoder = Decoder::new();
    assert_eq!(decode(&mut decoder, &bytes).len(), 1);
    decoder.cut();
    assert_eq!(decoder.counts().bad, 1);
}

#[test]
fn a_stream_without_zeros_does_not_fill_the_memory() {
    let mut decoder = Decoder::new();
    for _ in 0..40 {
        assert!(decode(&mut decoder, &[0x55; 100_000]).is_empty());
    }
    let mut bytes = vec![0];
    bytes.extend(nth(9).encode());
    assert_eq!(frames(decode(&mut decoder, &bytes)), vec![nth(9)]);
    assert_eq!(decoder.counts().bad, 1);
}

#[test]
fn a_frame_begins_when_its_first_byte_arrives() {
    let (mut decoder, mut events) = (Decoder::new(), Vec::new());
    let bytes: Vec<u8> = (0..2).flat_map(|i| nth(i).encode()).collect();
    let first = nth(0).encode().len();
    decoder.feed(10, &bytes[..first + 3], &mut events);
    decoder.feed(20, &bytes[first + 3..], &mut events);
    decoder.feed(30, &nth(2).encode(), &mut events);
    let began = |event: &Event| if let Event::Frame(taken) = event { taken.began_ns } else { -1 };
    assert_eq!(events.iter().map(began).collect::<Vec<_>>(), [10, 10, 30]);
}
