//! Faults of a sensor while it records, and what to do about them.

use serde::Serialize;

use crate::record::clock::device_clock::seconds;
use crate::record::health::sensor_health::SensorHealth;
use crate::rig::{Sensor, SensorKind};

/// A sensor that has not moved at all for so long, ns, and so many samples, is flat.
const FLAT_NS: i64 = 3_000_000_000;
const FLAT_SAMPLES: u64 = 30;
/// So many samples of the last second at an end are no single spike.
const REPEATED: u32 = 3;

/// What is wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "what", rename_all = "kebab-case")]
pub enum SensorFault {
    /// No sample comes.
    Silent,
    /// It stands again and again at the end of what it can show.
    Saturated {
        /// The end, in its unit.
        end: f64,
        /// The upper end.
        upper: bool,
    },
    /// Its device's times do not run as fast as they arrive.
    WrongTimeUnit {
        /// What they are taken for.
        read_as: &'static str,
        /// What they are likely in.
        likely: &'static str,
    },
    /// It does not move at all.
    Flat {
        /// Where it stands, in its unit.
        at: f64,
    },
    /// Its noise is large against its accuracy.
    Noisy {
        /// Standard deviation, in its unit.
        sd: f64,
        /// The largest that would do.
        limit: f64,
    },
}

impl SensorFault {
    /// The worst fault that the last seconds of a sensor show. Only a caller with a clock knows whether it is silent.
    pub fn of(sensor: &Sensor, health: &SensorHealth) -> Option<SensorFault> {
        let (at_low, at_high, samples) = health.at_ends();
        // of a slow sensor every sample counts
        if at_low.max(at_high) >= REPEATED.min(samples.max(1)) {
            let upper = at_high >= at_low;
            return Some(SensorFault::Saturated { end: if upper { health.ends.high } else { health.ends.low }, upper });
        }
        // other quantities may well stand still for a while
        if sensor.kind != SensorKind::Pressure {
            return None;
        }
        let magnitude = health.magnitude();
        // a converter coarser than the sensor hides its noise
        let coarse = sensor
            .wiring
            .as_ref()
            .is_some_and(|wiring| sensor.noise_limit(magnitude).is_some_and(|limit| wiring.scale.abs() > limit));
        let (still_ns, still) = health.still();
        if still_ns >= FLAT_NS && still >= FLAT_SAMPLES && !coarse {
            return Some(SensorFault::Flat { at: health.level().unwrap_or_default() });
        }
        let (sd, limit) = (health.noise()?, sensor.noise_limit(magnitude)?);
        (sd > limit).then_some(SensorFault::Noisy { sd, limit })
    }

    /// One word for it.
    pub fn word(&self) -> &'static str {
        match self {
            SensorFault::Silent => "silent",
            SensorFault::Saturated { .. } => "saturated",
            SensorFault::WrongTimeUnit { .. } => "wrong-time-unit",
            SensorFault::Flat { .. } => "flat",
            SensorFault::Noisy { .. } => "noisy",
        }
    }

    /// What is seen, with the numbers.
    pub fn seen(&self, unit: &str) -> String {
        match self {
            SensorFault::Silent => "silent: no samples arrive".to_owned(),
            SensorFault::Saturated { end, upper } => {
                let which = if *upper { "upper" } else { "lower" };
                format!("saturated: at the {which} end of its range, {} {unit}", short(*end, 4))
            }
            SensorFault::WrongTimeUnit { read_as, likely } => {
                format!("in a wrong unit of time: its device's times arrive at the pace of {likely}, not {read_as}")
            }
            SensorFault::Flat { at } => {
                format!("flat: constant at {} {unit} for 3 s", short(*at, 4))
            }
            SensorFault::Noisy { sd, limit } => {
                format!(
                    "noisy: standard deviation {} {unit}, where its accuracy allows {}",
                    short(*sd, 3),
                    short(*limit, 3)
                )
            }
        }
    }

    /// What to do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            SensorFault::Silent => "check its cable, and that its device runs and sends this channel",
            SensorFault::Saturated { .. } => {
                "check its wiring and supply, or use a larger range (or another 'scale'), before you close the valve"
            }
            SensorFault::WrongTimeUnit { likely: "s", .. } => {
                "set time_unit = \"s\" for its [[device]] in the rig file, and record anew"
            }
            SensorFault::WrongTimeUnit { likely: "ms", .. } => {
                "set time_unit = \"ms\" for its [[device]] in the rig file, and record anew"
            }
            SensorFault::WrongTimeUnit { likely: "us", .. } => {
                "leave out time_unit of its [[device]] in the rig file, and record anew"
            }
            SensorFault::WrongTimeUnit { .. } => {
                "set time_unit = \"ns\" for its [[device]] in the rig file, and record anew"
            }
            SensorFault::Flat { .. } => {
                "check that it is plugged in and powered, that its tapping is open, and that its channel is the right one"
            }
            SensorFault::Noisy { .. } => {
                "look for a loose plug, mains hum, trapped air or a pulsating pump before you close the valve"
            }
        }
    }
}

/// At most so many digits that matter.
fn short(value: f64, digits: i32) -> String {
    let before = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 + 1 };
    let digits = usize::try_from(digits - before).unwrap_or(0).min(6);
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A fault and how long it lasted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alert {
    /// The sensor.
    pub sensor: String,
    /// Its index in the rig.
    #[serde(skip)]
    pub index: usize,
    /// What was wrong.
    #[serde(flatten)]
    pub fault: SensorFault,
    /// From when on, s of the recording.
    pub from_s: f64,
    /// Until when; none where it lasted to the end.
    pub to_s: Option<f64>,
    /// Unit of the numbers.
    pub unit: &'static str,
    /// What to do about it.
    pub advice: &'static str,
}

impl Alert {
    /// When it was, on a clock that began at `zero_ns` of the session's, and what.
    pub fn message(&self, zero_ns: i64) -> String {
        let from_s = (self.from_s - seconds(zero_ns)).max(0.0);
        let seen = self.fault.seen(self.unit);
        match self.to_s {
            Some(to_s) => format!("from {from_s:.1} s to {:.1} s {seen}", to_s - seconds(zero_ns)),
            None => format!("from {from_s:.1} s on {seen}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Rig;

    fn judged(change: impl Fn(&mut Sensor), value: impl Fn(usize) -> f64) -> Option<SensorFault> {
        let mut rig = Rig::from_toml(include_str!("../../../rigs/demo-hdpe.toml"), "demo.toml").unwrap();
        change(&mut rig.sensors[0]);
        let mut health = SensorHealth::new(rig.ends(&rig.sensors[0]), 1.4);
        let values: Vec<f64> = (0..5000).map(value).collect();
        health.take(0, 1e6, &values);
        SensorFault::of(&rig.sensors[0], &health)
    }

    fn wiggle(i: usize) -> f64 {
        [0.3, -0.2, 0.1, -0.4, 0.2][i % 5]
    }

    #[test]
    fn a_sensor_that_is_well_is_not_called_out_even_in_a_surge() {
        assert_eq!(judged(|_| {}, |i| 245.0 + wiggle(i)), None);
        assert_eq!(judged(|_| {}, |i| if (i / 700) % 2 == 0 { 100.0 } else { 600.0 } + wiggle(i)), None);
        assert_eq!(judged(|_| {}, |i| if i == 4500 { 1500.0 } else { 245.0 + wiggle(i) }), None, "one spike");
    }

    #[test]
    fn saturated_flat_and_noisy_are_told_apart() {
        let at_end = judged(|_| {}, |_| 1000.0).unwrap();
        assert_eq!(at_end, SensorFault::Saturated { end: 998.9, upper: true });
        assert_eq!(at_end.seen("kPa"), "saturated: at the upper end of its range, 998.9 kPa");
        assert_eq!(judged(|_| {}, |i| -99.0 - wiggle(i).abs()).unwrap().word(), "saturated");
        assert_eq!(judged(|s| s.range = None, |i| 1105.34 + wiggle(i).abs()).unwrap().word(), "saturated");
        assert_eq!(judged(|_| {}, |_| 245.0), Some(SensorFault::Flat { at: 245.0 }));
        assert_eq!(judged(|s| s.kind = SensorKind::Temperature, |_| 24.0), None, "a temperature may stand still");
        assert_eq!(
            judged(|s| s.wiring.as_mut().unwrap().scale = 20.0, |_| 245.0),
            None,
            "a coarse converter hides noise"
        );
        let Some(SensorFault::Noisy { sd, limit }) = judged(|_| {}, |i| 245.0 + 100.0 * wiggle(i)) else { panic!() };
        assert!((20.0..32.0).contains(&sd) && (limit - 2.75).abs() < 1e-9, "{sd} {limit}");
    }

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 998.9, 1105.336, 0.012_345, 245.0, 123_456.0].map(|value| short(value, 4));
        assert_eq!(texts, ["0", "998.9", "1105", "0.01235", "245", "123456"]);
    }
}
