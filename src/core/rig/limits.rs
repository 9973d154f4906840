//! Limits of a sensor: the ends of its range and of its counts, its accuracy, and its permissible noise. `rig check`
//! judges recordings by them, `record` the sensors while it records.

use crate::rig::device::{Encoding, Protocol};
use crate::rig::types::{Coupling, Rig, Sensor, SensorKind};

/// Share of the range that counts as its end.
const END_SHARE: f64 = 0.001;
/// Assumed accuracy where none is given, percent of the reading.
const DEFAULT_ACCURACY_PERCENT: f64 = 0.5;
/// A good sensor's noise has a standard deviation below this many times its accuracy.
const NOISE_OVER_ACCURACY: f64 = 2.0;

/// Values beyond which a sensor no longer follows, in its unit; infinite if there is no such value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ends {
    /// At or below this.
    pub low: f64,
    /// At or above this.
    pub high: f64,
}

impl Ends {
    const NONE: Ends = Ends { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// True for a value at one of the ends.
    pub fn reached_by(&self, value: f64) -> bool {
        value <= self.low || value >= self.high
    }
}

impl Rig {
    /// Where a sensor of the rig saturates: at the ends of its range or of the counts that carry it, whichever come
    /// first. A valve or a trigger may rest at its ends, a flow at its zero.
    pub fn ends(&self, sensor: &Sensor) -> Ends {
        let low_counts = match sensor.kind {
            SensorKind::Pressure | SensorKind::Temperature => true,
            SensorKind::Flow => false,
            SensorKind::ValvePosition | SensorKind::Trigger => return Ends::NONE,
        };
        let mut ends = Ends::NONE;
        if let Some([low, high]) = sensor.range {
            let edge = END_SHARE * (high - low);
            ends = Ends { low: low + edge, high: high - edge };
        }
        if let (Some([from, to]), Some(wiring)) = (self.count_ends(sensor), &sensor.wiring) {
            let half = 0.5 * wiring.scale.abs();
            ends = Ends { low: ends.low.max(from + half), high: ends.high.min(to - half) };
        }
        if low_counts { ends } else { Ends { low: Ends::NONE.low, ..ends } }
    }

    /// Range of 16-bit counts, in the sensor's unit; `None` if numbers are printed or wider.
    pub(crate) fn count_ends(&self, sensor: &Sensor) -> Option<[f64; 2]> {
        let wiring = sensor.wiring.as_ref()?;
        let device = self.devices.iter().find(|device| device.name == wiring.device)?;
        let [least, most] = match (&device.protocol, wiring.register.map(|register| register.encoding)) {
            (Protocol::Frames, _) | (_, Some(Encoding::I16)) => [f64::from(i16::MIN), f64::from(i16::MAX)],
            (_, Some(Encoding::U16)) => [0.0, f64::from(u16::MAX)],
            _ => return None,
        };
        let [a, b] = [least, most].map(|count| wiring.offset + wiring.scale * count);
        Some([a.min(b), a.max(b)])
    }
}

impl Sensor {
    /// Accuracy at a reading, both in the sensor's unit.
    pub fn accuracy(&self, reading: f64) -> f64 {
        match (self.accuracy_percent_fs, self.range) {
            (Some(percent), Some([low, high])) => percent / 100.0 * (high - low),
            _ => DEFAULT_ACCURACY_PERCENT / 100.0 * reading.abs(),
        }
    }

    /// Standard deviation above which a pressure sensor counts as noisy near a reading, in its unit. `None` if nothing
    /// is known to compare with, and for sensors of which only the mean is used.
    pub fn noise_limit(&self, reading: f64) -> Option<f64> {
        let stated = self.range.is_some();
        if self.kind != SensorKind::Pressure || (self.coupling == Coupling::Ac && !stated) {
            return None;
        }
        let edge = self.range.map_or(0.0, |[low, high]| END_SHARE * (high - low));
        let limit = NOISE_OVER_ACCURACY * self.accuracy(reading).max(edge);
        (limit > 0.0).then_some(limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn demo() -> Rig {
        Rig::from_toml(include_str!("../../../rigs/demo-hdpe.toml"), "demo-hdpe.toml").unwrap()
    }

    #[test]
    fn a_sensor_ends_where_its_range_or_its_counts_do() {
        let mut rig = demo();
        assert_eq!(rig.ends(&rig.sensors[0]), Ends { low: -98.9, high: 998.9 });
        // 16 bits reach from -205 to 1105 kPa
        rig.sensors[0].range = None;
        let ends = rig.ends(&rig.sensors[0]);
        assert!((ends.low + 205.35).abs() < 1e-9 && (ends.high - 1105.33).abs() < 1e-9, "{ends:?}");
        assert!(ends.reached_by(-205.36) && ends.reached_by(1105.34) && !ends.reached_by(1105.3));
        // a flow at rest at its zero is no saturation
        assert_eq!(rig.ends(&rig.sensors[3]).low, f64::NEG_INFINITY);
        rig.sensors[0].kind = SensorKind::Trigger;
        assert!(!rig.ends(&rig.sensors[0]).reached_by(1e9));
    }

    #[test]
    fn noise_is_held_against_the_accuracy() {
        let mut sensor = demo().sensors[0].clone();
        assert_eq!(sensor.noise_limit(0.0), Some(2.2), "0.1% of the range is noise of any sensor");
        assert_eq!(sensor.noise_limit(800.0), Some(8.0));
        sensor.accuracy_percent_fs = Some(0.25);
        assert_eq!(sensor.noise_limit(800.0), Some(5.5));
        (sensor.range, sensor.coupling) = (None, Coupling::Ac);
        assert_eq!(sensor.noise_limit(800.0), None);
    }
}
