//! What no effect of the catalogue is: forcings whose place and waveform `explain` should find. Each has a law of its
//! own in the scheme's steps.

use std::f64::consts::TAU;

/// Every kind of forcing.
pub const KINDS: [&str; 9] = [
    "second-pump",
    "valve-reopens",
    "relief-valve",
    "swinging-check",
    "saturating-sensor",
    "nonlinear-wall",
    "free-surface",
    "operators-hand",
    "pulsation",
];

/// One of them; times in s after the start of the closure.
#[derive(Debug, Clone, PartialEq)]
pub enum Forced {
    /// A pump feeds in at a place, m: flow m³/s, from, time to run up, share by which it pulsates, its frequency Hz.
    SecondPump { at_m: f64, flow_m3_s: f64, from_s: f64, tau_s: f64, share: f64, hz: f64 },
    /// The valve opens again by a share, from, until, and takes a time to do either.
    ValveReopens { share: f64, from_s: f64, until_s: f64, ramp_s: f64 },
    /// Flows out at a place, m, above a head, m: `root_c √(H - above)`.
    ReliefValve { at_m: f64, above_m: f64, root_c: f64 },
    /// A check valve at the supply, whose disc swings: its loss at full opening over `Q²`, frequency Hz, damping ratio.
    SwingingCheck { loss: f64, hz: f64, damping: f64 },
    /// A sensor shows only a share of what goes beyond a head, m.
    SaturatingSensor { sensor: usize, above_m: f64, share: f64 },
    /// The wall strains by `by d abs(d)`, d being the head's deviation, m: it only ever softens, for a stiffer one
    /// outruns the scheme.
    NonlinearWall { by: f64 },
    /// The supply is a small tank, area m², whose surface also sloshes: amplitude m, frequency Hz, decay s.
    FreeSurface { area_m2: f64, slosh_m: f64, hz: f64, decay_s: f64 },
    /// The valve is let open by shares about times, each over a width, s.
    OperatorsHand { touches: Vec<(f64, f64, f64)> },
}

impl Forced {
    /// Flow into the pipe at its place, and its place, m, in the middle of a step.
    pub fn fed(&self, t: f64) -> Option<(f64, f64)> {
        match *self {
            Forced::SecondPump { at_m, flow_m3_s, from_s, tau_s, share, hz } => {
                let since = (t - from_s).max(0.0);
                let runs = 1.0 - (-since / tau_s).exp();
                Some((at_m, flow_m3_s * runs * (1.0 + share * (TAU * hz * since).sin())))
            }
            _ => None,
        }
    }

    /// Opening of the valve beside its closure.
    pub fn opening(&self, t: f64) -> f64 {
        match self {
            Forced::ValveReopens { share, from_s, until_s, ramp_s } => {
                let ramp = |from: f64| ((t - from) / ramp_s).clamp(0.0, 1.0);
                share * (ramp(*from_s) - ramp(*until_s))
            }
            Forced::OperatorsHand { touches } => touches
                .iter()
                .map(|(at, share, width)| match ((t - at) / width).abs() {
                    x if x < 1.0 => share * 0.5 * (1.0 + (std::f64::consts::PI * x).cos()),
                    _ => 0.0,
                })
                .sum(),
            _ => 0.0,
        }
    }

    /// Strain of the wall at a deviation of the head, m.
    pub fn strain(&self, deviation_m: f64) -> f64 {
        if let Forced::NonlinearWall { by } = self { by * deviation_m * deviation_m.abs() } else { 0.0 }
    }
}

/// What a supply does by itself: the state of a disc or a surface.
#[derive(Default)]
pub struct SupplyState {
    opening: f64,
    rate: f64,
    level_m: f64,
}

impl SupplyState {
    pub fn still() -> SupplyState {
        SupplyState { opening: 1.0, ..SupplyState::default() }
    }

    /// Head over that before the closure after a step that ends at `t`, with the flow out of the supply in it; steady
    /// until the closure.
    pub fn head_m(&mut self, forced: &Forced, flow_m3_s: f64, steady_m3_s: f64, t: f64, dt: f64) -> f64 {
        match *forced {
            Forced::SwingingCheck { loss, hz, damping } => {
                let w = TAU * hz;
                let target = (flow_m3_s / steady_m3_s).clamp(0.4, 1.0);
                self.rate += dt * (w * w * (target - self.opening) - 2.0 * damping * w * self.rate);
                self.opening = (self.opening + dt * self.rate).clamp(0.4, 1.2);
                loss * (steady_m3_s.powi(2) - flow_m3_s * flow_m3_s.abs() / self.opening.powi(2))
            }
            Forced::FreeSurface { area_m2, slosh_m, hz, decay_s } if t > 0.0 => {
                self.level_m -= dt * flow_m3_s / area_m2;
                self.level_m + slosh_m * (-t / decay_s).exp() * (TAU * hz * t).sin()
            }
            _ => 0.0,
        }
    }
}
