//! What someone relies on who records a live test: every sample right and at its device's time, every hole known, and a
//! file that survives whatever ends the session.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use surgescope::record::RecordError;
use surgescope::record::devices::simulated::{Faults, Playback, Script, Sent, SimulatedDevice};
use surgescope::record::devices::source::Sources;
use surgescope::record::session::live_test::{Options, live_devices, record};
use surgescope::record::session::output::Summary;
use surgescope::record::session::replay::{load, replay};
use surgescope::record::wire::frames::Frame;
use surgescope::recording::{Recording, Series};
use surgescope::rig::{Device, Rig};
use surgescope::storage as log;
use tempfile::TempDir;

use crate::common::surgescope;

pub const PERIOD_NS: u32 = 500_000;
pub const SCALES: [(f64, f64); 3] = [(0.030_518, -100.0), (0.030_518, -100.0), (0.000_01, 0.0)];

pub fn rig_text(protocol: &str) -> String {
    let sensors: String = [("P1", "pressure", "kPa"), ("P2", "pressure", "kPa"), ("Q1", "flow", "L/s")]
        .iter()
        .zip(SCALES)
        .enumerate()
        .map(|(channel, ((name, kind, unit), (scale, offset)))| {
            format!(
                "[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nposition_m = {}.0\nunit = \"{unit}\"\n\
                 device = \"daq\"\nchannel = {channel}\nscale = {scale}\noffset = {offset:?}\n",
                10 * (channel + 1),
            )
        })
        .collect();
    format!(
        "name = \"bench\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n\
         [[pipe]]\nname = \"main\"\nlength_m = 40.0\ninner_diameter_mm = 50.6\nwall_thickness_mm = 6.2\nmaterial = \"HDPE\"\n\
         [upstream]\nkind = \"reservoir\"\n[downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n{sensors}\
         [[device]]\nname = \"daq\"\nport = \"/dev/ttyBENCH\"\nbaud = 921600\nprotocol = \"{protocol}\"\n"
    )
}

pub fn rig() -> Rig {
    Rig::from_toml(&rig_text("frames"), "bench.toml").unwrap()
}

pub fn device() -> Device {
    live_devices(&rig(), &[]).unwrap().remove(0)
}

/// Three different decaying waves around a steady value, `seconds` long at 2 kHz.
pub fn playback(seconds: f64) -> Playback {
    let samples = (seconds * 2000.0) as usize;
    let wave = |steady: f64, height: f64, hertz: f64| {
        let at = |i: usize| i as f64 / 2000.0;
        let value = |t: f64| steady + height * (-0.3 * t).exp() * (std::f64::consts::TAU * hertz * t).sin();
        (0..samples).map(|i| value(at(i))).collect()
    };
    Playback {
        sample_period_ns: PERIOD_NS,
        sensors: vec![(0, wave(300.0, 250.0, 0.9)), (1, wave(200.0, 90.0, 2.7)), (2, wave(0.1, 0.05, 1.1))],
    }
}

/// What the converter makes of sample `index` of a channel.
fn quantised(playback: &Playback, channel: usize, index: usize) -> f64 {
    let (scale, offset) = SCALES[channel];
    scale * ((playback.sensors[channel].1[index] - offset) / scale).round() + offset
}

/// Plays through a pseudo-terminal and records it, in this process.
fn record_playback(playback: &Playback, speed: f64, faults: Faults, options: &Options) -> (Summary, Sent) {
    let rig = rig();
    let mut simulated = SimulatedDevice::open().unwrap();
    let device = device().on_pseudoterminal(simulated.path().to_str().unwrap());
    let sources = Sources::open(&rig, std::slice::from_ref(&device), false).unwrap();
    let script = Script::new(playback, &rig, &device).unwrap();
    assert_eq!(script.clipped, 0);
    simulated.start(script, speed, faults).unwrap();
    let summary = record(&rig, &sources, options, &AtomicBool::new(false), &mut |_| {}).unwrap();
    (summary, simulated.stop().unwrap())
}

/// Sample numbers by the device's clock; fails where a time is not on it.
fn indices(series: &Series) -> Vec<usize> {
    let period = i64::from(PERIOD_NS);
    let number = |time_s: &f64| {
        let time_ns = (time_s * 1e9).round() as i64;
        assert_eq!(time_ns % period, 0, "{time_s} s is no time of the device");
        (time_ns / period) as usize
    };
    series.time_s.iter().map(number).collect()
}

/// Every sample is the one that was played at its time, and every hole is a gap, nothing else is. Returns the samples
/// of each channel.
pub fn check(recording: &Recording, playback: &Playback) -> Vec<usize> {
    assert_eq!(recording.series.len(), 3);
    for (channel, series) in recording.series.iter().enumerate() {
        let indices = indices(series);
        assert_eq!(indices.first(), Some(&0));
        for (&index, &value) in indices.iter().zip(&series.value) {
            let expected = quantised(playback, channel, index);
            assert!((value - expected).abs() < 1e-9, "channel {channel}, sample {index}: {value} for {expected}");
        }
        let holes: Vec<_> = indices.windows(2).filter(|pair| pair[1] != pair[0] + 1).collect();
        assert_eq!(holes.len(), series.gaps.len());
        for (hole, gap) in holes.iter().zip(&series.gaps) {
            let time_s = |index: usize| (index as u64 * u64::from(PERIOD_NS)) as f64 / 1e9;
            assert!(
                (gap.from_s - time_s(hole[0])).abs() < 1e-9 && (gap.to_s - time_s(hole[1])).abs() < 1e-9,
                "{gap:?}"
            );
            assert_eq!(gap.samples, Some((hole[1] - hole[0] - 1) as u64));
        }
    }
    recording.series.iter().map(|series| series.value.len()).collect()
}

#[test]
fn every_sample_arrives_with_its_value_and_its_devices_time() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.mcap");
    let playback = playback(2.0);
    let (summary, sent) = record_playback(&playback, 4.0, Faults::default(), &Options::new(&file));
    let recording = log::read(&file).unwrap();
    assert_eq!(check(&recording, &playback), [4000; 3]);
    assert_eq!(summary.duration_s, 2.0);
    assert!(!summary.data_lost);
    assert_eq!(summary.ended, "the device hung up");
    assert_eq!(sent, Sent { frames: 200, ..Sent::default() });
    let device = &summary.devices[0];
    assert_eq!((device.frames, device.bad_frames, device.lost_frames, device.duplicated_frames), (200, 0, 0, 0));
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_nanos() as u64;
    let age_s = now.saturating_sub(recording.run.start_unix_ns) as f64 / 1e9;
    assert!((0.2..60.0).contains(&age_s), "the run started {age_s} s ago");
    assert!(recording.run.notes.contains(&("daq.frames".into(), "200".into())), "{:?}", recording.run.notes);
}

#[test]
fn on_a_bad_line_every_recorded_sample_is_right_and_every_hole_is_a_gap() {
    let folder = TempDir::new().unwrap();
    for seed in 1..=3 {
        let file = folder.path().join(format!("run{seed}.mcap"));
        let playback = playback(20.0);
        let faults = Faults {
            flip: 0.01,
            drop: 0.02,
            duplicate: 0.01,
            noise: 0.01,
            cut: 0.01,
            crc: 0.01,
            seed,
            ..Faults::default()
        };
        let (summary, sent) = record_playback(&playback, 0.0, faults, &Options::new(&file));
        assert!(sent.flipped > 5 && sent.dropped > 15 && sent.duplicated > 5, "too few faults to test: {sent:?}");
        assert!(sent.noisy > 5 && sent.cut > 5 && sent.wrong_crc > 5, "too few faults to test: {sent:?}");
        let missing = sent.harmed();
        let device = &summary.devices[0];
        assert_eq!(device.frames, sent.frames - missing);
        assert_eq!(device.bad_frames, sent.bad_pieces);
        assert_eq!(device.lost_frames, missing);
        assert_eq!(device.duplicated_frames, sent.duplicated);
        assert!(summary.data_lost);
        let samples = check(&log::read(&file).unwrap(), &playback);
        assert_eq!(samples, [40_000 - 20 * missing as usize; 3]);
        assert!(summary.sensors.iter().zip(samples).all(|(sensor, samples)| sensor.samples == samples as u64));
    }
}

#[test]
fn the_duration_is_kept_to_the_sample() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.mcap");
    // played as fast as it goes
    let options = Options { duration_s: Some(0.7775), real_time: false, ..Options::new(&file) };
    let (summary, _) = record_playback(&playback(2.0), 0.0, Faults::default(), &options);
    assert_eq!(summary.sensors.iter().map(|s| s.samples).collect::<Vec<_>>(), [1555; 3]);
    assert_eq!(summary.duration_s, 0.7775);
    assert_eq!(summary.ended, "the duration was reached");
}

#[test]
fn a_silent_device_and_one_that_speaks_something_else_leave_no_file() {
    let folder = TempDir::new().unwrap();
    let rig = rig();
    let options = Options { silence: Duration::from_millis(200), ..Options::new(folder.path().join("run.mcap")) };
    let record = |sources: Sources| record(&rig, &sources, &options, &AtomicBool::new(false), &mut |_| {}).unwrap_err();
    let error = record(Sources::reading(&device(), std::io::empty()).unwrap());
    assert!(matches!(&error, RecordError::Silent { .. }), "{error}");
    let error = record(Sources::reading(&device(), std::io::Cursor::new("12,3.4,5.6\n".repeat(100))).unwrap());
    assert!(matches!(&error, RecordError::NoFrame { bytes: 1100, .. }), "{error}");
    assert!(!options.file.exists());
}

#[test]
fn a_sensor_on_a_channel_that_the_device_lacks_is_an_error() {
    let folder = TempDir::new().unwrap();
    let rig = rig();
    let two = surgescope::record::wire::frames::Frame::new(0, 0, PERIOD_NS, 2, vec![1, 2]).unwrap();
    let sources = Sources::reading(&device(), std::io::Cursor::new(two.encode())).unwrap();
    let options = Options::new(folder.path().join("run.mcap"));
    let error = record(&rig, &sources, &options, &AtomicBool::new(false), &mut |_| {}).unwrap_err().to_string();
    assert!(error.contains("'Q1'") && error.contains("channel 2") && error.contains("2 channels"), "{error}");
    assert!(!options.file.exists());
}

#[test]
fn a_replayed_recording_holds_the_same_samples_and_gaps() {
    let folder = TempDir::new().unwrap();
    let (file, again) = (folder.path().join("run.mcap"), folder.path().join("again.mcap"));
    let faults = Faults { drop: 0.05, seed: 4, ..Faults::default() };
    record_playback(&playback(4.0), 0.0, faults, &Options::new(&file));
    let original = load(&file, None, &[]).unwrap();
    assert!(!original.series[0].gaps.is_empty());
    let summary =
        replay(&original, "run.mcap", 0.0, &Options::new(&again), &AtomicBool::new(false), &mut |_| {}).unwrap();
    let replayed = log::read(&again).unwrap();
    assert_eq!(replayed.series, original.series);
    assert_eq!(replayed.run.start_unix_ns, original.run.start_unix_ns);
    assert_eq!(summary.duration_s, 4.0);
    assert!(!summary.data_lost, "what the original lacks was not lost on the way");
}

/// A rig file, the arguments of a recorder on it, and a place for its file.
struct Bench {
    folder: TempDir,
    rig: PathBuf,
    file: PathBuf,
}

impl Bench {
    fn new(protocol: &str) -> Bench {
        let folder = TempDir::new().unwrap();
        let (rig, file) = (folder.path().join("rig.toml"), folder.path().join("run.mcap"));
        std::fs::write(&rig, rig_text(protocol)).unwrap();
        Bench { folder, rig, file }
    }

    fn recorder(&self, more: &[&str]) -> Command {
        let mut command = surgescope(["record", "--json", "--rig"]);
        command.arg(&self.rig).arg("-o").arg(&self.file).args(more);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// A recorder process on a simulated device that plays a minute in real time, after it has recorded for a while.
    fn running(&self, playback: &Playback) -> (Child, SimulatedDevice) {
        let mut simulated = SimulatedDevice::open().unwrap();
        let port = format!("daq={}", simulated.path().display());
        let child = self.recorder(&["--port", &port]).spawn().unwrap();
        let rig = rig();
        let script = Script::new(playback, &rig, &device()).unwrap();
        simulated.start(script, 1.0, Faults::default()).unwrap();
        let started = std::time::Instant::now();
        while !self.file.exists() {
            assert!(started.elapsed() < Duration::from_secs(20), "the recorder made no file");
            thread::sleep(Duration::from_millis(10));
        }
        thread::sleep(Duration::from_secs(1));
        (child, simulated)
    }
}

fn json(output: &Output) -> serde_json::Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}\n{}", String::from_utf8_lossy(&output.stderr)))
}

/// tools/recorder/kills.py does this 200 times, and measures the loss against the clock.
#[test]
fn a_recorder_killed_at_any_moment_leaves_what_it_had_recorded() {
    let playback = playback(60.0);
    let mut dice = fastrand::Rng::with_seed(11);
    for _ in 0..4 {
        let bench = Bench::new("frames");
        let (mut child, _simulated) = bench.running(&playback);
        thread::sleep(Duration::from_micros(dice.u64(..100_000)));
        child.kill().unwrap(); // SIGKILL
        child.wait().unwrap();
        let whole = bench.folder.path().join("whole.mcap");
        log::recover(&bench.file, &whole).unwrap();
        let samples = check(&log::read(&whole).unwrap(), &playback);
        assert!(samples.iter().all(|&count| count >= 1000), "of a second were saved: {samples:?}");
    }
}

#[test]
fn sigterm_ends_the_recording_with_a_whole_file() {
    let bench = Bench::new("frames");
    let playback = playback(60.0);
    let (child, _simulated) = bench.running(&playback);
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let samples = check(&log::read(&bench.file).unwrap(), &playback);
    assert!(samples[0] >= 1000, "{samples:?}");
    let summary = json(&output);
    assert_eq!(summary["file"], bench.file.to_str().unwrap());
    assert!((summary["duration_s"].as_f64().unwrap() - samples[0] as f64 * 0.0005).abs() < 1e-9);
    let sensor = |name: &str, samples: usize| serde_json::json!({"name": name, "samples": samples, "gaps": 0});
    let expected = serde_json::json!([sensor("P1", samples[0]), sensor("P2", samples[1]), sensor("Q1", samples[2])]);
    assert_eq!(summary["sensors"], expected);
    let device = &summary["devices"][0];
    assert_eq!((&device["name"], &device["bad_frames"], &device["lost_frames"]), (&"daq".into(), &0.into(), &0.into()));
    assert_eq!(device["frames"].as_u64(), Some(samples[0] as u64 / 20));
}

#[test]
fn an_existing_file_is_refused_and_left_alone() {
    let bench = Bench::new("frames");
    std::fs::write(&bench.file, "a recording that took a day").unwrap();
    let output = bench.recorder(&["--port", "daq=/dev/null"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("never overwritten"));
    assert!(output.stdout.is_empty());
    assert_eq!(std::fs::read_to_string(&bench.file).unwrap(), "a recording that took a day");
}

#[test]
fn what_cannot_be_recorded_is_said_before_anything_is_written() {
    for (protocol, more, said) in [
        ("frames", &[][..], "/dev/ttyBENCH of device 'daq' does not exist"),
        ("frames", &["--port", "dag=/dev/null"], "--port names 'dag'"),
        ("frames", &["--speed", "2"], "--replay"),
        ("frames", &["--simulate", "--faults", "flop=1"], "unknown fault 'flop'"),
        ("frames", &["--simulate", "--faults", "echo=true"], "only a device that is asked for its values"),
    ] {
        let bench = Bench::new(protocol);
        let output = bench.recorder(more).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(said), "{stderr}");
        assert!(!bench.file.exists());
    }
}

#[test]
fn a_csv_is_played_at_the_asked_pace() {
    let bench = Bench::new("frames");
    let csv = bench.folder.path().join("run.csv");
    let rows: String = (0..=2000).map(|i| format!("{:.4},{}.5,{}\n", f64::from(i) * 0.0005, i, 2 * i)).collect();
    std::fs::write(&csv, format!("time_s,P1,P2\n{rows}")).unwrap();
    let started = std::time::Instant::now();
    let output =
        bench.recorder(&["--replay", csv.to_str().unwrap(), "--speed", "2", "--without", "Q1"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(started.elapsed() >= Duration::from_millis(500), "1 s at double speed in {:?}", started.elapsed());
    assert_eq!(json(&output)["sensors"][0]["samples"], 2001);
    let (rig, columns) = (rig(), log::ImportOptions { without: vec!["Q1".into()], ..Default::default() });
    assert_eq!(log::read(&bench.file).unwrap().series, log::import_csv_with(&csv, &rig, &columns).unwrap().series);
}

#[test]
fn a_stop_flag_ends_a_slow_replay_at_once() {
    let folder = TempDir::new().unwrap();
    let (file, again) = (folder.path().join("run.mcap"), folder.path().join("again.mcap"));
    record_playback(&playback(1.0), 0.0, Faults::default(), &Options::new(&file));
    let original = load(&file, Some(&rig()), &[]).unwrap();
    let stop = AtomicBool::new(false);
    let started = std::time::Instant::now();
    let summary = thread::scope(|scope| {
        scope.spawn(|| {
            thread::sleep(Duration::from_millis(200));
            stop.store(true, Ordering::Relaxed);
        });
        replay(&original, "run.mcap", 0.001, &Options::new(&again), &stop, &mut |_| {}).unwrap()
    });
    assert_eq!(summary.ended, "stopped by the user");
    assert!(started.elapsed() < Duration::from_secs(5), "{:?}", started.elapsed());
    assert!(log::read(&again).is_ok());
}

/// Messages have nowhere to go: a pipe that nobody reads any more, a disk that is full.
#[test]
fn a_recording_goes_on_when_standard_error_does_not() {
    let simulate = ["--simulate", "--speed", "0", "--duration", "8"];
    let finished = |name: &str, bench: &Bench, output: Output| {
        assert_eq!(output.status.code(), Some(0), "standard error {name}");
        let recording = log::read(&bench.file).unwrap();
        assert_eq!(recording.series[0].value.len(), 8000, "standard error {name}");
        assert_eq!(json(&output)["sensors"][0]["samples"], 8000);
    };

    let bench = Bench::new("frames");
    let mut child = bench.recorder(&simulate).spawn().unwrap();
    drop(child.stderr.take());
    finished("closed", &bench, child.wait_with_output().unwrap());

    if let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") {
        let bench = Bench::new("frames");
        finished("full", &bench, bench.recorder(&simulate).stderr(full.try_clone().unwrap()).output().unwrap());
        let refused = bench.recorder(&simulate).stderr(full).status().unwrap();
        assert_eq!(refused.code(), Some(2), "the exit code holds without its message");
    }
}

#[test]
fn a_simulated_test_too_long_for_memory_is_refused_before_it_takes_any() {
    for more in [&["--rate", "1e9", "--duration", "3600"][..], &["--duration", "1e12"], &["--rate", "1e300"]] {
        let bench = Bench::new("frames");
        let output = bench.recorder(&[&["--simulate"], more].concat()).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains("GiB; shorten the duration or lower the rate"), "{stderr}");
        assert!(!bench.file.exists());
    }
}

/// The same device through a restart: samples of its second life stand where they were taken, behind a gap.
#[test]
fn a_restart_is_a_gap_and_what_follows_is_recorded() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.mcap");
    let playback = playback(6.0);
    let faults = Faults { reset: 0.003, stall: 0.003, seed: 2, ..Faults::default() };
    let (summary, sent) = record_playback(&playback, 1.0, faults, &Options::new(&file));
    assert!(sent.resets >= 1 && sent.stalls >= 1, "{sent:?}");
    assert_eq!(summary.devices[0].restarts, sent.resets, "{sent:?} {:?}", summary.devices[0]);
    let recording = log::read(&file).unwrap();
    let series = &recording.series[0];
    assert_eq!(series.gaps.len() as u64, sent.resets);
    assert_eq!(series.value.len() as u64, 12_000 - 20 * sent.reset_frames);
    assert!(summary.data_lost);
    // Between gaps every sample follows the one before it; a gap skips as many as the restart took.
    let times = &series.time_s;
    let mut index = 0;
    for (at, value) in series.value.iter().enumerate() {
        if at > 0 && series.gaps.iter().any(|gap| gap.to_s == times[at]) {
            index += 400; // 0.2 s
            let skipped_s = times[at] - times[at - 1];
            assert!((skipped_s - 0.2005).abs() < 0.02, "{skipped_s} s");
        }
        assert!((value - quantised(&playback, 0, index)).abs() < 1e-9, "sample {index} at {} s", times[at]);
        index += 1;
    }
}

/// Says its pieces, each at its time, s.
struct Told(std::vec::IntoIter<(f64, Vec<u8>)>, std::time::Instant);

impl std::io::Read for Told {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let Some((at_s, bytes)) = self.0.next() else { return Ok(0) };
        thread::sleep(Duration::from_secs_f64(at_s).saturating_sub(self.1.elapsed()));
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }
}

/// Records what a device says; pieces with their times, s.
fn told(protocol: &str, pieces: Vec<(f64, Vec<u8>)>, file: &Path) -> (Summary, Recording) {
    let rig = Rig::from_toml(&rig_text(protocol), "bench.toml").unwrap();
    let device = live_devices(&rig, &[]).unwrap().remove(0);
    let reader = Told(pieces.into_iter(), std::time::Instant::now());
    let sources = Sources::reading(&device, reader).unwrap();
    let options = Options { duration_s: Some(30.0), ..Options::new(file) };
    let summary = record(&rig, &sources, &options, &AtomicBool::new(false), &mut |_| {}).unwrap();
    (summary, log::read(file).unwrap())
}

/// Frame `index` of a device at 1 kHz, ten samples that count on.
fn counting(sequence: u16, first_us: u64, index: i16) -> Vec<u8> {
    let counts = (0..10).flat_map(|i| [10 * index + i; 3]).collect();
    Frame::new(sequence, first_us, 1_000_000, 3, counts).unwrap().encode()
}

/// A 64-bit clock read in halves: one time stamp is 2^32 µs ahead, far behind the duration's end.
#[test]
fn one_wrong_time_stamp_costs_nothing() {
    let folder = TempDir::new().unwrap();
    let torn = |index: u64| if index == 40 { 1 << 32 } else { 0 };
    let frame = |index: u64| counting(index as u16, index * 10_000 + torn(index), index as i16);
    let pieces = (0..100).map(|index| (index as f64 * 0.01, frame(index))).collect();
    let (summary, recording) = told("frames", pieces, &folder.path().join("run.mcap"));
    let series = &recording.series[0];
    assert_eq!((series.value.len(), series.gaps.len()), (1000, 0));
    let off = |(index, time_s): (usize, &f64)| (time_s - index as f64 / 1e3).abs();
    assert!(series.time_s.iter().enumerate().all(|sample| off(sample) < 1e-9));
    let device = &summary.devices[0];
    assert_eq!((device.frames, device.bad_frames, device.restamped_frames), (100, 0, 1), "{device:?}");
}

/// The new clock reads later than the last sample: the arrivals tell, and with frames the sequence.
#[test]
fn a_restart_with_a_clock_that_reads_later_is_noticed() {
    let folder = TempDir::new().unwrap();
    // 1 s of it, then a hole of 1.5 s, of which the device's clock shows 0.5 s
    let time_us = |index: u64| 10_000 * index + if index < 100 { 200_000 } else { 700_000 };
    let at_s = |index: u64| index as f64 * 0.01 + if index < 100 { 0.0 } else { 1.5 };
    let frame =
        |index: u64| counting(if index < 100 { index } else { index - 100 } as u16, time_us(index), index as i16);
    let line = |index: u64| format!("{},{index},0,0\n", time_us(index)).into_bytes();
    let frames = (0..200).map(|index| (at_s(index), frame(index))).collect();
    let lines = (0..200).map(|index| (at_s(index), line(index))).collect();
    for (protocol, pieces) in [("frames", frames), ("lines", lines)] {
        let (summary, recording) = told(protocol, pieces, &folder.path().join(protocol));
        let series = &recording.series[0];
        let device = &summary.devices[0];
        assert_eq!((device.restarts, device.lost_frames), (1, 0), "{device:?}");
        assert_eq!(series.gaps.len(), 1);
        let hole_s = series.gaps[0].to_s - series.gaps[0].from_s;
        assert!((hole_s - 1.5).abs() < 0.1, "{protocol}: {hole_s} s");
    }
}

/// A converter that prints nan for one sensor still measures with the others.
#[test]
fn a_line_with_a_nan_keeps_the_other_sensors() {
    let folder = TempDir::new().unwrap();
    let line = |index: u64| match index {
        10..15 => format!("{},nan,{index},{index}\n", 10_000 * index).into_bytes(),
        _ => format!("{},{index},{index},{index}\n", 10_000 * index).into_bytes(),
    };
    let pieces = (0..30).map(|index| (index as f64 * 0.01, line(index))).collect();
    let (summary, recording) = told("lines", pieces, &folder.path().join("run.mcap"));
    // the first line may be the rest of one
    let counts: Vec<_> = recording.series.iter().map(|series| (series.value.len(), series.gaps.len())).collect();
    assert_eq!(counts, [(24, 1), (29, 0), (29, 0)]);
    let gap = recording.series[0].gaps[0];
    assert!((gap.to_s - gap.from_s - 0.06).abs() < 1e-9, "{gap:?}");
    assert!(summary.data_lost);
}
