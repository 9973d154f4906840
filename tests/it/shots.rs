//! Recording around the valve's closure: each shot in a file of its own, with what came before it.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::Value;
use surgescope::record::health::monitor::{Expected, Monitor};
use surgescope::record::session::output::Summary;
use surgescope::record::session::shots::{Plan, Shots};
use surgescope::record::session::trigger::{Condition, Settings};
use surgescope::recording::{Gap, Recording, RunInfo};
use surgescope::rig::Rig;
use surgescope::storage as log;

use crate::common::{ended, printed, refused, run, text};

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

/// 20 s at 500 Hz: the pressure rises from 300 to 700 kPa at each closure and decays while it rings; a temperature
/// every 4 s.
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
    let play = ["record", "--replay", text(&csv), "--rig", text(&rig), "--speed", "0"];
    ended(run(&[&play[..], more, &["--out-dir", text(&folder.join("shots"))]].concat()))
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
    let text = printed(run(&["inspect", &file]));
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

#[test]
fn a_shot_that_the_end_cuts_short_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [&["--trigger", "edge", "--pre", "0.5", "--post", "3", "--duration", "4"][..], &NOTES].concat();
    let (code, out, err) = record(folder.path(), &arguments);
    assert_eq!(code, 3, "{err}");
    let document: Value = serde_json::from_str(&out).unwrap();
    let cut = &document["cut_short"][0];
    assert!((cut["kept_s"].as_f64().unwrap() - 1.0).abs() < 0.005 && cut["asked_s"] == 3.0, "{out}");
    assert!(cut["file"] == document["shots"][0] && document["data_lost"] == true, "{out}");
    let notes = &shots(&out)[0].1.run.notes;
    assert!(notes.iter().any(|(key, text)| key == "cut_short" && text.contains(" of 3 s after it fired")), "{notes:?}");
}

#[test]
fn a_name_that_is_taken_is_not_overwritten_and_loses_no_shot() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [&["--trigger", "edge", "--pre", "0.5", "--post", "3", "--shots", "1"][..], &NOTES].concat();
    let endings = ["-001.mcap", "-001-2.mcap", "-001-3.mcap"];
    for ending in endings {
        let (code, out, err) = record(folder.path(), &arguments);
        assert_eq!(code, 0, "{err}");
        assert!(shots(&out)[0].0.ends_with(ending), "{out}");
    }
    assert_eq!(fs::read_dir(folder.path().join("shots")).unwrap().count(), 3);
}

#[test]
fn a_folder_that_takes_no_file_is_refused_before_the_valve_closes() {
    let folder = tempfile::tempdir().unwrap();
    let (rig, csv) = series(folder.path());
    for to in [&["--trigger", "edge", "--out-dir", "/proc"][..], &["-o", "/proc/x.mcap"]] {
        let play = ["record", "--replay", text(&csv), "--rig", text(&rig), "--speed", "0"];
        let err = refused(&[&play[..], to].concat(), &["/proc"]);
        assert!(!err.contains("shots of 2 s") && !err.contains("armed"), "{err}");
    }
}

/// Feeds P1 and V1 in batches of 10 ms: the valve closes at 3 s, opens at 8 s and so on; a shot holds 0.5 s before and
/// 1 s after.
struct Bench {
    shots: Shots,
    monitor: Monitor,
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let rig = Rig::from_toml(RIG, "rig.toml").unwrap();
        let trigger = Settings { condition: Condition::Edge, pre_ns: 500_000_000, post_ns: 1_000_000_000 };
        let plan = Plan { trigger, sensor: 1, most: None, folder: folder.path().join("shots") };
        // of T1 nothing is expected
        let expected = [0, 1].map(|sensor| Expected { sensor, device: Some(0), silent_after: None });
        let shots = Shots::new(plan, &rig, &RunInfo::default(), &expected, Duration::from_secs(5));
        Bench { shots, monitor: Monitor::new(&rig, &[]), folder }
    }

    /// The frame `k` of a sensor: 10 samples, 1 ms apart.
    fn frame(&mut self, sensor: usize, k: i64) {
        let value = |i: i64| if sensor == 0 { i as f64 } else { ((i + 2000) / 5000 % 2) as f64 };
        let values: Vec<f64> = (10 * k..10 * k + 10).map(value).collect();
        self.shots.samples(sensor, k * 10_000_000, 1e6, &values).unwrap();
        self.shots.tick(&self.monitor).unwrap();
    }

    /// Both sensors from one frame to another, those of `late` between two frames held back until the second.
    fn run(&mut self, frames: std::ops::Range<i64>, late: usize, held: std::ops::Range<i64>) {
        for k in frames {
            for sensor in [0, 1] {
                if sensor != late || !held.contains(&k) {
                    if sensor == late && k == held.end {
                        held.clone().for_each(|k| self.frame(sensor, k));
                    }
                    self.frame(sensor, k);
                }
            }
        }
    }

    fn finish(self) -> (Summary, Vec<Recording>) {
        let summary = self.shots.finish(Vec::new(), "the test ended".to_owned(), &self.monitor).unwrap();
        let shots = summary.shots.iter().map(|file| log::read(Path::new(file)).unwrap()).collect();
        (summary, shots)
    }
}

#[test]
fn a_device_that_is_held_back_loses_nothing_whichever_it_is() {
    for (late, held) in [(1, 290..410), (0, 350..520), (0, 350..700)] {
        let mut bench = Bench::new();
        bench.run(0..790, late, held.clone());
        let (summary, shots) = bench.finish();
        assert!(!summary.data_lost && shots.len() == 1, "{late} {held:?}: {summary:?}");
        for series in &shots[0].series[..2] {
            assert!(series.value.len() == 1501 && series.gaps.is_empty(), "{late} {held:?}: {}", series.value.len());
        }
        assert_eq!((shots[0].series[0].value[0], shots[0].series[0].time_s[0]), (2500.0, 0.0));
    }
}

#[test]
fn a_device_that_stays_away_does_not_hold_a_shot_open_for_ever_and_leaves_a_gap() {
    let mut bench = Bench::new();
    bench.run(0..795, 0, 350..10_000);
    assert_eq!(bench.shots.view().fired, 1);
    // held for 5 s after the shot's end at 4 s, while the opening at 8 s is a shot of its own
    bench.run(795..910, 0, 350..10_000);
    let file = fs::read_dir(bench.folder.path().join("shots")).unwrap().map(|f| f.unwrap().path()).min().unwrap();
    let first = log::read(&file).expect("closed by now");
    let gap = Gap { from_s: 3.499 - 2.5, to_s: 1.5, samples: None };
    let [found] = first.series[0].gaps[..] else { panic!("{:?}", first.series[0].gaps) };
    assert!((found.from_s - gap.from_s).abs() < 1e-9 && (found.to_s - gap.to_s).abs() < 1e-9, "{found:?}");
    assert_eq!((first.series[0].value.len(), first.series[1].value.len()), (1000, 1501));
    assert!(bench.finish().0.data_lost);
}

#[test]
fn a_folder_that_is_gone_is_made_anew_and_one_that_cannot_be_loses_only_its_shot() {
    let mut bench = Bench::new();
    let (folder, away) = (bench.folder.path().join("shots"), bench.folder.path().join("away"));
    bench.run(0..450, 9, 0..0);
    fs::rename(&folder, &away).unwrap();
    bench.run(450..950, 9, 0..0);
    fs::remove_dir_all(&folder).unwrap();
    fs::write(&folder, "in the way").unwrap();
    bench.run(950..1450, 9, 0..0);
    let lost = bench.shots.view().lost;
    assert!(lost.len() == 1 && lost[0].starts_with("shot 3 could not be written and is lost: "), "{lost:?}");
    fs::remove_file(&folder).unwrap();
    bench.run(1450..1950, 9, 0..0);
    let summary = bench.shots.finish(Vec::new(), "the test ended".to_owned(), &bench.monitor).unwrap();
    assert!(summary.data_lost && summary.shots.len() == 3 && summary.lost_shots == lost, "{summary:?}");
    assert!(summary.shots[2].ends_with("-004.mcap") && Path::new(&summary.shots[2]).is_file(), "{summary:?}");
    assert_eq!(fs::read_dir(&away).unwrap().count(), 1);
}

/// A limit on the size of files is as near to a full disk as a test can come without one: it is full before the
/// trigger's moment.
#[cfg(unix)]
#[test]
fn a_shot_on_a_full_disk_says_why_and_how_much_of_it_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let (rig, csv) = series(folder.path());
    let command = format!(
        "ulimit -f 24; exec '{}' record --json --replay '{}' --rig '{}' --speed 0 --trigger edge --pre 2 --post 3 --out-dir '{}'",
        env!("CARGO_BIN_EXE_surgescope"),
        csv.display(),
        rig.display(),
        folder.path().join("shots").display()
    );
    let output = std::process::Command::new("bash").args(["-c", &command]).output().unwrap();
    let out = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(3), "{out}");
    let document: Value = serde_json::from_str(&out).unwrap();
    let ended = document["ended"].as_str().unwrap();
    assert!(ended.starts_with("the disk takes no more. ") && ended.contains("File too large"), "{ended}");
    let shot = &shots(&out)[0].1.series[0];
    assert!(*shot.time_s.last().unwrap() < 2.0, "the file ends before the trigger fired");
    assert_eq!(document["cut_short"][0]["kept_s"], 0.0, "{out}");
    assert_eq!(document["sensors"][0]["samples"], shot.value.len());
}
