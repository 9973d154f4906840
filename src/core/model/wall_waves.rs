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
//! What acts along the pipe (friction, creep, gas, an element at a place) acts on pressure waves alone. Dry friction on
//! what the pipe lies on acts on both ([`Floor`]).

use std::collections::VecDeque;

use crate::model::error::ModelError;
use crate::model::fitted::theta;
use crate::model::grid::Segment;
use crate::model::late::AllPass;
use crate::model::node::Arriving;
use crate::model::steady::Steady;
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
    /// Head whose push on the wall's end the dry friction all along the pipe just holds, m.
    pub floor_m: f64,
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
    ways: Ways,
    floor: Option<Floor>,
    length_m: f64,
    dt_s: f64,
}

impl WallWaves {
    /// Of a pipe in steady flow with what holds it at the nodes of the supply and of the valve: each with the head there
    /// before the closure, m. `reaches` is the number of steps that a pressure wave needs.
    ///
    /// # Errors
    /// A stress wave no faster than a pressure wave; fewer than two steps for it to pass the pipe.
    pub fn new(wall: &Wall, at: [(usize, Hold, f64); 2], steady: &Steady) -> Result<WallWaves, ModelError> {
        let modes = wall.modes()?;
        let (dt_s, reaches) = (steady.grid.dt_s, steady.grid.reaches());
        let steps = wall.length_m / modes.stress_speed_m_s / dt_s;
        // A floor needs a place where waves meet, and nodes about it.
        let least = if wall.floor_m > 0.0 { 3.0 } else { 2.0 };
        let too_few = |needed: f64| ModelError::TooFewReaches { reaches, needed: needed.ceil() as usize };
        if steps.round() < least {
            return Err(too_few(least * reaches as f64 / steps));
        }
        let ways = Ways::new(steps);
        let lies = wall.floor_m > 0.0;
        let floor = lies.then(|| Floor::new(wall, modes, ways.down.len(), steady).ok_or(too_few(2.0 * reaches as f64)));
        let floor = floor.transpose()?;
        let ([supply, valve], flows) = (at, &steady.flow_m3_s);
        let end = |(node, hold, head_m), out_m3_s| WallEnd::new(modes, node, hold, (head_m, out_m3_s), dt_s);
        Ok(WallWaves {
            ends: [end(supply, -flows[0]), end(valve, flows[flows.len() - 1])],
            ways,
            floor,
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
        [supply.arriving_m, valve.arriving_m] = self.ways.pass(supply.leaving_m, valve.leaving_m);
        for end in &mut self.ends {
            end.left_m.push(end.leaving_m);
            end.sums_m.push(end.sum_m);
        }
    }

    /// Whether the pipe lies on a floor, so that what rubs there acts on the line.
    pub(crate) fn lies(&self) -> bool {
        self.floor.is_some()
    }

    /// The floor holds the wall in the next step, or brakes it; adds its `d`. `next_u` is what arrives there at a node,
    /// before what friction takes over one reach.
    #[inline(always)]
    pub(crate) fn rub(&mut self, next_u: impl Fn(usize) -> f64, momentum: &mut [f64]) {
        if let Some(floor) = &mut self.floor {
            floor.rub(&mut self.ways, next_u, momentum);
        }
    }

    /// Makes room for what is kept of so many steps for the probes, so that no step has to.
    pub(crate) fn reserve(&mut self, steps: usize, probes: &[Probe]) {
        for end in &mut self.ends {
            end.left_m.reserve_exact(steps);
            end.sums_m.reserve_exact(steps);
        }
        if let Some(floor) = &mut self.floor {
            floor.heard = probes.iter().map(|probe| floor.around(probe.place().position_m, steps)).collect();
        }
    }

    /// Adds what the stress waves make of heads and flows to the traces of probes.
    pub(crate) fn show(self, probes: &[Probe], traces: &mut [Trace]) {
        let Modes { beta, stress_speed_m_s, area_m2, .. } = self.ends[0].modes;
        let trace = |values: &[f64]| Trace { dt_s: self.dt_s, values: values.to_vec(), late_s: 0.0 };
        for (n, (probe, shown)) in probes.iter().zip(traces).enumerate() {
            let x_m = probe.place().position_m;
            // Where waves were last heard on their way to the probe: at the ends, or where the floor changes them.
            let [before, behind] =
                self.floor.as_ref().map_or([None, None], |floor| floor.heard[n].each_ref().map(Option::as_ref));
            let (from_m, from_supply) =
                before.map_or((0.0, trace(&self.ends[0].left_m)), |at| (at.x_m, trace(&at.wave_m)));
            let (to_m, from_valve) =
                behind.map_or((self.length_m, trace(&self.ends[1].left_m)), |at| (at.x_m, trace(&at.wave_m)));
            for (i, value) in shown.values.iter_mut().enumerate() {
                let t = i as f64 * self.dt_s;
                let (down_m, up_m) = if x_m <= 0.0 {
                    (self.ends[0].left_m[i], self.ends[0].sums_m[i] - self.ends[0].left_m[i])
                } else if x_m >= self.length_m {
                    (self.ends[1].sums_m[i] - self.ends[1].left_m[i], self.ends[1].left_m[i])
                } else {
                    let since = |way_m: f64| t - way_m / stress_speed_m_s;
                    (from_supply.at(since(x_m - from_m)), from_valve.at(since(to_m - x_m)))
                };
                *value += match probe {
                    Probe::Head(_) => beta * (down_m + up_m),
                    Probe::Flow(_) => area_m2 * beta * GRAVITY_M_S2 / stress_speed_m_s * (down_m - up_m),
                };
            }
        }
    }
}

/// Stress waves on their way, oldest first: whole steps from the valve, and all-pass filters for the rest of the way,
/// at the supply.
struct Ways {
    down: VecDeque<f64>,
    up: VecDeque<f64>,
    rest: [AllPass; 2],
}

impl Ways {
    fn new(steps: f64) -> Ways {
        // One step more passes until the other end takes it; the filter takes a half to one and a half.
        let late = 1.0 + steps - steps.round();
        let whole = VecDeque::from(vec![0.0; steps.round() as usize - 2]);
        Ways { down: whole.clone(), up: whole, rest: [AllPass::new(late, 0.0); 2] }
    }

    /// What arrives at the supply and at the valve as these waves leave them.
    fn pass(&mut self, from_supply: f64, from_valve: f64) -> [f64; 2] {
        let [down, up] = &mut self.rest;
        let shift = |way: &mut VecDeque<f64>, wave: f64| {
            way.push_back(wave);
            way.pop_front().unwrap_or(wave)
        };
        let at_valve = shift(&mut self.down, down.pass(from_supply));
        [up.pass(shift(&mut self.up, from_valve)), at_valve]
    }
}

/// Dry friction between the pipe and what it lies on, gathered at the places where stress waves meet after each step.
///
/// There the stress jumps by `f`, at most by what the floor holds, against the wall's velocity; head, flow and that
/// velocity do not jump. It sends a stress wave of `-f/2(1 + αβ)` upstream, its opposite downstream, and pressure waves
/// of `-β` times as much. Where less than the most is enough, the wall stands still.
struct Floor {
    modes: Modes,
    /// From the valve on.
    places: Vec<Rubbed>,
    /// For each probe, where waves towards it were changed last.
    heard: Vec<[Option<Heard>; 2]>,
}

/// One place of it.
struct Rubbed {
    x_m: f64,
    /// Most of `f/2(1 + αβ)`.
    most_m: f64,
    /// Inner nodes around it, with weights.
    nodes: [(usize, f64); 2],
    /// Velocity of the wall by the pressure waves' `u`, in steady flow, and by what is sent.
    by_u: f64,
    steady_m_s: f64,
    by_sent: f64,
}

/// A wave as it was after each step at the place of this number.
struct Heard {
    place: usize,
    x_m: f64,
    wave_m: Vec<f64>,
}

impl Floor {
    /// Nothing where there are no nodes about its places.
    fn new(wall: &Wall, modes: Modes, count: usize, steady: &Steady) -> Option<Floor> {
        let (grid, reach_m) = (steady.grid, modes.stress_speed_m_s * steady.grid.dt_s);
        // Place, index and steady flow of each inner node.
        let inner = |(s, &flow): (&Segment, &f64)| {
            (1..s.reaches).map(|i| (s.start_m + s.reach_m * i as f64, s.offset + i, flow)).collect::<Vec<_>>()
        };
        let inner: Vec<(f64, usize, f64)> = grid.segments.iter().zip(&steady.flow_m3_s).flat_map(inner).collect();
        let last = inner.len().checked_sub(1).filter(|last| *last > 0)?;
        let twice = 2.0 * (1.0 + modes.alpha * modes.beta);
        let place = |i: usize| {
            let x_m = wall.length_m - (i + 1) as f64 * reach_m;
            // The first has what lies between it and the valve, the last what lies between it and the supply.
            let to_valve_m = if i == 0 { reach_m } else { 0.5 * reach_m };
            let to_supply_m = if i + 1 == count { x_m } else { 0.5 * reach_m };
            let behind = inner.partition_point(|(at_m, ..)| *at_m < x_m).clamp(1, last);
            let [(from_m, first, from_m3_s), (to_m, second, to_m3_s)] = [inner[behind - 1], inner[behind]];
            let part = ((x_m - from_m) / (to_m - from_m)).clamp(0.0, 1.0);
            let Segment { impedance, .. } = grid.segments[grid.stencil(x_m).segment];
            let by_u = modes.alpha * modes.density_ratio / (impedance * modes.area_m2);
            Rubbed {
                x_m,
                most_m: modes.thrust * wall.floor_m * (to_valve_m + to_supply_m) / wall.length_m / twice,
                nodes: [(first, 1.0 - part), (second, part)],
                by_u,
                steady_m_s: by_u * impedance * ((1.0 - part) * from_m3_s + part * to_m3_s),
                by_sent: modes.per_stress() + by_u * modes.beta * (part * part + (1.0 - part) * (1.0 - part)),
            }
        };
        Some(Floor { modes, places: (0..count).map(place).collect(), heard: Vec::new() })
    }

    #[inline(always)]
    fn rub(&mut self, ways: &mut Ways, next_u: impl Fn(usize) -> f64, momentum: &mut [f64]) {
        let (beta, by_stress) = (self.modes.beta, self.modes.per_stress());
        for (place, (down, up)) in self.places.iter().zip(ways.down.iter_mut().zip(ways.up.iter_mut().rev())) {
            let u = place.nodes.iter().map(|&(node, share)| share * (next_u(node) + momentum[node])).sum::<f64>();
            let free_m_s = place.by_u * u - place.steady_m_s - by_stress * (*down - *up);
            let sent = (free_m_s / place.by_sent).clamp(-place.most_m, place.most_m);
            *down += sent;
            *up -= sent;
            for &(node, share) in &place.nodes {
                momentum[node] -= share * beta * sent;
            }
        }
        let last = self.places.len().wrapping_sub(1);
        for [before, behind] in &mut self.heard {
            if let Some(heard) = before {
                heard.wave_m.push(ways.down[heard.place]);
            }
            if let Some(heard) = behind {
                heard.wave_m.push(ways.up[last - heard.place]);
            }
        }
    }

    /// The places before and behind a probe, with room for so many steps.
    fn around(&self, x_m: f64, steps: usize) -> [Option<Heard>; 2] {
        let before = self.places.iter().position(|place| place.x_m <= x_m);
        let behind = self.places.iter().rposition(|place| place.x_m >= x_m);
        [before, behind].map(|found| {
            let place = found?;
            // Nothing moves before the second step.
            let mut wave_m = Vec::with_capacity(steps + 2);
            wave_m.extend([0.0, 0.0]);
            Some(Heard { place, x_m: self.places[place].x_m, wave_m })
        })
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
            floor_m: 0.0,
        };
        let modes = wall.modes().unwrap();
        assert!((slow - 1024.7).abs() < 0.1 && (modes.stress_speed_m_s - 5280.5).abs() < 0.5, "{slow} {modes:?}");
    }

    #[test]
    fn a_whole_number_of_steps_is_an_exact_delay() {
        let mut ways = Ways::new(5.0);
        let heard: Vec<[f64; 2]> = (0..12).map(|i| ways.pass(f64::from(i * i), -f64::from(i))).collect();
        // The other end takes it a step later.
        for (i, arrived) in heard.iter().enumerate().skip(4) {
            assert_eq!(*arrived, [-((i - 4) as f64), ((i - 4) * (i - 4)) as f64]);
        }
    }
}
