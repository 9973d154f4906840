//! Hum in residuals: tones whose frequency and size are known from the record before the closure, and whose phase and
//! slow drift are not.
//!
//! A tone is `Σ_k (a_k cos 2πft + b_k sin 2πft) P_k(t)` with Legendre polynomials `P_k` over the record: the first is
//! the tone, the others an error of its frequency and its drift. Coefficients are normally distributed about zero, as
//! wide as the tone was large before the closure. With the columns `Q` orthonormal and coefficients of standard
//! deviation `s` in units of the noise, the covariance of residuals is `I + Q s² Qᵀ`, and its inverse square root
//! whitens them: each coefficient is divided by `√(1 + s²)`. So the likelihood is the one in which the hum has been
//! integrated out (Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, 2.7), for any model, and nothing
//! is simulated for it.

use std::f64::consts::TAU;

use crate::fit::data::run_data::SensorData;
use crate::signal::Tone;

/// Legendre polynomials of a tone: a constant, and a phase that bends twice.
const DEGREES: usize = 4;
/// A column of which less than this part is its own is a sum of others.
const LEAST_OWN: f64 = 1e-6;

/// The hum of one sensor at some of its times.
pub(crate) struct Hum {
    /// Orthonormal columns over the samples, and the standard deviation of the coefficient of each in units of the
    /// noise.
    columns: Vec<(Vec<f64>, f64)>,
}

impl Hum {
    /// At times of the sensor; none where it has no hum.
    pub(crate) fn of(sensor: &SensorData, time_s: &[f64]) -> Option<Hum> {
        let (first_s, last_s) = time_s.first().zip(time_s.last()).filter(|_| !sensor.hum.is_empty())?;
        let (middle_s, half_s) = (0.5 * (first_s + last_s), (0.5 * (last_s - first_s)).max(f64::MIN_POSITIVE));
        let mut columns: Vec<(Vec<f64>, f64)> = Vec::new();
        for Tone { hz, amplitude_m } in &sensor.hum {
            let sd = amplitude_m / sensor.noise_m * (0.5 * time_s.len() as f64).sqrt();
            for degree in 0..DEGREES {
                for quarter in [0.0, 0.25] {
                    let value = |t: &f64| (TAU * (hz * t + quarter)).cos() * legendre(degree, (t - middle_s) / half_s);
                    let column: Vec<f64> = time_s.iter().map(value).collect();
                    columns.extend(own_part(column, &columns).map(|own| (own, sd)));
                }
            }
        }
        Some(Hum { columns })
    }

    /// Whitens residuals, in units of the noise.
    pub(crate) fn whiten(&self, residuals: &mut [f64]) {
        for (column, sd) in &self.columns {
            let less = (1.0 / (1.0 + sd * sd).sqrt() - 1.0) * dot(column, residuals);
            residuals.iter_mut().zip(column).for_each(|(r, q)| *r += less * q);
        }
    }
}

/// What a model leaves of a sensor at times, less the hum that is expected in it.
pub fn without_hum(sensor: &SensorData, time_s: &[f64], mut left: Vec<f64>) -> Vec<f64> {
    for (column, sd) in Hum::of(sensor, time_s).iter().flat_map(|hum| &hum.columns) {
        let share = dot(column, &left) * sd * sd / (1.0 + sd * sd);
        left.iter_mut().zip(column).for_each(|(l, q)| *l -= share * q);
    }
    left
}

/// The part of a column that is orthogonal to others, of length one; none where it is a sum of them.
fn own_part(mut column: Vec<f64>, others: &[(Vec<f64>, f64)]) -> Option<Vec<f64>> {
    let whole = dot(&column, &column);
    for (other, _) in others {
        let shared = dot(other, &column);
        column.iter_mut().zip(other).for_each(|(c, o)| *c -= shared * o);
    }
    let own = dot(&column, &column);
    column.iter_mut().for_each(|c| *c /= own.sqrt());
    (own > LEAST_OWN * whole).then_some(column)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The Legendre polynomial of a degree, by Bonnet's recursion.
fn legendre(degree: usize, x: f64) -> f64 {
    let step = |(before, last): (f64, f64), n: usize| {
        let n = n as f64;
        (last, ((2.0 * n + 1.0) * x * last - n * before) / (n + 1.0))
    };
    match degree {
        0 => 1.0,
        _ => (1..degree).fold((1.0, x), step).1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Rig;

    fn sensor(head_m: Vec<f64>, time_s: Vec<f64>, hum: Vec<Tone>) -> SensorData {
        let rig = Rig::from_toml(crate::fit::problem::test_record::HDPE, "rig.toml").unwrap();
        let sensor = rig.sensors[0].clone();
        let (noise_m, total_noise_m, lines, offset_sd_m, saturated) = (0.1, 0.1, Vec::new(), 0.2, 0);
        SensorData { sensor, time_s, head_m, noise_m, total_noise_m, hum, lines, offset_sd_m, saturated }
    }

    /// The map is the inverse square root of the covariance of noise and hum: `W (I + Q s² Qᵀ) W = I`.
    #[test]
    fn residuals_with_hum_become_white() {
        let time_s: Vec<f64> = (0..40).map(|i| 0.1 + 3e-3 * f64::from(i)).collect();
        let tones = vec![Tone { hz: 50.0, amplitude_m: 0.6 }, Tone { hz: 100.0, amplitude_m: 0.05 }];
        let hum = Hum::of(&sensor(vec![0.0; 40], time_s.clone(), tones), &time_s).unwrap();
        assert_eq!(hum.columns.len(), 16);
        let whitened = |mut v: Vec<f64>| {
            hum.whiten(&mut v);
            v
        };
        for i in 0..40 {
            let own = whitened((0..40).map(|k| f64::from(u8::from(k == i))).collect());
            let mut covered = own.clone();
            for (q, sd) in &hum.columns {
                let share = sd * sd * dot(q, &own);
                covered.iter_mut().zip(q).for_each(|(c, q)| *c += share * q);
            }
            let back = whitened(covered);
            assert!((0..40).all(|k| (back[k] - f64::from(u8::from(k == i))).abs() < 1e-10), "{i}: {back:?}");
        }
    }

    /// A tone whose frequency is off by as much as a second before the closure tells, and which drifts: what is left
    /// of 0.6 m is less than the noise.
    #[test]
    fn a_tone_that_drifts_is_taken_out() {
        let time_s: Vec<f64> = (0..6000).map(|i| f64::from(i) * 2e-3).collect();
        let phase = |t: f64| TAU * (50.01 * t + 0.0005 * (t - 6.0).powi(2)) + 1.0;
        let left: Vec<f64> = time_s.iter().map(|t| 0.6 * phase(*t).sin()).collect();
        let sensor = sensor(left.clone(), time_s.clone(), vec![Tone { hz: 50.0, amplitude_m: 0.6 }]);
        let rest = without_hum(&sensor, &time_s, left);
        let rms = (dot(&rest, &rest) / 6000.0).sqrt();
        assert!(rms < 0.03, "{rms}");
    }
}
