//! The two ends of the line: what feeds it and what closes it. Each is solved with the one characteristic that reaches it.

/// Head at the supply.
pub trait Supply: Send {
    /// Head at `time_s` after the start of the closure, m.
    fn head_m(&mut self, time_s: f64) -> f64;
}

/// A tank of constant head.
pub struct ConstantHead(pub f64);

impl Supply for ConstantHead {
    fn head_m(&mut self, _time_s: f64) -> f64 {
        self.0
    }
}

/// A measured head that drives the model, linear between its samples and constant beyond them.
pub struct MeasuredHead {
    /// Times after the start of the closure, s, increasing.
    pub time_s: Vec<f64>,
    /// Heads, m.
    pub head_m: Vec<f64>,
    /// Sample before the last time asked for.
    pub cursor: usize,
}

impl Supply for MeasuredHead {
    fn head_m(&mut self, time_s: f64) -> f64 {
        let last = self.time_s.len() - 1;
        while self.cursor < last && self.time_s[self.cursor + 1] <= time_s {
            self.cursor += 1;
        }
        let i = self.cursor;
        if i == last || time_s <= self.time_s[i] {
            return self.head_m[i];
        }
        let part = (time_s - self.time_s[i]) / (self.time_s[i + 1] - self.time_s[i]);
        self.head_m[i] + part * (self.head_m[i + 1] - self.head_m[i])
    }
}

/// How the valve closes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Closure {
    /// An orifice whose opening falls linearly to zero over the closing time.
    Linear {
        /// Closing time, s.
        closing_time_s: f64,
    },
    /// The flow itself falls along half a period of a raised cosine, `Q = Q0 (1 + cos(π t/Tc))/2`, whatever the head.
    FlowRamp {
        /// Closing time, s.
        closing_time_s: f64,
    },
    /// The flow itself falls along a cycloid, `Q = Q0 (1 - t/Tc + sin(2π t/Tc)/2π)`: the closure of the exact solutions.
    FlowCycloid {
        /// Closing time, s.
        closing_time_s: f64,
    },
}

/// The valve: its steady point and its closure.
#[derive(Debug, Clone, Copy)]
pub struct ValveEnd {
    /// Flow before the closure, m³/s.
    pub flow_m3_s: f64,
    /// Head difference over the valve before the closure, m.
    pub drop_m: f64,
    /// Head behind it, m.
    pub discharge_head_m: f64,
    /// How it closes.
    pub closure: Closure,
}

impl ValveEnd {
    /// Flow through the valve at `time_s`, from the characteristic `H + z Q = e` that reaches it.
    pub fn flow_m3_s(&self, time_s: f64, z: f64, e: f64) -> f64 {
        let part = |closing_time_s: f64| {
            if closing_time_s > 0.0 { (time_s / closing_time_s).clamp(0.0, 1.0) } else { f64::from(time_s > 0.0) }
        };
        match self.closure {
            Closure::Linear { closing_time_s } => self.orifice_flow_m3_s(1.0 - part(closing_time_s), z, e),
            Closure::FlowRamp { closing_time_s } => {
                self.flow_m3_s * 0.5 * (1.0 + (std::f64::consts::PI * part(closing_time_s)).cos())
            }
            Closure::FlowCycloid { closing_time_s } => {
                let s = part(closing_time_s);
                let turn = std::f64::consts::TAU;
                self.flow_m3_s * (1.0 - s + (turn * s).sin() / turn)
            }
        }
    }

    /// `Q = τ Q0 √(ΔH/ΔH0)`, signed like `ΔH = H - H_discharge`, together with `H + z Q = e`.
    fn orifice_flow_m3_s(&self, opening: f64, z: f64, e: f64) -> f64 {
        let excess = e - self.discharge_head_m;
        if opening <= 0.0 || excess == 0.0 || self.drop_m <= 0.0 {
            return 0.0;
        }
        let root_c = opening * self.flow_m3_s / self.drop_m.sqrt();
        excess.signum() * 2.0 * excess.abs() * root_c
            / (z * root_c + (z * z * root_c * root_c + 4.0 * excess.abs()).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_orifice_meets_both_its_equations() {
        let valve = ValveEnd {
            flow_m3_s: 1e-3,
            drop_m: 20.0,
            discharge_head_m: 1.0,
            closure: Closure::Linear { closing_time_s: 0.1 },
        };
        for (time_s, z, e) in [(0.03, 4e4, 60.0), (0.09, 4e4, 30.0), (0.05, 2e4, -15.0)] {
            let flow = valve.flow_m3_s(time_s, z, e);
            let drop = e - z * flow - 1.0;
            let opening = 1.0 - time_s / 0.1;
            let orifice = opening * 1e-3 * (drop.abs() / 20.0).sqrt() * drop.signum();
            assert!((flow - orifice).abs() < 1e-12, "{flow} {orifice}");
        }
        assert_eq!(valve.flow_m3_s(0.1, 4e4, 30.0), 0.0);
    }

    #[test]
    fn a_measured_head_is_read_in_order() {
        let mut head = MeasuredHead { time_s: vec![0.0, 1.0, 3.0], head_m: vec![10.0, 12.0, 8.0], cursor: 0 };
        let seen: Vec<f64> = [-1.0, 0.5, 1.0, 2.0, 9.0].map(|t| head.head_m(t)).to_vec();
        assert_eq!(seen, [10.0, 11.0, 12.0, 10.0, 8.0]);
    }
}
