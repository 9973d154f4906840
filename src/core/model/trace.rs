//! Result of a simulation at a probe: head or flow step by step, and its value at any time.

/// Head or flow at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Time step, s.
    pub dt_s: f64,
    /// Head (m) or flow (m³/s) at `0, dt, 2dt, …` after the start of the closure; the first is the steady value, which also
    /// holds before.
    pub values: Vec<f64>,
    /// Delay of the trace against the true time, s: the skew of a sensor's clock.
    pub late_s: f64,
}

impl Trace {
    /// An empty trace with room for `values` values.
    pub fn with_capacity(dt_s: f64, values: usize) -> Trace {
        Trace { dt_s, values: Vec::with_capacity(values), late_s: 0.0 }
    }

    /// Value at a time after the start of the closure, cubic between steps; the steady value before the closure, the
    /// last value after the end.
    ///
    /// Linear interpolation would leave `dt² H''/8` at a front, more than the scheme's own error.
    pub fn at(&self, time_s: f64) -> f64 {
        self.after(0.0)(time_s)
    }

    /// The value at times of a clock on which the closure starts at `start_s`, as [`Trace::at`] has it.
    pub fn after(&self, start_s: f64) -> impl Fn(f64) -> f64 {
        let (from_s, per_s) = (start_s + self.late_s, 1.0 / self.dt_s);
        let last = self.values.len() - 1;
        move |time_s| {
            let x = (time_s - from_s) * per_s;
            if x <= 0.0 {
                return self.values[0];
            }
            let i = x as usize;
            let (a, b, c, d) = match self.values.get(i.wrapping_sub(1)..i.saturating_add(3)) {
                Some(&[a, b, c, d]) => (a, b, c, d),
                _ if i >= last => return self.values[last],
                _ => (
                    self.values[i.saturating_sub(1)],
                    self.values[i],
                    self.values[i + 1],
                    self.values[(i + 2).min(last)],
                ),
            };
            let s = x - i as f64;
            // Lagrange through -1, 0, 1, 2.
            let (m, p, q) = (s + 1.0, s - 1.0, s - 2.0);
            let (sp, mq) = (s * p, m * q);
            (1.0 / 6.0) * sp * (m * d - q * a) + 0.5 * mq * (p * b - s * c)
        }
    }
}

/// A quantity and its place, m from the supply.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Probe {
    /// Head, m.
    Head(f64),
    /// Flow, m³/s.
    Flow(f64),
}

impl Probe {
    /// Its position, m from the supply.
    pub fn position_m(self) -> f64 {
        let (Probe::Head(x) | Probe::Flow(x)) = self;
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubic_between_steps_and_steady_outside() {
        let f = |t: f64| 3.0 - t + 0.5 * t * t - 0.1 * t.powi(3);
        let trace = Trace { dt_s: 0.5, values: (0..20).map(|i| f(0.5 * i as f64)).collect(), late_s: 0.0 };
        for t in [0.5, 0.77, 3.17, 8.9] {
            assert!((trace.at(t) - f(t)).abs() < 1e-12, "{t}");
        }
        assert_eq!(trace.at(-1.0), f(0.0));
        assert_eq!(trace.at(100.0), f(9.5));
    }
}
