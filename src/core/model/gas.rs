//! Volumes of gas and vapour that take water out of the line as the pressure rises: the law of one volume and its time
//! step.
//!
//! A volume `V` shrinks by the water that flows into its place, `dV/dt = -q`. `K` sums up every step's flow in full,
//! and the volume that belongs to the new head lies between the old `K` and the new:
//!
//! ```text
//! K⁺ = K - dt q⁺,   V⁺ = ψ K⁺ + (1 - ψ) K   that is   V⁺ = V - dt [ψ q⁺ + (1 - ψ) q],   ψ = ½ + 4 dx/L
//! ```
//!
//! - The trapezoidal rule (`ψ = ½`) is of second order but lets `q` alternate from step to step for ever; `ψ = 1`
//!   prevents that but is of first order. With `ψ - ½` proportional to the step it stays second order, and the
//!   alternation decays by `(1 - ψ)/ψ` per step: by about `e^-16` over `L/a` on *every* grid.
//! - `K` is at least half of the volume, `K⁺ ≥ V⁺/2`. Otherwise a cavity that closes within a step would be filled
//!   beyond its end and throw the water back, step after step. As `K` itself is never changed, this loses or makes no
//!   water. A limiter that clips the volume instead would feed on alternating flows, and its spikes would grow with
//!   finer grids.
//!
//! Gas that follows the pressure with a lag `θ`, `V + θ dV/dt = V_eq(H)`, takes `ψ dt + θ` in place of `ψ dt`.
//!
//! Both conditions make `q⁺` an increasing, concave function of the head:
//! `q⁺ = min((K - V_eq)/(ψ dt + θ), (K - V_eq/2)/dt)`.

use crate::model::contribution::NodeField;
use crate::model::error::ModelError;
use crate::model::node::Shunt;
use crate::model::scene::{Scene, Spot};
use crate::model::steady::Steady;
use crate::rig::Place;
use crate::wide::widened;

/// Gas fraction up to which only cavities are computed. Literature: 10⁻⁷, by half a decade for what a fit may err.
pub const CAVITIES_ONLY: f64 = 3e-7;

/// Least `K` as a share of the volume.
const LEAST: f64 = 0.5;

/// Time step of a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepping {
    /// `dt`, s.
    pub dt_s: f64,
    /// `ψ dt + θ`, s.
    pub follow_s: f64,
}

impl Stepping {
    /// For reaches of `reach_m` of a line of `length_m`, and gas with a lag.
    pub fn new(dt_s: f64, reach_m: f64, length_m: f64, lag_s: f64) -> Self {
        let psi = (0.5 + 4.0 * reach_m / length_m).min(1.0);
        Stepping { dt_s, follow_s: psi * dt_s + lag_s }
    }

    /// At a joint or at the pipe's end.
    pub fn at(scene: &Scene, spot: &Spot, lag_s: f64) -> Self {
        Stepping::new(scene.dt_s, spot.wave_speed_m_s * scene.dt_s, scene.rig.length_m(), lag_s)
    }
}

/// Isothermal gas over vapour, spread along the pipe: `V_eq = content (1/y - 1/below)` per volume of pipe at a head `y`
/// above that of vapour, nothing from `y = below` on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gas {
    /// Product of the volume fraction and the absolute head at which it is measured, m.
    pub content_m: f64,
    /// Head above that of vapour from which there is no gas, m; infinite for gas that never dissolves.
    pub below_m: f64,
    /// Time that the volume takes to follow the pressure, s.
    pub lag_s: f64,
    /// Gauge pressure head of vapour, m.
    pub vapour_head_m: f64,
}

/// A volume under a pressure head `y = H - floor`: `y Vⁿ` is constant down to a low head, below which the volume grows
/// linearly, so that every head has a volume. Less a constant volume, where there is none above a certain head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Law {
    floor_m: f64,
    by_exponent: f64,
    low_m: f64,
    low_volume_m3: f64,
    low_slope_m2: f64,
    /// Volume at the head from which there is none.
    gone_m3: f64,
}

/// Fall of a node's head, m, over which its cavity grows by the volume of its piece of pipe in the linear part of the
/// law: far less than any sensor sees, yet enough for a head's last digits to distinguish volumes.
const CAVITY_DEPTH_M: f64 = 1e-4;

impl Law {
    /// Isothermal gas over vapour at a node at an elevation, in a piece of pipe of `pipe_volume_m3`.
    pub fn isothermal(elevation_m: f64, gas: Gas, pipe_volume_m3: f64) -> Self {
        let floor_m = elevation_m + gas.vapour_head_m;
        let content_m4 = gas.content_m * pipe_volume_m3;
        let low_slope_m2 = pipe_volume_m3 / CAVITY_DEPTH_M;
        let low_m = (content_m4 / low_slope_m2).sqrt();
        let gone_m3 = content_m4 / gas.below_m;
        Law { floor_m, by_exponent: 1.0, low_m, low_volume_m3: low_m * low_slope_m2, low_slope_m2, gone_m3 }
    }

    /// Polytropic gas of `volume_m3` at `y = reference_m`; straight below `y = low_m`.
    pub fn polytropic(floor_m: f64, exponent: f64, reference_m: f64, volume_m3: f64, low_m: f64) -> Self {
        let by_exponent = 1.0 / exponent;
        let low_volume_m3 = volume_m3 * (reference_m / low_m).powf(by_exponent);
        let low_slope_m2 = low_volume_m3 * by_exponent / low_m;
        Law { floor_m, by_exponent, low_m, low_volume_m3, low_slope_m2, gone_m3: 0.0 }
    }

    /// Volume at a head, m³, and its decrease with the head, m².
    pub fn volume(&self, head_m: f64) -> (f64, f64) {
        let y = head_m - self.floor_m;
        let (volume, fall) = if y <= self.low_m {
            (self.low_volume_m3 + self.low_slope_m2 * (self.low_m - y), self.low_slope_m2)
        } else {
            let ratio = self.low_m / y;
            // Isothermal nodes are many: spare them the power function.
            let volume =
                self.low_volume_m3 * if self.by_exponent == 1.0 { ratio } else { ratio.powf(self.by_exponent) };
            (volume, volume * self.by_exponent / y)
        };
        if volume > self.gone_m3 { (volume - self.gone_m3, fall) } else { (0.0, 0.0) }
    }
}

/// One volume at a joint or at the pipe's end, as a shunt.
pub struct Volume {
    law: Law,
    stepping: Stepping,
    sum_m3: f64,
}

impl Volume {
    /// A volume before [`Shunt::settle`].
    pub fn new(law: Law, stepping: Stepping) -> Self {
        Volume { law, stepping, sum_m3: 0.0 }
    }
}

impl Shunt for Volume {
    fn settle(&mut self, head_m: f64) -> f64 {
        self.sum_m3 = self.law.volume(head_m).0;
        0.0
    }
    fn outflow(&self, head_m: f64) -> (f64, f64) {
        let (volume, fall) = self.law.volume(head_m);
        let Stepping { dt_s, follow_s } = self.stepping;
        let (free, held) = ((self.sum_m3 - volume) / follow_s, (self.sum_m3 - LEAST * volume) / dt_s);
        if free <= held { (free, fall / follow_s) } else { (held, LEAST * fall / dt_s) }
    }
    fn advance(&mut self, head_m: f64) {
        self.sum_m3 -= self.stepping.dt_s * self.outflow(head_m).0;
    }
}

/// Isothermal gas over vapour at the inner nodes of all segments.
struct Field {
    segments: Vec<Piece>,
    /// Steady head above the vapour head at each node, m.
    steady_m: Vec<f64>,
    /// `K` of each node, m³.
    sum_m3: Vec<f64>,
}

/// Common data of the nodes of one segment.
struct Piece {
    offset: usize,
    content_m4: f64,
    /// Volume that the law would have at the head from which there is none.
    gone_m3: f64,
    stepping: Stepping,
}

impl NodeField for Field {
    /// With `y = h + y0` the node is `k y + c q = k y0 + s` with `q = min((K - V)/(ψ dt + θ), (K - V/2)/dt)` and
    /// `V = max(C/y - C/below, 0)`: two quadratics and, without gas, a line. The least outflow leaves the greatest `y`.
    fn inner(&mut self, segment: usize, one_plus_kappa: f64, c: f64, s: &[f64], h: &mut [f64], q: &mut [f64]) {
        let piece = &self.segments[segment];
        let inner = piece.offset + 1..piece.offset + 1 + s.len();
        let (steady, sum) = (&self.steady_m[inner.clone()], &mut self.sum_m3[inner]);
        take_out(piece, one_plus_kappa, c, steady, sum, s, h, q);
    }
}

// By index, as in the convolution of unsteady friction.
widened! {
    over s.len();
    fn take_out(piece: &Piece, k: f64, c: f64, steady: &[f64], sum: &mut [f64], s: &[f64], h: &mut [f64], q: &mut [f64]) {
        let Piece { content_m4, gone_m3, stepping: Stepping { dt_s, follow_s }, .. } = *piece;
        let (by_2k, by_c) = (0.5 / k, 1.0 / c);
        let (free, held) = (c / follow_s, c / dt_s);
        let (free_product, held_product) = (4.0 * k * free * content_m4, 4.0 * k * held * LEAST * content_m4);
        let (free_gone, held_gone) = (free * gone_m3, held * LEAST * gone_m3);
        let m = s.len();
        let (steady, sum, h, q) = (&steady[..m], &mut sum[..m], &mut h[..m], &mut q[..m]);
        for i in 0..m {
            let known = k * steady[i] + s[i];
            let (freely, filling) = (known - free * sum[i], known - held * sum[i]);
            let free_root = positive_root(freely - free_gone, free_product);
            let held_root = positive_root(filling - held_gone, held_product);
            let y = by_2k * larger(larger(free_root, held_root), 2.0 * larger(freely, filling));
            h[i] = y - steady[i];
            q[i] = by_c * (s[i] - k * h[i]);
            sum[i] -= dt_s * q[i];
        }
    }
}

/// The root `x ≥ 0` of `x² - 2 b x - p = 0`, `p ≥ 0`, without cancellation. Both forms are computed: a branch would
/// take nodes one by one.
#[inline(always)]
fn positive_root(b: f64, p: f64) -> f64 {
    let sum = (b * b + p).sqrt() + b.abs();
    let by_sum = p / sum;
    if b >= 0.0 { sum } else { by_sum }
}

/// The larger of two numbers; what is no number stays none.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a < b { b } else { a }
}

/// Gas at all inner nodes.
///
/// # Errors
/// If the water boils somewhere before the closure.
pub fn field(scene: &Scene, steady: &Steady, gas: Gas) -> Result<Box<dyn NodeField>, ModelError> {
    let length_m = scene.rig.length_m();
    let mut steady_m = vec![0.0; steady.head_m.len()];
    let mut sum_m3 = steady_m.clone();
    let mut segments = Vec::new();
    for segment in &steady.grid.segments {
        let content_m4 = gas.content_m * segment.mean(|s| s.area_m2()) * segment.reach_m;
        let gone_m3 = content_m4 / gas.below_m;
        for node in segment.nodes() {
            let position_m = segment.start_m + segment.reach_m * (node - segment.offset) as f64;
            steady_m[node] = steady.head_m[node]
                - gas.vapour_head_m
                - scene.rig.elevation_m(Place { line: segment.line, position_m });
            sum_m3[node] = (content_m4 / steady_m[node] - gone_m3).max(0.0);
        }
        let stepping = Stepping::new(scene.dt_s, segment.reach_m, length_m, gas.lag_s);
        segments.push(Piece { offset: segment.offset, content_m4, gone_m3, stepping });
    }
    if steady_m.iter().any(|&y| y <= 0.0) {
        return Err(ModelError::Value {
            name: "valve_head_m".to_owned(),
            value: scene.valve_head_m,
            allowed: "so high that the water boils nowhere before the closure",
        });
    }
    Ok(Box::new(Field { segments, steady_m, sum_m3 }))
}

/// The same at a joint or at the pipe's end.
pub fn at_node(scene: &Scene, spot: &Spot, gas: Gas) -> Box<dyn Shunt> {
    let law = Law::isothermal(spot.elevation_m, gas, spot.volume_m3);
    Box::new(Volume::new(law, Stepping::at(scene, spot, gas.lag_s)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::node::{Arriving, Node};

    fn laws() -> [Law; 4] {
        let isothermal = |content_m, below_m| {
            Law::isothermal(0.0, Gas { content_m, below_m, lag_s: 0.0, vapour_head_m: -9.0 }, 1e-5)
        };
        let polytropic = Law::polytropic(-10.3, 1.2, 40.0, 3e-5, 0.24);
        [isothermal(1e-6, f64::INFINITY), isothermal(0.0, f64::INFINITY), polytropic, isothermal(1e-6, 1.0)]
    }

    #[test]
    fn every_head_has_a_volume_that_falls_smoothly() {
        for law in laws() {
            let mut last = f64::INFINITY;
            for i in 0..40_000 {
                let head = -50.0 + 0.005 * f64::from(i);
                let (volume, fall) = law.volume(head);
                assert!(volume >= 0.0 && volume <= last && fall >= 0.0, "{law:?} {head}");
                last = volume;
            }
            for y in [-0.1, law.low_m * 3.0 + 1e-3, 25.0] {
                let head = law.floor_m + y;
                let step = 1e-5 * y + 1e-9;
                let slope = (law.volume(head - step).0 - law.volume(head + step).0) / (2.0 * step);
                assert!((slope - law.volume(head).1).abs() <= 1e-4 * slope.abs() + 1e-15, "{law:?} {y}");
            }
        }
        let law = laws()[2];
        let constant = |head: f64| (head + 10.3) * law.volume(head).0.powf(1.2);
        assert!((constant(29.7) / (40.0 * 3e-5f64.powf(1.2)) - 1.0).abs() < 1e-12);
        assert!((constant(300.0) / constant(0.0) - 1.0).abs() < 1e-12);
    }

    /// A closed end that is sucked and pushed at random: the node's equation holds at every step, the head never falls
    /// below that of vapour, and what flowed is what the volume shrank by.
    #[test]
    fn a_volume_at_a_closed_end_is_solved_however_hard_it_is_hit() {
        for law in laws() {
            let stepping = Stepping::new(1e-4, 0.1, 20.0, 0.0);
            let psi = stepping.follow_s / stepping.dt_s;
            let mut node =
                Node { losses: Vec::new(), shunts: vec![Box::new(Volume::new(law, stepping))], ..Node::default() };
            node.settle(30.0, 0.0);
            let (mut sum, mut head, mut seed) = (law.volume(30.0).0, 30.0, 1u64);
            for step in 0..3000 {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let e = (seed >> 33) as f64 / f64::from(1u32 << 31) * 250.0 - 120.0;
                let left = Arriving { z: 3e5, e };
                let solved = node.solve(left, |_| (0.0, 0.0), head);
                let q = solved.left_flow_m3_s;
                head = solved.left_head_m;
                assert!((head + left.z * q - e).abs() < 1e-3, "{law:?} step {step}: {head} {e}");
                let old = sum;
                sum -= stepping.dt_s * q;
                let volume = law.volume(head).0;
                assert!(sum >= 0.5 * volume * (1.0 - 1e-9) - 1e-18, "step {step}: {sum} {volume}");
                let even = psi * sum + (1.0 - psi) * old;
                let lag = even - volume;
                assert!(lag >= -1e-6 * volume - 1e-15, "step {step}: {even} {volume}");
                assert!(lag <= 1e-6 * volume + 1e-15 || sum <= 0.5 * volume * (1.0 + 1e-6) + 1e-18, "step {step}");
                if law.by_exponent == 1.0 {
                    assert!(head > law.floor_m - 0.1, "step {step}: {head}");
                }
            }
        }
    }

    /// The law is as stiff as any that a node meets; bisection alone would take fifty steps and more.
    #[test]
    fn newtons_method_needs_few_steps_of_it() {
        let mut volume = Volume::new(laws()[0], Stepping::new(1e-4, 0.1, 20.0, 0.0));
        volume.settle(30.0);
        let mut head = 30.0;
        let (mut total, mut most) = (0, 0);
        for step in 0..1000 {
            let e = 120.0 * (f64::from(step) * 2.4).sin() + 5.0;
            let calls = std::cell::Cell::new(0);
            let balance = |h: f64| {
                calls.set(calls.get() + 1);
                let (q, slope) = volume.outflow(h);
                (h + 3e5 * q - e, 1.0 + 3e5 * slope, ())
            };
            head = crate::model::node::root(balance, |(), _| (), head).0;
            volume.advance(head);
            total += calls.get();
            most = most.max(calls.get());
        }
        assert!(total <= 12_000 && most <= 40, "{total} {most}");
    }

    #[test]
    fn the_positive_root_is_one_on_either_side() {
        for (b, p) in [(3.0, 1e-9), (-3.0, 1e-9), (-1e6, 2.0), (0.0, 4.0), (-2.0, 0.0)] {
            let x = positive_root(b, p);
            assert!(x >= 0.0 && (x * (x - 2.0 * b) - p).abs() <= 1e-12 * p.max(b * b * 1e-3), "{b} {p}: {x}");
        }
    }
}
