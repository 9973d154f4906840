//! What someone relies on whose Modbus slaves share one RS-485 line: each one's values stand under its own sensors'
//! names, whoever answers late or not at all.
#![cfg(unix)]

use std::sync::atomic::AtomicBool;

use surgescope::record::RecordError;
use surgescope::record::devices::simulated::{Faults, Playback, Script, SimulatedDevice};
use surgescope::record::devices::source::Sources;
use surgescope::record::session::live_test::{Options, live_devices, record};
use surgescope::record::session::output::Summary;
use surgescope::recording::Series;
use surgescope::rig::{Device, Rig};
use surgescope::storage as log;
use tempfile::TempDir;

/// Slaves with a sensor each in the same register: an answer of one would fit a request to the other.
const SLAVES: [(&str, u8); 3] = [("north", 1), ("south", 2), ("off", 9)];

fn rig_text(timeout_s: f64) -> String {
    let slave = |(name, unit): (&str, u8)| {
        format!(
            "[[sensor]]\nname = \"P-{name}\"\nkind = \"pressure\"\nposition_m = 10.0\nunit = \"kPa\"\ndevice = \"{name}\"\nchannel = 10\n\
             encoding = \"i32\"\n[[device]]\nname = \"{name}\"\nport = \"/dev/none\"\nbaud = 19200\nprotocol = \"modbus-rtu\"\n\
             unit_id = {unit}\npoll_interval_s = 0.02\ntimeout_s = {timeout_s}\n"
        )
    };
    let rig = "name = \"bench\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n[[pipe]]\nname = \"main\"\nlength_m = 40.0\n\
         inner_diameter_mm = 50.6\nwall_thickness_mm = 6.2\nmaterial = \"HDPE\"\n[upstream]\nkind = \"reservoir\"\n\
         [downstream]\nkind = \"valve\"\nclosing_time_s = 0.1\n";
    rig.to_owned() + &SLAVES.map(slave).concat()
}

/// What sensor `index` shows at row `row`: it tells whose it is.
fn value(index: usize, row: usize) -> f64 {
    (1_000_000 * (index + 1) + row) as f64
}

/// Records ten seconds of the slaves named, the others being switched off.
fn recorded(on: &[&str], timeout_s: f64, faults: Faults) -> (Summary, Vec<Series>) {
    let rig = Rig::from_toml(&rig_text(timeout_s), "bench.toml").unwrap();
    let mut line = SimulatedDevice::open().unwrap();
    let path = line.path().display().to_string();
    let ports: Vec<(String, String)> = SLAVES.iter().map(|(name, _)| ((*name).to_owned(), path.clone())).collect();
    let devices = live_devices(&rig, &ports).unwrap();
    let script = |(index, device): (usize, &Device)| {
        let rows = (0..10_000).map(|row| value(index, row)).collect();
        let playback = Playback { sample_period_ns: 1_000_000, sensors: vec![(index, rows)] };
        Script::new(&playback, &rig, device).unwrap()
    };
    let on = devices.iter().enumerate().filter(|(_, device)| on.contains(&device.name.as_str()));
    let scripts = on.map(script).collect();
    let sources = Sources::open(&rig, &devices, false).unwrap();
    line.start_line(scripts, 1.0, faults).unwrap();
    let folder = TempDir::new().unwrap();
    let options = Options::new(folder.path().join("run.mcap"));
    let summary = record(&rig, &sources, &options, &AtomicBool::new(false), &mut |_| {}).unwrap();
    line.stop().unwrap();
    let series = log::read(&options.file).unwrap().series;
    for (index, series) in series.iter().enumerate() {
        for pair in series.value.windows(2) {
            assert!(pair[1] >= pair[0], "sensor {index}: {pair:?} is not in order");
        }
        for held in &series.value {
            assert!((value(index, 0)..value(index, 10_000)).contains(held), "{held} is none of sensor {index}");
        }
    }
    (summary, series)
}

#[test]
fn slaves_on_one_line_are_asked_in_turn() {
    // a time-out that a loaded machine keeps, too: without faults nothing is late
    let (summary, series) = recorded(&["north", "south", "off"], 2.0, Faults::default());
    for (device, series) in summary.devices.iter().zip(&series) {
        assert!(device.frames > 150 && series.value.len() > 150, "{device:?}");
        assert!(device.bad_frames == 0 && device.late_answers == 0, "{device:?}");
    }
}

/// The line is held up by each late answer, and a slave that is switched off costs a time-out now and then.
#[test]
fn late_answers_and_a_dead_slave_cost_the_others_time_and_no_value() {
    let faults = Faults { late: 0.1, crc: 0.02, noise: 0.02, cut: 0.02, drop: 0.02, seed: 5, ..Faults::default() };
    let (summary, series) = recorded(&["north", "south"], 0.03, faults);
    let (living, dead) = summary.devices.split_at(2);
    for (device, series) in living.iter().zip(&series) {
        assert!(device.frames > 60 && device.late_answers > 0 && device.lost_frames > 5, "{device:?}");
        assert!(!series.gaps.is_empty());
    }
    assert_eq!((dead[0].frames, dead[0].incomplete), (0, true), "{dead:?}");
    assert!((5..60).contains(&dead[0].lost_frames), "asked now and then: {dead:?}");
    assert!(summary.data_lost);
}

#[test]
fn what_cannot_share_a_line_is_told() {
    let refusal = |from: &str, to: &str| {
        let rig = Rig::from_toml(&rig_text(0.03).replacen(from, to, 1), "bench.toml").unwrap();
        live_devices(&rig, &[]).unwrap_err()
    };
    let same = refusal("unit_id = 2", "unit_id = 1");
    assert!(matches!(same, RecordError::SameUnit { unit: 1, .. }), "{same}");
    let unlike = refusal("baud = 19200", "baud = 9600");
    assert!(matches!(unlike, RecordError::UnlikeLine { .. }), "{unlike}");
    let text = unlike.to_string();
    assert!(text.contains("9600 baud 8N1") && text.contains("19200 baud 8N1"), "{text}");
}
