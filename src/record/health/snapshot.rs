//! Where a recording stands, a few times a second: what a view of it draws.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::record::devices::device_count::DeviceCount;
use crate::record::health::alert::SensorFault;

/// How often a view is given something to draw.
const EVERY: Duration = Duration::from_millis(50);
/// How often rates are counted anew: over less, a frame more or less shows.
const RATES_EVERY: Duration = Duration::from_millis(200);

/// Where a recording stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Snapshot {
    /// Time of the newest sample, s; `None` as long as no sample has come.
    pub recorded_s: Option<f64>,
    /// Samples of all sensors so far.
    pub samples: u64,
    /// Gaps of all sensors so far.
    pub gaps: u64,
    /// Samples of all sensors per second of the wall clock.
    pub samples_per_s: f64,
    /// The devices; none where a file is played.
    pub devices: Vec<DeviceView>,
    /// The sensors that are recorded, in the rig's order.
    pub sensors: Vec<SensorView>,
    /// The trigger, where shots are recorded.
    pub trigger: Option<TriggerView>,
    /// The file that grows; the folder of the shots between them.
    pub place: PathBuf,
    /// The disk; the view fills it in, because asking the system may take long.
    pub disk: Option<Disk>,
}

/// Room on the disk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disk {
    /// Bytes left.
    pub free_bytes: u64,
    /// How fast the recording takes them.
    pub bytes_per_s: f64,
}

impl Disk {
    /// How long the room lasts at this rate, s; infinite where nothing is written.
    pub fn lasts_s(&self) -> f64 {
        if self.bytes_per_s > 0.0 { self.free_bytes as f64 / self.bytes_per_s } else { f64::INFINITY }
    }
}

/// How a device stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DeviceView {
    /// What has come from it; without its clock.
    pub count: DeviceCount,
    /// Samples of its sensors so far.
    pub samples: u64,
    /// Samples of its sensors per second of the wall clock.
    pub samples_per_s: f64,
    /// How much of the queue to the session it fills, 0 to 1.
    pub queue: f64,
    /// Why nothing comes from it, and what to do.
    pub trouble: Option<String>,
}

/// How a sensor stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SensorView {
    /// Its name.
    pub name: String,
    /// Unit of its values.
    pub unit: &'static str,
    /// Its device, an index into [`Snapshot::devices`].
    pub device: Option<usize>,
    /// Samples so far.
    pub samples: u64,
    /// Samples per second of its own clock.
    pub rate_hz: Option<f64>,
    /// Mean of the last tenth of a second.
    pub level: Option<f64>,
    /// What it may be off: less than this is no change.
    pub accuracy: f64,
    /// Gaps so far.
    pub gaps: u64,
    /// Least and most value of each tenth of a second of the last ten seconds.
    pub trace: Vec<Option<[f64; 2]>>,
    /// What is wrong with it.
    pub fault: Option<SensorFault>,
}

/// How a trigger stands.
#[derive(Debug, Clone, PartialEq)]
pub struct TriggerView {
    /// What fires it, as in `P1 reaches 500 kPa`.
    pub condition: String,
    /// What it does.
    pub phase: Phase,
    /// Shots that have fired.
    pub fired: usize,
    /// Shots wanted.
    pub most: Option<usize>,
    /// Why shots could not be written.
    pub lost: Vec<String>,
}

/// What a trigger does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Phase {
    /// It waits until its sensor was quiet for as long as a shot holds before it fires.
    Settling {
        /// Quiet for so long by now, s.
        quiet_s: f64,
        /// So long is wanted, s.
        wanted_s: f64,
    },
    /// It may fire.
    Armed,
    /// It has fired.
    Fired {
        /// So long ago, s.
        since_s: f64,
        /// The shot lasts so long, s.
        lasts_s: f64,
    },
    /// All shots that were wanted are there.
    Over,
}

/// Hands on snapshots when it is time.
pub struct Reports<'a> {
    on: &'a mut dyn FnMut(Snapshot),
    at: Instant,
    counted: Counted,
    /// Samples per second of all sensors, and of each device's.
    rates: (f64, Vec<f64>),
}

/// Samples at a moment: of all sensors, and of each device's.
struct Counted {
    at: Instant,
    samples: u64,
    of_devices: Vec<u64>,
}

impl<'a> Reports<'a> {
    /// Snapshots go to `on`.
    pub fn to(on: &'a mut dyn FnMut(Snapshot)) -> Reports<'a> {
        let at = Instant::now();
        Reports { on, at, counted: Counted { at, samples: 0, of_devices: Vec::new() }, rates: (0.0, Vec::new()) }
    }

    /// Makes a snapshot and hands it on if it is time.
    pub fn when_due(&mut self, make: impl FnOnce() -> Snapshot) {
        if self.at.elapsed() < EVERY {
            return;
        }
        // on time again after one that was late, but not several at once after a long pause
        self.at = (self.at + EVERY).max(Instant::now().checked_sub(EVERY).unwrap_or(self.at));
        let mut snapshot = make();
        self.count(&snapshot);
        snapshot.samples_per_s = self.rates.0;
        for (device, rate) in snapshot.devices.iter_mut().zip(&self.rates.1) {
            device.samples_per_s = *rate;
        }
        (self.on)(snapshot);
    }

    fn count(&mut self, snapshot: &Snapshot) {
        let before = &self.counted;
        let since_s = before.at.elapsed().as_secs_f64();
        if since_s < RATES_EVERY.as_secs_f64() {
            return;
        }
        let rate = |now: u64, before: u64| now.saturating_sub(before) as f64 / since_s;
        let of_device =
            |(i, device): (usize, &DeviceView)| rate(device.samples, before.of_devices.get(i).copied().unwrap_or(0));
        let of_devices = snapshot.devices.iter().enumerate().map(of_device).collect();
        self.rates = (rate(snapshot.samples, before.samples), of_devices);
        let of_devices = snapshot.devices.iter().map(|device| device.samples).collect();
        self.counted = Counted { at: Instant::now(), samples: snapshot.samples, of_devices };
    }
}
