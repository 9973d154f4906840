//! Streams of several devices on one clock: that of the first device that has one of its own.
//!
//! Every device's clock is fitted against the host's ([`ClockFit`]); through the host each is set against the first
//! one's, whose times stay as they are. A stretch ends where a device restarts: its clock began anew. A device that is
//! asked (Modbus) is on the host's clock.

use crate::record::clock::clock_line::{ClockFit, ClockLine};
use crate::storage::ClockFix;

/// What a device recorded between two restarts.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Recording time of its first sample as logged, ns.
    pub from_ns: i64,
    /// Recording time of its last sample as logged, ns.
    pub last_ns: i64,
    /// Device time of the first sample, ns.
    pub device_ns: i64,
    fit: ClockFit,
    line: Option<ClockLine>,
}

impl Stretch {
    /// A stretch that begins with this sample.
    pub fn new(from_ns: i64, device_ns: i64) -> Stretch {
        Stretch { from_ns, last_ns: from_ns, device_ns, fit: ClockFit::default(), line: None }
    }

    /// A stretch of host times, logged as they are with `zero_ns` as recording time 0.
    pub fn of_host(from_ns: i64, last_ns: i64, zero_ns: i64) -> Stretch {
        let device_ns = from_ns.saturating_add(zero_ns);
        let host_ns = device_ns as f64;
        let (residual_ns, late) = ((0.0, 0.0), (0.0, 0.0));
        let line =
            ClockLine { device_ns, host_ns, rate: 1.0, drift_known: true, residual_ns, is_real_time: true, late };
        Stretch { from_ns, last_ns, device_ns, fit: ClockFit::default(), line: Some(line) }
    }

    /// Takes an arrival.
    pub fn arrived(&mut self, device_ns: i64, host_ns: i64) {
        self.fit.add(device_ns, host_ns);
    }

    /// Arrivals taken.
    pub fn seen(&self) -> u64 {
        self.fit.seen()
    }

    /// No more will come: only the line is kept.
    pub fn close(&mut self) {
        self.line = self.line();
        self.fit = ClockFit::default();
    }

    /// The device's clock against the host's, as well as it is known.
    pub fn line(&self) -> Option<ClockLine> {
        self.line.or_else(|| self.fit.line())
    }
}

/// What moves the times of each device's sensors to the clock of the first device with a clock of its own. Devices come
/// with the names of their sensors, in the order of the rig.
pub fn fixes(devices: &[(Vec<String>, Vec<Stretch>)], own_clock: &[bool]) -> Vec<ClockFix> {
    let fitted = devices.iter().map(|(sensors, stretches)| {
        let lines = stretches.iter().filter_map(|stretch| Some((stretch, stretch.line()?)));
        (sensors, lines.collect::<Vec<_>>())
    });
    let devices: Vec<_> = fitted.collect();
    let mut own = devices.iter().zip(own_clock).filter(|(_, own)| **own);
    let Some(&(first, reference)) = own.find_map(|((_, stretches), _)| stretches.first()) else { return Vec::new() };
    let since_first = |host_ns: f64| (host_ns - reference.host_at(first.device_ns)) / reference.rate;
    let begins = devices.iter().filter_map(|(_, stretches)| {
        let (stretch, line) = stretches.first().filter(|(_, line)| line.is_real_time)?;
        Some(since_first(line.host_at(stretch.device_ns)))
    });
    // The first device's times stay as they are, unless it is the earliest and what it sent first was late: the
    // recording begins with a sample.
    let first_ns = (first.from_ns as f64).min(-begins.fold(0.0, f64::min));
    let recording_ns = |host_ns: f64| first_ns + since_first(host_ns);
    let mut fixes = Vec::new();
    for (sensors, stretches) in &devices {
        let mut end_ns = i64::MIN;
        for (stretch, line) in stretches {
            // Of a clock that does not fit, as of a device that is played faster than in real time, nothing is known:
            // its own times hold.
            let (rate, to_ns) = if line.is_real_time && reference.is_real_time {
                (line.rate / reference.rate, recording_ns(line.host_at(stretch.device_ns)).round() as i64)
            } else {
                (1.0, stretch.from_ns)
            };
            // The fits' errors must not put a stretch before the end of the last one.
            let to_ns = to_ns.max(end_ns.saturating_add(1));
            end_ns = to_ns.saturating_add(((stretch.last_ns - stretch.from_ns) as f64 * rate).ceil() as i64);
            if (to_ns, rate) != (stretch.from_ns, 1.0) || stretches.len() > 1 {
                fixes.push(ClockFix { sensors: sensors.to_vec(), from_ns: stretch.from_ns, to_ns, rate });
            }
        }
    }
    fixes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute of a device, 100 frames a second, that began at the true time `begin_s` and whose clock runs fast by
    /// `drift`; logged from `logged_s` on.
    fn stretch(begin_s: f64, drift: f64, logged_s: f64, seed: u64) -> Stretch {
        let mut dice = fastrand::Rng::with_seed(seed);
        let device = |true_s: f64| (3e9 + (true_s - begin_s) * (1.0 + drift) * 1e9) as i64;
        let mut stretch = Stretch::new((logged_s * 1e9) as i64, device(begin_s));
        for index in 1..=6000 {
            let true_s = begin_s + f64::from(index) * 0.01;
            let delay_s = -0.000_2 * (1.0 - dice.f64()).ln() + if dice.u8(..20) == 0 { 0.03 } else { 0.0 };
            stretch.arrived(device(true_s), ((true_s + delay_s) * 1e9) as i64);
            stretch.last_ns = stretch.from_ns + device(true_s) - device(begin_s);
        }
        stretch
    }

    fn time_s(fix: &ClockFix, logged_s: f64) -> f64 {
        (fix.to_ns as f64 + (logged_s * 1e9 - fix.from_ns as f64) * fix.rate) / 1e9
    }

    #[test]
    fn devices_that_drift_apart_line_up() {
        // True time 0 is recording time 0 of the first device; the second is logged half a second off.
        let first = stretch(0.0, 60e-6, 0.0, 1);
        let second = stretch(7.0, -90e-6, 7.5, 2);
        let polled = Stretch::of_host(2_000_000_000, 50_000_000_000, 0);
        let devices = [
            (vec!["T1".to_owned()], vec![polled]),
            (vec!["P1".to_owned()], vec![first]),
            (vec!["P2".to_owned(), "P3".to_owned()], vec![second]),
        ];
        let fixes = fixes(&devices, &[false, true, true]);
        assert_eq!(fixes.iter().map(|fix| fix.sensors.len()).collect::<Vec<_>>(), [1, 2], "P1 stays as it is");
        for true_s in [7.0, 30.0, 60.0] {
            // What the first device's clock shows.
            let shown_s = true_s * (1.0 + 60e-6);
            let polled = time_s(&fixes[0], true_s);
            let second = time_s(&fixes[1], 7.5 + (true_s - 7.0) * (1.0 - 90e-6));
            assert!((polled - shown_s).abs() < 50e-6, "polled at {true_s} s: {} µs", (polled - shown_s) * 1e6);
            assert!((second - shown_s).abs() < 50e-6, "second at {true_s} s: {} µs", (second - shown_s) * 1e6);
        }
    }

    #[test]
    fn one_device_stays_on_its_own_clock_and_a_restart_is_put_where_it_was() {
        let sensors = vec!["P1".to_owned()];
        assert!(fixes(&[(sensors.clone(), vec![stretch(0.0, 1e-3, 0.0, 1)])], &[true]).is_empty());
        // The second stretch truly begins 65 s after the first, and was logged 2 s late.
        let mut first = stretch(0.0, 1e-3, 0.0, 1);
        first.close();
        let again = stretch(65.0, 1e-3, 67.0, 2);
        let fixes = fixes(&[(sensors, vec![first, again])], &[true]);
        assert_eq!((fixes[0].from_ns, fixes[0].to_ns, fixes[0].rate), (0, 0, 1.0));
        assert!((time_s(&fixes[1], 67.0) - 65.0 * 1.001).abs() < 100e-6, "{:?}", fixes[1]);
    }

    /// The first device begins at 0 and sends its first 2 s at once; the second, which also began at 0, arrived first.
    #[test]
    fn a_recording_begins_with_its_earliest_sample() {
        let (first, second) = (stretch(0.0, 0.0, 1.99, 1), stretch(0.0, 0.0, 0.0, 2));
        let devices = [(vec!["P1".to_owned()], vec![first]), (vec!["P2".to_owned()], vec![second])];
        let retimer = crate::storage::Retimer::new(fixes(&devices, &[true, true]));
        for (sensor, logged_ns) in [("P1", 1_990_000_000), ("P2", 0)] {
            assert!(retimer.of(sensor).time_ns(logged_ns).abs() < 50_000, "{sensor}");
        }
    }

    #[test]
    fn stretches_never_overlap() {
        let sensors = vec!["P1".to_owned()];
        // By its arrivals the second began before the first ended.
        let fixes = fixes(&[(sensors, vec![stretch(0.0, 0.0, 0.0, 1), stretch(59.0, 0.0, 61.0, 2)])], &[true]);
        assert!(time_s(&fixes[1], 61.0) > 60.0);
    }
}
