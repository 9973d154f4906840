//! Recording around the valve's closure: each shot in a file of its own, with what came before it.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;
use surgescope::log;
use surgescope::recording::Recording;

const RIG: &str = r#"
name = "bench 3"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 80.0
inner_diameter_mm = 30.0
wall_thickness_mm = 2.0
material = "copper"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.03
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 80.0
unit = "kPa"
[[sensor]]
name = "V1"
kind = "trigger"
position_m = 80.0
unit = "1"
[[sensor]]
name = "T1"
kind = "temperature"
position_m = 0.0
unit = "degC"
"#;

/// Closures of the valve, s; it opens again 2 s later.
const CLOSURES: [f64; 3] = [3.0, 9.0, 15.0];

/// 20 s at 500 Hz: the pressure rises from 300 to 700 kPa at each closure and decays while it rings; a temperature every 4 s.
fn series(folder: &Path) -> (PathBuf, PathBuf) {
    let mut csv = String::from("time_s,P1,V1,T1\n");
    for i in 0..10_000 {
        let t = f64::from(i) / 500.0;
        let since = CLOSURES.iter().map(|c| t - c).filter(|s| *s >= 0.0).fold(f64::INFINITY, f64::min);
        let ringing = (-3.0 * since).exp() * (12.0 * since).cos();
        let pressure = 300.0 + if since.is_finite() { 400.0 * ringing } else { 0.0 };
        let temperature = if i % 2000 == 0 { format!("{:.2}", 20.0 + t / 10.0) } else { String::new() };
        let _ = writeln!(csv, "{t:.3},{pressure:.3},{},{temperature}", u8::from(since < 2.0));
    }
    let (rig, file) = (folder.join("rig.toml"), folder.join("run.csv"));
    fs::write(&rig, RIG).unwrap();
    fs::write(&file, csv).unwrap();
    (rig, file)
}

fn record(folder: &Path, more: &[&str]) -> (i32, String, String) {
    let (rig, csv) = series(folder);
    let mut command = Command::cargo_bin("surgescope").unwrap();
    command.arg("record").arg("--replay").arg(csv).arg("--rig").arg(rig).args(["--speed", "0"]).args(more);
    let output = command.arg("--out-dir").arg(folder.join("shots")).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn shots(out: &str) -> Vec<(String, Recording)> {
    let document: Value = serde_json::from_str(out).unwrap();
    let files = document["shots"].as_array().unwrap().iter().map(|f| f.as_str().unwrap().to_owned());
    files.map(|f| (f.clone(), log::read(Path::new(&f)).unwrap())).collect()
}

/// Each shot holds the time around its closure, all sensors of it, and the notes.
fn assert_shots(shots: &[(String, Recording)], closures: &[f64], pre: f64, post: f64) {
    assert_eq!(shots.len(), closures.len());
    for (i, ((file, shot), closure)) in shots.iter().zip(closures).enumerate() {
        assert!(file.contains("bench-3-") && file.ends_with(&format!("-{:03}.mcap", i + 1)), "{file}");
        let pressure = &shot.series[0];
        let (first, last) = (pressure.time_s[0], *pressure.time_s.last().unwrap());
        assert!(first.abs() < 0.0021 && (last - (pre + post)).abs() < 0.0021, "{first} {last}");
        assert_eq!(pressure.time_s.len(), (500.0 * (pre + post)).round() as usize + 1);
        let rises = pressure.value.windows(2).position(|w| w[1] - w[0] > 300.0).unwrap();
        assert!((pressure.time_s[rises + 1] - pre).abs() < 0.0021, "the rise stands at {}", pressure.time_s[rises + 1]);
        let temperature = &shot.series[2];
        let expected = 20.0 + (4.0 * (closure / 4.0).floor()) / 10.0;
        assert!((temperature.value[0] - expected).abs() < 1e-6, "the last temperature before: {temperature:?}");
        let note = |key: &str| shot.run.notes.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str());
        assert_eq!((note("operator"), note("ambient")), (Some("Ada"), Some("12 degC")));
        assert_eq!(note("shot"), Some((i + 1).to_string().as_str()));
    }
}

const NOTES: [&str; 5] = ["--operator", "Ada", "--note", "ambient=12 degC", "--json"];

#[test]
fn the_edge_of_the_valves_command_cuts_out_each_closure() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, err) =
        record(folder.path(), &[&["--trigger", "edge", "--pre", "0.5", "--post", "3"][..], &NOTES].concat());
    assert_eq!(code, 0, "{err}");
    assert_shots(&shots(&out), &CLOSURES, 0.5, 3.0);
    let file = shots(&out)[0].0.clone();
    let inspected = Command::cargo_bin("surgescope").unwrap().args(["inspect", &file]).output().unwrap();
    let text = String::from_utf8(inspected.stdout).unwrap();
    assert!(text.contains("note operator") && text.contains("Ada"), "{text}");
}

#[test]
fn level_and_slope_fire_on_the_rise_and_not_on_the_ringing() {
    for trigger in ["level=500", "slope=5000"] {
        let folder = tempfile::tempdir().unwrap();
        let arguments = [&["--trigger", trigger, "--pre", "0.8", "--post", "2", "--shots", "2"][..], &NOTES].concat();
        let (code, out, err) = record(folder.path(), &arguments);
        assert_eq!(code, 0, "{trigger}: {err}");
        assert_shots(&shots(&out), &CLOSURES[..2], 0.8, 2.0);
        assert!(out.contains("all shots were recorded"), "{out}");
    }
}

#[test]
fn a_trigger_that_cannot_work_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = record(folder.path(), &["--trigger", "level=5", "--trigger-sensor", "P9"]);
    assert!(code == 2 && err.contains("no sensor 'P9'") && err.contains("P1, V1, T1"), "{err}");
    let (code, _, err) = record(folder.path(), &["--trigger", "rise"]);
    assert!(code == 2 && err.contains("edge, level=V or slope=V"), "{err}");
    assert!(!folder.path().join("shots").exists());
}
