//! A damped oscillator driven by a signal: a valve on its supports, the diaphragm of a pressure sensor.

/// `y'' + 2ζω y' + ω² y = ω² x`, solved exactly for an `x` that is linear over each step of one fixed length.
///
/// Under a ramp `x` of slope `g` the oscillator tends to `x - g T`, `T = 2ζ/ω`; the deviation from that moves freely,
/// by the transition matrix. This stays exact and bounded however stiff the oscillator is compared with the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillator {
    dt_s: f64,
    /// Its delay behind a ramp, `T`, s.
    lag_s: f64,
    /// From `(y, y')` to the new `y'`, and likewise to the new `y`.
    to_rate: [f64; 2],
    to_position: [f64; 2],
    /// Position, in units of the signal.
    pub position: f64,
    /// Its rate, 1/s.
    pub rate: f64,
}

impl Oscillator {
    /// At rest at `position`; `frequency_rad_s` is ω, `damping_ratio` ζ, both more than zero.
    pub fn new(frequency_rad_s: f64, damping_ratio: f64, dt_s: f64, position: f64) -> Oscillator {
        let (w, a) = (frequency_rad_s, frequency_rad_s * damping_ratio);
        let discriminant = damping_ratio * damping_ratio - 1.0;
        // `c = e^(-a dt) cosh(d dt)`, `s = e^(-a dt) sinh(d dt)/d` with `d² = a² - w²`, of either sign.
        let d = w * discriminant.abs().sqrt();
        let (c, s) = if d * dt_s < 1e-4 && a * dt_s < 1.0 {
            let square = discriminant.signum() * (d * dt_s).powi(2);
            let decay = (-a * dt_s).exp();
            (decay * (1.0 + square / 2.0), decay * dt_s * (1.0 + square / 6.0))
        } else if discriminant > 0.0 {
            // The slow root as w²/(a + d): a - d would lose its digits.
            let (slow, fast) = ((-w * w / (a + d) * dt_s).exp(), (-(a + d) * dt_s).exp());
            (0.5 * (slow + fast), 0.5 * (slow - fast) / d)
        } else {
            let decay = (-a * dt_s).exp();
            (decay * (d * dt_s).cos(), decay * (d * dt_s).sin() / d.max(f64::MIN_POSITIVE))
        };
        Oscillator {
            dt_s,
            lag_s: 2.0 * damping_ratio / w,
            to_rate: [-w * w * s, c - a * s],
            to_position: [c + a * s, s],
            position,
            rate: 0.0,
        }
    }

    /// The rate at the end of a step over which the signal goes from `before` to `after`, and its derivative by
    /// `after`.
    pub fn next_rate(&self, before: f64, after: f64) -> (f64, f64) {
        let [by_position, by_rate] = self.to_rate;
        let slope = (1.0 + by_position * self.lag_s - by_rate) / self.dt_s;
        (by_position * (self.position - before) + by_rate * self.rate + slope * (after - before), slope)
    }

    /// Advances over that step.
    pub fn advance(&mut self, before: f64, after: f64) {
        let slope = (after - before) / self.dt_s;
        let (off, off_rate) = (self.position - before + slope * self.lag_s, self.rate - slope);
        self.position = after - slope * self.lag_s + self.to_position[0] * off + self.to_position[1] * off_rate;
        self.rate = slope + self.to_rate[0] * off + self.to_rate[1] * off_rate;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Step response of each kind of damping, in closed form, whatever the step: a constant signal is linear.
    #[test]
    fn the_step_response_is_the_textbooks() {
        let w = 30.0f64;
        let under = |z: f64, t: f64| {
            let d = (1.0 - z * z).sqrt();
            1.0 - (-z * w * t).exp() * ((w * d * t).cos() + z / d * (w * d * t).sin())
        };
        let over = |z: f64, t: f64| {
            let d = (z * z - 1.0).sqrt();
            let (p, q) = (w * (z - d), w * (z + d));
            1.0 - (q * (-p * t).exp() - p * (-q * t).exp()) / (q - p)
        };
        let critical = |t: f64| 1.0 - (-w * t).exp() * (1.0 + w * t);
        for dt in [1e-3, 0.02, 0.7] {
            for z in [0.05, 0.7, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 3.0] {
                let mut oscillator = Oscillator::new(w, z, dt, 0.0);
                for i in 1..=40 {
                    let (rate, _) = oscillator.next_rate(1.0, 1.0);
                    oscillator.advance(1.0, 1.0);
                    assert!((rate - oscillator.rate).abs() < 1e-9);
                    let t = dt * f64::from(i);
                    let exact = match z {
                        0.05 | 0.7 => under(z, t),
                        3.0 => over(z, t),
                        _ => critical(t),
                    };
                    assert!((oscillator.position - exact).abs() < 1e-7, "dt {dt}, damping {z}: {i}");
                }
            }
        }
    }

    #[test]
    fn a_ramp_is_followed_by_the_lag_and_stiffness_does_no_harm() {
        for w in [10.0, 1e3, 1e8] {
            for z in [0.1, 1.0, 4.0] {
                let mut oscillator = Oscillator::new(w, z, 0.01, 5.0);
                let x = |i: u32| 5.0 + 2.0 * 0.01 * f64::from(i);
                for i in 0..10_000 {
                    let (rate, slope) = oscillator.next_rate(x(i), x(i + 1));
                    assert!(slope >= 0.0);
                    oscillator.advance(x(i), x(i + 1));
                    assert!((rate - oscillator.rate).abs() < 1e-6);
                }
                // What is left of the start after 100 s.
                let ringing = 4.0 / w * (-z * w * 100.0).exp();
                assert!((x(10_000) - oscillator.position - 2.0 * 2.0 * z / w).abs() < 1e-6 + ringing, "{w} {z}");
            }
        }
    }
}
