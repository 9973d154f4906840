//! Samples of different devices on one clock: what moves the times of a live file once the clocks are known.
//!
//! While a test runs, a device's samples are logged at its own clock's times, shifted as a whole. Drift and offset
//! against the other devices are known better from minute to minute; the live file holds the latest estimate as
//! metadata `surgescope.clocks`, and every sample is moved by it when the file is finished, recovered or read.

use std::collections::BTreeMap;

use mcap::records::Metadata;

use crate::recording::Gap;
use crate::storage::layout;
use crate::storage::layout::key;

/// Name of the metadata record.
pub const CLOCKS_METADATA: &str = "surgescope.clocks";
const FIXES: &str = "fixes";

/// From `from_ns` on (up to the next fix of the same sensor), time `t` becomes `to_ns` + `rate` × (`t` − `from_ns`).
#[derive(Debug, Clone, PartialEq)]
pub struct ClockFix {
    /// Names of the sensors whose times it moves.
    pub sensors: Vec<String>,
    /// Recording time as it was logged, ns.
    pub from_ns: i64,
    /// What it becomes, ns.
    pub to_ns: i64,
    /// Seconds of the recording's clock a second of the device's.
    pub rate: f64,
}

/// The fixes of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Retimer {
    fixes: Vec<ClockFix>,
}

/// The fixes of one sensor, by time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SensorClock(Vec<(i64, i64, f64)>);

impl Retimer {
    /// A retimer of these fixes.
    pub fn new(fixes: Vec<ClockFix>) -> Retimer {
        Retimer { fixes }
    }

    /// The record that holds the fixes in a live file, with a check sum: MCAP gives metadata none.
    pub fn metadata(&self) -> Metadata {
        let fixes: Vec<_> = self.fixes.iter().map(|f| (&f.sensors, f.from_ns, f.to_ns, f.rate.to_bits())).collect();
        let text = serde_json::to_string(&fixes).unwrap_or_default();
        let mut entries = BTreeMap::from([(FIXES.to_string(), text)]);
        entries.insert(key::CHECK.into(), layout::check_sum(&entries));
        Metadata { name: CLOCKS_METADATA.into(), metadata: entries }
    }

    /// The fixes in such a record; an error says what is wrong with it.
    pub fn read(record: &Metadata) -> Result<Retimer, String> {
        let entries = &record.metadata;
        if entries.get(key::CHECK) != Some(&layout::check_sum(entries)) {
            return Err("the check sum of the clocks is wrong".into());
        }
        let text = entries.get(FIXES).map_or("", String::as_str);
        let fixes: Vec<(Vec<String>, i64, i64, u64)> =
            serde_json::from_str(text).map_err(|_| "the record of the clocks cannot be read")?;
        let fix = |(sensors, from_ns, to_ns, rate)| ClockFix { sensors, from_ns, to_ns, rate: f64::from_bits(rate) };
        Ok(Retimer { fixes: fixes.into_iter().map(fix).collect() })
    }

    /// The fixes of one sensor.
    pub fn of(&self, sensor: &str) -> SensorClock {
        let own = |fix: &&ClockFix| fix.sensors.iter().any(|name| name == sensor);
        let mut fixes: Vec<_> = self.fixes.iter().filter(own).map(|fix| (fix.from_ns, fix.to_ns, fix.rate)).collect();
        fixes.sort_by_key(|fix| fix.0);
        SensorClock(fixes)
    }
}

impl SensorClock {
    /// True if no time moves.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A logged time on the recording's clock, ns.
    pub fn time_ns(&self, time_ns: i64) -> i64 {
        match self.fix(time_ns) {
            Some((from_ns, to_ns, rate)) => {
                to_ns.saturating_add((time_ns.saturating_sub(from_ns) as f64 * rate).round() as i64)
            }
            None => time_ns,
        }
    }

    /// The logged time of a time on the recording's clock, ns; in a hole between two stretches that of its begin.
    pub fn logged_ns(&self, time_ns: i64) -> i64 {
        let at = self.0.partition_point(|fix| fix.1 <= time_ns).max(1) - 1;
        let Some((from_ns, to_ns, rate)) = self.0.get(at).copied() else { return time_ns };
        let logged_ns = from_ns.saturating_add((time_ns.saturating_sub(to_ns) as f64 / rate).round() as i64);
        self.0.get(at + 1).map_or(logged_ns, |next| logged_ns.min(next.0 - 1))
    }

    /// Seconds of the recording's clock a second of the device's, at a logged time.
    pub fn rate(&self, time_ns: i64) -> f64 {
        self.fix(time_ns).map_or(1.0, |fix| fix.2)
    }

    /// A gap between logged times.
    pub fn gap(&self, gap: Gap) -> Gap {
        let time_s = |time_s: f64| layout::to_ns(time_s).map_or(time_s, |ns| layout::to_s(self.time_ns(ns)));
        if self.is_empty() { gap } else { Gap { from_s: time_s(gap.from_s), to_s: time_s(gap.to_s), ..gap } }
    }

    fn fix(&self, time_ns: i64) -> Option<(i64, i64, f64)> {
        self.0.iter().rev().find(|fix| fix.0 <= time_ns).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn retimer() -> Retimer {
        let fix = |from_ns, to_ns, rate| ClockFix { sensors: vec!["P1".into(), "P2".into()], from_ns, to_ns, rate };
        Retimer::new(vec![fix(2_000_000_000, 2_500_000_000, 1.5), fix(0, 1000, 1.000_1)])
    }

    #[test]
    fn each_stretch_of_a_sensor_moves_by_its_own_fix() {
        let clock = retimer().of("P2");
        assert_eq!(
            [-5, 0, 10_000, 2_000_000_000, 3_000_000_000].map(|t| clock.time_ns(t)),
            [-5, 1000, 11_001, 2_500_000_000, 4_000_000_000]
        );
        assert_eq!((clock.rate(1), clock.rate(2_000_000_000)), (1.000_1, 1.5));
        assert_eq!(
            [1000, 11_001, 2_200_000_000, 2_500_000_000, 4_000_000_000].map(|t| clock.logged_ns(t)),
            [0, 10_000, 1_999_999_999, 2_000_000_000, 3_000_000_000]
        );
        assert_eq!(SensorClock::default().logged_ns(7), 7);
        let gap = clock.gap(Gap { from_s: 0.0, to_s: 3.0, samples: Some(4) });
        assert_eq!(gap, Gap { from_s: 1e-6, to_s: 4.0, samples: Some(4) });
        assert!(retimer().of("Q1").is_empty());
    }

    #[test]
    fn the_record_gives_the_fixes_back_and_a_damaged_one_none() {
        let mut record = retimer().metadata();
        assert_eq!(Retimer::read(&record), Ok(retimer()));
        let text = record.metadata.get_mut(FIXES).unwrap();
        *text = text.replace("2500000000", "2500000001");
        assert!(Retimer::read(&record).is_err());
    }
}
