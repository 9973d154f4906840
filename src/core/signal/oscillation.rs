//! Oscillation of a head that is known without noise, such as a simulated one: the same crossings, extrema and damping
//! as of a recording.

use crate::signal::extrema;
use crate::signal::extrema::half_cycles;
use crate::signal::features::{Estimate, Extremum};
use crate::signal::trace::Trace;

/// Features of an oscillating head.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Oscillation {
    /// Times at which the head crosses its mean over a period, s after the first sample. Each ends a half cycle; the
    /// first half cycle is a peak.
    pub crossings_s: Vec<f64>,
    /// Peaks and troughs in turn, one per half cycle; a parabola gives times between samples.
    pub extrema: Vec<Extremum>,
    /// Period, s.
    pub period: Option<Estimate>,
    /// Logarithmic decrement of the swing from peak to trough, cycle by cycle.
    pub damping_per_cycle: Vec<f64>,
}

/// Analyses a head (m) sampled every `step_s` from the start of the closure. `period_s` is a guess of its period,
/// within a factor of about two. A head that does not oscillate has no crossings.
pub fn oscillation(step_s: f64, head_m: &[f64], period_s: f64) -> Oscillation {
    let time_s: Vec<f64> = (0..head_m.len()).map(|i| i as f64 * step_s).collect();
    let Some(trace) = Trace::new(&time_s, head_m) else { return Oscillation::default() };
    let mut cycles = half_cycles(&trace, 0.0, period_s, 0.0);
    let mut period = extrema::period(&cycles);
    if let Some(found) = period {
        // The mean to cross is one over a whole period, whose length is now known.
        cycles = half_cycles(&trace, 0.0, found.value, 0.0);
        period = extrema::period(&cycles).or(period);
    }
    let mut extrema = extrema::extrema(&trace, &cycles, 0.0, 0);
    for extremum in &mut extrema {
        refine(extremum, &trace);
    }
    let damping_per_cycle = extrema::damping(&extrema);
    Oscillation { crossings_s: cycles.ends_s, extrema, period, damping_per_cycle }
}

/// Moves an extremum to the vertex of the parabola through its sample and the two beside it.
fn refine(extremum: &mut Extremum, trace: &Trace) {
    let i = ((extremum.time_s - trace.start_s) / trace.step_s).round() as usize;
    if i == 0 || i + 1 >= trace.len() {
        return;
    }
    let (a, b, c) = (trace.head_m[i - 1], trace.head_m[i], trace.head_m[i + 1]);
    let bend = a - 2.0 * b + c;
    let towards = 0.5 * (a - c);
    let aside = towards / bend;
    // Beyond half a step the sample was not an extremum of its neighbours but lay at the end of its half cycle.
    if bend != 0.0 && aside.abs() <= 0.5 {
        extremum.time_s += aside * trace.step_s;
        extremum.head_m = b - 0.25 * (a - c) * aside;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_decaying_sine_is_read_between_its_samples() {
        let (step_s, period_s, decrement) = (0.01, 0.4, 0.2);
        let head: Vec<f64> = (0..400)
            .map(|i| i as f64 * step_s)
            .map(|t| 30.0 + 20.0 * (-t / period_s * decrement).exp() * (TAU * t / period_s).sin())
            .collect();
        // The guess is 40 % off.
        let seen = oscillation(step_s, &head, 0.56);
        assert!((seen.period.unwrap().value - period_s).abs() < 0.002, "{:?}", seen.period);
        assert!((seen.damping_per_cycle[0] - decrement).abs() < 0.01, "{:?}", seen.damping_per_cycle);
        // The vertex of the decaying sine comes atan(decrement/2π)/2π of a period before the sine's own.
        let vertex_s = period_s * (0.25 - (decrement / TAU).atan() / TAU);
        for (k, peak) in seen.extrema.iter().filter(|e| e.peak).take(4).enumerate() {
            assert!((peak.time_s - vertex_s - k as f64 * period_s).abs() < 5e-4, "{peak:?}");
        }
        assert!((seen.crossings_s[3] - 2.0 * period_s).abs() < 0.01, "{:?}", seen.crossings_s);
    }

    #[test]
    fn what_does_not_alternate_has_no_crossings() {
        let creeping: Vec<f64> = (0..400).map(|i| 30.0 + 10.0 * (1.0 - (-0.02 * f64::from(i)).exp())).collect();
        let seen = oscillation(0.01, &creeping, 0.4);
        assert!(seen.crossings_s.len() < 2 && seen.period.is_none(), "{seen:?}");
        assert_eq!(oscillation(0.01, &[1.0; 4], 0.4), Oscillation::default());
    }
}
