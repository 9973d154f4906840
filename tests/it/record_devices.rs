//! What someone relies on whose rig has several devices: each speaks its own protocol, may misbehave, vanish and come
//! back, and all of them end up on one clock in one whole file.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use surgescope::record::RecordError;
use surgescope::record::devices::simulated::{Faults, Playback, Script, Sent, SimulatedDevice};
use surgescope::record::devices::source::Sources;
use surgescope::record::session::live_test::{Options, live_devices, record};
use surgescope::record::session::output::Summary;
use surgescope::recording::Series;
use surgescope::rig::{Device, Rig};
use surgescope::storage as log;
use tempfile::TempDir;

use crate::common::surgescope;

const PERIOD_NS: u32 = 1_000_000;

/// P1 and P2 by frames, P3 by lines, Q1 and T1 in registers of the same shape: a late answer for one would fit the
/// other.
fn rig_text(timeout_s: f64) -> String {
    let sensor = |name: &str, kind: &str, unit: &str, wiring: &str| {
        format!("[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nposition_m = 10.0\nunit = \"{unit}\"\n{wiring}\n")
    };
    let polled =
        |address: u16| format!("device = \"plc\"\nchannel = {address}\nencoding = \"i32\"\nword_order = \"little\"");
    [
        "name = \"bench\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = 40.0\n\
         inner_diameter_mm = 50.6\nwall_thickness_mm = 6.2\nmaterial = \"HDPE\"\n[upstream]\nkind = \"reservoir\"\n\
         [downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n"
            .to_owned(),
        sensor("P1", "pressure", "kPa", "device = \"daq\"\nchannel = 0"),
        sensor("P2", "pressure", "kPa", "device = \"daq\"\nchannel = 1"),
        sensor("P3", "pressure", "kPa", "device = \"logger\"\nchannel = 0\nscale = 0.5"),
        sensor("Q1", "flow", "L/s", &polled(10)),
        sensor("T1", "temperature", "degC", &polled(20)),
        "[[device]]\nname = \"daq\"\nport = \"/dev/none0\"\nbaud = 921600\nprotocol = \"frames\"\n\
         [[device]]\nname = \"logger\"\nport = \"/dev/none1\"\nbaud = 115200\nprotocol = \"lines\"\n\
         [[device]]\nname = \"plc\"\nport = \"/dev/none2\"\nbaud = 19200\nprotocol = \"modbus-rtu\"\n\
         poll_interval_s = 0.02\n"
            .to_owned(),
        format!("timeout_s = {timeout_s}\n"),
    ]
    .concat()
}

fn rig() -> Rig {
    Rig::from_toml(&rig_text(0.03), "bench.toml").unwrap()
}

/// What sensor `index` shows at row `row`: its own ramp, so that a value tells whose it is and when it was.
fn value(index: usize, row: usize) -> f64 {
    match index {
        0..2 => (row % 20_000) as f64 - 10_000.0 * index as f64,
        2 => row as f64 * 0.5,
        _ => (1_000_000 * index + row) as f64,
    }
}

fn playback(rig: &Rig, device: &Device, seconds: f64) -> Playback {
    let rows = (seconds * 1000.0) as usize;
    let on_device = |index: &usize| rig.sensors[*index].wiring.as_ref().is_some_and(|w| w.device == device.name);
    let sensors = (0..rig.sensors.len()).filter(on_device);
    let ramp = |index: usize| (index, (0..rows).map(|row| value(index, row)).collect());
    Playback { sample_period_ns: PERIOD_NS, sensors: sensors.map(ramp).collect() }
}

/// Plays `seconds` on the devices named and records them.
fn record_devices(
    rig: &Rig,
    names: &[&str],
    seconds: f64,
    faults: impl Fn(&str) -> Faults,
    file: &Path,
) -> (Summary, Vec<Sent>) {
    let mut devices = live_devices(rig, &[]).unwrap();
    devices.retain(|device| names.contains(&device.name.as_str()));
    let mut simulated: Vec<SimulatedDevice> = devices.iter().map(|_| SimulatedDevice::open().unwrap()).collect();
    for (device, line) in devices.iter_mut().zip(&simulated) {
        *device = device.clone().on_pseudoterminal(&line.path().display().to_string());
    }
    let sources = Sources::open(rig, &devices, false).unwrap();
    for (device, line) in devices.iter().zip(&mut simulated) {
        let script = Script::new(&playback(rig, device, seconds), rig, device).unwrap();
        assert_eq!(script.clipped, 0);
        line.start(script, 1.0, faults(&device.name)).unwrap();
    }
    let summary = record(rig, &sources, &Options::new(file), &AtomicBool::new(false), &mut |_| {}).unwrap();
    (summary, simulated.into_iter().map(|line| line.stop().unwrap()).collect())
}

/// The row that a value was played at.
fn row(index: usize, value: f64) -> f64 {
    match index {
        0..2 => value + 10_000.0 * index as f64,
        2 => value * 2.0,
        _ => value - 1_000_000.0 * index as f64,
    }
}

/// Largest and smallest of (time of a sample − time that it was played at), s: the series' clock against the truth.
fn offsets_s(index: usize, series: &Series) -> (f64, f64) {
    let offset = |(time_s, value): (&f64, &f64)| time_s - row(index, *value) * 1e-3;
    let offsets: Vec<f64> = series.time_s.iter().zip(&series.value).map(offset).collect();
    (offsets.iter().copied().fold(f64::INFINITY, f64::min), offsets.iter().copied().fold(f64::NEG_INFINITY, f64::max))
}

#[test]
fn three_protocols_are_recorded_at_once_on_one_clock() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.mcap");
    // The logger's clock runs 1% fast, 80 ms in 8 s: more than a loaded machine delays half of the lines.
    let faults = |name: &str| Faults { drift_ppm: if name == "logger" { 10_000.0 } else { 0.0 }, ..Faults::default() };
    // a time-out that a loaded machine keeps, too
    let rig = Rig::from_toml(&rig_text(0.5), "bench.toml").unwrap();
    let (summary, sent) = record_devices(&rig, &["daq", "logger", "plc"], 8.0, faults, &file);
    let recording = log::read(&file).unwrap();
    assert_eq!(summary.devices[0].frames, sent[0].frames);
    for (index, rows) in [(0, 8000), (1, 8000), (2, 7999)] {
        let series = &recording.series[index];
        // The first line may be the rest of one, and is never taken.
        assert!(series.value.len() >= rows - 1, "{} samples of {rows}", series.value.len());
        let rows: Vec<f64> = series.value.iter().map(|value| row(index, *value)).collect();
        assert!(rows.windows(2).all(|pair| pair[1] == pair[0] + 1.0), "every sample, in order");
    }
    assert!(summary.devices[2].frames > 200, "{:?}", summary.devices[2]);
    assert!(summary.devices.iter().all(|device| !device.incomplete), "all hang up at once: {:?}", summary.devices);
    // P1 stands on its own device's clock, exactly.
    let (least, most) = offsets_s(0, &recording.series[0]);
    assert!(most - least < 1e-9, "{least} to {most} s");
    // The line's rows are played 1% early by the true clock: row r at r/1.01 ms.
    let logger = &recording.series[2];
    let off = |i: usize| logger.time_s[i] - row(2, logger.value[i]) * 1e-3 / 1.01;
    let (first, last) = (off(10), off(logger.value.len() - 10));
    assert!((last - first).abs() < 0.004, "P3 drifts against P1 by {} ms in 8 s", 1e3 * (last - first));
    let drift = summary.devices[1].clock.unwrap().drift_ppm.unwrap();
    assert!((drift - 10_000.0).abs() < 500.0, "{drift} ppm");
    assert!(recording.run.notes.iter().any(|(key, text)| key == "logger.clock" && text.contains("ppm")));
    for index in [3, 4] {
        let series = &recording.series[index];
        let mut offsets: Vec<f64> =
            series.time_s.iter().zip(&series.value).map(|(time_s, value)| time_s - row(index, *value) * 1e-3).collect();
        offsets.sort_by(f64::total_cmp);
        // A register is read within its request and answer; a busy machine may hold both up now and then.
        let (least, most) = (offsets[offsets.len() / 20], offsets[offsets.len() * 19 / 20]);
        assert!(least > -0.05 && most < 0.05, "sensor {index}: {least} to {most} s");
        assert!(offsets[0] > -0.5 && offsets[offsets.len() - 1] < 0.5, "sensor {index}: {offsets:?}");
    }
}

#[test]
fn late_answers_put_no_value_under_anothers_name() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.mcap");
    let faults = Faults { late: 0.2, crc: 0.02, noise: 0.02, cut: 0.02, drop: 0.02, seed: 3, ..Faults::default() };
    let (summary, sent) = record_devices(&rig(), &["plc"], 12.0, |_| faults, &file);
    let device = &summary.devices[0];
    assert!(sent[0].late > 10 && device.late_answers > 3, "{sent:?} {device:?}");
    assert!(device.bad_frames > 2 && device.lost_frames > 10 && device.frames > 60, "{device:?}");
    assert!(summary.data_lost);
    let recording = log::read(&file).unwrap();
    for index in [3, 4] {
        let series = &recording.series[index];
        assert!(series.value.len() > 30 && !series.gaps.is_empty());
        for value in &series.value {
            let row = row(index, *value);
            assert!((0.0..12_000.0).contains(&row), "{value} is no value of sensor {index}");
        }
        let rows: Vec<f64> = series.value.iter().map(|value| row(index, *value)).collect();
        // A register is looked at when the slave wakes up: it may be asked twice before its next row.
        let back = rows.windows(2).find(|pair| pair[1] < pair[0]);
        assert_eq!(back, None, "an old value came back");
    }
}

#[test]
fn lines_in_noise_are_counted_and_kept_out() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.mcap");
    let faults = Faults { noise: 0.02, drop: 0.02, seed: 5, ..Faults::default() };
    let (summary, sent) = record_devices(&rig(), &["logger"], 4.0, |_| faults, &file);
    let device = &summary.devices[0];
    assert!(sent[0].noisy > 20 && sent[0].dropped > 20);
    assert!(device.bad_frames >= sent[0].noisy, "{device:?}");
    let recording = log::read(&file).unwrap();
    let series = &recording.series[2];
    assert!(series.value.len() as u64 + sent[0].harmed() + 60 >= 4000, "{}", series.value.len());
    let rows: Vec<f64> = series.value.iter().map(|value| row(2, *value)).collect();
    let mut gaps = series.gaps.iter();
    for (at, pair) in rows.windows(2).enumerate() {
        assert!(pair[1] > pair[0]);
        if pair[1] != pair[0] + 1.0 {
            let gap = gaps.next().expect("every hole is a gap");
            assert_eq!((gap.from_s, gap.to_s), (series.time_s[at], series.time_s[at + 1]));
        }
    }
    let (least, most) = offsets_s(2, series);
    assert!(most - least < 1e-9, "times are the device's");
}

/// As when a plug is pulled and put back: the path is gone, then another terminal stands there.
#[test]
fn a_device_that_vanishes_is_waited_for_and_the_hole_is_a_gap() {
    let folder = TempDir::new().unwrap();
    let (file, port) = (folder.path().join("run.mcap"), folder.path().join("port"));
    let rig = rig();
    let device = live_devices(&rig, &[]).unwrap().remove(0).on_pseudoterminal(port.to_str().unwrap());
    let plug = |seconds: f64| {
        let mut line = SimulatedDevice::open().unwrap();
        let _ = std::fs::remove_file(&port);
        std::os::unix::fs::symlink(line.path(), &port).unwrap();
        line.start(Script::new(&playback(&rig, &device, seconds), &rig, &device).unwrap(), 1.0, Faults::default())
            .unwrap();
        line
    };
    // longer than a loaded machine takes to see the second one, whose clock is then seen to begin anew
    let first = plug(1.6);
    let sources = Sources::open(&rig, std::slice::from_ref(&device), true).unwrap();
    let options = Options { wait: Duration::from_secs(3), ..Options::new(&file) };
    let stop = AtomicBool::new(false);
    let summary = thread::scope(|scope| {
        scope.spawn(|| {
            thread::sleep(Duration::from_millis(2300));
            first.stop().unwrap();
            let mut second = plug(1.0);
            second.join().unwrap();
            thread::sleep(Duration::from_millis(200));
            stop.store(true, Ordering::Relaxed);
        });
        record(&rig, &sources, &options, &stop, &mut |_| {}).unwrap()
    });
    let count = &summary.devices[0];
    assert_eq!((count.reconnects, count.restarts), (1, 1), "{count:?}");
    assert!(summary.data_lost);
    let recording = log::read(&file).unwrap();
    let series = &recording.series[0];
    assert!(series.value.len() >= 2500, "{} of 2600", series.value.len());
    assert_eq!(series.gaps.len(), 1);
    let gap = series.gaps[0];
    assert!((0.5..3.0).contains(&(gap.to_s - gap.from_s)), "{gap:?}");
}

#[test]
fn two_devices_on_one_port_and_a_slave_without_the_register_are_told() {
    let rig = rig();
    let port = |name: &str| (name.to_owned(), "/dev/ttyX".to_owned());
    let error = live_devices(&rig, &[port("daq"), port("plc")]).unwrap_err();
    assert!(matches!(error, RecordError::SamePort { .. }), "{error}");
    let error = live_devices(&rig, &[port("dag")]).unwrap_err().to_string();
    assert!(error.contains("'dag'") && error.contains("daq, logger, plc"), "{error}");

    // A slave that has other registers than the rig says.
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.mcap");
    let other =
        rig_text(0.03).replace("channel = 10\n", "channel = 110\n").replace("channel = 20\n", "channel = 120\n");
    let other = Rig::from_toml(&other, "other.toml").unwrap();
    let mut line = SimulatedDevice::open().unwrap();
    let plc = |rig: &Rig| live_devices(rig, &[]).unwrap().remove(2);
    let script = Script::new(&playback(&other, &plc(&other), 2.0), &other, &plc(&other)).unwrap();
    let device = plc(&rig).on_pseudoterminal(line.path().to_str().unwrap());
    let sources = Sources::open(&rig, &[device], false).unwrap();
    line.start(script, 1.0, Faults::default()).unwrap();
    let options = Options { silence: Duration::from_secs(4), ..Options::new(&file) };
    let error = record(&rig, &sources, &options, &AtomicBool::new(false), &mut |_| {}).unwrap_err();
    assert!(matches!(error, RecordError::Refused { .. }), "{error}");
    assert!(error.to_string().contains("no register at that address"), "{error}");
    assert!(!file.exists());
}

fn program() -> Command {
    let mut command = surgescope::<&str>([]);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn write_rig(folder: &TempDir) -> PathBuf {
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, rig_text(0.03)).unwrap();
    rig
}

#[test]
fn record_simulate_plays_every_device_of_the_rig() {
    let folder = TempDir::new().unwrap();
    let (rig, file) = (write_rig(&folder), folder.path().join("run.mcap"));
    let mut command = program();
    command
        .args(["record", "--json", "--simulate", "--duration", "3", "--rate", "500", "--rig"])
        .arg(rig)
        .arg("-o")
        .arg(&file);
    let output = command.output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(0 | 3)), "{stderr}");
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["devices"].as_array().unwrap().len(), 3);
    let recording = log::read(&file).unwrap();
    assert!(recording.series[..3].iter().all(|series| series.value.len() >= 1400), "{summary}");
    assert!(recording.series[3..].iter().all(|series| series.value.len() >= 30), "{summary}");
}

/// A slave that is powered up after the program: nothing is recorded yet, so nothing is lost.
#[test]
fn polls_before_the_first_answer_are_no_loss() {
    let folder = TempDir::new().unwrap();
    let rig = rig();
    let mut line = SimulatedDevice::open().unwrap();
    let plc = live_devices(&rig, &[]).unwrap().remove(2);
    let device = plc.on_pseudoterminal(line.path().to_str().unwrap());
    let script = Script::new(&playback(&rig, &device, 0.5), &rig, &device).unwrap();
    let sources = Sources::open(&rig, &[device], false).unwrap();
    let options = Options::new(folder.path().join("run.mcap"));
    let summary = thread::scope(|scope| {
        scope.spawn(|| {
            thread::sleep(Duration::from_secs(2));
            line.start(script, 1.0, Faults::default()).unwrap();
        });
        record(&rig, &sources, &options, &AtomicBool::new(false), &mut |_| {}).unwrap()
    });
    let device = &summary.devices[0];
    assert!(device.frames > 5 && device.lost_frames < 10 && device.holes < 10, "{device:?}");
}

/// Played as fast as possible, the devices' clocks say nothing about each other.
#[test]
fn clocks_that_do_not_fit_are_told() {
    let folder = TempDir::new().unwrap();
    let (rig, file) = (write_rig(&folder), folder.path().join("run.mcap"));
    let mut command = program();
    command.args(["record", "--json", "--simulate", "--speed", "0", "--duration", "5", "--rig"]).arg(rig).arg("-o");
    let output = command.arg(&file).output().unwrap();
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let warning = summary["devices"][0]["clock_warning"].as_str().unwrap();
    assert!(warning.contains("does not run evenly"), "{warning}");
    assert_eq!(log::read(&file).unwrap().run.notes.iter().filter(|(key, _)| key == "daq.clock_warning").count(), 1);
}

/// A limit on the size of files is as near to a full disk as a test can come without one.
#[test]
fn a_full_disk_ends_the_recording_with_a_whole_file_and_a_clear_word() {
    let folder = TempDir::new().unwrap();
    let (rig, file) = (write_rig(&folder), folder.path().join("run.mcap"));
    let text = rig_text(0.03).replace("device = \"logger\"\nchannel = 0\nscale = 0.5\n", "");
    let text = text.replace("device = \"plc\"\nchannel = 10\nencoding = \"i32\"\nword_order = \"little\"\n", "");
    let text = text.replace("device = \"plc\"\nchannel = 20\nencoding = \"i32\"\nword_order = \"little\"\n", "");
    std::fs::write(&rig, text).unwrap();
    let command = format!(
        "ulimit -f 300; exec '{}' record --json --simulate --speed 0 --duration 20 --rig '{}' -o '{}'",
        env!("CARGO_BIN_EXE_surgescope"),
        rig.display(),
        file.display()
    );
    let output = Command::new("bash").args(["-c", &command]).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    assert!(stderr.contains("the disk takes no more") && stderr.contains("whole"), "{stderr}");
    let recording = log::read(&file).expect("a whole file");
    let samples = recording.series[0].value.len();
    assert!((1000..20_000).contains(&samples), "{samples}");
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["sensors"][0]["samples"], samples, "the summary counts what is in the file");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "the rig and the recording: {left:?}");
}

#[test]
fn ports_lists_and_tries_the_rigs_devices() {
    let folder = TempDir::new().unwrap();
    let output = program().args(["ports", "--json", "--rig"]).arg(write_rig(&folder)).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(document["ports"].is_array());
    let problem = document["devices"][1]["problem"].as_str().unwrap();
    assert!(problem.contains("/dev/none1 of device 'logger' does not exist"), "{problem}");
    assert_eq!(program().arg("ports").output().unwrap().status.code(), Some(0));
}

/// The logger sends in one unit of time what the rig file takes for another, for so long or until that is noticed.
fn logger_in(sends: &str, read_as: &str, seconds: f64, options: impl Fn(Options) -> Options) -> (Summary, Vec<String>) {
    let rig_in = |unit: &str| {
        let text =
            rig_text(0.03).replace("protocol = \"lines\"", &format!("protocol = \"lines\"\ntime_unit = \"{unit}\""));
        Rig::from_toml(&text, "bench.toml").unwrap()
    };
    let logger = |rig: &Rig| live_devices(rig, &[]).unwrap().into_iter().find(|d| d.name == "logger").unwrap();
    let folder = TempDir::new().unwrap();
    let (sender, reader) = (rig_in(sends), rig_in(read_as));
    let mut line = SimulatedDevice::open().unwrap();
    let device = logger(&reader).on_pseudoterminal(line.path().to_str().unwrap());
    let sources = Sources::open(&reader, std::slice::from_ref(&device), false).unwrap();
    let script = Script::new(&playback(&sender, &logger(&sender), seconds), &sender, &logger(&sender)).unwrap();
    line.start(script, 1.0, Faults::default()).unwrap();
    let (mut shown, noticed) = (Vec::new(), AtomicBool::new(false));
    let mut look = |now: surgescope::record::health::snapshot::Snapshot| {
        shown.extend(now.sensors.iter().filter_map(|s| s.fault).map(|fault| fault.word().to_owned()));
        shown.dedup();
        noticed.fetch_or(shown.iter().any(|word| word == "wrong-time-unit"), Ordering::Relaxed);
    };
    let options = options(Options::new(folder.path().join("run.mcap")));
    let summary = record(&reader, &sources, &options, &noticed, &mut look).unwrap();
    line.stop().unwrap();
    (summary, shown)
}

#[test]
fn times_in_another_unit_are_called_out_within_seconds() {
    // a thousand times too slow, and too fast; read as what they are, nothing is wrong
    let cases = [
        ("ms", "us", Some("ms")),
        ("ns", "us", Some("ns")),
        ("us", "ms", Some("us")),
        ("ms", "ms", None),
        ("us", "us", None),
    ];
    let one = |(sends, read_as, likely): (&'static str, &'static str, Option<&str>)| {
        // on a loaded machine it may take longer
        let seconds = if likely.is_some() { 40.0 } else { 4.0 };
        let (summary, shown) = logger_in(sends, read_as, seconds, |options| options);
        let units: Vec<_> = summary.alerts.iter().filter(|alert| alert.fault.word() == "wrong-time-unit").collect();
        assert_eq!(
            shown.iter().any(|word| word == "wrong-time-unit"),
            likely.is_some(),
            "{sends} as {read_as}: {shown:?}"
        );
        let Some(likely) = likely else { return assert!(units.is_empty(), "{units:?}") };
        let [alert] = units[..] else { panic!("{sends} as {read_as}: {:?}", summary.alerts) };
        let json = serde_json::to_value(alert).unwrap();
        assert_eq!(
            (&json["sensor"], &json["likely"], &json["read_as"]),
            (&"P3".into(), &likely.into(), &read_as.into())
        );
        assert!(alert.advice.contains("time_unit") && alert.advice.contains("[[device]]"), "{json}");
    };
    thread::scope(|scope| cases.into_iter().for_each(|case| drop(scope.spawn(move || one(case)))));
    // a duration of its own clock that is over at once
    let (summary, _) = logger_in("ns", "us", 1.0, |options| Options { duration_s: Some(60.0), ..options });
    assert_eq!(summary.alerts.iter().map(|alert| alert.fault.word()).collect::<Vec<_>>(), ["wrong-time-unit"]);
}

/// A two-wire adapter that listens while it speaks: every request comes back before its answer.
#[test]
fn a_line_that_sends_back_the_requests_is_read() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("run.mcap");
    let faults = Faults { echo: true, seed: 2, ..Faults::default() };
    // a time-out that a loaded machine keeps: no answer is late
    let rig_in_time = Rig::from_toml(&rig_text(3.0), "bench.toml").unwrap();
    let (summary, sent) = record_devices(&rig_in_time, &["plc"], 4.0, |_| faults, &file);
    let device = &summary.devices[0];
    assert!(10 * device.returned_requests >= 9 * sent[0].frames, "{device:?} {sent:?}");
    assert!(device.frames > 100 && device.bad_frames == 0 && device.late_answers == 0, "{device:?}");
    assert!(!summary.data_lost, "{device:?}");
    let recording = log::read(&file).unwrap();
    for index in [3, 4] {
        let rows: Vec<f64> = recording.series[index].value.iter().map(|value| row(index, *value)).collect();
        assert!(rows.len() > 50 && rows.windows(2).all(|pair| pair[1] >= pair[0]), "{rows:?}");
        assert!(rows.iter().all(|row| (0.0..4000.0).contains(row)), "{rows:?}");
    }
    // late and doubled answers are no one else's there either
    let faults = Faults { echo: true, late: 0.2, duplicate: 0.05, drop: 0.02, seed: 4, ..Faults::default() };
    let (summary, _) = record_devices(&rig(), &["plc"], 6.0, |_| faults, &folder.path().join("late.mcap"));
    assert!(summary.devices[0].frames > 30, "{:?}", summary.devices[0]);
    let recording = log::read(&folder.path().join("late.mcap")).unwrap();
    for index in [3, 4] {
        let rows: Vec<f64> = recording.series[index].value.iter().map(|value| row(index, *value)).collect();
        assert!(rows.iter().all(|row| (0.0..6000.0).contains(row)) && rows.windows(2).all(|pair| pair[1] >= pair[0]));
    }
}
