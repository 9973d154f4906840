//! Exact solutions of the linear problem: reservoir, uniform pipe, prescribed flow at the valve.
//!
//! The Laplace transform of the head's deviation,
//! `dH(x,s) = V0 sR/(g s γ) sinh(γx)/cosh(γL) L{-V'/V0}`, `γ² = sR s χ/a²`, `χ = 1 + F Σ J_k/(1 + s τ_k)`,
//! `F = a² ρ D/e`, `sR = s` without friction; with all that of laminar flow `s I₀(z)/I₂(z)`, `z = R √(s/ν)`
//! (Zielke 1968); with the unsteady part of turbulent flow alone `s (1 + (16ν/D²) L{W})`,
//! `L{W} = D²/(8ν)/√(sD²/4ν + B*)` (Vardy & Brown 2003), is inverted by a Fourier series on a shifted contour (Dubner &
//! Abate 1968; Crump 1976). Nothing here knows of the solver.

use nalgebra::Complex;

type C = Complex<f64>;
const G: f64 = 9.81;

/// A closure by its transform `L{-V'/V0}`.
#[derive(Clone, Copy)]
pub enum Ramp {
    /// `V = V0 (1 + cos(πt/Tc))/2`.
    Cosine(f64),
    /// `V = V0 (1 - t/Tc + sin(2πt/Tc)/2π)`.
    Cycloid(f64),
}

impl Ramp {
    pub fn transform(self, s: C) -> C {
        match self {
            Ramp::Cosine(tc) => {
                let w = std::f64::consts::PI / tc;
                (C::from(1.0) + (-s * tc).exp()) * (0.5 * w * w) / (s * s + w * w)
            }
            Ramp::Cycloid(tc) => {
                let w = std::f64::consts::TAU / tc;
                (C::from(1.0) - (-s * tc).exp()) * (s.inv() - s / (s * s + w * w)) / tc
            }
        }
    }
}

/// Friction; `viscosity` is kinematic.
#[derive(Clone, Copy)]
pub enum Shear {
    None,
    /// Steady and unsteady.
    Laminar {
        viscosity: f64,
    },
    /// Unsteady alone.
    Turbulent {
        viscosity: f64,
        reynolds: f64,
    },
}

impl Shear {
    /// `sR/s`.
    fn inertia(self, diameter: f64, s: C) -> C {
        match self {
            Shear::None => C::from(1.0),
            Shear::Laminar { viscosity } => bessel_ratio((s / viscosity).sqrt() * (0.5 * diameter)),
            Shear::Turbulent { viscosity, reynolds } => {
                let decay = reynolds.powf((15.29 / reynolds.powf(0.0567)).log10()) / 12.86;
                C::from(1.0) + (s * (diameter * diameter / (4.0 * viscosity)) + decay).sqrt().inv() * 2.0
            }
        }
    }
}

/// The linear problem, SI.
pub struct Exact {
    pub length: f64,
    pub diameter: f64,
    pub wall: f64,
    pub wave_speed: f64,
    pub density: f64,
    pub velocity: f64,
    pub ramp: Ramp,
    /// `(J, tau)`, 1/Pa and s.
    pub creep: Vec<(f64, f64)>,
    pub shear: Shear,
}

/// `I₀(z)/I₂(z)` in the right half-plane.
pub fn bessel_ratio(z: C) -> C {
    let first_by_zeroth = if z.norm() < 30.0 {
        // Gauss's continued fraction of I₁/I₀, from its far end: I_k/I_{k-1} = 1/(2k/z + I_{k+1}/I_k).
        (1..=120).rev().fold(C::from(0.0), |ratio, k| (z.inv() * (2.0 * f64::from(k)) + ratio).inv())
    } else {
        // Hankel's expansions; their terms fall as long as k < 2|z|.
        let expansion = |order: f64| {
            let mut term = C::from(1.0);
            (1..20).fold(term, |sum, k| {
                let odd = f64::from(2 * k - 1);
                term *= -(4.0 * order * order - odd * odd) / (8.0 * f64::from(k)) * z.inv();
                sum + term
            })
        };
        expansion(1.0) / expansion(0.0)
    };
    // I₂ = I₀ - (2/z) I₁
    (C::from(1.0) - z.inv() * 2.0 * first_by_zeroth).inv()
}

impl Exact {
    fn transform(&self, x: f64, s: C) -> C {
        let f = self.wave_speed.powi(2) * self.density * self.diameter / self.wall;
        let chi = self.creep.iter().map(|&(j, tau)| (C::from(1.0) + s * tau).inv() * (f * j)).sum::<C>() + 1.0;
        let inertia = self.shear.inertia(self.diameter, s);
        let gamma = s * (inertia * chi).sqrt() / self.wave_speed;
        // sinh(γx)/cosh(γL) without overflow.
        let up = (gamma * (x - self.length)).exp() * (C::from(1.0) - (gamma * (-2.0 * x)).exp());
        let down = C::from(1.0) + (gamma * (-2.0 * self.length)).exp();
        inertia / (gamma * G) * (up / down) * self.ramp.transform(s) * self.velocity
    }

    /// Deviation of the head from its steady value at `x` (m from the supply) and times `t`.
    pub fn head(&self, x: f64, times: &[f64]) -> Vec<f64> {
        invert(|s| self.transform(x, s), times)
    }
}

/// The function of time that has a Laplace transform.
pub fn invert(transform: impl Fn(C) -> C, times: &[f64]) -> Vec<f64> {
    let window = 1.5 * times.iter().copied().fold(0.0, f64::max);
    let shift = 15.0 / window;
    let terms = 60_000;
    let values: Vec<C> =
        (0..terms).map(|k| transform(C::new(shift, std::f64::consts::PI * k as f64 / window))).collect();
    times
        .iter()
        .map(|&t| {
            let turn = C::new(0.0, std::f64::consts::PI * t / window).exp();
            let (mut sum, mut phase) = (0.5 * values[0].re, C::from(1.0));
            for (k, value) in values.iter().enumerate().skip(1) {
                // Renewed now and then: a running product drifts.
                phase = if k % 512 == 0 {
                    C::new(0.0, std::f64::consts::PI * t / window * k as f64).exp()
                } else {
                    phase * turn
                };
                sum += (value * phase).re;
            }
            sum * (shift * t).exp() / window
        })
        .collect()
}
