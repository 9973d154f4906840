//! A recording that runs while the page looks on. The recorder is that of `surgescope record`, on threads of its own:
//! it hands on where it stands and waits for nobody.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf, absolute};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use chrono::Utc;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::model::effects::parse_list;
use crate::record::devices::source::Sources;
use crate::record::health::snapshot::{Phase, Snapshot};
use crate::record::session::live_test::{Options, live_devices, record};
use crate::record::session::output::Summary;
use crate::record::session::shots::{Plan, stem};
use crate::record::session::trigger::{Condition, Settings};
use crate::report::view::panel::OwnUnit;
use crate::rig::{Device, Rig, SensorKind};
use crate::shown::Shown as _;
#[cfg(unix)]
use crate::simulate::playback::Timing;
use crate::simulate::scenario::{Scenario, ValveForm};
#[cfg(unix)]
use crate::simulate::through_ports::{LEAD_S, record_scenario};
use crate::watch::evaluate::sentence;
use crate::web::session::events::Hub;

type AnyError = Box<dyn Error + Send + Sync>;

/// How long a device whose port has vanished is waited for.
const WAIT: Duration = Duration::from_secs(60);

/// What is to be recorded.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wanted {
    /// A simulated test instead of the rig's devices.
    pub simulate: bool,
    /// Effects of the simulated test.
    pub effects: Vec<String>,
    /// Values of the simulated test.
    pub set: BTreeMap<String, f64>,
    /// Samples per second of the simulated devices.
    pub rate_hz: Option<f64>,
    /// How many times faster than real time a simulated test plays.
    pub speed: Option<f64>,
    /// Recorded time after which it ends, s.
    pub duration_s: Option<f64>,
    /// Shots around a trigger instead of one recording.
    pub trigger: Option<Trigger>,
    /// Notes to keep with the recording.
    pub notes: BTreeMap<String, String>,
    /// The commands that a person has seen and agrees to start, by their devices: word for word, or nothing is started.
    pub commands: BTreeMap<String, Vec<String>>,
}

/// What fires a shot.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trigger {
    /// The sensor; the pressure sensor nearest to the valve if it is not named.
    #[serde(default)]
    pub sensor: Option<String>,
    /// A level reached from below, in the sensor's unit.
    #[serde(default)]
    pub level: Option<f64>,
    /// A rise per second, in the sensor's unit.
    #[serde(default)]
    pub slope: Option<f64>,
    /// Seconds before the trigger.
    pub pre_s: f64,
    /// Seconds after it.
    pub post_s: f64,
    /// Shots after which it ends.
    #[serde(default)]
    pub shots: Option<usize>,
}

/// See the module.
#[derive(Default)]
pub struct Recorder {
    state: Mutex<State>,
    stop: Arc<AtomicBool>,
}

#[derive(Default)]
struct State {
    running: bool,
    growing: Option<PathBuf>,
    /// Where the recording stands, and how often that was reported.
    live: Option<Arc<Snapshot>>,
    told: u64,
    /// The rig, and how its pressure sensors show a head.
    rig: Value,
    /// How the last one ended.
    ended: Option<Value>,
}

impl Recorder {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a recording runs.
    pub fn runs(&self) -> bool {
        self.lock().running
    }

    /// Where the recording stands, or how the last one ended.
    pub fn json(&self) -> Value {
        let state = self.lock();
        let (running, last, rig, ended) = (state.running, state.live.clone(), state.rig.clone(), state.ended.clone());
        drop(state);
        json!({ "running": running, "live": last.as_deref().map(live), "rig": rig, "ended": ended })
    }

    /// Where the recording stands, unless the listener has heard `told` reports already; with the number of reports.
    /// The caller puts it into words: the recording does not wait for that.
    pub fn live_since(&self, told: u64) -> Option<(u64, Value)> {
        let state = self.lock();
        let (now, last) = (state.told, state.live.clone());
        drop(state);
        Some((now, live(&*last.filter(|_| now != told)?)))
    }

    /// The file that is being written, where one is.
    pub fn growing(&self) -> Option<PathBuf> {
        self.lock().growing.clone()
    }

    /// Ends the recording; what has come is kept.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Ends the recording and waits until its file is whole.
    pub fn finish(&self) {
        self.stop();
        while self.runs() {
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Starts a recording on a rig, in a folder.
    ///
    /// # Errors
    /// One that runs already, a rig that cannot record it, a port that cannot be opened.
    pub fn start(self: &Arc<Self>, rig: &Rig, folder: &Path, wanted: &Wanted, hub: &Arc<Hub>) -> Result<(), AnyError> {
        let options = options(rig, folder, wanted)?;
        let session = prepared(rig, wanted)?;
        {
            let mut state = self.lock();
            if state.running {
                return Err("a recording is running: stop it first".into());
            }
            let (growing, told) = (Some(options.file.clone()), state.told);
            *state = State { running: true, growing, told, rig: heads(rig), ..State::default() };
        }
        self.stop.store(false, Ordering::Relaxed);
        let (recorder, hub) = (self.clone(), hub.clone());
        let work = move || {
            let mut report = |snapshot: Snapshot| {
                {
                    let mut state = recorder.lock();
                    state.growing = Some(snapshot.place.clone());
                    state.live = Some(Arc::new(snapshot));
                    state.told += 1;
                }
                hub.live();
            };
            let ended = session(&options, &recorder.stop, &mut report);
            {
                let mut state = recorder.lock();
                (state.running, state.growing) = (false, None);
                state.ended = Some(match ended {
                    Ok(summary) => json!({
                        "file": summary.file, "shots": summary.shots, "data_lost": summary.data_lost,
                        "says": summary.ended,
                    }),
                    Err(error) => json!({ "error": sentence(error.as_ref()) }),
                });
            }
            hub.changed();
        };
        std::thread::Builder::new().name("recording".into()).spawn(work)?;
        Ok(())
    }
}

/// A rig's name, and of each pressure sensor what turns its values into heads, in water as the rig file has it.
fn heads(rig: &Rig) -> Value {
    let pressures = rig.sensors.iter().filter(|sensor| sensor.kind == SensorKind::Pressure);
    let of_sensor = |sensor: &crate::rig::Sensor| {
        let unit = OwnUnit::of(rig, &sensor.name, rig.fluid.temperature_degc);
        let (per_m, zero) = unit.map_or((1.0, 0.0), |unit| (unit.per_m, unit.zero));
        (sensor.name.clone(), json!({ "symbol": sensor.unit.symbol, "per_m": per_m, "zero": zero }))
    };
    json!({ "name": rig.name, "heads": pressures.map(of_sensor).collect::<serde_json::Map<_, _>>() })
}

/// A recording that is ready to run.
type Session =
    Box<dyn FnOnce(&Options, &AtomicBool, &mut dyn FnMut(Snapshot)) -> Result<Summary, AnyError> + Send + 'static>;

/// Opens what is recorded, so that a failure to open shows at once.
fn prepared(rig: &Rig, wanted: &Wanted) -> Result<Session, AnyError> {
    let rig = rig.clone();
    if wanted.simulate {
        return simulated(rig, wanted);
    }
    let devices = live_devices(&rig, &[])?;
    agreed(&devices, &wanted.commands)?;
    let sources = Sources::open(&rig, &devices, true)?;
    Ok(Box::new(move |options, stop, report| Ok(record(&rig, &sources, options, stop, report)?)))
}

/// A rig file may come from anybody: its commands are started only if the person has seen them as they are.
fn agreed(devices: &[Device], commands: &BTreeMap<String, Vec<String>>) -> Result<(), AnyError> {
    for device in devices {
        let Some(command) = device.port.command() else { continue };
        if commands.get(&device.name) != Some(&command.words) {
            let name = &device.name;
            return Err(format!(
                "device '{name}' starts the program `{command}` on this computer: agree to that first"
            )
            .into());
        }
    }
    Ok(())
}

/// What a recording on a rig's devices starts on this computer, for the person to agree to.
pub fn commands(rig: &Rig) -> Vec<Value> {
    let of = |device: Device| {
        let command = device.port.command()?;
        let folder = absolute(command.folder.as_ref()?).ok()?.shown().into_owned();
        Some(json!({ "device": device.name, "words": command.words, "shown": command.to_string(), "folder": folder }))
    };
    live_devices(rig, &[]).map_or(Vec::new(), |devices| devices.into_iter().filter_map(of).collect())
}

#[cfg(unix)]
fn simulated(rig: Rig, wanted: &Wanted) -> Result<Session, AnyError> {
    let effects = parse_list(&wanted.effects.join(","))?;
    let set: Vec<(String, f64)> = wanted.set.iter().map(|(name, value)| (name.clone(), *value)).collect();
    let scenario = Scenario::new(rig, &effects, ValveForm::Linear, &set)?;
    let total_s = wanted.duration_s.unwrap_or(LEAD_S + 12.0 * scenario.period_s());
    let rate_hz = wanted.rate_hz.unwrap_or(1000.0);
    let speed = wanted.speed.unwrap_or(1.0);
    if !(rate_hz > 0.0 && rate_hz.is_finite() && speed >= 0.0 && speed.is_finite() && total_s.is_finite()) {
        return Err("rate, speed and duration must be numbers above 0".into());
    }
    let timing = Timing { rate_hz, lead_s: LEAD_S, after_s: (total_s - LEAD_S).max(0.0) };
    Ok(Box::new(move |options, stop, report| {
        record_scenario(&scenario, &timing, (speed, Default::default()), options, (stop, report), &|_| {})
    }))
}

#[cfg(not(unix))]
fn simulated(_: Rig, _: &Wanted) -> Result<Session, AnyError> {
    Err("a simulated test needs pseudo-terminals, which this system does not have".into())
}

fn options(rig: &Rig, folder: &Path, wanted: &Wanted) -> Result<Options, AnyError> {
    if wanted.duration_s.is_some_and(|s| !(s > 0.0 && s.is_finite())) {
        return Err("the duration must be above 0 s".into());
    }
    let shots = wanted.trigger.as_ref().map(|trigger| plan(rig, folder, trigger)).transpose()?;
    Ok(Options {
        duration_s: wanted.duration_s,
        wait: WAIT,
        notes: wanted.notes.clone().into_iter().collect(),
        shots,
        ..Options::new(free_name(rig, folder))
    })
}

/// A file of this rig and moment that does not exist yet.
fn free_name(rig: &Rig, folder: &Path) -> PathBuf {
    let now = u64::try_from(Utc::now().timestamp_nanos_opt().unwrap_or_default()).unwrap_or_default();
    let named = |number: usize| folder.join(format!("{}.mcap", stem(&rig.name, now, number)));
    (1..).map(named).find(|path| !path.exists()).unwrap_or_else(|| named(0))
}

fn plan(rig: &Rig, folder: &Path, trigger: &Trigger) -> Result<Plan, AnyError> {
    let condition = match (trigger.level, trigger.slope) {
        (None, None) => Condition::Edge,
        (Some(level), None) => Condition::Level(level),
        (None, Some(slope)) => Condition::Slope(slope),
        (Some(_), Some(_)) => return Err("a trigger is a level or a slope, not both".into()),
    };
    let wanted = match condition {
        Condition::Edge => SensorKind::Trigger,
        _ => SensorKind::Pressure,
    };
    let nearest = (rig.sensors.iter().enumerate().filter(|(_, s)| s.kind == wanted))
        .max_by(|a, b| a.1.position_m.total_cmp(&b.1.position_m))
        .map(|(i, _)| i);
    let sensor = match &trigger.sensor {
        Some(name) => rig.sensors.iter().position(|s| s.name == *name),
        None => nearest,
    };
    let sensor = sensor.ok_or_else(|| format!("rig '{}' has no sensor for this trigger", rig.name))?;
    if !(trigger.pre_s > 0.0 && trigger.post_s > 0.0 && trigger.pre_s.max(trigger.post_s) < 1e6) {
        return Err("the times before and after the trigger must be above 0 s".into());
    }
    let nanoseconds = |s: f64| (s * 1e9).round() as i64;
    let settings = Settings { condition, pre_ns: nanoseconds(trigger.pre_s), post_ns: nanoseconds(trigger.post_s) };
    Ok(Plan { trigger: settings, sensor, most: trigger.shots, folder: folder.to_owned() })
}

/// Where a recording stands, for a page.
fn live(snapshot: &Snapshot) -> Value {
    let sensors: Vec<Value> = (snapshot.sensors.iter())
        .map(|s| {
            json!({
                "name": s.name, "unit": s.unit, "samples": s.samples, "rate_hz": s.rate_hz, "level": s.level,
                "gaps": s.gaps, "trace": rounded(&s.trace), "fault": s.fault,
                "says": s.fault.map(|fault| format!("{}; {}", fault.seen(s.unit), fault.advice())),
            })
        })
        .collect();
    let devices: Vec<Value> = (snapshot.devices.iter())
        .map(|d| {
            json!({
                "name": d.count.name, "samples": d.samples, "samples_per_s": d.samples_per_s, "queue": d.queue,
                "trouble": d.trouble, "says": d.count.stderr.last(),
            })
        })
        .collect();
    let trigger = snapshot.trigger.as_ref().map(|t| {
        let (phase, seconds, of_seconds) = match t.phase {
            Phase::Settling { quiet_s, wanted_s } => ("settling", Some(quiet_s), Some(wanted_s)),
            Phase::Armed => ("armed", None, None),
            Phase::Fired { since_s, lasts_s } => ("fired", Some(since_s), Some(lasts_s)),
            Phase::Over => ("over", None, None),
        };
        json!({
            "condition": t.condition, "phase": phase, "seconds": seconds, "of_seconds": of_seconds,
            "fired": t.fired, "shots": t.most, "lost": t.lost,
        })
    });
    json!({
        // between shots no file is written
        "file": snapshot.place.file_name().map(|name| Path::new(name).shown()), "recorded_s": snapshot.recorded_s, "samples": snapshot.samples,
        "gaps": snapshot.gaps, "samples_per_s": snapshot.samples_per_s, "sensors": sensors, "devices": devices,
        "trigger": trigger,
    })
}

/// A trace to a thousandth of its height: no strip shows more, and it goes over the wire twenty times a second.
fn rounded(trace: &[Option<[f64; 2]>]) -> Vec<Option<[f64; 2]>> {
    let (low, high) = trace.iter().flatten().fold((f64::MAX, f64::MIN), |(l, h), bin| (l.min(bin[0]), h.max(bin[1])));
    let places = 3.0 - (high - low).max(1e-9 * high.abs()).max(f64::MIN_POSITIVE).log10().floor();
    let scale = 10f64.powf(places.clamp(0.0, 12.0));
    trace.iter().map(|bin| bin.map(|bin| bin.map(|v| (v * scale).round() / scale))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trace_is_told_to_a_thousandth_of_its_height() {
        let told = rounded(&[Some([245.301_234_567, 245.398_765_432]), None, Some([1e-3, 0.5])]);
        assert_eq!(told, [Some([245.3, 245.4]), None, Some([0.0, 0.5])]);
        let told = rounded(&[Some([245.301_234_567, 245.398_765_432])]);
        assert_eq!(told, [Some([245.30123, 245.39877])]);
        assert_eq!(rounded(&[Some([3.0, 3.0])]), [Some([3.0, 3.0])]);
        assert_eq!(rounded(&[None]), [None]);
        assert_eq!(rounded(&[Some([0.0, 5e7])]), [Some([0.0, 5e7])]);
    }
}
