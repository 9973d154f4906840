//! Stress waves in the wall of a pipe that may move along its axis, and how they meet the water at the pipe's two ends.
//!
//! Water and wall obey four equations (Skalak 1956; Tijsseling 1996, J. Fluids Struct. 10:109-146):
//!
//! ```text
//! dV/dt + g dH/dx = 0                  dH/dt + (c²/g) dV/dx = 2ν (c²/g) du/dx
//! du/dt - g r ds/dx = 0                g r ds/dt - ct² du/dx = g r ν (D/2e) dH/dt
//! ```
//!
//! `u` is the wall's velocity, `s` its axial stress as a head of water (`σ = ρ g s`), `r = ρ/ρ_wall`, `ct` the speed of
//! stress waves in a bar of the wall, `c` that of pressure waves in a wall which nothing moves. In a uniform pipe they
//! are two pairs of waves that do not see each other, of speeds `λ1` and `λ2`:
//!
//! ```text
//! (c² - λ²)(ct² - λ²) = 2ν² r (D/2e) c² λ²
//! pressure waves  s = -α H, α = ν (D/2e) λ1²/(ct² - λ1²);   stress waves  H = β s, β = 2ν r/(λ2²/c² - 1)
//! ```
//!
//! The line's own scheme carries the pressure waves: its wave speed *is* `λ1`. The stress waves need no grid. They are
//! delayed by `length/λ2` from one end to the other, exactly where that is a whole number of steps; elsewhere by an
//! all-pass filter, which loses nothing ([`AllPass`]). At an end two laws, of the water and of the
//! wall, send both pairs back; they change the characteristic that reaches the node there, and nothing else of it.
//!
//! What acts along the pipe (friction, creep, gas, an element at a place) acts on pressure waves alone.

use std::collections::VecDeque;

use crate::model::error::ModelError;
use crate::model::fitted::theta;
use crate::model::late::AllPass;
use crate::model::node::Arriving;
use crate::model::trace::{Probe, Trace};
use crate::units::GRAVITY_M_S2;

/// A pipe and its wall.
#[derive(Debug, Clone, Copy)]
pub struct Wall {
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// `ct`, m/s.
    pub stress_speed_m_s: f64,
    /// Density of the water over that of the wall.
    pub density_ratio: f64,
    /// Inner diameter over wall thickness.
    pub wall_ratio: f64,
    /// Cross-section of the water, m².
    pub area_m2: f64,
    /// Length, m.
    pub length_m: f64,
    /// Speed of pressure waves, `λ1`, m/s.
    pub wave_speed_m_s: f64,
}

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

/// Both pairs of waves.
#[derive(Debug, Clone, Copy)]
struct Modes {
    alpha: f64,
    beta: f64,
    /// `λ2`, m/s.
    stress_speed_m_s: f64,
    density_ratio: f64,
    area_m2: f64,
    /// Cross-section of the water over that of the wall.
    thrust: f64,
}

impl Modes {
    /// Velocity of the wall per stress that a wave carries.
    fn per_stress(&self) -> f64 {
        GRAVITY_M_S2 * self.density_ratio / self.stress_speed_m_s
    }

    /// Flow through a moving end per stress that a wave carries.
    fn flow_per_stress(&self) -> f64 {
        self.area_m2 * GRAVITY_M_S2 * (self.beta + self.density_ratio) / self.stress_speed_m_s
    }
}

impl Wall {
    fn modes(&self) -> Result<Modes, ModelError> {
        let Wall { poisson_ratio: nu, stress_speed_m_s: ct, density_ratio: r, wall_ratio, wave_speed_m_s: a, .. } =
            *self;
        let slow = ct * ct - a * a;
        let coupled = 2.0 * nu * nu * r * 0.5 * wall_ratio * a * a;
        if slow <= coupled {
            return Err(ModelError::Value {
                name: "stress_wave_speed_m_s".to_owned(),
                value: ct,
                allowed: "above the speed of pressure waves, with a margin for Poisson's ratio",
            });
        }
        let still = a * a * slow / (slow - coupled);
        let fast = still * ct * ct / (a * a);
        Ok(Modes {
            alpha: nu * 0.5 * wall_ratio * a * a / slow,
            beta: 2.0 * nu * r / (fast / still - 1.0),
            stress_speed_m_s: fast.sqrt(),
            density_ratio: r,
            area_m2: self.area_m2,
            thrust: 0.25 * wall_ratio,
        })
    }
}

/// The stress waves of a pipe, and its two ends.
pub struct WallWaves {
    ends: [WallEnd; 2],
    delays: [Delay; 2],
    length_m: f64,
    dt_s: f64,
}

impl WallWaves {
    /// Of a pipe in steady flow with what holds it at the nodes of the supply and of the valve: each with the head there
    /// before the closure, m. `reaches` is the number of steps that a pressure wave needs.
    ///
    /// # Errors
    /// A stress wave no faster than a pressure wave; fewer than two steps for it to pass the pipe.
    pub fn new(
        wall: &Wall,
        at: [(usize, Hold, f64); 2],
        flow_m3_s: f64,
        dt_s: f64,
        reaches: usize,
    ) -> Result<WallWaves, ModelError> {
        let modes = wall.modes()?;
        let steps = wall.length_m / modes.stress_speed_m_s / dt_s;
        if steps.round() < 2.0 {
            return Err(ModelError::TooFewReaches { reaches, needed: (2.0 * reaches as f64 / steps).ceil() as usize });
        }
        let [supply, valve] = at;
        let end = |(node, hold, head_m), out_m3_s| WallEnd::new(modes, node, hold, (head_m, out_m3_s), dt_s);
        Ok(WallWaves {
            ends: [end(supply, -flow_m3_s), end(valve, flow_m3_s)],
            delays: [Delay::new(steps), Delay::new(steps)],
            length_m: wall.length_m,
            dt_s,
        })
    }

    /// The end at a node of the graph.
    pub(crate) fn at(&mut self, node: usize) -> Option<&mut WallEnd> {
        self.ends.iter_mut().find(|end| end.node == node)
    }

    /// What left one end in this step goes on towards the other.
    pub(crate) fn turn(&mut self) {
        let [supply, valve] = &mut self.ends;
        let [down, up] = &mut self.delays;
        valve.arriving_m = down.pass(supply.leaving_m);
        supply.arriving_m = up.pass(valve.leaving_m);
        for end in &mut self.ends {
            end.left_m.push(end.leaving_m);
            end.sums_m.push(end.sum_m);
        }
    }

    /// Makes room for what the ends keep of so many steps, so that no step has to.
    pub(crate) fn reserve(&mut self, steps: usize) {
        for end in &mut self.ends {
            end.left_m.reserve_exact(steps);
            end.sums_m.reserve_exact(steps);
        }
    }

    /// Adds what the stress waves make of heads and flows to the traces of probes.
    pub(crate) fn show(self, probes: &[Probe], traces: &mut [Trace]) {
        let Modes { beta, stress_speed_m_s, area_m2, .. } = self.ends[0].modes;
        let trace = |values: &[f64]| Trace { dt_s: self.dt_s, values: values.to_vec(), late_s: 0.0 };
        let [from_supply, from_valve] = [0, 1].map(|i| trace(&self.ends[i].left_m));
        for (probe, shown) in probes.iter().zip(traces) {
            let x_m = probe.place().position_m;
            for (i, value) in shown.values.iter_mut().enumerate() {
                let t = i as f64 * self.dt_s;
                let (down_m, up_m) = if x_m <= 0.0 {
                    (self.ends[0].left_m[i], self.ends[0].sums_m[i] - self.ends[0].left_m[i])
                } else if x_m >= self.length_m {
                    (self.ends[1].sums_m[i] - self.ends[1].left_m[i], self.ends[1].left_m[i])
                } else {
                    let since = |way_m: f64| t - way_m / stress_speed_m_s;
                    (from_supply.at(since(x_m)), from_valve.at(since(self.length_m - x_m)))
                };
                *value += match probe {
                    Probe::Head(_) => beta * (down_m + up_m),
                    Probe::Flow(_) => area_m2 * beta * GRAVITY_M_S2 / stress_speed_m_s * (down_m - up_m),
                };
            }
        }
    }
}

/// A wave on its way from one end to the other: whole steps and an all-pass filter for the rest.
struct Delay {
    way: VecDeque<f64>,
    rest: AllPass,
}

impl Delay {
    fn new(steps: f64) -> Delay {
        // One step more passes until the other end takes it; the filter takes a half to one and a half.
        let late = 1.0 + steps - steps.round();
        let whole = steps.round() as usize - 2;
        Delay { way: VecDeque::from(vec![0.0; whole]), rest: AllPass::new(late, 0.0) }
    }

    fn pass(&mut self, wave: f64) -> f64 {
        self.way.push_back(wave);
        let wave = self.way.pop_front().unwrap_or(wave);
        self.rest.pass(wave)
    }
}

/// One end. Flows and travels out of the pipe count as positive; `h` and `q` are those of pressure waves, as deviations
/// from the steady flow, in which there are no stress waves.
pub(crate) struct WallEnd {
    modes: Modes,
    node: usize,
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
    arriving_m: f64,
    leaving_m: f64,
    sum_m: f64,
    travel_m: f64,
    rate_m_s: f64,
    /// Of this step: `h = ε - z q`, sum of the two stress waves `S0 + S1 q`.
    epsilon_m: f64,
    z: f64,
    s0: f64,
    s1: f64,
    left_m: Vec<f64>,
    sums_m: Vec<f64>,
}

impl WallEnd {
    fn new(modes: Modes, node: usize, hold: Hold, (steady_m, steady_m3_s): (f64, f64), dt_s: f64) -> WallEnd {
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
            arriving_m: 0.0,
            leaving_m: 0.0,
            sum_m: 0.0,
            travel_m: 0.0,
            rate_m_s: 0.0,
            epsilon_m: 0.0,
            z: 0.0,
            s0: 0.0,
            s1: 0.0,
            left_m: vec![0.0],
            sums_m: vec![0.0],
        }
    }

    /// The characteristic that reaches the node in true heads and in flows through the moving end, from that of the
    /// pressure waves.
    pub(crate) fn meets(&mut self, reached: Arriving) -> Arriving {
        let Modes { alpha, beta, density_ratio: r, area_m2, .. } = self.modes;
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
        let c0 = (travel * (2.0 * w * self.arriving_m - by_last) - force * friction_m) / sum;
        let by_h = force * (self.push + alpha) / sum;
        let by_q = -travel * alpha * r / (area_m2 * sum);
        self.z = reached.z;
        self.epsilon_m = reached.e - self.steady_m - reached.z * self.steady_m3_s;
        self.s0 = c0 + by_h * self.epsilon_m;
        self.s1 = by_q - by_h * self.z;
        let g = self.modes.flow_per_stress();
        let z = (self.z - beta * self.s1) / (1.0 - alpha * r - g * self.s1);
        let known_m3_s = self.steady_m3_s + g * (2.0 * self.arriving_m - self.s0);
        Arriving { z, e: self.steady_m + self.epsilon_m + beta * self.s0 + z * known_m3_s }
    }

    /// Head and flow of the pressure waves where the node has this true flow; advances the end.
    pub(crate) fn leaves(&mut self, out_m3_s: f64) -> (f64, f64) {
        let Modes { alpha, beta, density_ratio: r, area_m2, .. } = self.modes;
        let g = self.modes.flow_per_stress();
        let through = out_m3_s - self.steady_m3_s - g * (2.0 * self.arriving_m - self.s0);
        let q = through / (1.0 - alpha * r - g * self.s1);
        let h = self.epsilon_m - self.z * q;
        self.sum_m = self.s0 + self.s1 * q;
        self.leaving_m = self.sum_m - self.arriving_m;
        let rate = alpha * r * q / area_m2 - self.modes.per_stress() * (2.0 * self.arriving_m - self.sum_m);
        match self.slides {
            Some(direction) => {
                self.travel_m += self.dt_s * ((1.0 - self.theta) * self.rate_m_s + self.theta * rate);
                self.rate_m_s = rate;
                if rate * direction < 0.0 {
                    (self.slides, self.rate_m_s) = (None, 0.0);
                }
            }
            None => {
                let held_m = self.push * (h + beta * self.sum_m) + alpha * h - self.sum_m - self.spring * self.travel_m;
                self.slides = (held_m.abs() > self.dry_m).then_some(held_m.signum());
            }
        }
        (self.steady_m + h, self.steady_m3_s + q)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Delft Hydraulics' benchmark problem A: Tijsseling (2003) gives 1024.7 and 5280.5 m/s.
    #[test]
    fn speeds_of_the_two_waves_are_the_published_ones() {
        let still = f64::sqrt(1000.0 * (1.0 / 2.1e9 + (1.0 - 0.09) * 0.797 / (0.008 * 2.1e11))).recip();
        let (ct2, r, ratio) = (2.1e11 / 7900.0, 1.0 / 7.9, 0.797 / 0.008);
        let both = still * still + ct2 + 2.0 * 0.09 * r * 0.5 * ratio * still * still;
        let slow = (0.5 * (both - (both * both - 4.0 * still * still * ct2).sqrt())).sqrt();
        let wall = Wall {
            poisson_ratio: 0.3,
            stress_speed_m_s: ct2.sqrt(),
            density_ratio: r,
            wall_ratio: ratio,
            area_m2: 0.5,
            length_m: 20.0,
            wave_speed_m_s: slow,
        };
        let modes = wall.modes().unwrap();
        assert!((slow - 1024.7).abs() < 0.1 && (modes.stress_speed_m_s - 5280.5).abs() < 0.5, "{slow} {modes:?}");
    }

    #[test]
    fn a_whole_number_of_steps_is_an_exact_delay() {
        let mut delay = Delay::new(5.0);
        let heard: Vec<f64> = (0..12).map(|i| delay.pass(f64::from(i * i))).collect();
        // The other end takes it a step later.
        for (i, wave) in heard.iter().enumerate().skip(4) {
            assert_eq!(*wave, ((i - 4) * (i - 4)) as f64);
        }
    }
}
