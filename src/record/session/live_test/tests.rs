//! A session whose devices, and whose arrivals, are put together here: nothing in it waits, and no time is measured.

pub(crate) mod clocks;
pub(crate) mod end;
pub(crate) mod missing;

use std::path::Path;

use crate::record::devices::poll::PollCounts;
use crate::record::devices::queue::Polled;
use crate::record::session::live_test::*;
use crate::record::session::shots::Plan;
use crate::record::session::trigger::{Condition, Settings};
use crate::record::wire::frames::Frame;
use crate::recording::Recording;
use crate::storage as log;

const MS: i64 = 1_000_000;

/// P1 on device A, P2 on device B.
fn rig(protocol: &str) -> Rig {
    let mut text = "name = \"bench\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = 40.0\n\
                    inner_diameter_mm = 50.6\nwall_thickness_mm = 6.2\nmaterial = \"HDPE\"\n[upstream]\nkind = \"reservoir\"\n\
                    [downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n"
        .to_owned();
    for (sensor, device) in [("P1", "A"), ("P2", "B")] {
        text += &format!(
            "[[sensor]]\nname = \"{sensor}\"\nkind = \"pressure\"\nposition_m = 10.0\nunit = \"kPa\"\ndevice = \"{device}\"\nchannel = 0\n\
             [[device]]\nname = \"{device}\"\nport = \"/dev/{device}\"\nbaud = 921600\nprotocol = \"{protocol}\"\n"
        );
    }
    Rig::from_toml(&text, "bench.toml").unwrap()
}

/// Frame `index` of a device: ten samples at 1 kHz, 600 from the true time `closes_ms` on and 0 before.
fn frame(index: i64, stamp_us: i64, closes_ms: i64) -> Vec<u8> {
    let counts = (0..10).map(|i| if 10 * index + i >= closes_ms { 600 } else { 0 }).collect();
    Frame::new(index as u16, stamp_us as u64, 1_000_000, 1, counts).unwrap().encode()
}

/// Records messages of devices A (0) and B (1) in the order of their arrivals, ns; the last is not older than the
/// session's end.
fn played(options: &Options, messages: Vec<(i64, usize, Vec<u8>)>) -> Summary {
    played_on(&rig("frames"), options, messages)
}

fn played_on(rig: &Rig, options: &Options, mut messages: Vec<(i64, usize, Vec<u8>)>) -> Summary {
    messages.sort_by_key(|(at_ns, ..)| *at_ns);
    let devices = live_devices(rig, &[]).unwrap();
    let sources = Sources::reading(&devices[0], std::io::empty()).unwrap();
    let mut streams = streams_of(rig, &devices);
    let expected = streams.iter().enumerate().flat_map(|(device, stream)| count::expected(stream, device)).collect();
    let mut live = Live::new(rig, options, "a test".to_owned(), expected, sources.host);
    let mut clocks_ns = 0;
    let mut ended = BY_USER;
    for (at_ns, device, bytes) in messages {
        take(device, Input::Bytes { at_ns, bytes }, &mut streams, &mut live).unwrap();
        let due = at_ns - clocks_ns >= 5000 * MS;
        clocks_ns = if due { at_ns } else { clocks_ns };
        if live.has_begun()
            && let Some(why) = keep_up(due, &mut streams, &mut live).unwrap()
        {
            ended = why;
            break;
        }
        if all_over(&streams, options).is_some() {
            write_clocks(&mut live, &mut streams).unwrap();
            reopen(at_ns, &mut streams, &live);
            if all_over(&streams, options).is_some() {
                ended = "the duration was reached";
                break;
            }
        }
    }
    finish(&mut streams, live, &sources, options, ended.to_owned()).unwrap()
}

/// Gives messages to the streams of their devices in the order of their arrivals, ns.
fn feed(mut messages: Vec<(i64, usize, Vec<u8>)>, streams: &mut [Stream<'_>], live: &mut Live<'_>) {
    messages.sort_by_key(|(at_ns, ..)| *at_ns);
    for (at_ns, device, bytes) in messages {
        take(device, Input::Bytes { at_ns, bytes }, streams, live).unwrap();
    }
}

/// Frames of a device that runs for so long: by its index its stamp, µs, and its arrival, ns.
fn sent(
    device: usize,
    seconds: i64,
    closes_ms: i64,
    time: impl Fn(i64) -> (i64, i64),
) -> impl Iterator<Item = (i64, usize, Vec<u8>)> {
    let mut before_ns = 0;
    (0..100 * seconds).map(move |index| {
        let (stamp_us, at_ns) = time(index);
        // some µs of scatter, not the same for all, and one after the other
        before_ns = before_ns.max(at_ns + (index * 7919 + device as i64 * 101) % 97 * 1000);
        (before_ns, device, frame(index, stamp_us, closes_ms))
    })
}

/// On time: sent when its last sample was taken.
fn on_time(index: i64) -> (i64, i64) {
    (1_000_000 + index * 10_000, (index + 1) * 10 * MS)
}

/// Where a sensor's samples begin and end, and where they rise, s.
fn ends(recording: &Recording, sensor: usize) -> (f64, f64, f64) {
    let series = &recording.series[sensor];
    let rise = series.value.iter().position(|value| *value > 500.0).map_or(f64::NAN, |at| series.time_s[at]);
    (series.time_s[0], series.time_s[series.time_s.len() - 1], rise)
}

fn near(found: (f64, f64, f64), expected: (f64, f64, f64)) {
    let off = [found.0 - expected.0, found.1 - expected.1, found.2 - expected.2];
    assert!(off.iter().all(|off| off.abs() < 0.002), "{found:?} for {expected:?}");
}

/// A shot of 1 s before and 2 s after P1 reaches 500 kPa.
fn shots(folder: &Path, most: usize) -> Options {
    let trigger = Settings { condition: Condition::Level(500.0), pre_ns: 1000 * MS, post_ns: 2000 * MS };
    let plan = Plan { trigger, sensor: 0, most: Some(most), folder: folder.join("shots") };
    Options { shots: Some(plan), ..Options::new("") }
}

/// The first 0.8 s of B come in one burst: by its first arrival alone its clock is 0.8 s off.
fn late_at_first(index: i64) -> (i64, i64) {
    let (stamp_us, at_ns) = on_time(index);
    (stamp_us, at_ns.max(813 * MS))
}

#[test]
fn a_shot_is_cut_by_the_clocks_as_they_are_known_and_not_as_they_were_logged() {
    let two_percent = |index: i64| (1_000_000 + index * 10_000, ((index + 1) as f64 * 10e6 / 1.02) as i64);
    // fired at 3 s, before anybody has asked for the clocks, and after a minute of a clock that is 2% fast
    for (closes_ms, fast) in [(3000, false), (30_000, true)] {
        let folder = tempfile::tempdir().unwrap();
        let seconds = closes_ms / 1000 + 4;
        let a = sent(0, seconds, closes_ms, on_time);
        let b: Vec<_> = match fast {
            true => sent(1, seconds * 102 / 100, closes_ms * 102 / 100, two_percent).collect(),
            false => sent(1, seconds, closes_ms, late_at_first).collect(),
        };
        let summary = played(&shots(folder.path(), 1), a.chain(b).collect());
        assert!(!summary.data_lost && summary.shots.len() == 1, "{summary:?}");
        let shot = log::read(Path::new(&summary.shots[0])).unwrap();
        assert_eq!(ends(&shot, 0), (0.0, 3.0, 1.0));
        near(ends(&shot, 1), (0.0, 3.0, 1.0));
        let noted = |key: &str| shot.run.notes.iter().filter(|(noted, _)| noted == key).count();
        assert_eq!((noted("A.clock"), noted("B.clock")), (1, 1), "{:?}", shot.run.notes);
        let counted: Vec<u64> = summary.sensors.iter().map(|sensor| sensor.samples).collect();
        let held: Vec<u64> = shot.series.iter().map(|series| series.value.len() as u64).collect();
        assert_eq!((counted, shot.series[1].gaps.len()), (held, 0));
    }
}

#[test]
fn a_duration_is_that_of_the_recordings_clock_for_every_device() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options { duration_s: Some(5.0), ..Options::new(folder.path().join("run.mcap")) };
    let (a, b) = (sent(0, 9, 4000, on_time), sent(1, 9, 4000, late_at_first));
    let summary = played(&options, a.chain(b).collect());
    assert!(!summary.data_lost && summary.duration_s == 5.0, "{summary:?}");
    let recording = log::read(&options.file).unwrap();
    assert_eq!(ends(&recording, 0), (0.0, 4.999, 4.0));
    near(ends(&recording, 1), (0.0, 4.999, 4.0));
    assert_eq!(summary.sensors[0].samples, 5000);
    let times = &recording.series[1].time_s;
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] < 0.0015), "not one is missing between");
    assert_eq!(summary.sensors[1].samples as usize, recording.series[1].value.len());
}

/// B's clock is set by this at 3 s, while its sequence and its arrivals go on.
#[test]
fn a_clock_that_is_set_costs_no_sample_no_shot_and_no_alignment() {
    for step_us in [60_000_000, 3_600_000_000, 30_000, -6_000] {
        let folder = tempfile::tempdir().unwrap();
        let stepped = |index: i64| (on_time(index).0 + if index >= 300 { step_us } else { 0 }, on_time(index).1);
        for (stepping, other) in [(1, 0), (0, 1)] {
            let messages = sent(stepping, 10, 6000, stepped).chain(sent(other, 10, 6000, on_time));
            let summary = played(&shots(&folder.path().join(format!("{stepping}")), 1), messages.collect());
            assert!(!summary.data_lost && summary.ended == "all shots were recorded", "{step_us}: {summary:?}");
            let device = &summary.devices[stepping];
            assert_eq!((device.clock_steps, device.restarts, device.lost_frames, device.holes), (1, 0, 0, 0));
            let shot = log::read(Path::new(&summary.shots[0])).unwrap();
            near(ends(&shot, 0), (0.0, 3.0, 1.0));
            near(ends(&shot, 1), (0.0, 3.0, 1.0));
        }
    }
}

/// Nothing comes for 3 s and the sequence goes on: the arrivals say that it was a hole, and no step.
#[test]
fn a_device_that_pauses_is_no_clock_that_was_set() {
    let folder = tempfile::tempdir().unwrap();
    let pause = |index: i64| if index >= 300 { 3000 } else { 0 };
    let paused = |index: i64| (on_time(index).0 + 1000 * pause(index), on_time(index).1 + pause(index) * MS);
    let options = Options::new(folder.path().join("run.mcap"));
    let summary = played(&options, sent(0, 13, 0, on_time).chain(sent(1, 10, 0, paused)).collect());
    let device = &summary.devices[1];
    assert_eq!((device.clock_steps, device.holes, device.bad_frames), (0, 1, 0), "{device:?}");
    let gap = log::read(&options.file).unwrap().series[1].gaps[0];
    assert!((gap.to_s - gap.from_s - 3.001).abs() < 1e-4 && gap.samples == Some(3000), "{gap:?}");
}

/// Of the trigger's own device nothing comes any more while the other goes on: what it measured last decides how short
/// the shot is.
#[test]
fn a_shot_does_not_end_before_the_triggers_own_sensor() {
    let folder = tempfile::tempdir().unwrap();
    let summary =
        played(&shots(folder.path(), 1), sent(0, 7, 6000, on_time).chain(sent(1, 30, 6000, on_time)).collect());
    assert!(summary.data_lost && summary.ended == BY_USER, "{summary:?}");
    assert!((summary.cut_short[0].kept_s - 1.0).abs() < 0.002, "{:?}", summary.cut_short);
    let shot = log::read(Path::new(&summary.shots[0])).unwrap();
    near(ends(&shot, 0), (0.0, 1.999, 1.0));
    near(ends(&shot, 1), (0.0, 3.0, 1.0));
}

#[test]
fn a_device_is_silent_when_more_is_due_than_its_rhythm_allows() {
    let folder = tempfile::tempdir().unwrap();
    let (rig, options) = (rig("frames"), Options::new(folder.path().join("run.mcap")));
    let devices = live_devices(&rig, &[]).unwrap();
    let sources = Sources::reading(&devices[0], std::io::empty()).unwrap();
    let mut live = Live::new(&rig, &options, "a test".to_owned(), Vec::new(), sources.host);
    let mut streams = [Stream::new(&rig, &devices[0])];
    let after = |stream: &Stream<'_>, ms: u64| {
        stream
            .silent_since(stream.timing.last_message + Duration::from_millis(ms), options.silence)
            .map(|(since_ns, _)| since_ns)
    };
    for (at_ns, _, bytes) in sent(0, 1, 0, on_time) {
        take(0, Input::Bytes { at_ns, bytes }, &mut streams, &mut live).unwrap();
        if at_ns < 15 * MS {
            assert_eq!((after(&streams[0], 4000), after(&streams[0], 5001)), (None, Some(9 * MS)), "nothing to go by");
        }
    }
    // they came within moments of each other
    let stream = &mut streams[0];
    assert_eq!((after(stream, 400), after(stream, 3000)), (None, Some(999 * MS)));
    // one second without a message is its rhythm from here on
    stream.timing.last_message -= Duration::from_secs(1);
    take(0, Input::Bytes { at_ns: 2000 * MS, bytes: frame(100, 2_000_000, 0) }, &mut streams, &mut live).unwrap();
    assert_eq!(after(&streams[0], 1900), None);
    assert!(after(&streams[0], 3500).is_some());
    streams[0].state = State::Reached;
    assert_eq!(after(&streams[0], 3500), None, "it owes nothing more");
}

/// The port is gone for 2 s, and the clock of the device that comes back reads 0.3 s later than it should: too early
/// for it to have run on.
#[test]
fn a_device_that_comes_back_with_a_clock_a_little_ahead_has_restarted() {
    for (ahead_us, late_ms, restarts) in [(300_000, 0, 1), (0, 0, 0), (0, 250, 0), (-5_000_000, 0, 1)] {
        let folder = tempfile::tempdir().unwrap();
        let (rig, options) = (rig("lines"), Options::new(folder.path().join("run.mcap")));
        let devices = live_devices(&rig, &[]).unwrap();
        let sources = Sources::reading(&devices[0], std::io::empty()).unwrap();
        let mut live = Live::new(&rig, &options, "a test".to_owned(), Vec::new(), sources.host);
        let mut streams = [Stream::new(&rig, &devices[0])];
        for index in (0..300).chain(500..900) {
            if index == 500 {
                take(0, Input::Vanished("pulled".to_owned()), &mut streams, &mut live).unwrap();
                take(0, Input::Back, &mut streams, &mut live).unwrap();
            }
            // what waited for the port comes at once
            let (ahead_us, late_ms) =
                if index < 500 { (0, 0) } else { (ahead_us, (late_ms - 10 * (index - 500)).max(0)) };
            let bytes = format!("{},{}\n", 6_000_000 + 10_000 * index + ahead_us, index).into_bytes();
            take(0, Input::Bytes { at_ns: (10 * index + late_ms) * MS, bytes }, &mut streams, &mut live).unwrap();
        }
        let summary = finish(&mut streams, live, &sources, &options, BY_USER.to_owned()).unwrap();
        assert_eq!(summary.devices[0].restarts, restarts, "{ahead_us} {late_ms}: {:?}", summary.devices[0]);
        let series = &log::read(&options.file).unwrap().series[0];
        let last = (series.time_s[series.time_s.len() - 1], series.value[series.value.len() - 1]);
        // the first line may be the rest of one, and is never taken
        assert!((last.0 - 8.98).abs() < 1e-3 && last.1 == 899.0, "{ahead_us}: {last:?}");
    }
}

/// Nobody asks while the port is gone: what fell out meanwhile is missing, and nothing is where the next poll comes in
/// time.
#[test]
fn a_polled_device_whose_port_was_gone_has_a_hole() {
    for (back_at, gap_s) in [(40, Some((2.375, 5.0))), (20, None)] {
        let (summary, gaps) = polled_around_a_pull(back_at);
        let holes = u64::from(gap_s.is_some());
        assert_eq!((summary.devices[0].holes, summary.data_lost), (holes, holes > 0), "{summary:?}");
        assert_eq!(gaps.first().map(|gap| (gap.from_s, gap.to_s)), gap_s);
    }
}

/// A device asked every 125 ms, whose port is pulled after 20 polls and back before that of `back_at`.
fn polled_around_a_pull(back_at: i64) -> (Summary, Vec<Gap>) {
    let folder = tempfile::tempdir().unwrap();
    let (mut rig, options) = (rig("frames"), Options::new(folder.path().join("run.mcap")));
    rig.devices[0].protocol = Protocol::ModbusRtu { unit_id: 1, poll_interval_s: 0.125, timeout_s: 0.5 };
    let devices = live_devices(&rig, &[]).unwrap();
    let sources = Sources::reading(&devices[0], std::io::empty()).unwrap();
    let mut live = Live::new(&rig, &options, "a test".to_owned(), Vec::new(), sources.host);
    let mut streams = streams_of(&rig, &devices[..1]);
    for at in (0..20).chain(back_at..60) {
        if at == back_at {
            take(0, Input::Vanished("pulled".to_owned()), &mut streams, &mut live).unwrap();
            take(0, Input::Back, &mut streams, &mut live).unwrap();
        }
        let counts = PollCounts { answers: at as u64 + 1, ..PollCounts::default() };
        let polled = Polled { at_ns: at * 125 * MS, values: vec![(0, Some(1.0))], refused: None, counts };
        take(0, Input::Polled(polled), &mut streams, &mut live).unwrap();
    }
    let summary = finish(&mut streams, live, &sources, &options, BY_USER.to_owned()).unwrap();
    (summary, log::read(&options.file).unwrap().series[0].gaps.clone())
}

/// A slave that ignores echoes, one that knows them, and what either is asked for in vain before the recording begins.
#[test]
fn polls_that_fell_out_are_told_with_what_to_do() {
    let told = |unproven: u64, skipped: u64, missed: u64| {
        let folder = tempfile::tempdir().unwrap();
        let (mut rig, options) = (rig("frames"), Options::new(folder.path().join("run.mcap")));
        rig.devices[0].protocol = Protocol::ModbusRtu { unit_id: 1, poll_interval_s: 0.125, timeout_s: 0.5 };
        let devices = live_devices(&rig, &[]).unwrap();
        let sources = Sources::reading(&devices[0], std::io::empty()).unwrap();
        let mut live = Live::new(&rig, &options, "a test".to_owned(), Vec::new(), sources.host);
        let mut streams = streams_of(&rig, &devices[..1]);
        let counts = |answers: u64, skipped: u64, missed: u64| PollCounts {
            answers,
            skipped,
            missed,
            unproven,
            ..PollCounts::default()
        };
        let begins = (None, counts(0, 20, 7));
        for (at, (value, counts)) in
            [begins, (Some(1.0), counts(1, 20, 7)), (Some(2.0), counts(2, 20 + skipped, 7 + missed))]
                .into_iter()
                .enumerate()
        {
            let polled = Polled { at_ns: at as i64 * 125 * MS, values: vec![(0, value)], refused: None, counts };
            take(0, Input::Polled(polled), &mut streams, &mut live).unwrap();
        }
        let mut summary = finish(&mut streams, live, &sources, &options, BY_USER.to_owned()).unwrap();
        let device = summary.devices.remove(0);
        assert_eq!((device.skipped_polls, device.lost_frames), (skipped, missed));
        let notes = log::read(&options.file).unwrap().run.notes;
        assert_eq!(
            device.poll_warning.as_ref(),
            notes.iter().find(|(key, _)| key == "A.poll_warning").map(|(_, text)| text)
        );
        device.poll_warning.unwrap_or_default()
    };
    assert_eq!(
        (told(0, 0, 3), told(2, 0, 0)),
        (String::new(), String::new()),
        "lost polls are counted, and nothing fell out"
    );
    let slow = told(0, 9, 0);
    assert!(slow.starts_with("9 polls fell out") && slow.contains("raise poll_interval_s (now 0.125)"), "{slow}");
    let mute = told(2, 9, 3);
    for part in [
        "ignores echoes",
        "function 8",
        "left alone for 5 s",
        "9 polls fell out and 3 had no answer",
        "timeout_s (now 0.5)",
    ] {
        assert!(mute.contains(part), "{part}: {mute}");
    }
}
