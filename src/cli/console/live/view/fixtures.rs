//! Snapshots to draw.

use crate::record::health::alert::SensorFault;
use crate::record::health::snapshot::{DeviceView, Disk, Phase, SensorView, Snapshot, TriggerView};
use crate::record::session::output::DeviceCount;

fn device(name: &str, frames: u64) -> DeviceView {
    let count = DeviceCount { name: name.into(), frames, ..DeviceCount::default() };
    DeviceView { count, samples: 744_000, samples_per_s: 60_000.0, queue: 0.02, trouble: None }
}

/// A sensor near a level, with one spike.
pub fn sensor(name: &str, unit: &'static str, level: f64, device: usize) -> SensorView {
    let mut trace = vec![Some([level - 0.1, level + 0.1]); 100];
    trace[60] = Some([level, level + 400.0]);
    SensorView {
        name: name.into(),
        unit,
        device: Some(device),
        samples: 248_000,
        rate_hz: Some(20_000.0),
        level: Some(level),
        accuracy: 2.75,
        gaps: 0,
        trace,
        fault: None,
    }
}

/// Two devices, three sensors, nothing wrong.
pub fn healthy() -> Snapshot {
    let mut slow = SensorView { rate_hz: Some(10.0), accuracy: 0.11, ..sensor("T1", "degC", 22.2, 1) };
    slow.trace.fill(Some([22.2, 22.2]));
    Snapshot {
        recorded_s: Some(12.4),
        samples: 744_000,
        gaps: 3,
        samples_per_s: 60_000.0,
        devices: vec![device("daq", 1240), device("logger", 124)],
        sensors: vec![sensor("P1", "kPa", 245.3, 0), SensorView { gaps: 3, ..sensor("P2", "kPa", 251.0, 0) }, slow],
        trigger: None,
        place: "run.mcap".into(),
        disk: Some(Disk { free_bytes: 12_340_000_000, bytes_per_s: 1e6 }),
    }
}

/// A device gone, a sensor saturated and one noisy, the disk nearly full.
pub fn faulty() -> Snapshot {
    let mut snapshot = healthy();
    snapshot.devices[0].count.bad_frames = 17;
    snapshot.devices[1].trouble =
        Some("the port vanished: plug /dev/ttyUSB1 in again, it is waited for 60 s".to_owned());
    snapshot.sensors[0].fault = Some(SensorFault::Saturated { end: 998.9, upper: true });
    snapshot.sensors[1].fault = Some(SensorFault::Noisy { sd: 14.2, limit: 5.5 });
    snapshot.sensors[2].fault = Some(SensorFault::Silent);
    snapshot.sensors[2].trace[40..].fill(None);
    snapshot.disk = Some(Disk { free_bytes: 400_000_000, bytes_per_s: 833_000.0 });
    snapshot
}

/// With a trigger.
pub fn armed(phase: Phase, fired: usize) -> Snapshot {
    let condition = "P1 reaches 500 kPa".to_owned();
    Snapshot { trigger: Some(TriggerView { condition, phase, fired, most: Some(3), lost: Vec::new() }), ..healthy() }
}
