//! The two ends of the line: supply and valve. Each is solved with the one characteristic that reaches it.

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
    /// Sample before the last requested time.
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

/// Relative opening of a valve as a function of the elapsed share of its closing time (0 to 1).
pub type OpeningLaw = Box<dyn Fn(f64) -> f64 + Send>;

/// A head as a function of the time after the start of the closure.
pub type HeadInTime = Box<dyn Fn(f64) -> f64 + Send>;

/// What is prescribed at the valve's end, in place of the model's valve.
pub(crate) enum GivenEnd {
    /// Nothing.
    Nothing,
    /// The head before the valve, which then drives the line.
    Head(HeadInTime),
    /// The valve's law over the run's closing time.
    Law(OpeningLaw),
}

/// The valve: its steady point and its closure.
pub struct ValveEnd {
    /// Flow before the closure, m³/s.
    pub flow_m3_s: f64,
    /// Head difference over the valve before the closure, m.
    pub drop_m: f64,
    /// Head behind it, m.
    pub discharge_head_m: f64,
    /// How it closes.
    pub closure: Closure,
    /// A nonlinear law, for a closure by opening.
    pub law: Option<OpeningLaw>,
    /// Relative opening that remains when it is closed.
    pub residual_opening: f64,
    /// A prescribed head before the valve, which drives the line in place of the valve.
    pub given_head: Option<HeadInTime>,
}

/// Within this distance of the discharge head, m, the flow of an orifice is linear: a square root has no finite slope
/// at rest.
const SMALL_DROP_M: f64 = 1e-9;
/// Flow per head that enforces a prescribed head if another element sits before the valve, m²/s: a micrometre at a
/// litre a second.
const HOLDING_M2_S: f64 = 1e3;

impl ValveEnd {
    /// Flow through the valve at `time_s`, from the characteristic `H + z Q = e` that reaches it.
    pub fn flow_m3_s(&self, time_s: f64, z: f64, e: f64) -> f64 {
        if let Some(head) = &self.given_head {
            return (e - head(time_s)) / z;
        }
        match self.given_flow(time_s) {
            Some(flow) => flow,
            None => {
                let excess = e - self.discharge_head_m;
                let root_c = self.root_c(time_s);
                if root_c <= 0.0 || excess == 0.0 {
                    return 0.0;
                }
                // `Q = τ Q0 √(ΔH/ΔH0)`, signed like `ΔH = H - H_discharge`, together with `H + z Q = e`.
                excess.signum() * 2.0 * excess.abs() * root_c
                    / (z * root_c + (z * z * root_c * root_c + 4.0 * excess.abs()).sqrt())
            }
        }
    }

    /// Flow through the valve at `time_s` and a head before it, and its derivative by that head.
    pub fn flow_at_m3_s(&self, time_s: f64, head_m: f64) -> (f64, f64) {
        if let Some(head) = &self.given_head {
            return (HOLDING_M2_S * (head_m - head(time_s)), HOLDING_M2_S);
        }
        if let Some(flow) = self.given_flow(time_s) {
            return (flow, 0.0);
        }
        let (drop, root_c) = (head_m - self.discharge_head_m, self.root_c(time_s));
        if drop.abs() < SMALL_DROP_M {
            let slope = root_c / SMALL_DROP_M.sqrt();
            return (slope * drop, slope);
        }
        let flow = drop.signum() * root_c * drop.abs().sqrt();
        (flow, 0.5 * flow / drop)
    }

    /// The flow, if it is prescribed whatever the head.
    fn given_flow(&self, time_s: f64) -> Option<f64> {
        match self.closure {
            Closure::Linear { .. } => None,
            Closure::FlowRamp { closing_time_s } => {
                let s = part(time_s, closing_time_s);
                Some(self.flow_m3_s * 0.5 * (1.0 + (std::f64::consts::PI * s).cos()))
            }
            Closure::FlowCycloid { closing_time_s } => {
                let (s, turn) = (part(time_s, closing_time_s), std::f64::consts::TAU);
                Some(self.flow_m3_s * (1.0 - s + (turn * s).sin() / turn))
            }
        }
    }

    /// `τ Q0/√ΔH0`: the orifice's flow over the root of its head difference.
    fn root_c(&self, time_s: f64) -> f64 {
        let Closure::Linear { closing_time_s } = self.closure else { return 0.0 };
        if self.drop_m <= 0.0 {
            return 0.0;
        }
        let s = part(time_s, closing_time_s);
        let moving = self.law.as_ref().map_or(1.0 - s, |law| law(s)).clamp(0.0, 1.0);
        let opening = self.residual_opening + (1.0 - self.residual_opening) * moving;
        opening * self.flow_m3_s / self.drop_m.sqrt()
    }
}

/// The elapsed share of the closing time, 0 to 1.
fn part(time_s: f64, closing_time_s: f64) -> f64 {
    if closing_time_s > 0.0 { (time_s / closing_time_s).clamp(0.0, 1.0) } else { f64::from(time_s > 0.0) }
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
            law: None,
            residual_opening: 0.0,
            given_head: None,
        };
        for (time_s, z, e) in [(0.03, 4e4, 60.0), (0.09, 4e4, 30.0), (0.05, 2e4, -15.0)] {
            let flow = valve.flow_m3_s(time_s, z, e);
            let drop = e - z * flow - 1.0;
            let opening = 1.0 - time_s / 0.1;
            let orifice = opening * 1e-3 * (drop.abs() / 20.0).sqrt() * drop.signum();
            assert!((flow - orifice).abs() < 1e-12, "{flow} {orifice}");
            let (at, slope) = valve.flow_at_m3_s(time_s, e - z * flow);
            assert!((at - flow).abs() < 1e-12);
            let nearby = valve.flow_at_m3_s(time_s, e - z * flow + 1e-6).0;
            assert!(((nearby - at) / 1e-6 / slope - 1.0).abs() < 1e-4);
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
