//! A rig and recordings for the tests of this module.

use std::path::PathBuf;

use tempfile::TempDir;

use crate::recording::{Gap, Recording, RunInfo, Series};
use crate::rig::Rig;
use crate::storage::error::LogError;
use crate::storage::writer::Writer;

/// Two pressure sensors, a flow meter and a thermometer.
pub fn rig() -> Rig {
    let sensors =
        [("P1", "pressure", "kPa"), ("P2", "pressure", "bar"), ("Q1", "flow", "L/s"), ("T1", "temperature", "degC")];
    let mut text = r#"name = "bench"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 50.0
inner_diameter_mm = 20.0
wall_thickness_mm = 2.0
material = "copper"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.1
"#
    .to_string();
    for (name, kind, unit) in sensors {
        text += &format!("[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nposition_m = 10.0\nunit = \"{unit}\"\n");
    }
    Rig::from_toml(&text, "bench.toml").unwrap()
}

/// A recording of a few samples: a fast and a slow sensor, a gap, a sensor without any.
pub fn recording() -> Recording {
    let fast = Series {
        time_s: (0..40).filter(|i| !(10..15).contains(i)).map(|i| f64::from(i) / 1000.0).collect(),
        value: (0..35).map(|i| 400.0 + f64::from(i) * 0.1).collect(),
        gaps: vec![Gap { from_s: 0.009, to_s: 0.015, samples: Some(5) }],
    };
    let slow = Series { time_s: vec![0.0, 0.02], value: vec![4.5, -0.0], gaps: vec![] };
    let run = RunInfo {
        start_unix_ns: 1_700_000_000_000_000_000,
        source: "test".into(),
        program: "surgescope test".into(),
        notes: vec![("operator".into(), "A".into()), ("operator".into(), "B".into())],
        csv: None,
    };
    Recording { rig: rig(), series: vec![fast, slow.clone(), slow, Series::default()], run }
}

/// A folder of its own, and the path of a file in it.
pub fn place(name: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    (folder, path)
}

/// Writes a recording's samples the live way: by time, flushed after every tenth.
pub fn play(recording: &Recording, writer: &mut Writer) -> Result<(), LogError> {
    let ns = |s: f64| (s * 1e9).round() as i64;
    let mut samples = Vec::new();
    for (sensor, series) in recording.series.iter().enumerate() {
        for gap in &series.gaps {
            writer.gap(sensor, *gap)?;
        }
        samples.extend(series.time_s.iter().zip(&series.value).map(|(&t, &v)| (ns(t), sensor, v)));
    }
    samples.sort_by_key(|(t, ..)| *t);
    for (i, (time_ns, sensor, value)) in samples.into_iter().enumerate() {
        writer.sample(sensor, time_ns, value)?;
        if i % 10 == 9 {
            writer.flush()?;
        }
    }
    writer.flush()
}

/// Asserts that two recordings are the same, bit by bit.
pub fn assert_same(a: &Recording, b: &Recording) {
    assert_eq!(a.rig.source, b.rig.source);
    assert_eq!(a.run, b.run);
    assert_eq!(a.series.len(), b.series.len());
    for (a, b) in a.series.iter().zip(&b.series) {
        let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(a.time_s, b.time_s);
        assert_eq!(bits(&a.value), bits(&b.value));
        assert_eq!(a.gaps, b.gaps);
    }
}
