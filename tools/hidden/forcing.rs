//! What no effect of the catalogue is: forcings whose place and waveform `explain` should find. Each has a law of its
//! own in the scheme's steps.

use std::f64::consts::TAU;

use serde_json::{Value, json};

use super::rig::{Case, Hidden};
use super::scheme::{Solved, solve};

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
    /// Draws one of a kind; `place_m` and `sensor` are drawn already.
    pub fn draw(random: &mut fastrand::Rng, kind: &str, case: &Case, place_m: f64, sensor: usize) -> Hidden {
        let between = |random: &mut fastrand::Rng, a: f64, b: f64| a + (b - a) * random.f64();
        let log = |random: &mut fastrand::Rng, a: f64, b: f64| a * (b / a).powf(random.f64());
        let (period_s, rise_m) = (4.0 * case.length_m / case.wave_speed_m_s, case.joukowsky_m());
        let flow = case.velocity_m_s * case.area_m2();
        let later = |random: &mut fastrand::Rng| between(random, 1.5, 8.0) * period_s;
        Hidden::Forced(match kind {
            "second-pump" => Forced::SecondPump {
                at_m: place_m,
                flow_m3_s: flow * log(random, 0.02, 0.1),
                from_s: later(random),
                tau_s: period_s * log(random, 0.3, 2.0),
                share: between(random, 0.1, 0.4),
                hz: log(random, 0.3, 2.0) / period_s,
            },
            "valve-reopens" => {
                let from_s = later(random);
                Forced::ValveReopens {
                    share: log(random, 0.01, 0.08),
                    from_s,
                    until_s: from_s + between(random, 1.0, 6.0) * period_s,
                    ramp_s: period_s * between(random, 0.1, 0.5),
                }
            }
            "relief-valve" => {
                let over_m = rise_m * between(random, 0.25, 0.6);
                let most = flow * log(random, 0.03, 0.15);
                Forced::ReliefValve {
                    at_m: place_m,
                    above_m: case.valve_head_m + over_m,
                    root_c: most / (rise_m - over_m).sqrt(),
                }
            }
            "swinging-check" => Forced::SwingingCheck {
                loss: rise_m * log(random, 0.01, 0.03) / (flow * flow),
                hz: log(random, 0.3, 2.0) / period_s,
                damping: between(random, 0.1, 0.5),
            },
            "saturating-sensor" => Forced::SaturatingSensor {
                sensor,
                above_m: case.valve_head_m + rise_m * between(random, 0.1, 0.5),
                share: between(random, 0.5, 0.9),
            },
            "nonlinear-wall" => Forced::NonlinearWall {
                by: log(random, 0.03, 0.15) * 9.81 / (2.0 * case.wave_speed_m_s.powi(2) * rise_m),
            },
            "free-surface" => Forced::FreeSurface {
                area_m2: flow * period_s / (rise_m * log(random, 0.05, 0.3)),
                slosh_m: rise_m * log(random, 0.01, 0.05),
                hz: log(random, 0.15, 1.5) / period_s,
                decay_s: period_s * between(random, 2.0, 10.0),
            },
            "operators-hand" => {
                let touches =
                    (0..3).map(|_| (later(random), log(random, 0.01, 0.06), period_s * between(random, 0.3, 2.0)));
                Forced::OperatorsHand { touches: touches.collect() }
            }
            _ => return Hidden::Pulsation(rise_m * log(random, 0.01, 0.05), log(random, 1.0, 30.0)),
        })
    }

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
                self.level_m -= dt * (flow_m3_s - 0.0) / area_m2;
                self.level_m + slosh_m * (-t / decay_s).exp() * (TAU * hz * t).sin()
            }
            _ => 0.0,
        }
    }
}

/// Where a hidden forcing is, its unit and its waveform in every run, with the root mean square of what it does to the
/// sensors over the noise.
pub fn truth(case: &Case) -> Option<Value> {
    let (place, position_m, unit) = match case.hidden.first()? {
        Hidden::Pulsation(..) => ("supply".to_owned(), None, "m"),
        Hidden::Forced(forced) => match forced {
            Forced::SecondPump { at_m, .. } | Forced::ReliefValve { at_m, .. } => ("pipe".into(), Some(*at_m), "m³/s"),
            Forced::ValveReopens { .. } | Forced::OperatorsHand { .. } => ("valve".into(), None, "m³/s"),
            Forced::SwingingCheck { .. } | Forced::FreeSurface { .. } => ("supply".into(), None, "m"),
            Forced::SaturatingSensor { sensor, .. } => (format!("sensor@P{}", sensor + 1), None, "m"),
            Forced::NonlinearWall { .. } => ("wall".into(), None, "1"),
        },
        _ => return None,
    };
    let without = Case {
        hidden: Vec::new(),
        sensors_m: case.sensors_m.clone(),
        name: String::new(),
        creep: case.creep.clone(),
        start_effects: Vec::new(),
        ..*case
    };
    let of = |velocity: f64| {
        let (with, bare) = (solve(case, velocity, case.duration_s), solve(&without, velocity, case.duration_s));
        let lead = if with.heads_m[0].len() > bare.heads_m[0].len() + 2 {
            (case.lead_s / with.dt_s).ceil() as usize
        } else {
            0
        };
        let (mut sum, mut n) = (0.0, 0.0);
        for s in 0..case.sensors_m.len() {
            let shown = super::record::sensed(case, s, &with);
            for (a, b) in shown[lead..].iter().zip(&bare.heads_m[s]) {
                sum += (a - b).powi(2);
                n += 1.0;
            }
        }
        let every = (with.forcing.len() / 2000).max(1);
        let waveform = waveform(case, &with);
        let kept: Vec<(f64, f64)> =
            waveform.iter().enumerate().step_by(every).map(|(i, v)| ((i as f64 + 0.5) * with.dt_s, *v)).collect();
        json!({"strength": f64::sqrt(sum / n) / case.noise_m, "time_s": kept.iter().map(|k| k.0).collect::<Vec<_>>(),
               "value": kept.iter().map(|k| k.1).collect::<Vec<_>>()})
    };
    let mut runs = json!({"run": of(case.velocity_m_s)});
    if let Some(velocity) = case.second_velocity_m_s {
        runs["run2"] = of(velocity);
    }
    let hz = if let Hidden::Pulsation(_, hz) = case.hidden[0] { Some(hz) } else { None };
    Some(json!({"where": place, "position_m": position_m, "unit": unit, "frequency_hz": hz, "runs": runs}))
}

/// The waveform from the closure on: what the scheme kept, or what a sensor makes of its head.
fn waveform(case: &Case, solved: &Solved) -> Vec<f64> {
    let Some(Hidden::Forced(Forced::SaturatingSensor { sensor, .. })) = case.hidden.first() else {
        return solved.forcing.clone();
    };
    let shown = super::record::sensed(case, *sensor, solved);
    shown.iter().zip(&solved.heads_m[*sensor]).map(|(a, b)| a - b).collect()
}
