//! NI TDMS, against what npTDMS wrote and read back (tools/tdms_fixture.py), and files made by hand.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use surgescope::log::foreign::{ForeignOptions, decode_foreign, read_foreign};

use super::{Bench, mended};

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

#[test]
fn every_channel_has_the_times_and_scaled_values_that_nptdms_reads() {
    let file = read_foreign(&here("tests/fixtures/nptdms.tdms"), &ForeignOptions::default()).unwrap();
    let expected: Value = serde_json::from_slice(&fs::read(here("tests/fixtures/nptdms.json")).unwrap()).unwrap();
    assert_eq!(file.tracks.len(), 4, "{:?}", file.tracks.iter().map(|t| &t.name).collect::<Vec<_>>());
    for track in &file.tracks {
        let channel = &expected[&track.short];
        let (value, time_s) = (numbers(&channel["value"]), numbers(&channel["time_s"]));
        assert_eq!(track.series.value.len(), value.len(), "{}", track.name);
        for (i, (a, b)) in track.series.value.iter().zip(&value).enumerate() {
            assert!((a - b).abs() <= 1e-12 * b.abs().max(1.0), "{} {i}: {a} is not {b}", track.name);
        }
        for (a, b) in track.series.time_s.iter().zip(&time_s) {
            assert!((a - b).abs() < 1e-9, "{}: {a} s is not {b} s", track.name);
        }
    }
    let unit = |name: &str| file.tracks.iter().find(|t| t.short == name).unwrap().unit.clone();
    assert_eq!((unit("P1"), unit("P2"), unit("T1")), (Some("kPa".into()), Some("bar".into()), Some("degC".into())));
    // 2026-03-14T09:26:53.25Z
    assert_eq!(file.start.unwrap().unix_ns, 1_773_480_413_250_000_000);
    assert!(file.notes.contains(&("Operator".into(), "A. Joukowsky".into())), "{:?}", file.notes);
}

#[test]
fn channels_become_sensors_by_name_by_map_and_in_the_sensors_unit() {
    let bench = Bench::new(&[
        ("P1", "pressure", "bar", ""),
        ("PX", "pressure", "bar", "position_m = 60.0"),
        ("Valve", "trigger", "1", ""),
    ]);
    bench.put("run.tdms", fs::read(here("tests/fixtures/nptdms.tdms")).unwrap());
    bench.refuses(&["run.tdms"], &["no column for the pressure sensor 'PX'"]);
    let (document, _) = bench.import(0, &["run.tdms", "--map", "/'Fast ''piezo'''/'P2'=PX"]);
    assert!(mended(&document, "left-out")["text"].as_str().unwrap().contains("/'Slow'/'T1'"));
    assert!(mended(&document, "unit")["text"].as_str().unwrap().contains("from kPa to bar"));
    let recording = bench.recording();
    // the first count is -3000: 0.02 × -3000 + 450 kPa
    assert!((recording.series[0].value[0] - 3.9).abs() < 1e-12);
    assert_eq!(recording.series[2].value.iter().filter(|v| **v == 1.0).count(), 60);
}

#[test]
fn interleaved_big_endian_and_cut_off_segments_are_read() {
    for (name, p1, p2, cut) in [
        ("little-contiguous", 6, 6, false),
        ("big-interleaved", 6, 6, false),
        ("little-interleaved-cut", 5, 5, true),
        ("big-contiguous-cut", 6, 5, true),
    ] {
        let path = here(&format!("tools/fuzz/corpus/tdms/{name}.tdms"));
        let file = read_foreign(&path, &ForeignOptions::default()).unwrap();
        let ramp = |n: usize, step: f64| (0..n).map(|i| i as f64 * step).collect::<Vec<_>>();
        let values: Vec<&Vec<f64>> = file.tracks.iter().map(|t| &t.series.value).collect();
        assert_eq!(values, [&ramp(p1, 1.0), &ramp(p2, 0.5)], "{name}");
        assert_eq!(file.tracks[0].series.time_s[2], 0.002, "{name}");
        assert_eq!(file.mended.iter().any(|m| m.what == "cut-off" && m.lost), cut, "{name}");
    }
}

#[test]
fn what_cannot_be_read_is_refused_in_words() {
    let whole = fs::read(here("tests/fixtures/nptdms.tdms")).unwrap();
    let read = |bytes: &[u8]| decode_foreign(bytes, Path::new("run.tdms"), &ForeignOptions::default());
    let mut daqmx = whole.clone();
    daqmx[4] |= 0x80;
    assert!(read(&daqmx).unwrap_err().to_string().contains("run.tdms: it holds raw DAQmx data"));
    let mut damaged = whole.clone();
    let second = whole.windows(4).enumerate().filter(|(_, w)| w == b"TDSm").nth(1).unwrap().0;
    damaged[second] = b'X';
    assert!(read(&damaged).unwrap_err().to_string().contains(&format!("no segment begins at byte {second}")));
    assert!(read(b"TDSh").unwrap_err().to_string().contains("name the .tdms file"));
    let mut strange = whole;
    let at = strange.windows(6).position(|w| w == b"Linear").unwrap();
    strange[at..at + 6].copy_from_slice(b"Teapot");
    assert!(read(&strange).unwrap_err().to_string().contains("scale 'Teapot' is not known"));
}
