//! What a recovered forcing looks like: when it begins, how large it is, and whether it is one tone.

use std::f64::consts::TAU;

use crate::fit::data::run_data::RunData;
use crate::golden::least_between;

/// A forcing begins where it exceeds so many of its errors, at two knots in turn.
const ERRORS: f64 = 4.0;
/// Share of its variance that one tone must have for it to be a pulsation.
const TONE_SHARE: f64 = 0.6;
/// A tone has at least so many cycles in a record, and its cycle so many knots.
pub(crate) const CYCLES: f64 = 3.0;
pub(crate) const KNOTS_A_CYCLE: f64 = 3.0;
/// Amplitude of a tone before the closure over its error, for it to be there.
const BEFORE_ERRORS: f64 = 5.0;

/// A forcing after the closure.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Waveform {
    /// Times after the start of the closure, s.
    pub(crate) time_s: Vec<f64>,
    /// Values.
    pub(crate) value: Vec<f64>,
    /// Their standard deviations.
    pub(crate) sd: Vec<f64>,
}

/// One tone.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pulsation {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude, in the forcing's unit.
    pub amplitude: f64,
    /// Phase of `a sin(2πft + φ)`, rad.
    pub phase_rad: f64,
    /// Whether the record has it before the closure, too; none where it is too short there.
    pub is_there_before: Option<bool>,
}

impl Waveform {
    /// The mean.
    pub(crate) fn mean(&self) -> f64 {
        self.value.iter().sum::<f64>() / self.value.len().max(1) as f64
    }

    /// The value farthest from zero.
    pub(crate) fn peak(&self) -> f64 {
        self.value.iter().copied().fold(0.0, |peak: f64, v| if v.abs() > peak.abs() { v } else { peak })
    }

    /// When it begins, s after the start of the closure.
    pub(crate) fn onset_s(&self) -> Option<f64> {
        let is_clear =
            |i: usize| self.value[i].abs() > ERRORS * self.sd[i] && self.value[i].abs() > 0.1 * self.peak().abs();
        (1..self.value.len()).find(|&i| is_clear(i - 1) && is_clear(i)).map(|i| self.time_s[i - 1])
    }

    /// The tone that it is, if it is one. The record before the closure says whether it was there.
    pub(crate) fn pulsation(&self, data: &RunData, start_s: f64) -> Option<Pulsation> {
        let (n, mean) = (self.value.len(), self.mean());
        let duration_s = self.time_s.last()? - self.time_s[0];
        let step_s = duration_s / (n - 1) as f64;
        let square: f64 = self.value.iter().map(|v| (v - mean).powi(2)).sum();
        let left = |hz: f64| tone(&self.time_s, &self.value, hz).map_or(f64::INFINITY, |(_, _, left)| left);
        let (least, most) = (CYCLES / duration_s, 1.0 / (KNOTS_A_CYCLE * step_s));
        let scan = (0..).map(|i| least + f64::from(i) * 0.2 / duration_s).take_while(|hz| *hz < most);
        let at = scan.min_by(|a, b| left(*a).total_cmp(&left(*b)))?;
        let hz = least_between(left, at - 0.2 / duration_s, at + 0.2 / duration_s);
        let (cos, sin, left) = tone(&self.time_s, &self.value, hz)?;
        if left > (1.0 - TONE_SHARE) * square {
            return None;
        }
        let is_there_before = before(data, start_s, hz, 0.2 / duration_s);
        Some(Pulsation { frequency_hz: hz, amplitude: cos.hypot(sin), phase_rad: cos.atan2(sin), is_there_before })
    }
}

/// `a cos 2πft + b sin 2πft + c` by least squares: `a`, `b`, and the sum of squares that it leaves.
fn tone(time_s: &[f64], value: &[f64], hz: f64) -> Option<(f64, f64, f64)> {
    use nalgebra::{Matrix3, Vector3};
    let (mut m, mut r, mut square) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for (t, v) in time_s.iter().zip(value) {
        let (sin, cos) = (TAU * hz * t).sin_cos();
        let row = Vector3::new(cos, sin, 1.0);
        m += row * row.transpose();
        r += row * *v;
        square += v * v;
    }
    let x = m.cholesky()?.solve(&r);
    Some((x[0], x[1], square - x.dot(&r)))
}

/// Whether sensors show a tone near `hz` before the closure; none where no record holds a cycle.
fn before(data: &RunData, start_s: f64, hz: f64, by_hz: f64) -> Option<bool> {
    let leads = data.sensors.iter().map(|s| {
        let to = s.time_s.partition_point(|&t| t < start_s);
        let time_s: Vec<f64> = s.time_s[..to].iter().map(|t| t - start_s).collect();
        (time_s, &s.head_m[..to], s.noise_m)
    });
    let leads: Vec<_> = leads.filter(|(t, ..)| t.len() > 20 && -t[0] * hz > 1.0).collect();
    let there = leads.iter().any(|(time_s, head_m, noise_m)| {
        let wide = 1.0 / -time_s[0];
        let left = |hz: f64| tone(time_s, head_m, hz).map_or(f64::INFINITY, |(_, _, left)| left);
        let near = least_between(left, hz - by_hz.max(0.25 * wide), hz + by_hz.max(0.25 * wide));
        let error_m = noise_m * (2.0 / time_s.len() as f64).sqrt();
        tone(time_s, head_m, near).is_some_and(|(cos, sin, left)| {
            let scatter_m = (left / time_s.len() as f64).sqrt() * (2.0 / time_s.len() as f64).sqrt();
            cos.hypot(sin) > BEFORE_ERRORS * error_m.max(scatter_m)
        })
    });
    (!leads.is_empty()).then_some(there)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::model::RunValues;
    use crate::rig::Rig;

    /// A tone is read to a small part of the distance of two frequencies that the record tells apart; the record before
    /// the closure, at 0.2 s, has one of its own or not.
    #[test]
    fn a_tone_is_a_pulsation_with_its_frequency() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let mut data = record(&rig, &[], &[380.0], run, 0.02, 3.0);
        let time_s: Vec<f64> = (0..300).map(|i| f64::from(i) * 0.01).collect();
        let value: Vec<f64> = time_s.iter().map(|t| 0.3 + 1.4 * (TAU * 7.31 * t + 0.5).sin()).collect();
        let tone = Waveform { sd: vec![0.05; value.len()], value, time_s: time_s.clone() };
        let seen = tone.pulsation(&data, 0.2).unwrap();
        assert!((seen.frequency_hz - 7.31).abs() < 0.01 && (seen.amplitude - 1.4).abs() < 0.01, "{seen:?}");
        assert!((seen.phase_rad - 0.5).abs() < 0.1 && seen.is_there_before == Some(false), "{seen:?}");
        let sensor = &mut data.sensors[0];
        for (t, head) in sensor.time_s.iter().zip(&mut sensor.head_m) {
            *head += 0.5 * (TAU * 7.31 * t).sin();
        }
        assert_eq!(tone.pulsation(&data, 0.2).unwrap().is_there_before, Some(true));
        assert_eq!(tone.pulsation(&data, 0.1).unwrap().is_there_before, None);
        let ramp = Waveform { value: time_s.iter().map(|t| t.powi(2)).collect(), ..tone };
        assert_eq!(ramp.pulsation(&data, 0.2), None);
        let late = Waveform { value: time_s.iter().map(|t| f64::from(u8::from(*t > 1.0))).collect(), ..ramp };
        assert!((late.onset_s().unwrap() - 1.01).abs() < 0.011);
    }
}
