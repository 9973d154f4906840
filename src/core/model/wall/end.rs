//! An end of the line, where the law of the water and that of the wall send pressure and stress waves back.

use crate::model::fitted::theta;
use crate::model::node::Arriving;
use crate::model::wall::modes::Modes;
use crate::model::wall::ways::Mouth;

/// What holds an end of the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hold {
    /// It does not move.
    Anchored,
    /// Nothing, and the water passes it.
    Open,
    /// The end carries the valve, on which the water pushes, on a spring with dry friction.
    Valve {
        /// Travel per head, m/m; infinite without a spring.
        give: f64,
        /// Head whose push on the valve just overcomes the friction, m.
        dry_m: f64,
    },
}

/// One end. Flows and travels out of the pipe count as positive; `h` and `q` are those of pressure waves, as deviations
/// from the steady flow, in which there are no stress waves.
pub(crate) struct WallEnd {
    modes: Modes,
    /// Its node of the graph.
    pub(crate) node: usize,
    steady_m: f64,
    steady_m3_s: f64,
    dt_s: f64,
    /// Push of the water on the wall, per head.
    push: f64,
    /// Weights of the balance of forces and of that of travels in the wall's law; `θ` of the travel.
    force: f64,
    travel: f64,
    theta: f64,
    /// Head per travel of the spring.
    spring: f64,
    /// Dry friction as a stress, and its direction while the end slides.
    dry_m: f64,
    slides: Option<f64>,
    pub(crate) mouth: Mouth,
    travel_m: f64,
    rate_m_s: f64,
    /// Of this step: `h = ε - z q`, sum of the two stress waves `S0 + S1 q`.
    epsilon_m: f64,
    z: f64,
    s0: f64,
    s1: f64,
}

impl WallEnd {
    pub(crate) fn new(
        modes: Modes,
        node: usize,
        hold: Hold,
        (steady_m, steady_m3_s): (f64, f64),
        dt_s: f64,
    ) -> WallEnd {
        let spring = match hold {
            Hold::Valve { give, .. } if give > 0.0 => modes.thrust / give,
            Hold::Open => 0.0,
            Hold::Valve { .. } | Hold::Anchored => f64::INFINITY,
        };
        let theta = theta(dt_s * spring * modes.per_stress());
        let anchored = spring.is_infinite();
        let (push, dry_m) = match hold {
            Hold::Valve { dry_m, .. } => (modes.thrust, modes.thrust * dry_m),
            Hold::Open | Hold::Anchored => (0.0, 0.0),
        };
        WallEnd {
            modes,
            node,
            steady_m,
            steady_m3_s,
            dt_s,
            push,
            force: if anchored { 0.0 } else { 1.0 },
            travel: if anchored { 1.0 } else { spring * theta * dt_s },
            theta,
            spring: if anchored { 0.0 } else { spring },
            dry_m: if anchored { 0.0 } else { dry_m },
            slides: if dry_m > 0.0 { None } else { Some(0.0) },
            mouth: Mouth::new(),
            travel_m: 0.0,
            rate_m_s: 0.0,
            epsilon_m: 0.0,
            z: 0.0,
            s0: 0.0,
            s1: 0.0,
        }
    }

    /// The characteristic that reaches the node in true heads and in flows through the moving end, from that of the
    /// pressure waves.
    pub(crate) fn meets(&mut self, reached: Arriving) -> Arriving {
        let Modes { alpha, beta, .. } = self.modes;
        let w = self.modes.per_stress();
        // force [Σ - push (h + βΣ) - α h + f] + travel [x/(θ dt) + u] = 0, u = α r q/A - w (2 s - Σ).
        let (force, travel, friction_m) = match self.slides {
            Some(direction) => (self.force, self.travel, self.dry_m * direction),
            None => (0.0, 1.0, 0.0),
        };
        let by_last = match self.slides {
            Some(_) => (self.travel_m + self.dt_s * (1.0 - self.theta) * self.rate_m_s) / (self.theta * self.dt_s),
            None => 0.0,
        };
        let sum = force * (1.0 - self.push * beta) + travel * w;
        let c0 = (travel * (2.0 * w * self.mouth.arriving_m - by_last) - force * friction_m) / sum;
        let by_h = force * (self.push + alpha) / sum;
        let by_q = -travel * self.modes.per_flow() / sum;
        self.z = reached.z;
        self.epsilon_m = reached.e - self.steady_m - reached.z * self.steady_m3_s;
        self.s0 = c0 + by_h * self.epsilon_m;
        self.s1 = by_q - by_h * self.z;
        let g = self.modes.flow_per_stress();
        let z = (self.z - beta * self.s1) / (self.modes.through() - g * self.s1);
        let known_m3_s = self.steady_m3_s + g * (2.0 * self.mouth.arriving_m - self.s0);
        Arriving { z, e: self.steady_m + self.epsilon_m + beta * self.s0 + z * known_m3_s }
    }

    /// Head and flow of the pressure waves where the node has this true flow; advances the end.
    pub(crate) fn leaves(&mut self, out_m3_s: f64) -> (f64, f64) {
        let Modes { alpha, beta, .. } = self.modes;
        let g = self.modes.flow_per_stress();
        let through = out_m3_s - self.steady_m3_s - g * (2.0 * self.mouth.arriving_m - self.s0);
        let q = through / (self.modes.through() - g * self.s1);
        let h = self.epsilon_m - self.z * q;
        let sum_m = self.s0 + self.s1 * q;
        self.mouth.leaving_m = sum_m - self.mouth.arriving_m;
        let rate = self.modes.per_flow() * q - self.modes.per_stress() * (2.0 * self.mouth.arriving_m - sum_m);
        match self.slides {
            Some(direction) => {
                self.travel_m += self.dt_s * ((1.0 - self.theta) * self.rate_m_s + self.theta * rate);
                self.rate_m_s = rate;
                if rate * direction < 0.0 {
                    (self.slides, self.rate_m_s) = (None, 0.0);
                }
            }
            None => {
                let held_m = self.push * (h + beta * sum_m) + alpha * h - sum_m - self.spring * self.travel_m;
                self.slides = (held_m.abs() > self.dry_m).then_some(held_m.signum());
            }
        }
        (self.steady_m + h, self.steady_m3_s + q)
    }
}
