//! NI TDMS, against what npTDMS wrote and read back (tools/tdms_fixture.py), and files made by hand.

use std::fs;
use std::path::Path;

use serde_json::Value;
use surgescope::storage::import::{SourceOptions, decode_source, read_source};

use super::{Bench, mended};
use crate::common::here;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

#[test]
fn every_channel_has_the_times_and_scaled_values_that_nptdms_reads() {
    let file = read_source(&here("tests/fixtures/nptdms.tdms"), &SourceOptions::default()).unwrap();
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
        let file = read_source(&path, &SourceOptions::default()).unwrap();
        let ramp = |n: usize, step: f64| (0..n).map(|i| i as f64 * step).collect::<Vec<_>>();
        let values: Vec<&Vec<f64>> = file.tracks.iter().map(|t| &t.series.value).collect();
        assert_eq!(values, [&ramp(p1, 1.0), &ramp(p2, 0.5)], "{name}");
        assert_eq!(file.tracks[0].series.time_s[2], 0.002, "{name}");
        assert_eq!(file.repairs.iter().any(|m| m.what == "cut-off" && m.lost), cut, "{name}");
    }
}

#[test]
fn what_cannot_be_read_is_refused_in_words() {
    let whole = fs::read(here("tests/fixtures/nptdms.tdms")).unwrap();
    let read = |bytes: &[u8]| decode_source(bytes, Path::new("run.tdms"), &SourceOptions::default());
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

#[test]
fn what_is_no_number_and_what_lies_between_stretches_is_a_gap() {
    let bench = Bench::new(&[("P1", "pressure", "kPa", "")]);
    bench.put("run.tdms", fs::read(here("tests/fixtures/nptdms-stretches.tdms")).unwrap());
    // of the groups' channels of one name, the one that is named
    let (document, err) = bench.import(3, &["run.tdms", "--map", "/'A'/'P1'=P1"]);
    assert_eq!(mended(&document, "no-number")["count"], 3);
    assert!(err.contains("3 values of /'A'/'P1' are no numbers: recorded as gaps"), "{err}");
    let p1 = bench.recording().series.remove(0);
    let gaps: Vec<_> = p1.gaps.iter().map(|g| (g.from_s, g.to_s, g.samples)).collect();
    assert_eq!((p1.value.len(), gaps), (47, vec![(0.0, 0.01, Some(1)), (0.06, 0.09, Some(2))]));

    let (document, _) = bench.import(0, &["run.tdms", "--map", "/'B'/'P1'=P1"]);
    assert_eq!(mended(&document, "stretches")["count"], 1);
    let recording = bench.recording();
    // 2026-03-14T09:26:53.25Z, the first stretch's
    assert_eq!(recording.run.start_unix_ns, 1_773_480_413_250_000_000);
    let p1 = &recording.series[0];
    assert_eq!(
        (p1.value.len(), p1.value[59], p1.time_s[49], p1.time_s[50], p1.time_s[59]),
        (60, 59.0, 0.49, 10.0, 10.18)
    );
    assert_eq!((p1.gaps.len(), p1.gaps[0].from_s, p1.gaps[0].to_s), (1, 0.49, 10.0));
    bench.refuses(&["run.tdms"], &["/'A'/'P1'' and '/'B'/'P1'' are both the sensor 'P1'"]);
    // said late, or corrected behind the last value: of all values
    for (group, last_s) in [("C", 0.08), ("D", 0.16)] {
        bench.import(0, &["run.tdms", "--map", &format!("/'{group}'/'P1'=P1")]);
        let p1 = bench.recording().series.remove(0);
        assert_eq!((p1.value.len(), p1.gaps.len()), (9, 0), "{group}");
        // up to 10 s behind the other groups, by their starts
        assert!((p1.time_s[8] - p1.time_s[0] - last_s).abs() < 1e-9, "{group} {:?}", p1.time_s);
    }
}

#[test]
fn a_rate_counts_where_the_file_states_no_times() {
    let bench = Bench::new(&[("P1", "pressure", "kPa", "")]);
    bench.put("run.tdms", fs::read(here("tests/fixtures/nptdms-rates.tdms")).unwrap());
    let last_s = |bench: &Bench| bench.recording().series[0].time_s[99];
    let of = |group: &str| format!("/'{group}'/'P1'=P1");
    // what has no times is named, with the option that gives them, and lost
    let (document, _) = bench.import(3, &["run.tdms", "--yes", "--map", &of("B")]);
    assert!((last_s(&bench) - 99.0 / 500.0).abs() < 1e-12, "the stated rate");
    let not_read = mended(&document, "not-read")["text"].as_str().unwrap();
    assert!(
        ["/'A'/'P1' (100 numbers without times)", "/'D'/'Remark'", "--rate"].iter().all(|w| not_read.contains(w)),
        "{not_read}"
    );
    bench.import(0, &["run.tdms", "--yes", "--map", &of("B"), "--ignore", "/'A'/'P1'"]);
    // the rate of the user counts there, and only there
    bench.import(0, &["run.tdms", "--yes", "--map", &of("A"), "--rate", "50"]);
    assert!((last_s(&bench) - 99.0 / 50.0).abs() < 1e-12);
    bench.import(0, &["run.tdms", "--yes", "--map", &of("B"), "--rate", "50"]);
    assert!((last_s(&bench) - 99.0 / 500.0).abs() < 1e-12);
    // several times in one group
    bench.refuses(&["run.tdms", "--map", &of("C")], &["the times of /'C'/'P1' are /'C'/'Time 1'", "--yes"]);
    for (channel, last) in [("P1", 0.099), ("P2", 0.396)] {
        bench.import(3, &["run.tdms", "--yes", "--map", &format!("/'C'/'{channel}'=P1")]);
        assert!((last_s(&bench) - last).abs() < 1e-12, "{channel}");
    }
    let alone = fs::read(here("tools/fuzz/corpus/tdms/little-contiguous.tdms")).unwrap();
    let mut without = alone.clone();
    let mut from = 0;
    while let Some(at) = without[from..].windows(12).position(|w| w == b"wf_increment") {
        without[from + at..from + at + 12].copy_from_slice(b"no_increment");
        from += at + 12;
    }
    bench.put("none.tdms", &without);
    bench.refuses(&["none.tdms", "--yes"], &["neither wf_increment nor a time channel", "--rate"]);
    bench.import(0, &["none.tdms", "--yes", "--rate", "10", "--map", "P2=P1"]);
    assert_eq!(bench.recording().series[0].time_s[1], 0.1);
}
