//! Lines that come whole, damaged, late, again, and from devices that restart.

use crate::record::wire::lines::*;
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
        Event::Hole { from_us, .. } => (*from_us, true),
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

/// A process that is started again says the same times again, and the same values.
#[test]
fn a_stream_that_begins_anew_is_whole_from_its_first_byte_on() {
    let mut decoder = Decoder::new();
    let mut events = Vec::new();
    for life in 1..=3 {
        decoder.begin_anew();
        events.clear();
        decoder.feed(0, b"time_us,P1\n1000,1,2\n2000,3,4\n3000,5,6\n40", &mut events);
        assert_eq!(times(&events), [(1000, false), (2000, false), (3000, false)], "a heading is no line");
        decoder.finish(&mut events);
        decoder.cut();
        assert_eq!(decoder.counts(), LineCounts { lines: 3 * life, bad: life, stale: 0 });
    }
    // how many values a line has is known by now; what was held back is lost
    decoder.begin_anew();
    events.clear();
    decoder.feed(0, b"1000,1,2\n2000,1,2\n3000,1,2\n4000,1,2\n900000,1,2\n", &mut events);
    decoder.begin_anew();
    assert_eq!((events.len(), decoder.counts()), (4, LineCounts { lines: 13, bad: 4, stale: 0 }));
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
    assert_eq!(times(&decode(&mut decoder, "\n10,5,1\n20,1,2\n")), [(10, false), (20, false)], "few, but all alike");
    let mut decoder = Decoder::new();
    assert_eq!(decode(&mut decoder, "\n10,5\n20,1,2\n"), [], "nobody knows which");
    assert_eq!(decoder.counts().bad, 2);
}

/// Before three steps are known nothing is a jump: the lines that follow show it.
#[test]
fn a_hole_between_the_first_lines_is_told_by_those_after_them() {
    let holes = |of: &[(u64, u64)]| of.to_vec();
    for (lost, expected) in [
        (vec![2, 3], holes(&[(1, 4)])),
        ((3..20).collect(), holes(&[(2, 20)])),
        ((4..9).collect(), holes(&[(3, 9)])),
        (vec![2, 4], holes(&[(1, 3), (3, 5)])),
        (vec![2, 4, 8, 12], holes(&[(1, 3), (3, 5), (7, 9), (11, 13)])),
        (vec![], holes(&[])),
    ] {
        let sent = (0..40).filter(|index| !lost.contains(index));
        let text: String = sent.map(|index| format!("{},1\n", 1_000_000 + 100_000 * index)).collect();
        let mut decoder = Decoder::new();
        // the first line may be the rest of one
        let events = decode(&mut decoder, &text);
        let time_us = |index: u64| 1_000_000 + 100_000 * index;
        let told: Vec<(u64, u64)> = events
            .iter()
            .zip(events.iter().skip(1))
            .filter_map(|pair| match pair {
                (Event::Hole { from_us, to_us }, _) => Some((*from_us, *to_us)),
                (Event::Line(before), Event::Line(line)) if line.hole_before => Some((before.time_us, line.time_us)),
                _ => None,
            })
            .collect();
        let mut told = told;
        told.sort_unstable();
        let expected: Vec<_> = expected.into_iter().map(|(from, to)| (time_us(from), time_us(to))).collect();
        assert_eq!(told, expected, "{lost:?}");
    }
    // two steps in turns are a rhythm
    let text: String = (0..40).map(|index| format!("{},1\n", 60_000 * (index / 2) + 10_000 * (index % 2))).collect();
    assert!(times(&decode(&mut Decoder::new(), &text)).iter().all(|(_, hole)| !hole));
    // a device that writes when it has something to say
    let events = decode(&mut Decoder::new(), "\n1,1\n1000001,1\n6000001,1\n8000001,1\n");
    assert_eq!(times(&events), [(1, false), (1_000_001, false), (6_000_001, false), (8_000_001, false)]);
}

#[test]
fn a_line_that_is_cut_before_its_rhythm_is_known_may_miss_anything() {
    for (lines, hole) in [(2, true), (10, false)] {
        let (mut decoder, mut events) = (Decoder::new(), Vec::new());
        let text: String = (0..=lines).map(|index| format!("{},1\n", 10_000 * index)).collect();
        decoder.feed(0, text.as_bytes(), &mut events);
        decoder.cut();
        // what comes first may be the rest of a line
        decoder.feed(0, format!("0\n{},1\n", 10_000 * (lines + 1)).as_bytes(), &mut events);
        assert_eq!(times(&events).last(), Some(&(10_000 * (lines + 1), hole)));
    }
}

/// A microcontroller's counter of µs wraps after 71.6 min.
#[test]
fn a_counter_that_wraps_goes_on() {
    let wrap = 1 << 32;
    let text: String = (0..60).map(|index| format!("{},{index}\n", (wrap - 305_000 + 10_000 * index) % wrap)).collect();
    let mut decoder = Decoder::new();
    let expected: Vec<_> = (1..60).map(|index| (wrap - 305_000 + 10_000 * index, false)).collect();
    assert_eq!(times(&decode(&mut decoder, &text)), expected);
    // a device that starts again does not go on, nor one whose time was damaged before its rhythm was known
    let again: String = (0..20).map(|index| format!("{},1\n", 10_000 * (index % 10))).collect();
    let damaged = [0, 0, 50, 60, 2_147_483_647, 80, 90, 100, 110].map(|time_us| format!("{time_us},1\n")).concat();
    for sent in [again, damaged] {
        let events = decode(&mut Decoder::new(), &sent);
        let goes_on = events.iter().any(|event| matches!(event, Event::Line(line) if line.time_us >= wrap));
        assert!(events.contains(&Event::Restarted) && !goes_on, "{events:?}");
    }
    // lines that are lost where it wraps are a hole there
    for lost in [30..32, 28..30, 29..36] {
        let sent = text.lines().enumerate().filter(|(index, _)| !lost.contains(index));
        let sent: String = sent.map(|(_, line)| format!("{line}\n")).collect();
        let mut decoder = Decoder::new();
        let found = times(&decode(&mut decoder, &sent));
        let kept = expected.iter().enumerate().filter(|(index, _)| !lost.contains(&(index + 1)));
        let kept: Vec<_> = kept.map(|(index, (at, _))| (*at, index + 1 == lost.end)).collect();
        assert_eq!(found, kept, "{lost:?}");
        assert_eq!(decoder.counts(), LineCounts { lines: kept.len() as u64, bad: 0, stale: 0 }, "{lost:?}");
    }
    // nor does a damaged line at the very end of the count begin it anew
    let damaged = text.replace(",29\n", ",29\n0,5,9\n");
    let expected: Vec<_> = expected.into_iter().map(|(at, _)| (at, at == wrap - 5_000)).collect();
    assert_eq!(times(&decode(&mut Decoder::new(), &damaged)), expected);
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
                Event::Hole { from_us, to_us } => prop_assert!(from_us < to_us && to_us <= last),
                Event::Line(line) => {
                    prop_assert!(line.time_us >= last && line.values.iter().flatten().all(|v| v.is_finite()));
                    last = line.time_us;
                }
            }
        }
    }
}
