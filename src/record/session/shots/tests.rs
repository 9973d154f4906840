//! Shots whose memory is small.

use crate::record::session::shots::*;
use crate::storage as log;

const MS: i64 = 1_000_000;

/// Frame `k` of a sensor: ten samples at 1 kHz, of the first their numbers, of the second 600 from 3 s on.
fn frame(shots: &mut Shots, monitor: &Monitor, sensor: usize, k: i64) {
    let value = |i: i64| if sensor == 0 { i as f64 } else { 600.0 * f64::from(u8::from(i >= 3000)) };
    let values: Vec<f64> = (10 * k..10 * k + 10).map(value).collect();
    shots.samples(sensor, 10 * k * MS, 1e6, &values).unwrap();
    shots.tick(monitor).unwrap();
}

/// The trigger's sensor comes 3.3 s late, and there is room for 3 s of the other: the shot reports what had to go for
/// it as missing.
#[test]
fn what_there_is_no_memory_for_is_a_gap_of_the_shot() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::from_toml(include_str!("../../../../rigs/demo-hdpe.toml"), "demo.toml").unwrap();
    let monitor = Monitor::new(&rig, &[]);
    let batch = Batch { sensor: 0, first_ns: 0, period_ns: 0.0, values: vec![0.0; 10] };
    // 150 of the trigger's own, as it must keep 0.5 s before a shot and 1 s of margin
    for (room, missing_s) in [(150 + 300, 0.6), (150 + 1000, 0.0)] {
        let trigger = Settings { condition: Condition::Level(500.0), pre_ns: 500 * MS, post_ns: 1000 * MS };
        let plan = Plan { trigger, sensor: 1, most: Some(1), folder: folder.path().join(format!("{room}")) };
        let expected = [0, 1].map(|sensor| Expected { sensor, device: Some(sensor), silent_after: None });
        let mut shots = Shots::new(plan, &rig, &RunInfo::default(), &expected, Duration::from_secs(30));
        shots.kept = Kept::new(rig.sensors.len(), room * batch.bytes());
        (0..290).for_each(|k| [0, 1].into_iter().for_each(|sensor| frame(&mut shots, &monitor, sensor, k)));
        (290..620).for_each(|k| frame(&mut shots, &monitor, 0, k));
        (290..620).for_each(|k| frame(&mut shots, &monitor, 1, k));
        let summary = shots.finish(Vec::new(), "the test ended".to_owned(), &monitor).unwrap();
        let shot = log::read(Path::new(&summary.shots[0])).unwrap();
        let series = &shot.series[0];
        let first = (series.time_s[0], series.value[0]);
        assert!((first.0 - missing_s).abs() < 0.05 && (first.1 - 2500.0 - 1e3 * first.0).abs() < 1e-6, "{first:?}");
        assert_eq!((series.time_s.last(), shot.series[1].value.len()), (Some(&1.5), 1501));
        assert_eq!(summary.data_lost, missing_s > 0.0, "{summary:?}");
        assert_eq!(series.gaps.len(), usize::from(missing_s > 0.0), "{:?}", series.gaps);
        let is_before_it = |gap: &Gap| gap.from_s.abs() < 1e-9 && (gap.to_s - first.0).abs() < 1e-9;
        assert!(series.gaps.iter().all(is_before_it), "{:?}", series.gaps);
    }
}
