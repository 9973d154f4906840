//! The health of all sensors of a session: present and past faults.

use std::time::{Duration, Instant};

use crate::record::clock::device_clock::seconds;
use crate::record::health::alert::{Alert, SensorFault};
use crate::record::health::sensor_health::SensorHealth;
use crate::record::health::snapshot::SensorView;
use crate::rig::check::return_time_s;
use crate::rig::{Rig, TimeUnit};

/// How often the sensors are judged, ns of recorded time; of the wall clock where no time passes.
const JUDGE_EVERY_NS: i64 = 200_000_000;
const JUDGE_EVERY: Duration = Duration::from_millis(200);
/// An alert is over when it was not seen for so long, ns: a sensor that saturates at each peak of a surge gives one
/// alert.
const OVER_AFTER_NS: i64 = 3_000_000_000;
/// Alerts that are kept; more than these come from a chattering contact.
const MOST: usize = 200;

/// A sensor that is recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Its index in the rig.
    pub sensor: usize,
    /// Its device, in the order of the session's.
    pub device: Option<usize>,
    /// It is silent after so long without a sample; `None` where that cannot be judged.
    pub silent_after: Option<Duration>,
}

struct Watched {
    expected: Expected,
    health: SensorHealth,
    /// Samples and gaps when it was last seen to send, and when that was.
    last_seen: (u64, u64, Instant),
    /// The longest pause that it has made by itself.
    pause: Duration,
    /// Its alert, an index into those of the monitor, and when it was last seen, ns.
    now: Option<(usize, i64)>,
    fault: Option<SensorFault>,
    /// Unit of its device's times as they are read, and what they are likely in.
    time_unit: Option<(TimeUnit, TimeUnit)>,
}

/// See the module.
pub struct Monitor {
    watched: Vec<Watched>,
    /// Place in `watched` of each sensor of the rig.
    places: Vec<Option<usize>>,
    rig: Rig,
    newest_ns: i64,
    judged: (i64, Instant),
    alerts: Vec<Alert>,
}

impl Monitor {
    /// Nothing has come yet.
    pub fn new(rig: &Rig, expected: &[Expected]) -> Monitor {
        let water = rig.fluid.properties(rig.fluid.temperature_degc);
        let period_s = 2.0 * return_time_s(rig, &water);
        let now = Instant::now();
        let mut places = vec![None; rig.sensors.len()];
        let mut watched = Vec::new();
        for expected in expected {
            let Some(sensor) = rig.sensors.get(expected.sensor) else { continue };
            places[expected.sensor] = Some(watched.len());
            watched.push(Watched {
                expected: *expected,
                health: SensorHealth::new(rig.ends(sensor), period_s),
                last_seen: (0, 0, now),
                pause: Duration::ZERO,
                now: None,
                fault: None,
                time_unit: None,
            });
        }
        Monitor { watched, places, rig: rig.clone(), newest_ns: i64::MIN, judged: (i64::MIN, now), alerts: Vec::new() }
    }

    /// Samples of a sensor have come.
    pub fn samples(&mut self, sensor: usize, first_ns: i64, period_ns: f64, values: &[f64]) {
        let Some(watched) = self.place(sensor) else { return };
        watched.health.take(first_ns, period_ns, values);
        let last_ns = first_ns.saturating_add((values.len().saturating_sub(1) as f64 * period_ns) as i64);
        self.newest_ns = self.newest_ns.max(last_ns);
    }

    /// Samples of a sensor are missing.
    pub fn gap(&mut self, sensor: usize) {
        if let Some(watched) = self.place(sensor) {
            watched.health.gap();
        }
    }

    /// The times of a sensor's device are read in the first unit, and likely in the second.
    pub fn likely_unit(&mut self, sensor: usize, units: (TimeUnit, TimeUnit)) {
        if let Some(watched) = self.place(sensor) {
            watched.time_unit = Some(units);
        }
    }

    /// To be called at the end of a session: what was found since the last look.
    pub fn last_look(&mut self) {
        self.judge(Instant::now());
    }

    fn place(&mut self, sensor: usize) -> Option<&mut Watched> {
        self.watched.get_mut((*self.places.get(sensor)?)?)
    }

    /// To be called often: judges the sensors when it is time.
    pub fn tick(&mut self) {
        self.tick_at(Instant::now());
    }

    fn tick_at(&mut self, moment: Instant) {
        let (judged_ns, judged_at) = self.judged;
        let waited = moment.saturating_duration_since(judged_at);
        if self.newest_ns.saturating_sub(judged_ns) >= JUDGE_EVERY_NS || waited >= JUDGE_EVERY {
            self.judged = (self.newest_ns, moment);
            self.judge(moment);
        }
    }

    fn judge(&mut self, moment: Instant) {
        let now_ns = self.now_ns();
        for watched in &mut self.watched {
            let Some(sensor) = self.rig.sensors.get(watched.expected.sensor) else { continue };
            let found = if watched.is_silent(moment) {
                Some(SensorFault::Silent)
            } else if let Some((read_as, likely)) = watched.time_unit {
                Some(SensorFault::WrongTimeUnit { read_as: read_as.symbol(), likely: likely.symbol() })
            } else {
                SensorFault::of(sensor, &watched.health)
            };
            watched.fault = found.or(watched.fault.filter(|_| watched.now.is_some()));
            let before = watched.now.and_then(|(index, _)| self.alerts.get(index)).map(|alert| alert.fault.word());
            match (found, before) {
                (Some(found), Some(before)) if found.word() == before => {
                    watched.now = watched.now.map(|(i, _)| (i, now_ns))
                }
                (None, Some(_)) => {
                    let seen_ns = watched.now.map_or(0, |(_, seen_ns)| seen_ns);
                    let silent = matches!(watched.fault, Some(SensorFault::Silent));
                    if silent || now_ns - seen_ns >= OVER_AFTER_NS {
                        watched.close(&mut self.alerts, now_ns);
                    }
                }
                (Some(fault), _) => {
                    watched.close(&mut self.alerts, now_ns);
                    watched.fault = Some(fault);
                    if self.alerts.len() < MOST {
                        watched.now = Some((self.alerts.len(), now_ns));
                        let (sensor, unit) = (sensor.name.clone(), sensor.unit.symbol);
                        let (index, from_s) = (watched.expected.sensor, seconds(now_ns));
                        let advice = fault.advice();
                        self.alerts.push(Alert { sensor, index, fault, from_s, to_s: None, unit, advice });
                    }
                }
                (None, None) => watched.fault = None,
            }
        }
    }

    /// What was wrong, in the order in which it was seen.
    pub fn alerts(&self) -> &[Alert] {
        &self.alerts
    }

    /// Notes on what was wrong within a stretch of the session, with times from its beginning.
    pub fn notes(&self, from_ns: i64, to_ns: i64) -> Vec<(String, String)> {
        let within = |c: &&Alert| c.from_s < seconds(to_ns) && c.to_s.is_none_or(|to_s| to_s > seconds(from_ns));
        let note = |c: &Alert| (format!("{}.{}", c.sensor, c.fault.word()), c.message(from_ns));
        self.alerts.iter().filter(within).map(note).collect()
    }

    fn now_ns(&self) -> i64 {
        if self.newest_ns == i64::MIN { 0 } else { self.newest_ns }
    }

    /// Time of the newest sample, s.
    pub fn newest_s(&self) -> Option<f64> {
        (self.newest_ns > i64::MIN).then(|| seconds(self.newest_ns))
    }

    /// Samples and gaps of all sensors so far.
    pub fn totals(&self) -> (u64, u64) {
        self.watched.iter().fold((0, 0), |sum, w| (sum.0 + w.health.samples, sum.1 + w.health.gaps))
    }

    /// How each sensor stands.
    pub fn views(&self) -> Vec<SensorView> {
        let view = |watched: &Watched| {
            let sensor = self.rig.sensors.get(watched.expected.sensor)?;
            let health = &watched.health;
            Some(SensorView {
                name: sensor.name.clone(),
                unit: sensor.unit.symbol,
                device: watched.expected.device,
                samples: health.samples,
                rate_hz: health.rate_hz(),
                level: health.level(),
                accuracy: sensor.accuracy(health.magnitude()),
                gaps: health.gaps,
                trace: health.trace(self.now_ns()),
                fault: watched.fault,
            })
        };
        self.watched.iter().filter_map(view).collect()
    }
}

impl Watched {
    /// Notes whether something has come, and says whether nothing has for too long. A pause that the sensor has made by
    /// itself, without a gap, is its way.
    fn is_silent(&mut self, moment: Instant) -> bool {
        let (samples, gaps, at) = self.last_seen;
        let since = moment.saturating_duration_since(at);
        if self.health.samples != samples {
            if samples > 0 && self.health.gaps == gaps {
                self.pause = self.pause.max(since);
            }
            self.last_seen = (self.health.samples, self.health.gaps, moment);
            return false;
        }
        self.expected.silent_after.is_some_and(|after| since >= after.max(2 * self.pause))
    }

    fn close(&mut self, alerts: &mut [Alert], now_ns: i64) {
        if let Some((index, _)) = self.now.take()
            && let Some(alert) = alerts.get_mut(index)
        {
            alert.to_s = Some(seconds(now_ns));
        }
        self.fault = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn monitor(silent_after: Option<Duration>) -> (Monitor, Instant) {
        let rig = Rig::from_toml(include_str!("../../../rigs/demo-hdpe.toml"), "demo.toml").unwrap();
        let expected = [0, 1].map(|sensor| Expected { sensor, device: Some(0), silent_after });
        (Monitor::new(&rig, &expected), Instant::now())
    }

    /// A second of both sensors at 100 Hz in frames of ten, that comes from a moment on.
    fn second(monitor: &mut Monitor, from: Instant, at_s: i64, first: impl Fn(i64) -> f64) {
        for frame in 0..10 {
            let at = |i: i64| at_s * 100 + frame * 10 + i;
            let values = |of: &dyn Fn(i64) -> f64| (0..10).map(|i| of(at(i))).collect::<Vec<_>>();
            let wiggle = |i: i64| 245.0 + [0.3, -0.2, 0.1][i as usize % 3];
            monitor.samples(0, at_s * S + frame * S / 10, 1e7, &values(&first));
            monitor.samples(1, at_s * S + frame * S / 10, 1e7, &values(&wiggle));
            monitor.tick_at(from + Duration::from_millis(100 * frame as u64));
        }
    }

    #[test]
    fn a_call_out_begins_lasts_through_its_pauses_and_ends() {
        let (mut monitor, start) = monitor(None);
        let well = |i: i64| 300.0 + [0.5, -0.5, 0.2][i as usize % 3];
        // saturates in every other second from 2 s to 9 s, as the peaks of a surge do
        let peaks = |i: i64| if (2..9).contains(&(i / 100)) && (i / 100) % 2 == 0 { 1000.0 } else { well(i) };
        let second = |monitor: &mut Monitor, s| second(monitor, start + Duration::from_secs(s as u64), s, peaks);
        (0..2).for_each(|s| second(&mut monitor, s));
        assert_eq!((monitor.alerts(), monitor.views()[0].fault), (&[][..], None));
        (2..9).for_each(|s| second(&mut monitor, s));
        assert_eq!(monitor.alerts().len(), 1);
        assert_eq!(monitor.views()[0].fault.unwrap().word(), "saturated");
        assert_eq!(monitor.alerts()[0].to_s, None);
        (9..14).for_each(|s| second(&mut monitor, s));
        let [alert] = monitor.alerts() else { panic!("{:?}", monitor.alerts()) };
        assert!((2.0..2.4).contains(&alert.from_s) && (11.5..13.5).contains(&alert.to_s.unwrap()), "{alert:?}");
        assert_eq!((monitor.views()[0].fault, monitor.views()[1].fault), (None, None));
        assert_eq!((monitor.totals(), monitor.views()[1].rate_hz), ((2800, 0), Some(100.0)));
        // a shot from 1.2 s on tells it on its own clock; one before it does not know of it
        let [(key, text)] = &monitor.notes(12 * S / 10, 5 * S)[..] else { panic!() };
        assert!(key == "P1.saturated" && text.contains(" s saturated: at the upper end"), "{key} {text}");
        let from_s: f64 = text.split(' ').nth(1).unwrap().parse().unwrap();
        assert!((0.8..1.2).contains(&from_s), "{text}");
        assert_eq!(monitor.notes(0, 2 * S), []);
    }

    #[test]
    fn a_sensor_that_falls_silent_is_called_out_at_once_and_only_while_it_is() {
        let (mut monitor, start) = monitor(Some(Duration::from_millis(300)));
        let ms = |ms| start + Duration::from_millis(ms);
        let well = |i: i64| 300.0 + [0.5, -0.5, 0.2][i as usize % 3];
        second(&mut monitor, ms(0), 0, well);
        [1120, 2400].into_iter().for_each(|at_ms| monitor.tick_at(ms(at_ms)));
        assert!(monitor.views().iter().all(|view| view.fault == Some(SensorFault::Silent)));
        monitor.gap(0);
        second(&mut monitor, ms(2400), 1, well);
        assert!(monitor.views().iter().all(|view| view.fault.is_none()), "{:?}", monitor.alerts());
        // the second sensor came back without a gap: that is its way, and not silence
        [3520, 4800].into_iter().for_each(|at_ms| monitor.tick_at(ms(at_ms)));
        let silent: Vec<bool> = monitor.views().iter().map(|view| view.fault.is_some()).collect();
        assert_eq!(silent, [true, false]);
        assert_eq!(monitor.alerts().iter().map(|c| c.index).collect::<Vec<_>>(), [0, 1, 0]);
    }
}
