//! Frames in their order: which come again, which are missing, and whose time is false.

use crate::record::wire::frames::tests::*;

#[test]
fn a_restarted_device_is_noticed_and_a_late_frame_is_not_taken_for_one() {
    let mut decoder = Decoder::new();
    let bytes: Vec<u8> = [500, 501, 499, 502].iter().flat_map(|&i| nth(i).encode()).collect();
    assert_eq!(frames(decode(&mut decoder, &bytes)).len(), 3);
    let before = decoder.counts();
    let bytes: Vec<u8> = (0..5).flat_map(|i| nth(i).encode()).collect();
    let mut events = decode(&mut decoder, &bytes);
    assert_eq!(events.remove(0), Event::Restarted);
    assert_eq!(frames(events), (0..5).map(nth).collect::<Vec<_>>(), "not one frame is lost by a restart");
    let counts = decoder.counts();
    assert_eq!((counts.frames, counts.duplicated), (before.frames + 5, before.duplicated));
}

/// A device that restarts twice within a few frames, with the same numbers and times; and one that sends a block of
/// frames again.
#[test]
fn a_second_restart_is_told_from_frames_that_come_again() {
    let mut decoder = Decoder::new();
    let other = |index: u16| Frame { counts: vec![7; 12], ..nth(index) };
    let bytes: Vec<u8> = (0..7).map(nth).chain((0..7).map(other)).flat_map(|frame| frame.encode()).collect();
    let events = decode(&mut decoder, &bytes);
    assert_eq!(events.iter().filter(|event| **event == Event::Restarted).count(), 1);
    assert_eq!(decoder.counts(), FrameCounts { frames: 14, ..FrameCounts::default() });

    let mut decoder = Decoder::new();
    let bytes: Vec<u8> = (0..8).chain(4..8).chain(8..12).flat_map(|i| nth(i).encode()).collect();
    assert_eq!(frames(decode(&mut decoder, &bytes)), (0..12).map(nth).collect::<Vec<_>>());
    assert_eq!(decoder.counts(), FrameCounts { frames: 12, duplicated: 4, ..FrameCounts::default() });
}

/// Two frames of a restart that nothing comes behind are as lost as any; frames that came again are not.
#[test]
fn the_first_frames_of_a_restart_at_the_end_are_lost() {
    for (last, bad, duplicated) in [([0, 1], 2, 0), ([501, 502], 0, 2), ([500, 3], 1, 1)] {
        let mut decoder = Decoder::new();
        let bytes: Vec<u8> = [500, 501, 502].iter().chain(&last).flat_map(|&i| nth(i).encode()).collect();
        assert_eq!(frames(decode(&mut decoder, &bytes)).len(), 3);
        assert_eq!(decoder.counts(), FrameCounts { frames: 3, bad, duplicated, ..FrameCounts::default() }, "{last:?}");
    }
    // two frames of a restart, then others of it behind a hole that nobody saw, as when the cable was pulled
    let mut decoder = Decoder::new();
    let bytes: Vec<u8> = [500, 501, 502, 0, 1, 7, 8, 9].iter().flat_map(|&i| nth(i).encode()).collect();
    assert_eq!(frames(decode(&mut decoder, &bytes).into_iter().filter(|e| *e != Event::Restarted).collect()).len(), 6);
    assert_eq!(decoder.counts(), FrameCounts { frames: 6, bad: 2, ..FrameCounts::default() });
}

/// A frame of 10 ms.
fn at(sequence: u16, first_us: u64) -> Frame {
    Frame::new(sequence, first_us, 1_000_000, 1, vec![0; 10]).unwrap()
}

/// Feeds frames with their arrivals, ms, and returns the sequence numbers of those handed on.
fn fed(decoder: &mut Decoder, frames: &[(i64, Frame)]) -> Vec<u16> {
    let mut events = Vec::new();
    frames.iter().for_each(|(at_ms, frame)| decoder.feed(at_ms * 1_000_000, &frame.encode(), &mut events));
    decoder.finish(&mut events);
    self::frames(events).iter().map(Frame::sequence).collect()
}

#[test]
fn a_hole_longer_than_the_sequence_is_counted_by_the_devices_time() {
    for arrival_ms in [700_000, 0] {
        let mut decoder = Decoder::new();
        let frames =
            [0, 70_000, 70_001].map(|index| (arrival_ms.min(index as i64 * 10), at(index as u16, index * 10_000)));
        assert_eq!(fed(&mut decoder, &frames).len(), 3);
        assert_eq!(decoder.counts(), FrameCounts { frames: 3, lost: 69_999, ..FrameCounts::default() });
    }
}

/// A 64-bit clock that is read in halves while it wraps.
#[test]
fn a_false_time_is_dropped_and_a_true_jump_is_not() {
    let mut decoder = Decoder::new();
    let torn = |index: u64| if index == 5 { 1 << 32 } else { 0 };
    let frames: Vec<_> =
        (0..10).map(|index| (index as i64 * 10, at(index as u16, torn(index) + index * 10_000))).collect();
    assert_eq!(fed(&mut decoder, &frames), (0..10).collect::<Vec<_>>());
    assert_eq!(decoder.counts(), FrameCounts { frames: 10, restamped: 1, ..FrameCounts::default() });

    // the clock jumps for good, with one frame that comes late and one that comes twice meanwhile
    let mut decoder = Decoder::new();
    let jump = [(0, 0), (1, 10_000), (2, 3_000_000), (0, 0), (2, 3_000_000), (3, 3_010_000), (4, 3_020_000)];
    let frames = jump.map(|(sequence, first_us)| (i64::from(sequence) * 10, at(sequence, first_us)));
    assert_eq!(fed(&mut decoder, &frames), [0, 1, 2, 3, 4]);
    assert_eq!(decoder.counts(), FrameCounts { frames: 5, duplicated: 2, ..FrameCounts::default() });

    // samples now and then, played faster than in real time: each frame jumps
    let mut decoder = Decoder::new();
    let frames: Vec<_> = (0..9).map(|index| (0, at(index, u64::from(index) * 1_000_000))).collect();
    assert_eq!(fed(&mut decoder, &frames).len(), 9);
    assert_eq!(decoder.counts(), FrameCounts { frames: 9, ..FrameCounts::default() });
}

/// One stamp in an unbroken sequence is off: its frame stands where the sequence puts it. In the last case nothing came
/// for just as long, which spoke for its time: until that has passed nothing can be taken.
#[test]
fn a_stamp_that_is_off_by_less_than_a_stall_moves_nothing_else() {
    for (off_us, late_ms, bad) in [
        (8_000, 0, 0),
        (25_000, 0, 0),
        (40_000, 0, 0),
        (-6_000, 0, 0),
        (-300_000, 0, 0),
        (25_000, 60, 0),
        (40_000, 60, 4),
    ] {
        let mut decoder = Decoder::new();
        let frames: Vec<_> = (0..20u16)
            .map(|index| {
                let (off_us, late_ms) = if index == 10 { (off_us, late_ms) } else { (0, 0) };
                let first_us = (1_000_000 + i64::from(index) * 10_000 + off_us) as u64;
                (i64::from(index) * 10 + late_ms, at(index, first_us))
            })
            .collect();
        let (mut events, mut stamps) = (Vec::new(), Vec::new());
        frames.iter().for_each(|(at_ms, frame)| decoder.feed(at_ms * 1_000_000, &frame.encode(), &mut events));
        for frame in self::frames(events) {
            if bad == 0 || frame.sequence() != 10 {
                assert_eq!(frame.first_us(), 1_000_000 + u64::from(frame.sequence()) * 10_000, "{off_us} µs off");
            }
            stamps.push(frame.sequence());
        }
        let counts = FrameCounts { frames: 20 - bad, bad, lost: bad, duplicated: 0, restamped: u64::from(bad == 0) };
        assert_eq!(decoder.counts(), counts, "{off_us} µs off, {late_ms} ms late");
        assert_eq!(stamps.len() as u64, 20 - bad);
    }
}

/// A device whose frames come in bursts of 200 ms: that nothing came for so long does not speak for a false stamp.
#[test]
fn bursts_do_not_speak_for_a_false_stamp() {
    for (false_at, off_us) in (9..40).flat_map(|at| [(at, 60_000), (at, 90_000), (at, -90_000)]) {
        let mut decoder = Decoder::new();
        let frames: Vec<_> = (0..60u16)
            .map(|index| {
                let first_us = 1_000_000 + i64::from(index) * 100_000 + if index == false_at { off_us } else { 0 };
                let burst_ms = (i64::from(index) * 100 / 200 + 1) * 200;
                (burst_ms, Frame::new(index, first_us as u64, 1_000_000, 1, vec![0; 100]).unwrap())
            })
            .collect();
        let mut events = Vec::new();
        frames.iter().for_each(|(at_ms, frame)| decoder.feed(at_ms * 1_000_000, &frame.encode(), &mut events));
        assert!(events.iter().all(|event| matches!(event, Event::Frame(taken) if taken.jump.is_none())));
        let moved = |frame: &Frame| frame.first_us() != 1_000_000 + u64::from(frame.sequence()) * 100_000;
        assert_eq!(
            self::frames(events).iter().filter(|frame| moved(frame)).count(),
            0,
            "frame {false_at}, {off_us} µs"
        );
        assert_eq!(decoder.counts(), FrameCounts { frames: 60, restamped: 1, ..FrameCounts::default() });
    }
}

/// Frames that are missing, a clock set back at the same time by less or more than them, and the next frames that say
/// so.
#[test]
fn a_clock_that_is_set_back_where_frames_are_missing_is_told_by_the_sequence() {
    for (lost, step_us) in
        [(0_u16, -12_000_i64), (0, -27_000), (0, -200_000), (3, -20_000), (3, -35_000), (2, -400_000)]
    {
        let mut decoder = Decoder::new();
        let mut events = Vec::new();
        for index in (0..20u16).chain(20 + lost..40) {
            let first_us = 1_000_000 + i64::from(index) * 10_000 + if index < 20 { 0 } else { step_us };
            decoder.feed(i64::from(index) * 10_000_000, &at(index, first_us as u64).encode(), &mut events);
        }
        let jumps: Vec<(u16, u32)> = events
            .iter()
            .filter_map(|event| match event {
                Event::Frame(taken) => taken.jump.map(|_| (taken.frame.sequence(), taken.lost_before)),
                Event::Restarted => panic!("not restarted"),
            })
            .collect();
        assert_eq!(jumps, [(20 + lost, u32::from(lost))], "{lost} lost, {step_us} µs");
        let counts = FrameCounts { frames: 40 - u64::from(lost), lost: u64::from(lost), ..FrameCounts::default() };
        assert_eq!(decoder.counts(), counts);
    }
}

/// Stamps that a device's program takes when it comes to it, 3 to 9 ms late, or that tick in milliseconds while it
/// samples at 10 kHz: no frame is lost, none jumps, and once their scatter is known the samples go on evenly.
#[test]
fn stamps_that_scatter_are_smoothed() {
    let mut dice = fastrand::Rng::with_seed(4);
    for (period_ns, samples, least_us, most_us, tick_us) in
        [(1_000_000, 10, 3000, 9000, 1), (1_000_000, 10, 0, 9000, 1), (100_000, 97, 0, 0, 1000)]
    {
        let mut decoder = Decoder::new();
        let mut events = Vec::new();
        let length_us = u64::from(period_ns) * samples / 1000;
        for index in 0..3000u16 {
            let true_us = 1_000_000 + u64::from(index) * length_us;
            let stamp_us = (true_us + dice.u64(least_us..=most_us)) / tick_us * tick_us;
            let frame = Frame::new(index, stamp_us, period_ns, 1, vec![0; samples as usize]).unwrap();
            decoder.feed((true_us + length_us) as i64 * 1000, &frame.encode(), &mut events);
        }
        let scatter_s = decoder.stamps_scatter_s().unwrap();
        assert!(scatter_s > 0.2e-3 && scatter_s < 4e-3, "{scatter_s}");
        assert!(events.iter().all(|event| matches!(event, Event::Frame(taken) if taken.jump.is_none())));
        let handed_on = self::frames(events);
        assert_eq!(
            decoder.counts(),
            FrameCounts { frames: 3000, restamped: decoder.counts().restamped, ..FrameCounts::default() }
        );
        assert!(decoder.counts().restamped < 10, "{:?}", decoder.counts());
        let off = |frame: &Frame| frame.first_us() as f64 - 1e6 - f64::from(frame.sequence()) * length_us as f64;
        let late: Vec<f64> = handed_on[100..].iter().map(off).collect();
        let mean = late.iter().sum::<f64>() / late.len() as f64;
        let scatter = (late.iter().map(|off| (off - mean).powi(2)).sum::<f64>() / late.len() as f64).sqrt();
        let middle = (least_us + most_us) as f64 / 2.0 - (tick_us - 1) as f64 / 2.0;
        assert!((mean - middle).abs() < 0.1 * f64::from(period_ns) / 1e3 + 50.0, "{mean} for {middle}");
        assert!(
            scatter < 0.3 * ((most_us - least_us) as f64 / 12f64.sqrt() + tick_us as f64 / 12f64.sqrt()),
            "{scatter}"
        );
    }
}

/// A clock that is set, forward or back, while the sequence goes on: the next frame confirms it, and nothing is lost.
#[test]
fn a_step_of_the_clock_loses_no_frame() {
    for step_us in [30_000_i64, 3_000_000, 7_200_000_000, -6_000, -40_000] {
        let mut decoder = Decoder::new();
        let long = |index: u16| {
            let stepped_us = if index < 10 { 0 } else { step_us };
            let first_us = (1_000_000 + i64::from(index) * 100_000 + stepped_us) as u64;
            (i64::from(index) * 100, Frame::new(index, first_us, 1_000_000, 1, vec![0; 100]).unwrap())
        };
        let frames: Vec<_> = (0..20).map(long).collect();
        assert_eq!(fed(&mut decoder, &frames).len(), 20, "{step_us} µs");
        assert_eq!(decoder.counts(), FrameCounts { frames: 20, ..FrameCounts::default() });
    }
}

/// Frames of 10 ms that say 100 ms, 25 ms, or 9.5 ms.
#[test]
fn a_wrong_period_is_taken_from_the_stamps_and_told() {
    for (stated_ns, longer) in [(10_000_000, -0.9), (2_500_000, -0.6), (950_000, 1.0 / 19.0)] {
        let (mut decoder, mut events) = (Decoder::new(), Vec::new());
        for index in 0..100u16 {
            let frame = Frame::new(index, 1_000_000 + u64::from(index) * 10_000, stated_ns, 1, vec![0; 10]).unwrap();
            decoder.feed(i64::from(index) * 10_000_000, &frame.encode(), &mut events);
        }
        assert!((decoder.period_off_s().0 - longer).abs() < 1e-6);
        let handed_on = frames(events);
        assert!(handed_on[10..].iter().all(|frame| frame.period_ns().abs_diff(1_000_000) <= 1));
        assert!(handed_on.iter().all(|frame| frame.first_us() == 1_000_000 + u64::from(frame.sequence()) * 10_000));
        assert_eq!(decoder.counts(), FrameCounts { frames: 100, ..FrameCounts::default() });
    }
}

/// Nothing comes behind one or two frames off their place: they stand by their sequence.
#[test]
fn the_last_frames_stand_by_their_sequence() {
    for (last, off_us) in [(1, -1500), (1, 50_000), (2, 50_000), (2, -50_000)] {
        let mut decoder = Decoder::new();
        let mut events = Vec::new();
        for index in 0..40i64 {
            let first_us = 1_000_000 + 10_000 * index + if index < 40 - last { 0 } else { off_us };
            decoder.feed(index * 10_000_000, &at(index as u16, first_us as u64).encode(), &mut events);
        }
        decoder.finish(&mut events);
        let handed_on = frames(events);
        assert_eq!(handed_on.len(), 40);
        assert!(handed_on.iter().all(|frame| frame.first_us() == 1_000_000 + 10_000 * u64::from(frame.sequence())));
        assert_eq!(decoder.counts(), FrameCounts { frames: 40, restamped: last as u64, ..FrameCounts::default() });
    }
}

/// A sign of life behind every frame, with a number of its own: one stamp is false, and a clock is set.
#[test]
fn signs_of_life_keep_their_numbers_beside_a_false_time() {
    for (false_at, off_us, set_us, jumps) in
        [(30, 60_000, 0, 0), (30, -60_000, 0, 0), (99, 0, -60_000, 1), (99, 0, 400_000, 1)]
    {
        let (mut decoder, mut events) = (Decoder::new(), Vec::new());
        for index in 0..60i64 {
            let off_us = if index == false_at { off_us } else { 0 } + if index >= 30 { set_us } else { 0 };
            let first_us = (1_000_000 + index * 10_000 + off_us) as u64;
            decoder.feed(index * 10_000_000, &at(2 * index as u16, first_us).encode(), &mut events);
            let sign = Frame::new(2 * index as u16 + 1, first_us, 1_000_000, 1, Vec::new()).unwrap();
            decoder.feed(index * 10_000_000, &sign.encode(), &mut events);
        }
        let jumped = |event: &&Event| matches!(event, Event::Frame(taken) if taken.jump.is_some());
        assert_eq!(events.iter().filter(jumped).count(), jumps, "{off_us} {set_us}");
        assert_eq!(frames(events).len(), 60);
        let restamped = u64::from(off_us != 0);
        assert_eq!(decoder.counts(), FrameCounts { frames: 120, restamped, ..FrameCounts::default() });
    }
}

/// An hour, and 300 days, where two frames are missing: not as many as fit into them.
#[test]
fn a_clock_set_far_ahead_beside_lost_frames_invents_none() {
    for ahead_us in [3_600_000_000, 300 * 86_400_000_000] {
        let (mut decoder, mut events) = (Decoder::new(), Vec::new());
        for index in (0..30).chain(32..60u64) {
            let first_us = 1_000_000 + index * 10_000 + if index < 30 { 0 } else { ahead_us };
            decoder.feed(index as i64 * 10_000_000, &at(index as u16, first_us).encode(), &mut events);
        }
        assert_eq!(decoder.counts(), FrameCounts { frames: 58, lost: 2, ..FrameCounts::default() });
    }
}

#[test]
fn a_sequence_that_begins_anew_invents_no_lost_frames() {
    let (mut decoder, mut events) = (Decoder::new(), Vec::new());
    let sent = [(100, 1_000_000), (101, 1_010_000), (0, 1_600_000), (1, 1_610_000), (2, 1_620_000)];
    sent.iter().for_each(|&(sequence, first_us)| decoder.feed(0, &at(sequence, first_us).encode(), &mut events));
    let anew = |event: &Event| matches!(event, Event::Frame(Taken { anew: true, lost_before: 0, .. }));
    assert_eq!(events.iter().map(anew).collect::<Vec<_>>(), [false, false, true, false, false]);
    assert_eq!(decoder.counts().lost, 0);
}
