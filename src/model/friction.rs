//! Steady wall friction: Darcy-Weisbach with a constant factor or one that follows the Reynolds number.

use crate::rig::darcy_friction_factor;
use crate::units::GRAVITY_M_S2;

/// How the wall's friction depends on the flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WallFriction {
    /// A constant Darcy factor.
    Constant {
        /// Darcy friction factor.
        factor: f64,
    },
    /// Laminar below Re 2320, Colebrook-White above, times a scale.
    Reynolds {
        /// Kinematic viscosity, m²/s.
        viscosity_m2_s: f64,
        /// Roughness, m (0: smooth).
        roughness_m: f64,
        /// Multiplies the factor; 1 is the textbook.
        scale: f64,
    },
}

impl WallFriction {
    /// A constant Darcy factor.
    pub fn constant(factor: f64) -> Self {
        WallFriction::Constant { factor }
    }

    /// The same law with its factor multiplied.
    pub fn scaled(self, by: f64) -> Self {
        match self {
            WallFriction::Constant { factor } => WallFriction::Constant { factor: factor * by },
            WallFriction::Reynolds { viscosity_m2_s, roughness_m, scale } => {
                WallFriction::Reynolds { viscosity_m2_s, roughness_m, scale: scale * by }
            }
        }
    }

    /// Head lost per metre of pipe, signed like the flow: `f V|V| / (2 g D)`.
    pub fn slope(self, diameter_m: f64, flow_m3_s: f64) -> f64 {
        let velocity = flow_m3_s / (std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m);
        let factor = match self {
            WallFriction::Constant { factor } => factor,
            WallFriction::Reynolds { viscosity_m2_s, roughness_m, scale } => {
                let reynolds = velocity.abs() * diameter_m / viscosity_m2_s;
                if reynolds == 0.0 {
                    return 0.0;
                }
                scale * darcy_friction_factor(reynolds, roughness_m / diameter_m)
            }
        };
        factor * velocity * velocity.abs() / (2.0 * GRAVITY_M_S2 * diameter_m)
    }
}

/// Half a reach's friction as the kernel uses it, for `u = B Q`.
///
/// With `½R(u/B) = u φ(|u|)` the equation `u + ½R(u/B) = d` is solved by a series in the small ratio `φ` (friction over
/// one reach against the impedance); the terms kept leave a relative error of order `φ³`.
pub trait NodeFriction {
    /// `φ(|u|)`.
    fn phi(&self, u: f64) -> f64;
    /// `u` with `u (1 + φ(|u|)) = d`.
    fn solve(&self, d: f64) -> f64;
    /// Half a reach's loss `½R` at `u`, m.
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
    /// Expansion of `2d / (1 + √(1 + 4z))`, `z = k|d|`.
    #[inline(always)]
    fn solve(&self, d: f64) -> f64 {
        let z = self.k * d.abs();
        d * (1.0 - z * (1.0 - z * (2.0 - 5.0 * z)))
    }
}

/// A factor that follows the Reynolds number: `φ` tabulated at even steps of `|u|`, linear between, constant beyond.
#[derive(Debug, Clone)]
pub struct Tabulated {
    per_m: f64,
    phi: Vec<f64>,
}

/// Steps of a friction table.
const TABLE_STEPS: usize = 1024;

impl Tabulated {
    /// From `φ` itself and the largest `|u|` expected.
    fn new(phi_at: impl Fn(f64) -> f64, largest_u_m: f64) -> Self {
        let step = largest_u_m.max(1e-9) / TABLE_STEPS as f64;
        let mut phi: Vec<f64> = (0..=TABLE_STEPS + 1).map(|i| phi_at(i.max(1) as f64 * step)).collect();
        // Laminar friction is linear down to rest: φ is a constant there.
        phi[0] = phi_at(0.5 * step);
        Tabulated { per_m: 1.0 / step, phi }
    }
}

impl NodeFriction for Tabulated {
    #[inline(always)]
    fn phi(&self, u: f64) -> f64 {
        let x = (u.abs() * self.per_m).min(TABLE_STEPS as f64);
        let i = x as usize;
        let (low, high) = (self.phi[i], self.phi[i + 1]);
        low + (x - i as f64) * (high - low)
    }
    #[inline(always)]
    fn solve(&self, d: f64) -> f64 {
        let first = d - d * self.phi(d);
        let second = d - first * self.phi(first);
        d - second * self.phi(second)
    }
}

/// The friction of one segment's reaches.
#[derive(Debug, Clone)]
pub enum ReachFriction {
    /// See [`Quadratic`].
    Quadratic(Quadratic),
    /// See [`Tabulated`].
    Tabulated(Tabulated),
}

impl ReachFriction {
    /// From the loss over one reach, `loss_m(Q)`, and the impedance `B`; `largest_u_m` bounds the table of a law that is
    /// not `quadratic`.
    pub fn new(quadratic: bool, loss_m: impl Fn(f64) -> f64, impedance: f64, largest_u_m: f64) -> Self {
        if quadratic {
            ReachFriction::Quadratic(Quadratic { k: 0.5 * loss_m(1.0) / (impedance * impedance) })
        } else {
            ReachFriction::Tabulated(Tabulated::new(|u| 0.5 * loss_m(u / impedance) / u, largest_u_m))
        }
    }

    /// Half a reach's loss `½R` at `u`, m, and its derivative by `u`.
    pub fn half_loss_and_slope(&self, u: f64) -> (f64, f64) {
        match self {
            ReachFriction::Quadratic(q) => (q.half_loss(u), 2.0 * q.phi(u)),
            ReachFriction::Tabulated(t) => {
                let du = 0.5 / t.per_m;
                (t.half_loss(u), (t.half_loss(u + du) - t.half_loss(u - du)) / (2.0 * du))
            }
        }
    }

    /// Largest `φ` up to `u`: the share of the impedance that friction over one reach takes.
    pub fn largest_share(&self, u: f64) -> f64 {
        match self {
            ReachFriction::Quadratic(q) => q.phi(u),
            ReachFriction::Tabulated(t) => t.phi.iter().copied().fold(0.0, f64::max),
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
            assert!((friction.solve(d) - exact).abs() <= 14.0 * (1e-4 * d.abs()).powi(4) * d.abs() + 1e-14);
        }
    }

    #[test]
    fn the_table_solves_its_own_equation() {
        let law = WallFriction::Reynolds { viscosity_m2_s: 1e-6, roughness_m: 0.0, scale: 1.0 };
        let impedance = 1e5;
        let friction = Tabulated::new(|u| 0.25 * law.slope(0.02, u / impedance) / u, 60.0);
        for d in [-40.0, -3.0, 0.01, 1.0, 25.0] {
            let u = friction.solve(d);
            assert!((u + friction.half_loss(u) - d).abs() < 1e-8 * d.abs(), "{d}");
            let exact = 0.5 * law.slope(0.02, u / impedance) * 0.5;
            assert!((friction.half_loss(u) - exact).abs() < 2e-3 * exact.abs() + 1e-9, "{d}");
        }
    }

    #[test]
    fn laminar_friction_is_hagen_poiseuille() {
        let law = WallFriction::Reynolds { viscosity_m2_s: 1e-6, roughness_m: 0.0, scale: 1.0 };
        let (d, velocity): (f64, f64) = (0.02, 0.05);
        let flow = velocity * std::f64::consts::FRAC_PI_4 * d * d;
        let exact = 32.0 * 1e-6 * velocity / (GRAVITY_M_S2 * d * d);
        assert!((law.slope(d, flow) / exact - 1.0).abs() < 1e-12);
    }
}
