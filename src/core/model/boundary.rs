//! Supply and valve, and what a node is at one time. Each is solved with the characteristic that reaches it.

use crate::rig::at_time;

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
    /// The flow itself falls along a cycloid, `Q = Q0 (1 - t/Tc + sin(2π t/Tc)/2π)`: the closure of the exact
    /// solutions.
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
    /// When it starts to close, s.
    pub start_s: f64,
    /// How it closes.
    pub closure: Closure,
    /// A nonlinear law, for a closure by opening.
    pub law: Option<OpeningLaw>,
    /// Relative opening over the share of the stroke; empty where it is what is left of the stroke.
    pub characteristic: Vec<(f64, f64)>,
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

/// What a node is at one time, for the water that reaches it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outlet {
    /// A head, m, that drives the line.
    Head(f64),
    /// A flow, m³/s, whatever the head.
    Flow(f64),
    /// `Q = c √ΔH`, signed like `ΔH`, the head less that behind the valve.
    Orifice {
        /// `c = τ Q0/√ΔH0`, zero or more.
        root_c: f64,
        /// Head behind it, m.
        behind_m: f64,
    },
    /// A surface that rises with what flows into it: `Q = r H - k`.
    Surface {
        /// `r`, twice its area over the step, m²/s.
        rate_m2_s: f64,
        /// `k`, m³/s.
        known_m3_s: f64,
    },
}

impl ValveEnd {
    /// What it is at `time_s`.
    #[inline]
    pub fn at(&self, time_s: f64) -> Outlet {
        let time_s = time_s - self.start_s;
        match (&self.given_head, self.closure) {
            (Some(head), _) => Outlet::Head(head(time_s + self.start_s)),
            (None, Closure::Linear { closing_time_s }) => {
                let root_c = self.root_c(part(time_s, closing_time_s));
                Outlet::Orifice { root_c, behind_m: self.discharge_head_m }
            }
            (None, Closure::FlowRamp { closing_time_s }) => {
                let s = part(time_s, closing_time_s);
                Outlet::Flow(self.flow_m3_s * 0.5 * (1.0 + (std::f64::consts::PI * s).cos()))
            }
            (None, Closure::FlowCycloid { closing_time_s }) => {
                let (s, turn) = (part(time_s, closing_time_s), std::f64::consts::TAU);
                Outlet::Flow(self.flow_m3_s * (1.0 - s + (turn * s).sin() / turn))
            }
        }
    }

    /// `τ Q0/√ΔH0`: the orifice's flow over the root of its head difference, `s` of the closing time being over.
    #[inline]
    fn root_c(&self, s: f64) -> f64 {
        let left = self.law.as_ref().map_or(1.0 - s, |law| law(s)).clamp(0.0, 1.0);
        let moving = if self.characteristic.is_empty() { left } else { at_time(&self.characteristic, 1.0 - left) };
        let opening = self.residual_opening + (1.0 - self.residual_opening) * moving;
        if opening <= 0.0 || self.drop_m <= 0.0 { 0.0 } else { opening * self.flow_m3_s / self.drop_m.sqrt() }
    }
}

impl Outlet {
    /// Head and flow, m and m³/s, from the characteristic `H + z Q = e` that reaches it.
    #[inline]
    pub fn solve(self, z: f64, e: f64) -> (f64, f64) {
        let flow_m3_s = self.flow_m3_s(z, e);
        (if let Outlet::Head(head_m) = self { head_m } else { e - z * flow_m3_s }, flow_m3_s)
    }

    /// Flow through it, m³/s, from the characteristic `H + z Q = e` that reaches it.
    #[inline]
    pub fn flow_m3_s(self, z: f64, e: f64) -> f64 {
        match self {
            Outlet::Head(head_m) => (e - head_m) / z,
            Outlet::Flow(flow_m3_s) => flow_m3_s,
            Outlet::Surface { rate_m2_s, known_m3_s } => (rate_m2_s * e - known_m3_s) / (1.0 + z * rate_m2_s),
            Outlet::Orifice { root_c, behind_m } => {
                let excess = e - behind_m;
                if root_c <= 0.0 || excess == 0.0 {
                    return 0.0;
                }
                excess.signum() * 2.0 * excess.abs() * root_c
                    / (z * root_c + (z * z * root_c * root_c + 4.0 * excess.abs()).sqrt())
            }
        }
    }

    /// Flow through it at a head before it, m³/s, and its derivative by that head.
    #[inline]
    pub fn flow_at_m3_s(self, head_m: f64) -> (f64, f64) {
        match self {
            Outlet::Head(held_m) => (HOLDING_M2_S * (head_m - held_m), HOLDING_M2_S),
            Outlet::Flow(flow_m3_s) => (flow_m3_s, 0.0),
            Outlet::Surface { rate_m2_s, known_m3_s } => (rate_m2_s * head_m - known_m3_s, rate_m2_s),
            Outlet::Orifice { root_c, .. } if root_c <= 0.0 => (0.0, 0.0),
            Outlet::Orifice { root_c, behind_m } => {
                let drop = head_m - behind_m;
                if drop.abs() < SMALL_DROP_M {
                    let slope = root_c / SMALL_DROP_M.sqrt();
                    return (slope * drop, slope);
                }
                let flow = drop.signum() * root_c * drop.abs().sqrt();
                (flow, 0.5 * flow / drop)
            }
        }
    }
}

/// The elapsed share of the closing time, 0 to 1.
#[inline]
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
            start_s: 0.0,
            closure: Closure::Linear { closing_time_s: 0.1 },
            law: None,
            characteristic: Vec::new(),
            residual_opening: 0.0,
            given_head: None,
        };
        for (time_s, z, e) in [(0.03, 4e4, 60.0), (0.09, 4e4, 30.0), (0.05, 2e4, -15.0)] {
            let outlet = valve.at(time_s);
            let flow = outlet.flow_m3_s(z, e);
            let drop = e - z * flow - 1.0;
            let opening = 1.0 - time_s / 0.1;
            let orifice = opening * 1e-3 * (drop.abs() / 20.0).sqrt() * drop.signum();
            assert!((flow - orifice).abs() < 1e-12, "{flow} {orifice}");
            let (at, slope) = outlet.flow_at_m3_s(e - z * flow);
            assert!((at - flow).abs() < 1e-12);
            let nearby = outlet.flow_at_m3_s(e - z * flow + 1e-6).0;
            assert!(((nearby - at) / 1e-6 / slope - 1.0).abs() < 1e-4);
        }
        assert_eq!(valve.at(0.1).flow_m3_s(4e4, 30.0), 0.0);
    }

    #[test]
    fn a_measured_head_is_read_in_order() {
        let mut head = MeasuredHead { time_s: vec![0.0, 1.0, 3.0], head_m: vec![10.0, 12.0, 8.0], cursor: 0 };
        let seen: Vec<f64> = [-1.0, 0.5, 1.0, 2.0, 9.0].map(|t| head.head_m(t)).to_vec();
        assert_eq!(seen, [10.0, 11.0, 12.0, 10.0, 8.0]);
    }
}
