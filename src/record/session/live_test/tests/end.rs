//! How a session ends, and whose part of it is incomplete then.

use crate::record::session::live_test::tests::*;

/// What becomes of devices that send for so many seconds each, on time, where something `happens` then and says why the
/// session ended.
fn ended(
    options: &Options,
    seconds: &[i64],
    happens: impl FnOnce(&mut [Stream<'_>], &mut Live<'_>) -> String,
) -> Summary {
    let rig = rig("frames");
    let devices = live_devices(&rig, &[]).unwrap();
    let sources = Sources::reading(&devices[0], std::io::empty()).unwrap();
    let mut live = Live::new(&rig, options, "a test".to_owned(), Vec::new(), sources.host);
    let mut streams = streams_of(&rig, &devices[..seconds.len()]);
    let messages = seconds.iter().enumerate().flat_map(|(device, seconds)| sent(device, *seconds, 0, on_time));
    feed(messages.collect(), &mut streams, &mut live);
    let why = happens(&mut streams, &mut live);
    finish(&mut streams, live, &sources, options, why).unwrap()
}

/// Its port stays open and the user stops: what it did not send is missing.
#[test]
fn a_device_that_fell_silent_before_the_end_is_incomplete_and_leaves_a_gap() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options::new(folder.path().join("run.mcap"));
    let summary = ended(&options, &[6, 2], |streams, _| {
        streams[1].timing.last_message -= Duration::from_secs(4);
        BY_USER.to_owned()
    });
    assert!(!summary.devices[0].incomplete && summary.devices[1].incomplete && summary.data_lost, "{summary:?}");
    let gap = log::read(&options.file).unwrap().series[1].gaps[0];
    assert!((gap.from_s - 1.999).abs() < 0.002 && (gap.to_s - 6.0).abs() < 0.5, "{gap:?}");
}

/// With nobody left who sends, that is the stream's end, whether the program waits it out or the user is faster:
/// nothing is known to be owed.
#[test]
fn where_all_have_fallen_silent_the_stream_has_ended_however_the_session_does() {
    let folder = tempfile::tempdir().unwrap();
    for (silent_ms, several, duration_s) in
        [(3000, false, None), (6000, false, None), (3000, true, None), (6000, true, None), (3000, false, Some(60.0))]
    {
        let file = folder.path().join(format!("{silent_ms}-{several}-{duration_s:?}.mcap"));
        let options = Options { duration_s, ..Options::new(file) };
        let seconds = if several { &[2, 2][..] } else { &[2] };
        let summary = ended(&options, seconds, |streams, _| {
            streams.iter_mut().for_each(|stream| stream.timing.last_message -= Duration::from_millis(silent_ms));
            assert_eq!(all_over(streams, &options).is_some(), silent_ms == 6000);
            all_over(streams, &options).unwrap_or(BY_USER.to_owned())
        });
        // of a duration that was asked for more was due
        let owed = duration_s.is_some();
        assert!(summary.devices.iter().all(|device| device.incomplete == owed), "{summary:?}");
        let ended = if silent_ms == 3000 {
            "stopped by the user; nothing had come for 3.0 s"
        } else {
            "no valid frame for 5 s"
        };
        assert_eq!(summary.ended, ended);
        assert_eq!((summary.data_lost, log::read(&options.file).unwrap().series[0].gaps.is_empty()), (owed, !owed));
    }
}

/// Both hang up: the first is incomplete only where the other goes on without it.
#[test]
fn a_device_that_ends_by_itself_is_incomplete_where_another_goes_on() {
    for (after_ms, incomplete) in [(300, false), (3000, true)] {
        let folder = tempfile::tempdir().unwrap();
        let options = Options::new(folder.path().join("run.mcap"));
        let summary = ended(&options, &[2, 2], |streams, live| {
            for device in [0, 1] {
                take(device, Input::Ended("the device hung up".to_owned()), streams, live).unwrap();
            }
            streams[1].timing.last_message -= Duration::from_millis(after_ms);
            all_over(streams, &options).unwrap()
        });
        let gaps = &log::read(&options.file).unwrap().series[1].gaps;
        let found: Vec<bool> =
            gaps.iter().map(|gap| (gap.from_s - 1.999).abs() < 0.002 && (gap.to_s - 4.999).abs() < 0.5).collect();
        assert_eq!(found, if incomplete { vec![true] } else { vec![] }, "{gaps:?}");
        let found: Vec<bool> = summary.devices.iter().map(|device| device.incomplete).collect();
        assert_eq!((found, summary.data_lost), (vec![false, incomplete], incomplete), "{after_ms} ms");
    }
}

/// As when the disk stands still while the user stops: what has come by then is not thrown away.
#[test]
fn what_waits_in_the_queue_when_the_user_stops_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let (rig, options) = (rig("frames"), Options::new(folder.path().join("run.mcap")));
    let devices = live_devices(&rig, &[]).unwrap();
    let bytes: Vec<u8> = sent(0, 1, 0, on_time).flat_map(|(.., bytes)| bytes).collect();
    let sources = Sources::reading(&devices[0], std::io::Cursor::new(bytes)).unwrap();
    let started = Instant::now();
    // the bytes, and that no more come
    while sources.queued(0) * 4096.0 < 1.5 {
        assert!(started.elapsed() < Duration::from_secs(20), "nothing comes");
        std::thread::yield_now();
    }
    let stop = AtomicBool::new(true);
    let summary = record(&rig, &sources, &options, &stop, &mut |_| {}).unwrap();
    assert_eq!((summary.ended.as_str(), summary.sensors[0].samples), (BY_USER, 1000));
}

/// What is bad on the wire behind the duration, while another device is awaited, is not the recording's.
#[test]
fn what_is_bad_behind_the_duration_is_no_loss() {
    for (bad_at, lost) in [(250, true), (450, false)] {
        let folder = tempfile::tempdir().unwrap();
        let options = Options { duration_s: Some(3.0), ..Options::new(folder.path().join("run.mcap")) };
        let flipped = |(at_ns, device, mut bytes): (i64, usize, Vec<u8>)| {
            let last = bytes.len() - 1;
            bytes[last] ^= u8::from(device == 0 && at_ns / (10 * MS) == bad_at);
            (at_ns, device, bytes)
        };
        // B comes 3 s later: while it is awaited, A goes on
        let later = |index: i64| (on_time(index).0, on_time(index).1 + 3000 * MS);
        let summary = played(&options, sent(0, 7, 0, on_time).chain(sent(1, 4, 0, later)).map(flipped).collect());
        let bad: Vec<u64> = summary.devices.iter().map(|device| device.bad_frames).collect();
        assert_eq!((bad, summary.data_lost), (vec![u64::from(lost), 0], lost), "{summary:?}");
    }
}

/// A logger that sends a line every 10 ms for 6 s, whose clock runs so many times as fast as ours.
fn logger(times: f64, options: &Options) -> (Summary, Recording) {
    let mut rig = rig("lines");
    rig.devices.truncate(1);
    rig.sensors.truncate(1);
    let line = |i: i64| {
        let time_us = 7_000_000 + (times * 1e4 * i as f64).round() as i64;
        ((10 * i + i * 7919 % 3) * MS, 0, format!("{time_us},{i}\n").into_bytes())
    };
    let summary = played_on(&rig, options, (0..600).map(line).collect());
    (summary, log::read(&options.file).unwrap())
}

/// Milliseconds read as microseconds, nanoseconds, and clocks that are off by a factor that no unit explains.
#[test]
fn a_duration_is_our_time_for_a_device_whose_clock_is_off() {
    let folder = tempfile::tempdir().unwrap();
    for (times, duration_s, told) in [
        (1.0, 3.0, ""),
        (1.001, 3.0, ""),
        (1e-3, 3.0, "ms"),
        (1e3, 3.0, "ns"),
        (1e-3, 0.3, "ms"),
        (1e3, 0.3, "ns"),
        (10.0, 3.0, "10.0"),
        (0.1, 3.0, "0.100"),
    ] {
        let name = format!("{times}-{duration_s}.mcap");
        let options = Options { duration_s: Some(duration_s), ..Options::new(folder.path().join(name)) };
        let (summary, recording) = logger(times, &options);
        let all = format!("{times}, {duration_s} s: {summary:?}");
        assert!((recording.series[0].value.len() as f64 - 100.0 * duration_s).abs() <= 2.0, "{all}");
        assert!(!summary.data_lost && summary.ended == "the duration was reached", "{all}");
        let advice: Vec<&str> = summary.alerts.iter().map(|alert| alert.advice).collect();
        let warning = summary.devices[0].clock_warning.clone().unwrap_or_default();
        match told {
            "" => assert!(advice.is_empty() && warning.is_empty(), "{all}"),
            "ms" | "ns" => {
                assert!(advice[0].contains(&format!("time_unit = \"{told}\"")) && warning.is_empty(), "{all}")
            }
            _ => assert!(advice.is_empty() && warning.contains(&format!("run {told} times as fast")), "{all}"),
        }
    }
}

/// What a device sends is nothing that can be used: the message says so with the unit to set.
#[test]
fn decimal_times_are_said_with_the_unit_that_they_are_in() {
    for (unit_s, told) in [(1.0, "time_unit = \"s\""), (1e-3, "time_unit = \"ms\""), (1e-6, "whole microseconds")] {
        let folder = tempfile::tempdir().unwrap();
        let (rig, options) = (rig("lines"), Options::new(folder.path().join("run.mcap")));
        let devices = live_devices(&rig, &[]).unwrap();
        let sources = Sources::reading(&devices[0], std::io::empty()).unwrap();
        let mut live = Live::new(&rig, &options, "a test".to_owned(), Vec::new(), sources.host);
        let mut streams = streams_of(&rig, &devices[..1]);
        for i in 0..100 {
            let bytes = format!("{:.3},{i}\n", 1e-2 / unit_s * f64::from(i) + 0.5).into_bytes();
            take(0, Input::Bytes { at_ns: 10 * i64::from(i) * MS, bytes }, &mut streams, &mut live).unwrap();
        }
        let error = finish(&mut streams, live, &sources, &options, "no valid line for 5 s".to_owned()).unwrap_err();
        assert!(error.to_string().contains(told), "{error}");
        assert!(!options.file.exists());
    }
}
