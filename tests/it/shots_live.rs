//! Triggers over real ports: devices on pseudo-terminals, repeated closures, each shot in a file of its own, and what
//! is wrong with a sensor said while the trigger is armed.
#![cfg(unix)]

use std::collections::HashSet;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use surgescope::record::devices::simulated::{Faults, Playback, Script, SimulatedDevice};
use surgescope::record::devices::source::Sources;
use surgescope::record::health::snapshot::{Phase, Snapshot};
use surgescope::record::session::live_test::{Options, live_devices, record};
use surgescope::record::session::output::{Absent, Summary};
use surgescope::record::session::shots::Plan;
use surgescope::record::session::trigger::{Condition, Settings};
use surgescope::recording::Recording;
use surgescope::rig::Rig;
use surgescope::storage as log;

const PERIOD_NS: u32 = 1_000_000;
/// Closures, s after the device's start, and where the device ends.
const CLOSURES: [f64; 3] = [1.5, 4.0, 6.5];
const END_S: f64 = 8.0;
const PRE_S: f64 = 0.6;
const POST_S: f64 = 0.8;

/// P1 and P2 and the valve's command on one device.
fn rig(protocol: &str) -> Rig {
    Rig::from_toml(&rig_text(protocol), "bench.toml").unwrap()
}

fn rig_text(protocol: &str) -> String {
    let sensor = |channel: usize, name: &str, kind: &str, more: &str| {
        format!(
            "[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nposition_m = 30.0\n{more}\ndevice = \"daq\"\nchannel = {channel}\n"
        )
    };
    let pressure = "unit = \"kPa\"\nrange = [-100.0, 1000.0]\nscale = 0.05";
    let text = [
        "name = \"bench\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = 30.0\n\
         inner_diameter_mm = 50.6\nwall_thickness_mm = 6.2\nmaterial = \"HDPE\"\n[upstream]\nkind = \"reservoir\"\n\
         [downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n"
            .to_owned(),
        sensor(0, "P1", "pressure", pressure),
        sensor(1, "P2", "pressure", pressure),
        sensor(2, "V1", "trigger", "unit = \"1\""),
        format!("[[device]]\nname = \"daq\"\nport = \"/dev/none\"\nbaud = 921600\nprotocol = \"{protocol}\"\n"),
    ];
    text.concat()
}

fn time_s(row: usize) -> f64 {
    row as f64 * 1e-3
}

/// 300 kPa, 400 more at each closure, ringing at 3 Hz and dying out; a little that says which row it is.
fn pressure(row: usize) -> f64 {
    let t = time_s(row);
    let since = CLOSURES.iter().map(|closure| t - closure).filter(|s| *s >= -1e-9).fold(f64::INFINITY, f64::min);
    let surge = if since.is_finite() { 400.0 * (-6.0 * since).exp() * (19.0 * since).cos() } else { 0.0 };
    300.0 + 0.05 * (surge / 0.05).round() + 0.05 * (row % 5) as f64
}

/// Shut for half a second from each closure on, and longer at the first: the opening is no shot unless the trigger is
/// armed again.
fn command(row: usize) -> f64 {
    let shut = |closure: &f64| (closure - 1e-9..closure + 0.5).contains(&time_s(row));
    f64::from(u8::from(CLOSURES.iter().any(shut)))
}

fn played(
    protocol: &str,
    condition: Condition,
    sensor: usize,
    most: Option<usize>,
) -> (Summary, Vec<Recording>, Vec<Snapshot>) {
    let folder = tempfile::tempdir().unwrap();
    let rig = rig(protocol);
    let device = live_devices(&rig, &[]).unwrap().remove(0);
    let mut line = SimulatedDevice::open().unwrap();
    let device = device.on_pseudoterminal(line.path().to_str().unwrap());
    let rows = (END_S * 1e3) as usize;
    let values = |of: &dyn Fn(usize) -> f64| (0..rows).map(of).collect::<Vec<f64>>();
    // P2 stands at the end of its range from the start
    let sensors = vec![(0, values(&pressure)), (1, values(&|_| 1000.0)), (2, values(&command))];
    let script = Script::new(&Playback { sample_period_ns: PERIOD_NS, sensors }, &rig, &device).unwrap();
    assert_eq!(script.clipped, 0);
    let nanoseconds = |s: f64| (s * 1e9) as i64;
    let trigger = Settings { condition, pre_ns: nanoseconds(PRE_S), post_ns: nanoseconds(POST_S) };
    let options = Options {
        notes: vec![("operator".to_owned(), "Ada".to_owned())],
        shots: Some(Plan { trigger, sensor, most, folder: folder.path().to_owned() }),
        ..Options::new("")
    };
    let sources = Sources::open(&rig, &[device], false).unwrap();
    line.start(script, 1.0, Faults::default()).unwrap();
    let mut snapshots = Vec::new();
    let summary = record(&rig, &sources, &options, &AtomicBool::new(false), &mut |now| snapshots.push(now)).unwrap();
    drop(sources);
    line.stop().unwrap();
    let shots = summary.shots.iter().map(|file| log::read(Path::new(file)).unwrap()).collect();
    (summary, shots, snapshots)
}

/// Each shot holds every sample around its closure at its place, of all sensors, and says what was wrong.
fn assert_shots(shots: &[Recording], fired_s: &[f64]) {
    assert_eq!(shots.len(), fired_s.len());
    for (i, (shot, fired_s)) in shots.iter().zip(fired_s).enumerate() {
        let first_row = ((fired_s - PRE_S) * 1e3).round() as usize;
        let series = &shot.series[0];
        let wanted = ((PRE_S + POST_S) * 1e3).round() as usize + 1;
        assert!(series.gaps.is_empty() && series.value.len().abs_diff(wanted) <= 1, "{} samples", series.value.len());
        // lines begin with the second row, by times that are the device's own
        let rows: Vec<usize> = (0..series.value.len()).map(|k| first_row + k).collect();
        let shift = [0, 1, 2].into_iter().find(|shift| {
            rows.iter().zip(&series.value).all(|(row, value)| (value - pressure(row + shift - 1)).abs() < 1e-6)
        });
        assert!(shift.is_some(), "shot {i}: a sample is not where it was played: {:?}", &series.value[..5]);
        assert!(series.time_s[0].abs() < 0.0011, "{}", series.time_s[0]);
        assert!(shot.series[1].value.iter().all(|value| (value - 1000.0).abs() < 1e-6));
        assert_eq!(shot.series[2].value.len(), series.value.len());
        let note = |key: &str| shot.run.notes.iter().find(|(k, _)| k == key).map(|(_, text)| text.as_str());
        assert_eq!(note("shot"), Some((i + 1).to_string().as_str()));
        assert!(
            note("P2.saturated").is_some_and(|text| text.starts_with("from 0.0 s on saturated")),
            "{:?}",
            shot.run.notes
        );
        assert_eq!(note("P1.saturated").or(note("P1.noisy")).or(note("P1.flat")), None, "the surge is none of these");
    }
}

/// Settling, armed, fired and settling again, with the call-out on the screen while it was armed.
fn assert_shown(snapshots: &[Snapshot], shots: usize) {
    let mut seen = HashSet::new();
    for snapshot in snapshots {
        let trigger = snapshot.trigger.as_ref().unwrap();
        let phase = match trigger.phase {
            Phase::Settling { .. } => "settling",
            Phase::Armed => "armed",
            Phase::Fired { .. } => "fired",
            Phase::Over => "over",
        };
        seen.insert((phase, trigger.fired));
        if phase == "armed" {
            assert_eq!(snapshot.sensors[1].fault.unwrap().word(), "saturated");
            assert_eq!(snapshot.sensors[0].fault, None);
        }
    }
    assert!(seen.contains(&("settling", 0)), "{seen:?}");
    for shot in 0..shots {
        assert!(seen.contains(&("armed", shot)) && seen.contains(&("fired", shot + 1)), "{seen:?}");
    }
}

#[test]
fn the_edge_of_a_channel_of_text_lines_cuts_out_each_closure() {
    let (summary, shots, snapshots) = played("lines", Condition::Edge, 2, None);
    assert_shots(&shots, &CLOSURES);
    assert_shown(&snapshots, 3);
    assert_eq!(summary.alerts.iter().map(|c| c.sensor.as_str()).collect::<Vec<_>>(), ["P2"]);
    assert!(!summary.data_lost, "{summary:?}");
}

#[test]
fn a_level_fires_on_each_rise_and_not_on_the_ringing() {
    let (summary, shots, snapshots) = played("frames", Condition::Level(500.0), 0, Some(2));
    assert_shots(&shots, &CLOSURES[..2]);
    assert_shown(&snapshots, 2);
    assert!(summary.ended.contains("all shots were recorded") && !summary.data_lost, "{summary:?}");
}

#[test]
fn a_slope_fires_on_each_rise() {
    let (_, shots, snapshots) = played("frames", Condition::Slope(10_000.0), 0, None);
    assert_shots(&shots, &CLOSURES);
    assert_shown(&snapshots, 3);
}

/// A thermometer's logger says a line every 1.4 s. One line says nothing of how many values a line has, so when the
/// shot's end has waited for it in vain it is still held back.
#[test]
fn a_logger_too_slow_for_the_shot_is_said_to_be_missing() {
    let folder = tempfile::tempdir().unwrap();
    let text = rig_text("frames")
        + "[[sensor]]\nname = \"T1\"\nkind = \"temperature\"\nposition_m = 0.0\nunit = \"degC\"\ndevice = \"logger\"\nchannel = 0\n\
           [[device]]\nname = \"logger\"\nport = \"/dev/none1\"\nbaud = 9600\nprotocol = \"lines\"\n";
    let rig = Rig::from_toml(&text, "bench.toml").unwrap();
    let mut devices = live_devices(&rig, &[]).unwrap();
    let mut lines = [SimulatedDevice::open().unwrap(), SimulatedDevice::open().unwrap()];
    for (device, line) in devices.iter_mut().zip(&lines) {
        *device = device.clone().on_pseudoterminal(&line.path().display().to_string());
    }
    let rows = (END_S * 1e3) as usize;
    let of_daq = |of: fn(usize) -> f64| (0..rows).map(of).collect::<Vec<f64>>();
    let daq = vec![(0, of_daq(pressure)), (1, of_daq(|_| 300.0)), (2, of_daq(command))];
    let played = [(PERIOD_NS, daq), (1_400_000_000, vec![(3, vec![20.5; 5])])];
    let trigger = Settings { condition: Condition::Edge, pre_ns: (PRE_S * 1e9) as i64, post_ns: (POST_S * 1e9) as i64 };
    let plan = Plan { trigger, sensor: 2, most: Some(1), folder: folder.path().to_owned() };
    let options = Options { silence: Duration::from_secs(1), shots: Some(plan), ..Options::new("") };
    let sources = Sources::open(&rig, &devices, false).unwrap();
    for ((line, device), (sample_period_ns, sensors)) in lines.iter_mut().zip(&devices).zip(played) {
        let script = Script::new(&Playback { sample_period_ns, sensors }, &rig, device).unwrap();
        line.start(script, 1.0, Faults::default()).unwrap();
    }
    let summary = record(&rig, &sources, &options, &AtomicBool::new(false), &mut |_| {}).unwrap();
    drop(sources);
    for line in lines {
        line.stop().unwrap();
    }
    let [file] = &summary.shots[..] else { panic!("{summary:?}") };
    assert!(summary.data_lost && summary.ended == "all shots were recorded", "{summary:?}");
    assert_eq!(summary.absent, [Absent { file: file.clone(), sensors: vec!["T1".to_owned()] }]);
    let shot = log::read(Path::new(file)).unwrap();
    let [gap] = shot.series[3].gaps[..] else { panic!("{:?}", shot.series[3].gaps) };
    assert!(gap.from_s.abs() < 1e-3 && (gap.to_s - PRE_S - POST_S).abs() < 1e-3, "{gap:?}");
    assert!(shot.series[..3].iter().all(|series| series.gaps.is_empty() && series.value.len() > 1300));
}
