//! The sine of a frequency that fits an even record best, beside a straight line.

use std::f64::consts::TAU;

/// See the module.
pub(crate) struct Sine {
    /// Its frequency, in cycles a sample.
    pub(crate) cycles_per_sample: f64,
    cosine: f64,
    sine: f64,
}

impl Sine {
    /// Of samples from which a straight line was taken off.
    pub(crate) fn of(samples: &[f64], cycles_per_sample: f64) -> Sine {
        let [c, s] = columns(samples.len(), cycles_per_sample);
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let [cc, cs, ss, cy, sy] = [dot(&c, &c), dot(&c, &s), dot(&s, &s), dot(&c, samples), dot(&s, samples)];
        let determinant = cc * ss - cs * cs;
        let (cosine, sine) = match determinant > 1e-6 * cc * cc {
            true => ((cy * ss - sy * cs) / determinant, (sy * cc - cy * cs) / determinant),
            // at half the rate there is a cosine alone
            false => (cy / cc.max(f64::MIN_POSITIVE), 0.0),
        };
        Sine { cycles_per_sample, cosine, sine }
    }

    /// Its amplitude, in the samples' unit.
    pub(crate) fn amplitude(&self) -> f64 {
        self.cosine.hypot(self.sine)
    }

    /// Takes it out of the samples, which stay without a straight line.
    pub(crate) fn take(&self, samples: &mut [f64]) {
        let [c, s] = columns(samples.len(), self.cycles_per_sample);
        for (y, (c, s)) in samples.iter_mut().zip(c.iter().zip(&s)) {
            *y -= self.cosine * c + self.sine * s;
        }
    }
}

/// Cosine and sine without their straight lines: a tone of few cycles has one, which is gone from the samples.
fn columns(samples: usize, cycles_per_sample: f64) -> [Vec<f64>; 2] {
    let (cosine, sine): (Vec<f64>, Vec<f64>) = (0..samples)
        .map(|i| {
            let (s, c) = (TAU * cycles_per_sample * i as f64).sin_cos();
            (c, s)
        })
        .unzip();
    [detrended(&cosine), detrended(&sine)]
}

/// Residuals of a straight line.
pub(crate) fn detrended(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let mean = values.iter().sum::<f64>() / n;
    let (mut xy, mut xx) = (0.0, 0.0);
    for (i, v) in values.iter().enumerate() {
        let x = i as f64 - middle;
        xy += x * (v - mean);
        xx += x * x;
    }
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    values.iter().enumerate().map(|(i, v)| v - mean - slope * (i as f64 - middle)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tone of 1.4 cycles loses a fifth of its energy to a straight line; it is found whole.
    #[test]
    fn a_tone_of_few_cycles_is_found_beside_its_straight_line() {
        let tone = |i: usize| 0.7 * (TAU * 0.0014 * i as f64 + 0.4).sin();
        let samples = detrended(&(0..1000).map(tone).collect::<Vec<_>>());
        let found = Sine::of(&samples, 0.0014);
        assert!((found.amplitude() - 0.7).abs() < 1e-9, "{}", found.amplitude());
        let mut left = samples;
        found.take(&mut left);
        assert!(left.iter().all(|v| v.abs() < 1e-9));
    }
}
