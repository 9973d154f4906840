//! How well a device's clock is known against this computer's, for the user.

use std::fmt;

use serde::Serialize;

use super::fit::ClockLine;

/// Where half of the arrivals are later than this after the line, the line is none, ms.
const MOST_RESIDUAL_MS: f64 = 50.0;

/// A device's clock against this computer's: the line below all arrivals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClockSummary {
    /// How much faster the device's clock runs, millionths; `None` where the stream was too short for the scatter of its arrivals, or not in real time.
    pub drift_ppm: Option<f64>,
    /// How late after the line half of the arrivals came at most, ms.
    pub residual_median_ms: f64,
    /// How late 95% of them came at most, ms.
    pub residual_95_ms: f64,
}

impl ClockSummary {
    /// False where most of the arrivals do not lie on one line.
    pub(super) fn fits(&self) -> bool {
        self.residual_median_ms <= MOST_RESIDUAL_MS
    }

    /// What to tell the user where the arrivals do not lie on one line: a clock that stepped, or a line that stalls.
    pub(super) fn warning(&self) -> Option<String> {
        // a stall makes some arrivals late and does the fit no harm; where most are, there is no line
        let (share, late_ms, line) = match self {
            ClockSummary { residual_median_ms: half, .. } if *half > MOST_RESIDUAL_MS => {
                ("half", half, "does its line stall?")
            }
            ClockSummary { residual_95_ms: most, .. } if *most > MOST_RESIDUAL_MS => {
                ("a twentieth", most, "did its line only stall? Then its times are right")
            }
            _ => return None,
        };
        Some(format!(
            "its clock does not run evenly against this computer's ({share} of the frames came over {late_ms:.0} ms late): its times may \
             be off by as much against other devices; did it restart, or was it set; or {line}"
        ))
    }

    pub(super) fn of(line: &ClockLine) -> ClockSummary {
        let (median_ns, most_ns) = line.residual_ns;
        let drift_ppm = line.drift_known.then_some((1.0 / line.rate - 1.0) * 1e6);
        ClockSummary { drift_ppm, residual_median_ms: median_ns / 1e6, residual_95_ms: most_ns / 1e6 }
    }
}

impl fmt::Display for ClockSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.drift_ppm {
            Some(drift) => write!(f, "{drift:+.1} ppm against this computer's")?,
            None => f.write_str("drift not known")?,
        }
        let ClockSummary { residual_median_ms: half, residual_95_ms: most, .. } = self;
        write!(f, "; half of the frames came within {half:.3} ms of the fit, 95% within {most:.3} ms")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fit::ClockFit;

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
    fn a_step_is_told_wherever_it_was() {
        assert_eq!(stepped(0.0).warning(), None);
        for after in [0.06, 0.3, 0.6, 0.9] {
            let warning = stepped(after).warning().unwrap_or_default();
            assert!(warning.contains("does not run evenly"), "{after}: {:?}", stepped(after));
        }
    }
}
