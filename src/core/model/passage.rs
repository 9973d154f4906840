//! What a node lets pass from the lines that end there to those that begin there: valves, check valves and pumps.
//!
//! Between the characteristic of the one side, `H + z Q = e`, and that of the other, `H - z Q = e`, a flow `Q` leaves
//! the head `e₁ - e₂ - (z₁ + z₂) Q`, which the law of the node takes or, a pump, adds to.

use crate::model::boundary::{Outlet, ValveEnd};
use crate::model::node::root;
use crate::rig::{Drive, NodeKind, Opening, Pump, PumpCurve, at_time};
use crate::units::GRAVITY_M_S2;

/// Head per flow that keeps water from flowing back in a steady state, s/m².
const BARRIER: f64 = 1e12;
/// Head per flow of an open check valve, s/m²: next to none, and enough that the steady flow is well determined.
const OPEN: f64 = 1e-2;
/// Least relative speed in a power of it.
const LEAST_SPEED: f64 = 1e-3;

/// The law of a node that water passes.
pub enum Passage {
    /// A valve that closes.
    Valve(ValveEnd),
    /// Another valve or opening, and the head behind it where no line follows, m.
    Opening(Opening, f64),
    /// Water passes one way.
    Check,
    /// See [`Turning`].
    Pump(Turning),
}

impl Passage {
    /// What it is at a time, for what ends there alone.
    #[inline]
    pub(crate) fn at(&self, time_s: f64) -> Outlet {
        match self {
            Passage::Valve(valve) => valve.at(time_s),
            Passage::Opening(valve, behind_m) => {
                Outlet::Orifice { root_c: root_c(valve, at_time(&valve.opening, time_s)), behind_m: *behind_m }
            }
            Passage::Check | Passage::Pump(_) => Outlet::Flow(0.0),
        }
    }

    /// Flow that it lets pass between two sides with `e = e₁ - e₂` and `z = z₁ + z₂`, and its derivative by `e`.
    pub(crate) fn through(&self, time_s: f64, e: f64, z: f64) -> (f64, f64) {
        match self {
            Passage::Check if e > 0.0 => (e / (z + OPEN), 1.0 / (z + OPEN)),
            Passage::Check => (0.0, 0.0),
            Passage::Pump(pump) => pump.through(e, z),
            valve => match valve.at(time_s) {
                Outlet::Orifice { root_c, .. } if root_c > 0.0 => {
                    let flow = Outlet::Orifice { root_c, behind_m: 0.0 }.flow_m3_s(z, e);
                    (flow, 1.0 / (z + 2.0 * flow.abs() / (root_c * root_c)).max(f64::MIN_POSITIVE))
                }
                Outlet::Orifice { .. } => (0.0, 0.0),
                other => other.flow_at_m3_s(e),
            },
        }
    }

    /// Goes on to the next step with the flow of this one, and the head that it gained.
    pub(crate) fn advance(&mut self, time_s: f64, dt_s: f64, flow_m3_s: f64, gain_m: f64) {
        if let Passage::Pump(pump) = self {
            pump.advance(time_s, dt_s, flow_m3_s, gain_m);
        }
    }
}

/// `c` of `Q = c √ΔH`.
fn root_c(valve: &Opening, opening: f64) -> f64 {
    opening * valve.cda_m2 * (2.0 * GRAVITY_M_S2).sqrt()
}

/// Head that a node takes of a steady flow that passes it, m, and its slope.
pub(crate) fn steady_loss(kind: &NodeKind, flow_m3_s: f64) -> (f64, f64) {
    if let Some(valve) = kind.opening() {
        let k = root_c(valve, at_time(&valve.opening, 0.0)).powi(-2);
        return (k * flow_m3_s * flow_m3_s.abs(), 2.0 * k * flow_m3_s.abs());
    }
    match kind {
        _ if flow_m3_s < 0.0 => {
            let shut_m = if let NodeKind::Pump(pump) = kind { -gain(&pump.curve, speed(pump), 0.0).0 } else { 0.0 };
            (shut_m + BARRIER * flow_m3_s, BARRIER)
        }
        NodeKind::Pump(pump) => {
            let (gain_m, slope) = gain(&pump.curve, speed(pump), flow_m3_s);
            (-gain_m, -slope)
        }
        _ => (OPEN * flow_m3_s, OPEN),
    }
}

/// Relative speed before the closure.
fn speed(pump: &Pump) -> f64 {
    match &pump.drive {
        Drive::Speed(points) => at_time(points, 0.0),
        Drive::Trip { .. } => 1.0,
    }
}

/// Head that a pump adds at a relative speed and a flow, and its slope: the laws of affinity, `H/α² = f(Q/α)`.
fn gain(curve: &PumpCurve, speed: f64, flow_m3_s: f64) -> (f64, f64) {
    let PumpCurve { shutoff_m, fall, power, least_m } = *curve;
    let fall = fall * speed.max(LEAST_SPEED).powf(2.0 - power);
    let gain_m = speed * speed * shutoff_m - fall * flow_m3_s.powf(power);
    if gain_m < least_m { (least_m, 0.0) } else { (gain_m, -power * fall * flow_m3_s.powf(power - 1.0)) }
}

/// A pump that turns.
///
/// Without power its speed falls by `I dω/dt = -T`, `T = ρ g Q H/(η ω)` with the efficiency that the file gives (Wylie
/// & Streeter 1993, Fluid Transients in Systems, ch. 7, without the zones of reverse flow and turbine: it lets no water
/// back). The torque is extrapolated from the last two steps.
pub struct Turning {
    curve: PumpCurve,
    drive: Drive,
    weight_n_m3: f64,
    speed: f64,
    flow_m3_s: f64,
    /// Fall of the relative speed in a second, at the last step.
    slowing_per_s: f64,
}

impl Turning {
    /// A pump with its flow and the head that it adds before the closure.
    pub(crate) fn new(pump: &Pump, density_kg_m3: f64, flow_m3_s: f64, gain_m: f64) -> Turning {
        let (curve, drive, weight_n_m3) = (pump.curve, pump.drive.clone(), density_kg_m3 * GRAVITY_M_S2);
        let mut turning = Turning { curve, drive, weight_n_m3, speed: speed(pump), flow_m3_s, slowing_per_s: 0.0 };
        turning.slowing_per_s = turning.slowing(flow_m3_s, gain_m);
        turning
    }

    fn slowing(&self, flow_m3_s: f64, gain_m: f64) -> f64 {
        let Drive::Trip { inertia_kg_m2, speed_rad_s, efficiency, .. } = self.drive else { return 0.0 };
        let power_w = (self.weight_n_m3 * flow_m3_s * gain_m / efficiency).max(0.0);
        power_w / (inertia_kg_m2 * speed_rad_s * speed_rad_s * self.speed.max(LEAST_SPEED))
    }

    /// `e - z Q + gain(Q) = 0` for `Q ≥ 0`.
    fn through(&self, e: f64, z: f64) -> (f64, f64) {
        let shutoff_m = gain(&self.curve, self.speed, 0.0).0;
        if e + shutoff_m <= 0.0 {
            return (0.0, 0.0);
        }
        let balance = |q: f64| {
            let (gain_m, slope) = if q > 0.0 { gain(&self.curve, self.speed, q) } else { (shutoff_m, 0.0) };
            (z * q - gain_m - e, z - slope, z - slope)
        };
        let (flow, slope) = root(balance, |slope, _| slope, self.flow_m3_s);
        (flow, 1.0 / slope)
    }

    fn advance(&mut self, time_s: f64, dt_s: f64, flow_m3_s: f64, gain_m: f64) {
        self.flow_m3_s = flow_m3_s;
        let next_s = time_s + dt_s;
        match &self.drive {
            Drive::Speed(points) => self.speed = at_time(points, next_s),
            Drive::Trip { at_s, .. } => {
                let slowing = self.slowing(flow_m3_s, gain_m);
                // The step in which power is lost counts in part.
                let without_s = (next_s - at_s).clamp(0.0, dt_s);
                self.speed = (self.speed - without_s * (1.5 * slowing - 0.5 * self.slowing_per_s)).max(0.0);
                self.slowing_per_s = slowing;
            }
        }
    }

    /// Its relative speed.
    pub fn speed(&self) -> f64 {
        self.speed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pump_runs_on_its_curve_and_by_the_laws_of_affinity() {
        let curve = PumpCurve::through(&[(0.0, 60.0), (0.05, 50.0), (0.1, 25.0)]).unwrap();
        for (q, h) in [(0.0, 60.0), (0.05, 50.0), (0.1, 25.0)] {
            assert!((gain(&curve, 1.0, q).0 - h).abs() < 1e-9);
            assert!((gain(&curve, 0.7, 0.7 * q).0 - 0.49 * h).abs() < 1e-9);
        }
        let pump = Pump { curve, suction_head_m: None, drive: Drive::Speed(vec![(0.0, 1.0)]) };
        let turning = Turning::new(&pump, 998.0, 0.02, 55.0);
        for (e, z) in [(-20.0, 300.0), (-59.0, 1e5), (5.0, 40.0)] {
            let (q, slope) = turning.through(e, z);
            assert!(q > 0.0 && (e - z * q + gain(&curve, 1.0, q).0).abs() < 1e-7, "{e} {z}: {q}");
            assert!(((turning.through(e + 1e-4, z).0 - q) / 1e-4 / slope - 1.0).abs() < 1e-3);
        }
        assert_eq!(turning.through(-61.0, 300.0), (0.0, 0.0));
        // With a bypass it never takes head: 0.2 m³/s is beyond the curve's end.
        let curve = PumpCurve { least_m: 0.0, ..curve };
        let turning = Turning::new(&Pump { curve, suction_head_m: None, drive: pump.drive }, 998.0, 0.02, 55.0);
        let (q, slope) = turning.through(60.0, 300.0);
        assert!((q - 0.2).abs() < 1e-12 && (slope - 1.0 / 300.0).abs() < 1e-12, "{q} {slope}");
    }

    /// Against a torque that falls with the square of the speed, `α = 1/(1 + t/T)`, `T = I ω²/P`.
    #[test]
    fn a_tripped_pump_slows_down_as_its_inertia_says() {
        let curve = PumpCurve::through(&[(0.1, 40.0)]).unwrap();
        let (inertia_kg_m2, speed_rad_s, efficiency) = (12.0, 150.0, 0.8);
        let drive = Drive::Trip { at_s: 0.0, inertia_kg_m2, speed_rad_s, efficiency };
        let mut turning = Turning::new(&Pump { curve, suction_head_m: None, drive }, 1000.0, 0.1, 40.0);
        let power_w = 1000.0 * GRAVITY_M_S2 * 0.1 * 40.0 / efficiency;
        let own_s = inertia_kg_m2 * speed_rad_s * speed_rad_s / power_w;
        let dt_s = own_s / 400.0;
        for i in 0..800 {
            let a = turning.speed();
            turning.advance(f64::from(i) * dt_s, dt_s, 0.1 * a, 40.0 * a * a);
        }
        assert!((turning.speed() - 1.0 / 3.0).abs() < 1e-4, "{}", turning.speed());
    }
}
