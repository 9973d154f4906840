use crate::storage::fixtures::{assert_same, place, play, recording, rig};
use crate::storage::writer::*;
use crate::storage::{read, recover};

#[test]
fn a_finished_live_recording_reads_as_what_was_played() {
    let (folder, path) = place("run.mcap");
    let recording = recording();
    let run = RunInfo { notes: recording.run.notes[..1].to_vec(), ..recording.run.clone() };
    let mut writer = Writer::create(&path, &recording.rig, &run).unwrap();
    play(&recording, &mut writer).unwrap();
    writer.note("operator", "B").unwrap();
    writer.finish().unwrap();
    assert_same(&read(&path).unwrap(), &recording);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays behind");
}

#[test]
fn blocks_of_a_fast_sensor_keep_its_times() {
    let (_folder, path) = place("run.mcap");
    let mut writer = Writer::create(&path, &rig(), &RunInfo::default()).unwrap();
    let values: Vec<f64> = (0..500).map(f64::from).collect();
    writer.samples(0, 1000, 1e9 / 48_000.0, &values).unwrap();
    writer.samples(1, 0, 1e6, &values).unwrap();
    writer.finish().unwrap();
    let recording = read(&path).unwrap();
    assert_eq!(recording.series[0].value, values);
    assert_eq!(recording.series[0].time_s[48], 0.001_001);
    assert_eq!(recording.series[1].time_s[499], 0.499);
}

#[test]
fn samples_reach_the_system_while_the_recording_runs() {
    let (_folder, path) = place("run.mcap");
    let mut writer = Writer::create(&path, &rig(), &RunInfo::default()).unwrap();
    writer.sample(0, 0, 1.0).unwrap();
    std::thread::sleep(FLUSH_EVERY);
    writer.sample(0, 1_000_000, 2.0).unwrap();
    // As a kill would leave it: nothing is flushed, finished or dropped.
    let out = path.with_file_name("saved.mcap");
    let recovery = recover(&path, &out).unwrap();
    assert!(!recovery.whole);
    assert_eq!(read(&out).unwrap().series[0].value, [1.0, 2.0]);
    drop(writer);
}

#[test]
fn a_writer_dropped_without_an_end_leaves_a_torn_file_with_every_sample() {
    let (_folder, path) = place("run.mcap");
    let recording = recording();
    let mut writer = Writer::create(&path, &recording.rig, &recording.run).unwrap();
    writer.samples(0, 0, 1e6, &[1.0, 2.0, 3.0]).unwrap();
    drop(writer);
    assert!(matches!(read(&path), Err(LogError::Torn(_))));
    let out = path.with_file_name("saved.mcap");
    assert_eq!(recover(&path, &out).unwrap().kept.sensors[0].samples, 3);
}

/// Two stretches of a device's clock, one 100 ppm fast; the other sensor's times stay as they are.
fn on_two_clocks(path: &Path) -> Writer {
    let mut writer = Writer::create(path, &rig(), &RunInfo::default()).unwrap();
    let fix = |from_ns, to_ns| ClockFix { sensors: vec!["P1".into(), "P2".into()], from_ns, to_ns, rate: 1.0001 };
    writer.samples(0, 0, 1e7, &[1.0, 2.0]).unwrap();
    writer.clocks(vec![fix(0, 77)]).unwrap();
    writer.samples(1, 0, 1e4, &[1.0, 2.0, 3.0]).unwrap();
    writer.gap(0, Gap { from_s: 0.01, to_s: 3.0, samples: None }).unwrap();
    for step in 0..10 {
        writer.samples(0, 3_000_000_000 + step * 10_000_000, 1e9, &[3.0]).unwrap();
        writer.samples(2, step, 1e9, &[4.0]).unwrap();
        writer.flush().unwrap();
    }
    writer.clocks(vec![fix(0, 1000), fix(3_000_000_000, 3_500_000_000)]).unwrap();
    writer.flush().unwrap();
    writer
}

#[test]
fn samples_end_on_the_recordings_clock_whether_finished_recovered_or_closed_in_place() {
    let (_folder, path) = place("run.mcap");
    assert!(matches!(on_two_clocks(&path).finish().unwrap(), Ending::Finished(left_out) if left_out.is_empty()));
    let finished = read(&path).unwrap();
    let series = &finished.series[0];
    assert_eq!(series.time_s[..3], [0.000_001, 0.010_002, 3.5]);
    assert_eq!((series.gaps[0].from_s, series.gaps[0].to_s), (0.010_002, 3.5));
    assert_eq!(finished.series[1].time_s, [0.000_001, 0.000_011_001, 0.000_021_002]);
    assert_eq!(finished.series[2].time_s[9], 9e-9);
    let torn = path.with_file_name("torn.mcap");
    drop(on_two_clocks(&torn));
    let recovered = path.with_file_name("recovered.mcap");
    recover(&torn, &recovered).unwrap();
    end_in_place(&mut OpenOptions::new().read(true).write(true).open(&torn).unwrap()).unwrap();
    for other in [recovered, torn] {
        let other = read(&other).unwrap();
        assert_eq!(other.series, finished.series);
    }
}

#[test]
fn samples_that_no_recording_may_hold_are_refused_and_the_others_stay() {
    let (_folder, path) = place("run.mcap");
    let mut writer = Writer::create(&path, &rig(), &RunInfo::default()).unwrap();
    writer.sample(0, 100, 1.0).unwrap();
    for refused in [
        writer.sample(0, 100, 2.0),
        writer.sample(0, 50, 2.0),
        writer.sample(0, 200, f64::NAN),
        writer.samples(0, 200, 0.0, &[1.0, 2.0]),
        writer.samples(0, 200, f64::NAN, &[1.0, 2.0]),
        writer.samples(0, i64::MAX - 5, 1e18, &[1.0, 2.0, 3.0]),
        writer.sample(9, 200, 2.0),
        writer.gap(9, Gap { from_s: 0.0, to_s: 1.0, samples: None }),
        writer.gap(0, Gap { from_s: 0.0, to_s: f64::NAN, samples: None }),
    ] {
        assert!(matches!(refused, Err(LogError::BadSamples { .. })), "{refused:?}");
    }
    writer.sample(0, 300, 3.0).unwrap();
    writer.finish().unwrap();
    assert_eq!(read(&path).unwrap().series[0].value, [1.0, 3.0]);
}

#[test]
fn neither_start_nor_end_touches_a_file_of_someone_else() {
    let (_folder, path) = place("run.mcap");
    std::fs::write(&path, "mine").unwrap();
    assert!(matches!(Writer::create(&path, &rig(), &RunInfo::default()), Err(LogError::Exists(_))));
    std::fs::remove_file(&path).unwrap();
    let mut writer = Writer::create(&path, &rig(), &RunInfo::default()).unwrap();
    writer.sample(0, 0, 1.0).unwrap();
    let moved = path.with_file_name("moved.mcap");
    std::fs::rename(&path, &moved).unwrap();
    std::fs::write(&path, "mine").unwrap();
    let error = writer.finish().unwrap_err();
    assert!(matches!(error, LogError::Gone { .. }) && error.to_string().contains("moved or deleted"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    assert_eq!(recover(&moved, &path.with_file_name("saved.mcap")).unwrap().kept.sensors[0].samples, 1);
}

#[test]
fn of_a_file_that_is_gone_with_its_folder_nothing_is_called_safe() {
    let (folder, _) = place("run.mcap");
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let mut writer = Writer::create(&inner.join("run.mcap"), &rig(), &RunInfo::default()).unwrap();
    writer.sample(0, 0, 1.0).unwrap();
    std::fs::remove_dir_all(&inner).unwrap();
    let error = writer.finish().unwrap_err().to_string();
    assert!(error.contains("moved or deleted") && !error.contains("safe"), "{error}");
}

#[test]
fn a_finished_file_keeps_what_its_windows_say_on_the_recordings_clock() {
    let (_folder, path) = place("run.mcap");
    let mut writer = Writer::create(&path, &rig(), &RunInfo { start_unix_ns: 1 << 60, ..RunInfo::default() }).unwrap();
    let values: Vec<f64> = (0..500).map(f64::from).collect();
    // 0 s to 1 s of a fast and a slow sensor, both logged 0.25 s early
    writer.samples(0, 0, 2e6, &values).unwrap();
    writer.samples(1, 0, 2e7, &values[..50]).unwrap();
    let gap = |from_s: f64, to_s: f64| Gap { from_s, to_s, samples: None };
    [gap(0.0, 0.002), gap(0.1, 0.2), gap(0.9, 0.95)].into_iter().for_each(|gap| writer.gap(0, gap).unwrap());
    writer.samples(2, 0, 2e6, &values).unwrap();
    let sensors = vec!["P1".to_owned(), "P2".to_owned()];
    writer.clocks(vec![ClockFix { sensors, from_ns: 0, to_ns: 250_000_000, rate: 1.0 }]).unwrap();
    [0, 1].into_iter().for_each(|sensor| writer.keep(sensor, 300_000_000, 700_000_000));
    let Ending::Finished(left_out) = writer.finish().unwrap() else { panic!() };
    assert_eq!((left_out.len(), left_out["P1"], left_out["P2"]), (2, (500 - 201, 2), (50 - 20, 0)));
    let series = read(&path).unwrap().series;
    let ends = |i: usize| (series[i].time_s[0], series[i].time_s[series[i].time_s.len() - 1]);
    assert_eq!([ends(0), ends(1), ends(2)], [(0.3, 0.7), (0.31, 0.69), (0.0, 0.998)]);
    assert_eq!((series[0].value[0], series[1].value[0]), (25.0, 3.0));
    assert_eq!(series[0].gaps, [gap(0.35, 0.45)]);
}
