//! How well a device's clock is known against this computer's, for the user.

use std::fmt;

use serde::Serialize;

use crate::number::significant;
use crate::record::clock::clock_line::ClockLine;

/// A device's clock against this computer's: the line below all arrivals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClockSummary {
    /// How much faster the device's clock runs, millionths; `None` where the stream was too short for the scatter of
    /// its arrivals, or not in real time.
    pub drift_ppm: Option<f64>,
    /// How late after the line half of the arrivals came at most, ms.
    pub residual_median_ms: f64,
    /// How late 95% of them came at most, ms.
    pub residual_95_ms: f64,
    /// The share of the time, in pieces of a second or more, of which nothing came within 50 ms of the line, and by how
    /// much the worst was late, ms.
    pub late_share: f64,
    /// See [`ClockSummary::late_share`].
    pub late_most_ms: f64,
    /// What it sent came as fast as it was measured. A replay at another speed says nothing of a clock.
    #[serde(skip)]
    pub is_real_time: bool,
}

impl ClockSummary {
    /// What to tell the user where for a second or more nothing came on time: bursts do no harm.
    pub(crate) fn warning(&self) -> Option<String> {
        let ClockSummary { late_share: share, late_most_ms: most, .. } = self;
        (*share > 0.0).then(|| {
            format!(
                "its clock does not run evenly against this computer's: in {:.0}% of the time everything came late, by up to {most:.0} ms; if its \
                 line stalled, its times are right, but if its clock was set, or it restarted, they may be off by as much from \
                 other devices",
                100.0 * share
            )
        })
    }

    /// That of the next stretch; keeps the worse lateness of the two.
    pub(crate) fn and(self, next: ClockSummary) -> ClockSummary {
        let (late_share, late_most_ms) =
            (self.late_share.max(next.late_share), self.late_most_ms.max(next.late_most_ms));
        ClockSummary { late_share, late_most_ms, ..next }
    }

    pub(crate) fn of(line: &ClockLine) -> ClockSummary {
        let (median_ns, most_ns) = line.residual_ns;
        let drift_ppm = line.drift_known.then_some((1.0 / line.rate - 1.0) * 1e6);
        ClockSummary {
            drift_ppm,
            residual_median_ms: median_ns / 1e6,
            residual_95_ms: most_ns / 1e6,
            late_share: line.late.1,
            late_most_ms: line.late.0 / 1e6,
            is_real_time: line.is_real_time,
        }
    }
}

impl fmt::Display for ClockSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.is_real_time {
            return f.write_str("not compared: what it sent did not come in real time");
        }
        match self.drift_ppm {
            Some(drift) => write!(f, "{drift:+.1} ppm against this computer's")?,
            None => f.write_str("drift not known")?,
        }
        let ClockSummary { residual_median_ms: half, residual_95_ms: most, .. } = self;
        let (half, most) = (significant(*half, 2), significant(*most, 2));
        write!(f, "; half of the frames arrived within {half} ms of the fitted clock, 95% within {most} ms")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::clock::clock_line::ClockFit;

    /// A minute of frames every 10 ms; the clock is set forward by 0.2 s after a part of it, and nobody has noticed.
    fn stepped(after: f64) -> ClockSummary {
        let mut fit = ClockFit::default();
        for index in 0..6000 {
            let step_ns = if f64::from(index) < 6000.0 * after { 0 } else { 200_000_000 };
            fit.add(i64::from(index) * 10_000_000 + step_ns, i64::from(index) * 10_000_000);
        }
        ClockSummary::of(&fit.line().unwrap())
    }

    #[test]
    fn a_replay_at_another_speed_says_nothing_of_a_clock() {
        let mut fit = ClockFit::default();
        (0..1000).for_each(|i| fit.add(i * 10_000_000, i * 1_000_000));
        let summary = ClockSummary::of(&fit.line().unwrap());
        assert_eq!(summary.to_string(), "not compared: what it sent did not come in real time");
        assert!(!serde_json::to_string(&summary).unwrap().contains("real_time"));
    }

    #[test]
    fn bursts_are_not_told() {
        for (seconds, burst_ms) in [(3, 800), (20, 800), (60, 200)] {
            let mut fit = ClockFit::default();
            for index in 1..=100 * seconds {
                let came_ms = (10 * index + burst_ms - 1) / burst_ms * burst_ms;
                fit.add(index * 10_000_000, came_ms * 1_000_000 + (index * 7919) % 97_000);
            }
            let summary = ClockSummary::of(&fit.line().unwrap());
            assert_eq!(summary.warning(), None, "{summary:?}");
            assert!(summary.residual_95_ms > 50.0, "{summary:?}");
        }
    }

    #[test]
    fn one_late_line_of_a_slow_logger_is_not_told() {
        let mut fit = ClockFit::default();
        for index in 0..20 {
            let late_ns = if index == 12 { 60_000_000 } else { 0 };
            fit.add(index * 2_000_000_000, index * 2_000_000_000 + late_ns);
        }
        assert_eq!(ClockSummary::of(&fit.line().unwrap()).warning(), None);
    }

    #[test]
    fn what_was_late_before_a_restart_is_told_all_the_same() {
        let both = stepped(0.5).and(stepped(0.0));
        assert!(both.warning().is_some() && stepped(0.0).and(stepped(0.0)).warning().is_none());
    }

    #[test]
    fn a_step_is_told_wherever_it_was() {
        assert_eq!(stepped(0.0).warning(), None);
        for after in [0.06, 0.3, 0.6, 0.9] {
            let warning = stepped(after).warning().unwrap_or_default();
            assert!(warning.contains("does not run evenly"), "{after}: {:?}", stepped(after));
        }
    }
}
