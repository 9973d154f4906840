//! What a shot lacks of a device, said.

use crate::record::session::live_test::tests::*;
use crate::record::session::output::Absent;
use crate::rig::TimeUnit;

/// A shot of A (frames) from 2 s to 5 s of its clock, beside a B that speaks `lines` at these moments, ms; the line of
/// moment 0 is the rest of one. Samples of B are its moments.
fn beside_a_logger(moments_ms: &[i64]) -> (Summary, Recording) {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = rig("frames");
    rig.devices[1].protocol = Protocol::Lines { time_unit: TimeUnit::default() };
    let line = |ms: &i64| (ms * MS, 1, format!("{},{ms}\n", 1000 * (ms + 7_000_000)).into_bytes());
    let messages = sent(0, 14, 3000, on_time).chain([0].iter().chain(moments_ms).map(line)).collect();
    let summary = played_on(&rig, &shots(folder.path(), 1), messages);
    assert_eq!((summary.shots.len(), summary.ended.as_str()), (1, "all shots were recorded"), "{summary:?}");
    let shot = log::read(Path::new(&summary.shots[0])).unwrap();
    (summary, shot)
}

/// The shot names what it lacks at its beginning, or wholly: a gap from one time to another, s.
fn assert_lacks(moments_ms: &[i64], from_s: f64, to_s: f64) {
    let (summary, shot) = beside_a_logger(moments_ms);
    assert!(summary.data_lost, "{moments_ms:?}: {summary:?}");
    let [gap] = shot.series[1].gaps[..] else { panic!("{moments_ms:?}: {:?}", shot.series[1].gaps) };
    assert!((gap.from_s - from_s).abs() < 0.03 && (gap.to_s - to_s).abs() < 0.03, "{moments_ms:?}: {gap:?}");
    let whole = to_s - from_s == 3.0;
    let note = shot.run.notes.iter().find(|(key, _)| key == "absent").map(|(_, text)| text.as_str());
    let (file, sensors) = (summary.shots[0].clone(), vec!["P2".to_owned()]);
    assert_eq!(summary.absent, if whole { vec![Absent { file, sensors }] } else { Vec::new() });
    assert_eq!(note.is_some_and(|text| text.starts_with("P2: ")), whole, "{note:?}");
    let gaps: Vec<(&str, u64)> = summary.sensors.iter().map(|sensor| (sensor.name.as_str(), sensor.gaps)).collect();
    assert_eq!(gaps, [("P1", 0), ("P2", 1)]);
    assert_eq!(shot.series[1].value.is_empty(), whole);
}

/// One line says nothing of how many values a line has, so it is held back: the shot waits for the second, and then
/// says that it was missing.
#[test]
fn a_logger_whose_second_line_comes_late_is_waited_for_and_then_said_to_be_missing() {
    let (summary, shot) = beside_a_logger(&[3500, 8500]);
    assert!(!summary.data_lost && summary.absent.is_empty(), "{summary:?}");
    assert_eq!((&shot.series[1].value[..], shot.series[1].gaps.len()), (&[3500.0][..], 0));
    assert!((shot.series[1].time_s[0] - 1.5).abs() < 0.03, "{:?}", shot.series[1].time_s);
    assert_lacks(&[3500, 13_500], 0.0, 3.0);
}

#[test]
fn a_device_that_has_never_spoken_when_a_shot_ends_is_said_to_be_missing() {
    assert_lacks(&[], 0.0, 3.0);
    let late: Vec<i64> = (0..50).map(|i| 7000 + 20 * i).collect();
    assert_lacks(&late, 0.0, 3.0);
    let soon: Vec<i64> = (0..50).map(|i| 5200 + 20 * i).collect();
    assert_lacks(&soon, 0.0, 3.0);
}

#[test]
fn a_device_that_begins_within_a_shot_leaves_a_gap_before_it() {
    let begins: Vec<i64> = (0..400).map(|i| 3500 + 20 * i).collect();
    assert_lacks(&begins, 0.0, 1.5);
    // less than its rhythm
    let slow: Vec<i64> = (0..10).map(|i| 2900 + 1000 * i).collect();
    let (summary, shot) = beside_a_logger(&slow);
    assert!(!summary.data_lost && shot.series[1].value == [2900.0, 3900.0, 4900.0], "{summary:?}");
}

/// What is bad between shots is nobody's loss.
#[test]
fn a_bad_line_outside_of_every_shot_costs_nothing() {
    for (bad_ms, lost) in [(200, false), (3100, true)] {
        let folder = tempfile::tempdir().unwrap();
        let mut rig = rig("frames");
        rig.devices[1].protocol = Protocol::Lines { time_unit: TimeUnit::default() };
        let line = |ms: i64| {
            let text = if ms == bad_ms { "4x\n".to_owned() } else { format!("{},{ms}\n", 1000 * (ms + 7_000_000)) };
            (ms * MS, 1, text.into_bytes())
        };
        let messages = sent(0, 8, 3000, on_time).chain((0..400).map(|i| line(20 * i))).collect();
        let summary = played_on(&rig, &shots(folder.path(), 1), messages);
        assert_eq!((summary.shots.len(), summary.devices[1].bad_frames), (1, 1), "{summary:?}");
        let gaps = log::read(Path::new(&summary.shots[0])).unwrap().series[1].gaps.len();
        assert_eq!((summary.data_lost, gaps), (lost, usize::from(lost)), "{bad_ms}: {summary:?}");
    }
}

/// Its last sample says how it stood, and the shot reports that nothing more came.
#[test]
fn a_device_that_died_before_a_shot_is_absent_from_it() {
    let dies: Vec<i64> = (0..40).map(|i| 20 * i).collect();
    let (summary, shot) = beside_a_logger(&dies);
    assert!(summary.data_lost && shot.series[1].value == [780.0], "{summary:?}");
    assert_eq!(summary.absent.iter().map(|absent| &absent.sensors[..]).collect::<Vec<_>>(), [["P2".to_owned()]]);
}

/// B begins 2 s after A, which is more than its rhythm.
#[test]
fn a_device_that_begins_after_the_recording_leaves_a_gap_before_it() {
    for (begins, late) in [(200, true), (50, false)] {
        let folder = tempfile::tempdir().unwrap();
        let options = Options { duration_s: Some(5.0), ..Options::new(folder.path().join("run.mcap")) };
        let later = |index: i64| (on_time(index).0, on_time(index + begins).1);
        let summary = played(&options, sent(0, 9, 0, on_time).chain(sent(1, 9, 0, later)).collect());
        let device = &summary.devices[1];
        assert_eq!(
            (device.began_late_s.is_some(), device.incomplete, summary.data_lost),
            (late, false, late),
            "{summary:?}"
        );
        let recording = log::read(&options.file).unwrap();
        let gaps: Vec<bool> = recording.series[1]
            .gaps
            .iter()
            .map(|gap| gap.from_s.abs() < 0.002 && (gap.to_s - 2.0).abs() < 0.002)
            .collect();
        assert_eq!(gaps, if late { vec![true] } else { vec![] }, "{:?}", recording.series[1].gaps);
    }
}
