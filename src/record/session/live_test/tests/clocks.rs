//! What becomes of the times of a device whose clock, line or program misbehaves: every sample carries its number, and
//! so its true time.

use crate::record::session::live_test::tests::*;

/// What happens once to device B, at a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    Nothing,
    /// One stamp is off, µs.
    False(i64),
    /// So many frames are lost, and the clock is set, µs.
    Set(i64, i64),
    /// It does not sample for so long, ms, and its sequence goes on.
    Pause(i64),
}

#[derive(Debug, Clone, Copy)]
struct Device {
    /// Samples a frame, at 1 kHz.
    rows: i64,
    /// What it sends comes at the end of every such stretch of time, ms.
    burst_ms: i64,
    /// Its stamps are late by up to this, µs.
    jitter_us: i64,
    event: Event,
    at: i64,
}

const SECONDS: i64 = 12;

impl Device {
    fn messages(self, dice: &mut fastrand::Rng) -> Vec<(i64, usize, Vec<u8>)> {
        let mut before_ns = 0;
        let mut messages = Vec::new();
        for index in 0..1000 * SECONDS / self.rows {
            let is_past = index >= self.at;
            let (pause_ms, set_us, lost) = match self.event {
                Event::Pause(ms) if is_past => (ms, 0, 0),
                Event::Set(lost, us) if is_past => (0, us, lost),
                _ => (0, 0, 0),
            };
            if is_past && index < self.at + lost {
                continue;
            }
            let first_ms = index * self.rows + pause_ms;
            let mut stamp_us = 1_000_000 + 1000 * first_ms + set_us + dice.i64(0..=self.jitter_us);
            if let (Event::False(off_us), true) = (self.event, index == self.at) {
                stamp_us += off_us;
            }
            let sent_ms = first_ms + self.rows;
            let came_ms = if self.burst_ms == 0 {
                sent_ms
            } else {
                (sent_ms + self.burst_ms - 1) / self.burst_ms * self.burst_ms
            };
            before_ns = before_ns.max(came_ms * MS + dice.i64(0..200_000));
            let counts = (first_ms..first_ms + self.rows).map(|ms| ms as i16).collect();
            let frame = Frame::new(index as u16, stamp_us as u64, 1_000_000, 1, counts).unwrap();
            messages.push((before_ns, 1, frame.encode()));
        }
        messages
    }

    /// How far its samples may be from their true times, s: stamps that are late look late, and a step is known as well
    /// as two of them.
    fn most_off_s(self) -> f64 {
        0.0015 + 2.0 * self.jitter_us as f64 / 1e6
    }
}

/// How far the worst sample is from its true time, s, and how many there are.
fn worst(recording: &Recording) -> (f64, usize) {
    let series = &recording.series[1];
    let off = |(time_s, value): (&f64, &f64)| (time_s - value / 1e3).abs();
    (series.time_s.iter().zip(series.value.iter()).map(off).fold(0.0, f64::max), series.value.len())
}

fn run(device: Device, duration_s: Option<f64>, dice: &mut fastrand::Rng) -> (Summary, Recording) {
    let folder = tempfile::tempdir().unwrap();
    let options = Options { duration_s, ..Options::new(folder.path().join("run.mcap")) };
    let messages = sent(0, SECONDS, 0, on_time).chain(device.messages(dice)).collect();
    let summary = played(&options, messages);
    let recording = log::read(&options.file).unwrap();
    (summary, recording)
}

#[test]
#[ignore = "takes 15 s; CI runs it at night"]
fn whatever_happens_to_a_clock_no_sample_is_lost_or_out_of_place() {
    let dice = &mut fastrand::Rng::with_seed(11);
    for (rows, jitter_us) in [(10, 0), (10, 300), (10, 900), (10, 9000), (100, 0), (100, 6000)] {
        for burst_ms in [0, 150, 200, 800] {
            let size_us = dice.i64(1000 * rows / 2..400_000) + 10_000;
            let lost = dice.i64(1..6);
            let mut events = vec![
                Event::Nothing,
                Event::False(size_us),
                Event::False(-size_us),
                Event::False(dice.i64(25_000..95_000)),
                Event::Set(0, -size_us),
                Event::Set(lost, 0),
                Event::Set(lost, -size_us),
                Event::Set(lost, -1000 * rows * lost - 15_000),
                Event::Pause(dice.i64(60..400)),
            ];
            if burst_ms == 0 {
                // in a burst a hole and a clock set forward look the same
                events.push(Event::Set(0, size_us + 50_000));
            }
            if jitter_us == 0 {
                // less than half a frame
                events.push(Event::Set(0, -400 * rows));
            }
            for event in events {
                let device = Device { rows, burst_ms, jitter_us, event, at: dice.i64(20..1000 * SECONDS / rows - 20) };
                let (summary, recording) = run(device, None, dice);
                let (off_s, samples) = worst(&recording);
                let counts = &summary.devices[1];
                let lost = if let Event::Set(lost, _) = event { lost } else { 0 };
                let told = format!("{device:?}: {off_s} s off, {counts:?}");
                assert!(off_s < device.most_off_s(), "{told}");
                assert_eq!(samples as i64, 1000 * SECONDS - lost * rows, "{told}");
                let gaps = &recording.series[1].gaps;
                let holes = usize::from(lost > 0 || matches!(event, Event::Pause(_)));
                assert_eq!(gaps.len(), holes, "{told}: {gaps:?}");
                assert_eq!(summary.data_lost, !gaps.is_empty(), "{told}");
            }
        }
    }
}

#[test]
fn a_duration_ends_where_it_should_for_a_device_whose_frames_come_in_bursts() {
    let dice = &mut fastrand::Rng::with_seed(5);
    for (rows, burst_ms) in [(10, 150), (10, 400), (100, 300), (10, 800), (100, 800)] {
        for duration_s in [2.0, 5.0, 9.5] {
            let device = Device { rows, burst_ms, jitter_us: 0, event: Event::Nothing, at: 0 };
            let (summary, recording) = run(device, Some(duration_s), dice);
            let (off_s, samples) = worst(&recording);
            let told = format!("{rows} {burst_ms} {duration_s}: {off_s} s off, {samples}, {:?}", summary.devices[1]);
            assert!(off_s < 0.0015 && !summary.data_lost, "{told}");
            assert!((samples as f64 - 1e3 * duration_s).abs() <= 1.0, "{told}");
        }
    }
}
