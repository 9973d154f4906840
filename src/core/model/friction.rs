//! Steady wall friction: Darcy-Weisbach with a constant factor or one that follows the Reynolds number.

use crate::rig::{Pipe, Regime, WaterProperties, darcy_friction_factor, turbulent_friction_factor};
use crate::units::GRAVITY_M_S2;

/// Law of the wall's friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WallFriction {
    /// A constant Darcy factor.
    Constant {
        /// Darcy friction factor.
        factor: f64,
    },
    /// Hagen-Poiseuille at every flow: linear.
    Laminar {
        /// Kinematic viscosity, m²/s.
        viscosity_m2_s: f64,
        /// Multiplies the loss; 1 is the textbook value.
        scale: f64,
    },
    /// The factor of the momentary flow: laminar below Re 2320, Colebrook-White above, times a scale.
    Reynolds {
        /// Kinematic viscosity, m²/s.
        viscosity_m2_s: f64,
        /// Roughness, m (0: smooth).
        roughness_m: f64,
        /// Multiplies the factor; 1 is the textbook value.
        scale: f64,
    },
}

impl WallFriction {
    /// A constant Darcy factor.
    pub fn constant(factor: f64) -> Self {
        WallFriction::Constant { factor }
    }

    /// The law of a pipe that carries `flow_m3_s` before the closure.
    ///
    /// A given factor is constant. A given roughness makes the factor follow the momentary Reynolds number. With
    /// neither, the pipe is smooth and its factor that of the flow before the closure (the common quasi-steady
    /// friction): laminar and linear below Re 2320, constant above.
    pub fn of(pipe: &Pipe, water: &WaterProperties, flow_m3_s: f64) -> Self {
        WallFriction::in_regime(pipe, water, flow_m3_s, Regime::of(pipe.reynolds(water, flow_m3_s)))
    }

    /// The same where the regime is known.
    pub fn in_regime(pipe: &Pipe, water: &WaterProperties, flow_m3_s: f64, regime: Regime) -> Self {
        let viscosity_m2_s = water.kinematic_viscosity_m2_s;
        if let Some(factor) = pipe.friction_factor {
            return WallFriction::Constant { factor };
        }
        if let Some(roughness_m) = pipe.roughness_m {
            return WallFriction::Reynolds { viscosity_m2_s, roughness_m, scale: 1.0 };
        }
        match regime {
            Regime::Laminar => WallFriction::Laminar { viscosity_m2_s, scale: 1.0 },
            Regime::Turbulent => {
                WallFriction::Constant { factor: turbulent_friction_factor(pipe.reynolds(water, flow_m3_s), 0.0) }
            }
        }
    }

    /// The same law with its loss multiplied by a scale.
    pub fn scaled(self, by: f64) -> Self {
        match self {
            WallFriction::Constant { factor } => WallFriction::Constant { factor: factor * by },
            WallFriction::Laminar { viscosity_m2_s, scale } => {
                WallFriction::Laminar { viscosity_m2_s, scale: scale * by }
            }
            WallFriction::Reynolds { viscosity_m2_s, roughness_m, scale } => {
                WallFriction::Reynolds { viscosity_m2_s, roughness_m, scale: scale * by }
            }
        }
    }

    /// Head lost per metre of pipe, signed like the flow: `f V|V| / (2 g D)`, laminar `32 ν V / (g D²)`.
    pub fn slope(self, diameter_m: f64, flow_m3_s: f64) -> f64 {
        let velocity = flow_m3_s / (std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m);
        let darcy = |factor: f64| factor * velocity * velocity.abs() / (2.0 * GRAVITY_M_S2 * diameter_m);
        match self {
            WallFriction::Constant { factor } => darcy(factor),
            WallFriction::Laminar { viscosity_m2_s, scale } => {
                scale * 32.0 * viscosity_m2_s * velocity / (GRAVITY_M_S2 * diameter_m * diameter_m)
            }
            WallFriction::Reynolds { viscosity_m2_s, roughness_m, scale } => {
                let reynolds = velocity.abs() * diameter_m / viscosity_m2_s;
                if reynolds == 0.0 {
                    return 0.0;
                }
                darcy(scale * darcy_friction_factor(reynolds, roughness_m / diameter_m))
            }
        }
    }
}

/// Half a reach's friction as the kernel uses it, for `u = B Q`.
///
/// With `½R(u/B) = u φ(|u|)` the equation `u + ½R(u/B) = d` is solved by a series in the small ratio `φ` (friction over
/// one reach against the impedance); the terms kept leave a relative error of order `φ⁴` or less.
pub trait NodeFriction {
    /// `φ(|u|)`.
    fn phi(&self, u: f64) -> f64;
    /// `u` with `u (1 + φ(|u|)) = d`.
    fn solve(&self, d: f64) -> f64;
    /// Half a reach's loss `½R` at `u`, m.
    #[inline(always)]
    fn half_loss(&self, u: f64) -> f64 {
        u * self.phi(u)
    }
}

/// A constant factor: `φ = k |u|`.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// `k`, 1/m.
    pub k: f64,
}

impl NodeFriction for Quadratic {
    #[inline(always)]
    fn phi(&self, u: f64) -> f64 {
        self.k * u.abs()
    }
    /// Expansion of `2d / (1 + √(1 + 4z))`, `z = k|d|`: `1 - z + 2z² - 5z³ + 14z⁴`, in pairs, which wait for each other
    /// less than one after the other.
    #[inline(always)]
    fn solve(&self, d: f64) -> f64 {
        let z = self.k * d.abs();
        let z2 = z * z;
        d * ((1.0 - z) + z2 * ((2.0 - 5.0 * z) + 14.0 * z2))
    }
}

/// Laminar friction: `φ` is a constant.
#[derive(Debug, Clone)]
pub struct Linear {
    phi: f64,
    by_one_and_phi: f64,
}

impl NodeFriction for Linear {
    #[inline(always)]
    fn phi(&self, _u: f64) -> f64 {
        self.phi
    }
    #[inline(always)]
    fn solve(&self, d: f64) -> f64 {
        d * self.by_one_and_phi
    }
}

/// A factor that follows the Reynolds number: `φ` tabulated at even steps of `|u|`, linear in between, constant beyond.
#[derive(Debug, Clone)]
pub struct Tabulated {
    per_m: f64,
    /// `φ` at each step and its rise to the next.
    steps: Vec<(f64, f64)>,
}

/// Steps of a friction table. They interpolate Colebrook's `φ ~ |u|^0.8` to 1e-4 of itself, except over the slowest
/// twentieth of the flows, where friction itself is small.
const TABLE_STEPS: usize = 256;

impl Tabulated {
    /// From `φ` itself and the largest `|u|` expected.
    fn new(phi_at: impl Fn(f64) -> f64, largest_u_m: f64) -> Self {
        let step = largest_u_m.max(1e-9) / TABLE_STEPS as f64;
        let mut phi: Vec<f64> = (0..=TABLE_STEPS).map(|i| phi_at(i.max(1) as f64 * step)).collect();
        // Laminar friction is linear down to rest: φ is a constant there.
        phi[0] = phi_at(0.5 * step);
        let rise = |i: usize| phi.get(i + 1).map_or(0.0, |next| next - phi[i]);
        Tabulated { per_m: 1.0 / step, steps: (0..phi.len()).map(|i| (phi[i], rise(i))).collect() }
    }

    /// `φ` and `|u| dφ/d|u|` at `|u|`.
    #[inline(always)]
    fn look_up(&self, size: f64) -> (f64, f64) {
        let x = (size * self.per_m).min(TABLE_STEPS as f64);
        let i = x as usize;
        let (low, rise) = self.steps[i];
        (low + (x - i as f64) * rise, x * rise)
    }
}

impl NodeFriction for Tabulated {
    #[inline(always)]
    fn phi(&self, u: f64) -> f64 {
        self.look_up(u.abs()).0
    }
    /// About `u = d`, where `φ` is a line: with `p = |u| dφ/d|u|`, `u = d (1 - δ)`, `δ (1 + φ + p) = φ + p δ²`, to
    /// third order.
    #[inline(always)]
    fn solve(&self, d: f64) -> f64 {
        let (phi, p) = self.look_up(d.abs());
        let slope = phi + p;
        d - d * phi * (1.0 - slope * (1.0 - slope) + p * phi)
    }
}

/// The friction of one segment's reaches.
#[derive(Debug, Clone)]
pub enum ReachFriction {
    /// See [`Quadratic`].
    Quadratic(Quadratic),
    /// See [`Linear`].
    Linear(Linear),
    /// See [`Tabulated`].
    Tabulated(Tabulated),
}

impl ReachFriction {
    /// From the laws of the reach's parts, its loss `loss_m(Q)` and the impedance `B`; `largest_u_m` bounds the table
    /// of a law without a simple form.
    pub fn new<'a>(
        mut laws: impl Iterator<Item = &'a WallFriction> + Clone,
        loss_m: impl Fn(f64) -> f64,
        impedance: f64,
        largest_u_m: f64,
    ) -> Self {
        if laws.clone().all(|law| matches!(law, WallFriction::Constant { .. })) {
            return ReachFriction::Quadratic(Quadratic { k: 0.5 * loss_m(1.0) / (impedance * impedance) });
        }
        if laws.all(|law| matches!(law, WallFriction::Laminar { .. })) {
            let phi = 0.5 * loss_m(1.0) / impedance;
            return ReachFriction::Linear(Linear { phi, by_one_and_phi: 1.0 / (1.0 + phi) });
        }
        ReachFriction::Tabulated(Tabulated::new(|u| 0.5 * loss_m(u / impedance) / u, largest_u_m))
    }

    /// The same friction as the kernel's loops see it: of `w = 2u`, its loss divided by `1 + μ`.
    pub fn of_twice_u(&self, one_plus_mu: f64) -> Self {
        match self {
            ReachFriction::Quadratic(q) => ReachFriction::Quadratic(Quadratic { k: 0.5 * q.k / one_plus_mu }),
            ReachFriction::Linear(l) => {
                let phi = l.phi / one_plus_mu;
                ReachFriction::Linear(Linear { phi, by_one_and_phi: 1.0 / (1.0 + phi) })
            }
            ReachFriction::Tabulated(t) => {
                let steps = t.steps.iter().map(|&(phi, rise)| (phi / one_plus_mu, rise / one_plus_mu)).collect();
                ReachFriction::Tabulated(Tabulated { per_m: 0.5 * t.per_m, steps })
            }
        }
    }

    /// `u` with `u + ½R(u/B) = d`.
    #[inline]
    pub fn solve(&self, d: f64) -> f64 {
        match self {
            ReachFriction::Quadratic(q) => q.solve(d),
            ReachFriction::Linear(l) => l.solve(d),
            ReachFriction::Tabulated(t) => t.solve(d),
        }
    }

    /// Half a reach's loss `½R` at `u`, m, and its derivative by `u`.
    #[inline]
    pub fn half_loss_and_slope(&self, u: f64) -> (f64, f64) {
        match self {
            ReachFriction::Quadratic(q) => (q.half_loss(u), 2.0 * q.phi(u)),
            ReachFriction::Linear(l) => (l.half_loss(u), l.phi),
            ReachFriction::Tabulated(t) => {
                let (phi, by_u) = t.look_up(u.abs());
                (u * phi, phi + by_u)
            }
        }
    }

    /// `½R0` of a steady `u` as [`NodeFriction::solve`] sees it: `solve(u + ½R0) = u` to rounding, so the error of the
    /// series does not disturb the steady state.
    pub fn steady_half_loss(&self, u: f64) -> f64 {
        let mut loss = self.half_loss_and_slope(u).0;
        for _ in 0..4 {
            loss += u - self.solve(u + loss);
        }
        loss
    }

    /// Largest `φ` up to `u`: the share of the impedance that friction over one reach takes.
    pub fn largest_share(&self, u: f64) -> f64 {
        match self {
            ReachFriction::Quadratic(q) => q.phi(u),
            ReachFriction::Linear(l) => l.phi,
            ReachFriction::Tabulated(t) => t.steps.iter().map(|s| s.0).fold(0.0, f64::max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadratic_series_meets_the_closed_form() {
        let friction = Quadratic { k: 1e-4 };
        for d in [-30.0f64, -1.0, 0.0, 2.0, 50.0] {
            let exact = 2.0 * d / (1.0 + (1.0 + 4.0 * 1e-4 * d.abs()).sqrt());
            assert!((friction.solve(d) - exact).abs() <= 42.0 * (1e-4 * d.abs()).powi(5) * d.abs() + 1e-13);
        }
    }

    #[test]
    fn the_table_solves_its_own_equation() {
        let law = WallFriction::Reynolds { viscosity_m2_s: 1e-6, roughness_m: 0.0, scale: 1.0 };
        let impedance = 1e5;
        let friction = Tabulated::new(|u| 0.25 * law.slope(0.02, u / impedance) / u, 60.0);
        for d in [-40.0, -3.0, 0.01, 1.0, 25.0] {
            let u = friction.solve(d);
            let phi = friction.phi(d);
            assert!((u + friction.half_loss(u) - d).abs() < 10.0 * phi.powi(4) * d.abs() + 1e-12, "{d}");
            let exact = 0.5 * law.slope(0.02, u / impedance) * 0.5;
            assert!((friction.half_loss(u) - exact).abs() < 5e-3 * exact.abs() + 1e-6, "{d}");
        }
    }

    #[test]
    fn laminar_friction_is_hagen_poiseuille() {
        for law in [
            WallFriction::Reynolds { viscosity_m2_s: 1e-6, roughness_m: 0.0, scale: 1.0 },
            WallFriction::Laminar { viscosity_m2_s: 1e-6, scale: 1.0 },
        ] {
            let (d, velocity): (f64, f64) = (0.02, 0.05);
            let flow = velocity * std::f64::consts::FRAC_PI_4 * d * d;
            let exact = 32.0 * 1e-6 * velocity / (GRAVITY_M_S2 * d * d);
            assert!((law.slope(d, flow) / exact - 1.0).abs() < 1e-12);
        }
    }
}
