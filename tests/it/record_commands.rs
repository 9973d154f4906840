//! What someone relies on whose device is a program: the same as of a serial line, and that the program ends with the
//! recorder, comes back after it died, and never stands with a sample at a wrong time.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::{Duration, Instant};

use surgescope::record::devices::simulated::{Faults, Script, SimulatedDevice};
use surgescope::record::devices::source::Sources;
use surgescope::record::session::live_test::{Options, live_devices, record};
use surgescope::recording::Recording;
use surgescope::rig::Rig;
use surgescope::storage as log;
use tempfile::TempDir;

use crate::common::surgescope;
use crate::record_live::{SCALES, check, playback, rig_text};

/// A folder with a rig file whose device is a command.
pub struct Bench {
    pub folder: TempDir,
    pub rig: PathBuf,
    pub file: PathBuf,
}

impl Bench {
    /// `source` is what stands in `[[device]]` in place of port and baud.
    pub fn new(protocol: &str, source: &str) -> Bench {
        let folder = TempDir::new().unwrap();
        let (rig, file) = (folder.path().join("rig.toml"), folder.path().join("run.mcap"));
        let bench = Bench { folder, rig, file };
        bench.write(protocol, source);
        bench
    }

    pub fn write(&self, protocol: &str, source: &str) {
        let serial = "port = \"/dev/ttyBENCH\"\nbaud = 921600\n";
        let text = rig_text(protocol);
        assert!(text.contains(serial));
        std::fs::write(&self.rig, text.replace(serial, &format!("{source}\n"))).unwrap();
    }

    /// A shell script as the command.
    fn script(protocol: &str, text: &str) -> Bench {
        let bench = Bench::new(protocol, "command = [\"sh\", \"daq.sh\"]");
        std::fs::write(bench.folder.path().join("daq.sh"), text).unwrap();
        bench
    }

    fn recorder(&self, more: &[&str]) -> Command {
        let mut command = surgescope(["record", "--json", "--rig"]);
        command.arg(&self.rig).arg("-o").arg(&self.file).args(more);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn read(&self) -> Recording {
        log::read(&self.file).unwrap()
    }

    /// Waits until the command has written a file, and takes its number.
    fn number(&self, name: &str) -> i32 {
        let path = self.path(name);
        until("the command writes its number", || std::fs::read_to_string(&path).ok()?.trim().parse().ok())
    }
}

/// Asks until there is an answer.
fn until<T>(what: &str, ask: impl Fn() -> Option<T>) -> T {
    let started = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(started.elapsed() < Duration::from_secs(30), "{what}: not within 30 s");
        thread::sleep(Duration::from_millis(10));
    }
}

fn lives(process: i32) -> bool {
    let state = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // one that nobody has buried yet is dead all the same
    state.rsplit(')').next().and_then(|rest| rest.trim().chars().next()).is_some_and(|state| state != 'Z')
}

fn gone(process: i32) {
    until("a process ends", || (!lives(process)).then_some(()));
}

fn json(output: &Output) -> serde_json::Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}\n{}", String::from_utf8_lossy(&output.stderr)))
}

fn signal(child: &Child, signal: &str) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

/// The command hands on what a simulated device sends, through every fault that a serial line has.
#[test]
fn a_command_is_recorded_as_a_serial_line_is() {
    for (seed, speed, faults) in [
        (0, 4.0, Faults::default()),
        (
            1,
            0.0,
            Faults { flip: 0.01, drop: 0.02, duplicate: 0.01, noise: 0.01, cut: 0.01, crc: 0.01, ..Faults::default() },
        ),
    ] {
        let played = playback(if seed == 0 { 2.0 } else { 20.0 });
        let mut line = SimulatedDevice::open().unwrap();
        let bench =
            Bench::script("frames", &format!("echo ready >&2; cat {} 2>/dev/null || true", line.path().display()));
        let rig = Rig::load(&bench.rig).unwrap();
        let devices = live_devices(&rig, &[]).unwrap();
        let sources = Sources::open(&rig, &devices, true).unwrap();
        let script = Script::new(&played, &rig, &devices[0]).unwrap();
        line.start(script, speed, Faults { seed, ..faults }).unwrap();
        let (options, stop) = (Options::new(&bench.file), AtomicBool::new(false));
        let summary = record(&rig, &sources, &options, &stop, &mut |_| {}).unwrap();
        let sent = line.stop().unwrap();
        let samples = check(&bench.read(), &played);
        let device = &summary.devices[0];
        assert_eq!((device.reconnects, summary.ended.as_str()), (0, "the command has ended"));
        assert_eq!(device.stderr, ["ready"]);
        if seed == 0 {
            assert_eq!((samples, device.frames, summary.data_lost), (vec![4000; 3], 200, false), "{device:?}");
        } else {
            assert!(sent.flipped > 5 && sent.dropped > 15, "too few faults to test: {sent:?}");
            assert!(summary.data_lost && device.bad_frames > 0 && device.lost_frames > 0, "{device:?}");
        }
    }
}

#[test]
fn the_first_line_counts_and_what_it_says_is_kept() {
    let bench = Bench::script(
        "lines",
        "echo in $(basename $(pwd)) >&2; sleep 0.3; for i in 1 2 3 4; do echo ${i}000,$i,2,3; done; sleep 0.3",
    );
    let output = bench.recorder(&[]).current_dir("/").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let recording = bench.read();
    assert_eq!(recording.series[0].time_s, [0.0, 0.001, 0.002, 0.003]);
    let summary = json(&output);
    let said = format!("in {}", bench.folder.path().file_name().unwrap().to_str().unwrap());
    assert_eq!(summary["devices"][0]["stderr"], serde_json::json!([said]), "in the rig file's folder");
    let note = recording.run.notes.iter().find(|(key, _)| key == "daq.stderr").expect("a note");
    assert!(note.1.ends_with(&said) && note.1.starts_with("at "), "{note:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains(&format!("daq says: {said}")), "live, too");
    assert!(recording.run.source.contains("by the command `sh daq.sh`"), "{}", recording.run.source);
}

/// Each life prints the time of day as its values, and dies; what is recorded of it stands where it was taken.
#[test]
fn a_command_that_dies_ten_times_leaves_ten_gaps_and_no_sample_at_a_wrong_time() {
    let life = "n=$(cat lives 2>/dev/null || echo 0); echo $((n + 1)) >lives\n\
                start=$(date +%s%N); i=0\n\
                while [ $i -lt 15 ] || [ $n -eq 10 ]; do\n\
                now=$(date +%s%N); echo $(((now - start) / 1000)),$((now / 1000 % 100000000000)),$i,$n; sleep 0.01; i=$((i + 1)); done\n\
                case $((n % 3)) in 0) exit 1 ;; 1) kill -9 $$ ;; 2) printf '99,'; exit 3 ;; esac\n";
    let bench = Bench::script("lines", life);
    let child = bench.recorder(&[]).spawn().unwrap();
    until("the eleventh life", || (std::fs::read_to_string(bench.path("lives")).ok()?.trim() == "11").then_some(()));
    thread::sleep(Duration::from_millis(600));
    signal(&child, "-INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    let device = &json(&output)["devices"][0];
    assert_eq!((device["reconnects"].as_u64(), device["restarts"].as_u64()), (Some(10), Some(10)), "{device}");
    // three lines are cut off by the end of a life; on a loaded machine one may come so late that nothing confirms its
    // time
    let unconfirmed = device["bad_frames"].as_u64().unwrap() - 3;
    assert!(unconfirmed <= 15, "{device}");
    let recording = bench.read();
    let series = &recording.series[0];
    let lives: Vec<f64> = recording.series[2].value.iter().map(|value| (value / SCALES[2].0).round()).collect();
    let mut ends = 0;
    for (at, life) in lives.iter().enumerate().skip(1) {
        let is_gap = series.gaps.iter().any(|gap| gap.to_s == series.time_s[at] && gap.from_s == series.time_s[at - 1]);
        let is_end = *life != lives[at - 1];
        ends += usize::from(is_end);
        // a shell that was held up on a loaded machine has left a hole of its own
        let paused = series.time_s[at] - series.time_s[at - 1] > 0.015;
        assert!(is_gap == is_end || (is_gap && paused), "sample {at}: {is_gap}, {is_end}");
    }
    assert_eq!(ends, 10);
    let sent = lives.iter().filter(|life| **life < 10.0).count() as u64;
    assert!((150 - unconfirmed..=150).contains(&sent), "{sent} of 150: all that each life sent");
    let (scale, offset) = SCALES[0];
    let start_us = recording.run.start_unix_ns as f64 / 1e3 % 1e11;
    let off_s = |(time_s, value): (&f64, &f64)| time_s - ((value - offset) / scale - start_us) / 1e6;
    let mut off: Vec<f64> = series.time_s.iter().zip(&series.value).map(off_s).collect();
    off.sort_by(f64::total_cmp);
    let (least, most) = (off[0], off[off.len() - 1]);
    // what a process needs to print a line, on a loaded machine
    assert!(least > -0.01 && most < 0.2, "samples stand {least} to {most} s off their time");
}

/// Two processes: the one that sends, and one that it left behind.
const FAMILY: &str = "sleep 1000 & echo $! >child; echo $$ >pid; exec cat ";

#[test]
fn a_recorder_killed_at_any_moment_leaves_what_it_had_recorded_and_no_process() {
    let played = playback(60.0);
    let mut dice = fastrand::Rng::with_seed(12);
    for _ in 0..4 {
        let mut line = SimulatedDevice::open().unwrap();
        let bench = Bench::script("frames", &format!("{FAMILY}{}", line.path().display()));
        let mut child = bench.recorder(&[]).spawn().unwrap();
        let processes = [bench.number("pid"), bench.number("child")];
        let rig = Rig::load(&bench.rig).unwrap();
        line.start(Script::new(&played, &rig, &live_devices(&rig, &[]).unwrap()[0]).unwrap(), 1.0, Faults::default())
            .unwrap();
        until("the recorder makes a file", || bench.file.exists().then_some(()));
        thread::sleep(Duration::from_micros(1_000_000 + dice.u64(..100_000)));
        child.kill().unwrap(); // SIGKILL
        child.wait().unwrap();
        let whole = bench.path("whole.mcap");
        log::recover(&bench.file, &whole).unwrap();
        let samples = check(&log::read(&whole).unwrap(), &played);
        assert!(samples.iter().all(|&count| count >= 1000), "of a second were saved: {samples:?}");
        processes.into_iter().for_each(gone);
    }
}

#[test]
fn the_command_ends_with_the_session_by_force_if_it_must() {
    // the first ends itself when it is asked to, the second does not listen
    let polite = "trap 'echo asked >end; exit 0' TERM\n";
    for (what, asked) in [(polite, true), ("trap '' TERM\n", false)] {
        let text = format!(
            "{what}sleep 1000 & echo $! >child; echo $$ >pid\ni=0; while :; do echo ${{i}}000,1,2,3; i=$((i + 10)); sleep 0.01; done"
        );
        let bench = Bench::script("lines", &text);
        let child = bench.recorder(&[]).spawn().unwrap();
        until("the recorder makes a file", || bench.file.exists().then_some(()));
        let processes = [bench.number("pid"), bench.number("child")];
        let started = Instant::now();
        signal(&child, "-TERM");
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(started.elapsed() < Duration::from_secs(20), "{:?}", started.elapsed());
        assert_eq!(bench.path("end").exists(), asked);
        processes.into_iter().for_each(gone);
        assert!(bench.read().series[0].value.len() > 1);
    }
}

/// Mistakes of a person at the rig, and the messages that answer them. Nothing is written.
#[test]
fn a_command_that_cannot_be_recorded_says_why() {
    let refused = |source: &str, more: &[&str], said: &[&str]| {
        let bench = Bench::new("lines", source);
        for (name, text, mode) in
            [("plain.py", "print(1)", 0o644), ("bare", "print(1)", 0o755), ("odd", "#!/usr/bin/nopython\n", 0o755)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            std::fs::write(bench.path(name), text).unwrap();
            std::fs::set_permissions(bench.path(name), std::fs::Permissions::from_mode(mode)).unwrap();
        }
        let output = bench.recorder(more).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{source}: {stderr}");
        assert!(said.iter().all(|said| stderr.contains(said)), "{source}: {stderr}");
        assert!(output.stdout.is_empty() && !bench.file.exists(), "{source}");
    };
    let sh = |text: &str| format!("command = [\"sh\", \"-c\", '{text}']");
    refused(
        "command = [\"nosuch\"]",
        &[],
        &["program 'nosuch' of device 'daq' is not found", "nor in the rig file's folder"],
    );
    refused("command = [\"bare\"]", &[], &["is called \"./bare\""]);
    refused("command = [\"./plain.py\"]", &[], &["not executable", "chmod +x"]);
    refused("command = [\"./bare\"]", &[], &["cannot be started", "#!/usr/bin/env python3"]);
    refused("command = [\"./odd\"]", &[], &["the interpreter that its first line names is not there"]);
    refused(
        &sh("echo no driver >&2; exit 1"),
        &[],
        &["sent nothing (the command exited with code 1; its last words: no driver)", "by itself"],
    );
    refused(&sh("kill -9 $$"), &[], &["the command was killed by signal 9"]);
    refused(
        &sh("echo usage: daq; exit 1"),
        &["--silence", "1"],
        &["sent ", "bytes but nothing valid", "prints on its standard output"],
    );
    refused(&sh("sleep 60"), &["--silence", "1"], &["sent nothing (no valid line for 1 s)", "flush"]);
    refused("command = [\"true\"]", &["--port", "daq=/dev/ttyUSB0"], &["the speed of /dev/ttyUSB0 is not known"]);
}

/// Whoever writes a flood of messages loses some of them, and no sample.
#[test]
fn a_flood_of_messages_costs_no_sample() {
    let text = "i=0; while [ $i -lt 20000 ]; do echo $((i * 100)),1,2,3; echo message $i >&2; i=$((i + 1)); done";
    let bench = Bench::script("lines", text);
    let output = bench.recorder(&[]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let recording = bench.read();
    assert_eq!((recording.series[0].value.len(), recording.series[0].gaps.len()), (20_000, 0));
    let notes: Vec<&str> =
        recording.run.notes.iter().filter(|(key, _)| key == "daq.stderr").map(|(_, text)| text.as_str()).collect();
    assert!(notes.len() <= 201 && notes.iter().any(|note| note.ends_with("lines left out)")), "{notes:?}");
}

/// `ports` says whether a command is there; it does not start it.
#[test]
fn ports_looks_a_command_up_and_does_not_start_it() {
    let bench = Bench::script("lines", "touch started");
    let checked = surgescope(["rig", "check", "--json"]).arg(&bench.rig).output().unwrap();
    assert!(matches!(checked.status.code(), Some(0 | 1)), "{}", String::from_utf8_lossy(&checked.stderr));
    let ports = |bench: &Bench| surgescope(["ports", "--json", "--rig"]).arg(&bench.rig).output().unwrap();
    let output = ports(&bench);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(json(&output)["devices"], serde_json::json!([{"name": "daq", "port": "sh daq.sh", "problem": null}]));
    bench.write("lines", "command = [\"./daq\"]");
    let output = ports(&bench);
    assert_eq!(output.status.code(), Some(1));
    assert!(json(&output)["devices"][0]["problem"].as_str().unwrap().contains("'./daq' of device 'daq' is not found"));
    assert!(!bench.path("started").exists());
}

/// Simulated devices stand in for all devices of a rig: nothing is started.
#[test]
fn a_simulated_test_starts_no_command() {
    let bench = Bench::script("frames", "touch started");
    let output = bench.recorder(&["--simulate", "--speed", "0", "--duration", "2"]).output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(bench.read().series[0].value.len() > 1000 && !bench.path("started").exists());
}

/// A rig that came with a recording, by mail say, names a command and has no folder on this computer.
#[test]
fn a_rig_that_did_not_come_from_a_file_starts_nothing() {
    let bench = Bench::script("lines", "touch started");
    let text = std::fs::read_to_string(&bench.rig).unwrap();
    let rig = Rig::from_toml(&text, "attached").unwrap();
    let error = Sources::open(&rig, &live_devices(&rig, &[]).unwrap(), true).unwrap_err().to_string();
    assert!(error.contains("did not come from a rig file") && error.contains("`sh daq.sh`"), "{error}");
    assert!(!Path::new("started").exists() && !bench.path("started").exists());
}
