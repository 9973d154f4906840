//! The velocity over a pipe's cross-section, in rings, and what the wall takes of it: the radial half of the quasi-2D
//! equations (Vardy & Hwang 1991, J. Hydraul. Res. 29:669-684; Pezzinga 1999, J. Hydraul. Eng. 125:676-685; Zhao &
//! Ghidaoui 2003, J. Hydraul. Eng. 129:1007-1013).
//!
//! The head is the same over a cross-section, so the rings share its slope: `∂v/∂t = -g ∂H/∂x + 1/r ∂/∂r(r ν ∂v/∂r)`,
//! `v = 0` at the wall. Time is in units of the diffusion time, `θ = νt/R²`, the radius in units of `R`. With ring areas
//! `M` and the resistances `K` between rings, `M v' = G M1 - K v`; the slope `G` is the one that makes the rings' mean
//! the mean velocity `V` of the characteristics.
//!
//! With a viscosity that is frozen, `K` is the same at all nodes and times. Of `v = V s + z`, `s` the steady profile of
//! mean 1, the part `z` without mean then falls into the eigenvectors of `K` between the profiles of mean 0:
//! `a' = -σ a + V' f/σ`, where `f` is the wall shear of an eigenvector. So the rings need no solution of equations at
//! each node and step, and no error in time beyond that of `V`, which is linear within a step. The wall shear is that of
//! the steady profile and `Σ f a`: a convolution with the weights `f²/(4σ)`, which for laminar flow are Zielke's, one
//! for each zero of J₂, as far as the rings resolve them.

use nalgebra::{DMatrix, SymmetricEigen};

use crate::model::eddy_viscosity::EddyViscosity;
use crate::model::rings::{CORE, cells};
use crate::model::unsteady_kernels::mean_of_decay;

/// Thickness of the ring at the wall, in units of the depth `√Δθ` to which a step's shear reaches, and of the distance
/// over which the viscosity begins to rise.
const WALL: f64 = 0.15;
/// Least thickness of the ring at the wall: beyond, rounding is no smaller than what is gained.
const THINNEST: f64 = 1e-6;

/// A profile that decays as a whole.
#[derive(Debug, Clone, PartialEq)]
struct Mode {
    /// `σ`: it falls as `exp(-σθ)`.
    rate: f64,
    /// `f`: wall shear of it.
    shear: f64,
    /// Its velocity in each ring.
    shape: Vec<f64>,
}

/// The rings of a cross-section and how their profile moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Middle of each ring, a part of the radius, from the axis to the wall.
    radii: Vec<f64>,
    /// Velocity in each ring in steady flow of mean 1.
    steady: Vec<f64>,
    /// Wall shear of that flow.
    steady_shear: f64,
    modes: Vec<Mode>,
}

impl Profile {
    /// For steps of `step = ν Δt/R²`.
    pub fn new(viscosity: EddyViscosity, step: f64) -> Profile {
        let wall = (WALL * step.sqrt()).min(viscosity.finest()).clamp(THINNEST, CORE);
        Profile::in_rings(|distance| viscosity.total(distance), &cells(wall, 1.0))
    }

    /// With rings between these distances from the wall and any viscosity over that distance.
    fn in_rings(viscosity: impl Fn(f64) -> f64, distances: &[f64]) -> Profile {
        let edges: Vec<f64> = distances.iter().rev().map(|y| 1.0 - y).collect();
        let rings = edges.len() - 1;
        let areas: Vec<f64> = edges.windows(2).map(|e| e[1] * e[1] - e[0] * e[0]).collect();
        let radii: Vec<f64> = edges.windows(2).map(|e| 0.5 * (e[0] + e[1])).collect();
        // Between the middles of two rings the flux grows as in steady flow, with the square of the radius: from that at
        // their edge `ρ₁` it takes ½ ∫ ρ dρ/(n ρ₁²), here by Gauss's two points on either side of the edge.
        let resistance = |edge: f64, middle: f64| {
            let (centre, half) = (0.5 * (edge + middle), 0.5 * (edge - middle));
            let at = |r: f64| half.abs() * r / (2.0 * edge * edge * viscosity(1.0 - r));
            at(centre - half / 3f64.sqrt()) + at(centre + half / 3f64.sqrt())
        };
        let conductance: Vec<f64> = (0..rings)
            .map(|j| {
                let beyond = radii.get(j + 1).map_or(0.0, |&next| resistance(edges[j + 1], next));
                1.0 / (resistance(edges[j + 1], radii[j]) + beyond)
            })
            .collect();
        // M^-½ K M^-½, and its image of e = M^½ 1: the wall alone takes from a plug.
        let root: Vec<f64> = areas.iter().map(|a| a.sqrt()).collect();
        let mut matrix = DMatrix::zeros(rings, rings);
        for (j, &c) in conductance.iter().enumerate() {
            matrix[(j, j)] += c / areas[j];
            if j + 1 < rings {
                matrix[(j + 1, j + 1)] += c / areas[j + 1];
                matrix[(j, j + 1)] = -c / (root[j] * root[j + 1]);
                matrix[(j + 1, j)] = matrix[(j, j + 1)];
            }
        }
        let wall_of_plug = conductance[rings - 1];
        let image = wall_of_plug / root[rings - 1];
        // Between the profiles without a mean: (1 - e eᵀ) A (1 - e eᵀ).
        for (j, &r) in root.iter().enumerate() {
            matrix[(j, rings - 1)] -= r * image;
            matrix[(rings - 1, j)] -= r * image;
        }
        for j in 0..rings {
            for k in 0..rings {
                matrix[(j, k)] += wall_of_plug * root[j] * root[k];
            }
        }
        let eigen = SymmetricEigen::new(matrix);
        let (steady, steady_shear) = steady(&areas, &conductance);
        // The shear of an eigenvector from what the steady profile has of it, -σ sᵀMz: the wall's own ring, a small
        // number times a large one, would round it off.
        let part = |k: usize| (0..rings).map(|j| steady[j] * root[j] * eigen.eigenvectors[(j, k)]).sum::<f64>();
        let mut modes: Vec<Mode> = (0..rings)
            .map(|k| Mode {
                rate: eigen.eigenvalues[k],
                shear: -eigen.eigenvalues[k] * part(k),
                shape: (0..rings).map(|j| eigen.eigenvectors[(j, k)] / root[j]).collect(),
            })
            .collect();
        modes.sort_by(|a, b| a.rate.total_cmp(&b.rate));
        // The plug itself, whose rate is 0 to rounding.
        modes.remove(0);
        Profile { radii, steady, steady_shear, modes }
    }

    /// The weighting function `W = Σ m exp(-σθ)` of the unsteady wall shear `4 ∫ W V' dθ`: `(σ, m)`, the slowest first.
    pub fn weights(&self) -> impl Iterator<Item = (f64, f64)> {
        self.modes.iter().map(|mode| (mode.rate, mode.shear * mode.shear / (4.0 * mode.rate)))
    }

    /// Middle of each ring, a part of the radius, from the axis to the wall.
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// Wall shear of the steady flow of mean 1, `2 R τ/(ρ ν V)`: 8 if laminar.
    pub fn steady_shear(&self) -> f64 {
        self.steady_shear
    }

    /// The profile of a flow that has been steady at a mean velocity, m/s.
    pub fn at_rest(&self, mean_m_s: f64) -> Moving<'_> {
        Moving { profile: self, mean_m_s, amplitudes: vec![0.0; self.modes.len()] }
    }
}

/// Profile and wall shear of the steady flow of mean 1, from the flux that each ring passes on.
fn steady(areas: &[f64], conductance: &[f64]) -> (Vec<f64>, f64) {
    let mut within: f64 = areas.iter().sum();
    let whole = within;
    let mut velocity = vec![0.0; areas.len()];
    let mut inside = 0.0;
    for j in (0..areas.len()).rev() {
        inside += within / conductance[j];
        velocity[j] = inside;
        within -= areas[j];
    }
    let mean: f64 = velocity.iter().zip(areas).map(|(v, a)| v * a).sum::<f64>() / whole;
    velocity.iter_mut().for_each(|v| *v /= mean);
    (velocity, whole / mean)
}

/// A profile in time.
#[derive(Debug, Clone)]
pub struct Moving<'a> {
    profile: &'a Profile,
    mean_m_s: f64,
    amplitudes: Vec<f64>,
}

impl Moving<'_> {
    /// Goes on by `step = ν Δt/R²` to a new mean velocity, linear in between.
    pub fn advance(&mut self, step: f64, mean_m_s: f64) {
        let by = mean_m_s - self.mean_m_s;
        for (a, mode) in self.amplitudes.iter_mut().zip(&self.profile.modes) {
            let r = mode.rate * step;
            *a = *a * (-r).exp() + by * mean_of_decay(r) * mode.shear / mode.rate;
        }
        self.mean_m_s = mean_m_s;
    }

    /// Velocity in each ring, m/s.
    pub fn velocity_m_s(&self) -> Vec<f64> {
        let mut velocity: Vec<f64> = self.profile.steady.iter().map(|s| s * self.mean_m_s).collect();
        for (a, mode) in self.amplitudes.iter().zip(&self.profile.modes) {
            velocity.iter_mut().zip(&mode.shape).for_each(|(v, shape)| *v += a * shape);
        }
        velocity
    }

    /// Wall shear beyond that of the steady profile of this mean, `2 R τ/(ρ ν)`, m/s.
    pub fn unsteady_shear_m_s(&self) -> f64 {
        self.amplitudes.iter().zip(&self.profile.modes).map(|(a, mode)| a * mode.shear).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::unsteady_kernels::{Kernel, Steps};
    use crate::rig::{Regime, turbulent_friction_factor};

    /// Zeros of J₀: one by one from tables (Abramowitz & Stegun 9.5), then McMahon's expansion (ibid. 9.5.12).
    fn zero_of_j0(i: usize) -> f64 {
        const FIRST: [f64; 3] = [2.404_825_557_7, 5.520_078_110_3, 8.653_727_912_9];
        FIRST.get(i - 1).copied().unwrap_or_else(|| {
            let b = (i as f64 - 0.25) * std::f64::consts::PI;
            let e = 8.0 * b;
            b + 1.0 / e - 124.0 / (3.0 * e.powi(3)) + 120_928.0 / (15.0 * e.powi(5))
        })
    }

    /// `J_n` by its series, for arguments up to 25.
    fn bessel(n: u32, x: f64) -> f64 {
        let mut term = (1..=n).fold(1.0, |product, k| product * 0.5 * x / f64::from(k));
        let mut sum = term;
        for k in 1..80 {
            term *= -0.25 * x * x / (f64::from(k) * f64::from(k + n));
            sum += term;
        }
        sum
    }

    /// Flow that a constant slope starts from rest (Szymanski 1932, J. Math. Pures Appl. 11:67-107), of final mean 1:
    /// mean, wall shear and velocity at a part of the radius.
    fn started(theta: f64, zeros: usize) -> (f64, f64, impl Fn(f64) -> f64) {
        let decayed = move |power: i32| -> f64 {
            let zeros = (1..=zeros).map(zero_of_j0).take_while(|z| z * z * theta < 40.0);
            zeros.map(|z| (-z * z * theta).exp() / z.powi(power)).sum()
        };
        let at = move |r: f64| {
            let of = |z: f64| bessel(0, z * r) / (z.powi(3) * bessel(1, z)) * (-z * z * theta).exp();
            2.0 * (1.0 - r * r) - 16.0 * (1..=7).map(zero_of_j0).map(of).sum::<f64>()
        };
        (1.0 - 32.0 * decayed(4), 8.0 * (1.0 - 4.0 * decayed(2)), at)
    }

    /// Largest errors of wall shear after θ = 0.03 and of ten profiles, `steps` steps up to θ = 0.4, and of the steady
    /// profile's shear.
    fn errors(steps: usize, finer: f64) -> [f64; 3] {
        let step = 0.4 / steps as f64;
        let profile = Profile::in_rings(|_| 1.0, &cells(5e-3, finer));
        let mut moving = profile.at_rest(0.0);
        let (mut of_shear, mut of_velocity): (f64, f64) = (0.0, 0.0);
        for i in 1..=steps {
            let theta = i as f64 * step;
            let (mean, shear, at) = started(theta, 2000);
            moving.advance(step, mean);
            if theta >= 0.03 {
                let own = profile.steady_shear() * mean + moving.unsteady_shear_m_s();
                of_shear = of_shear.max((own - shear).abs());
            }
            if i % (steps / 10) == 0 {
                let off = moving.velocity_m_s().into_iter().zip(profile.radii()).map(|(v, &r)| (v - at(r)).abs());
                of_velocity = off.fold(of_velocity, f64::max);
            }
        }
        [of_shear, of_velocity, (profile.steady_shear() - 8.0).abs()]
    }

    #[test]
    fn a_started_laminar_flow_is_szymanskis_with_order_two_in_rings() {
        let by_ring = [1.0, 2.0, 4.0].map(|finer| errors(10_000, finer));
        println!("wall shear, profile, steady shear off with rings 1, 2, 4 times as fine: {by_ring:?}");
        for pair in by_ring.windows(2) {
            let orders: Vec<f64> = pair[0].iter().zip(&pair[1]).map(|(coarse, fine)| (coarse / fine).log2()).collect();
            assert!(orders.iter().all(|&o| o > 1.9), "orders {orders:?}");
        }
        assert!(by_ring[0][0] < 0.08 && by_ring[0][1] < 0.01, "{by_ring:?}");
        // The mean velocity is linear within a step: a second order.
        let by_step = [40, 80, 160].map(|steps| errors(steps, 4.0)[0]);
        println!("wall shear off with 40, 80, 160 steps: {by_step:?}");
        assert!(by_step.windows(2).all(|w| (w[0] / w[1]).log2() > 1.4), "{by_step:?}");
    }

    /// Against Zielke's function: the means over steps are what enters the solver.
    #[test]
    fn laminar_weights_are_zielkes() {
        for step in [1e-3, 1e-5, 1e-7, 1e-9] {
            let zielke = Kernel::of(1000.0, Regime::Laminar).steps(step);
            let own = Steps::of(Profile::new(EddyViscosity::LAMINAR, step).weights(), step);
            let after = |steps: &Steps, whole: i32| -> f64 {
                steps.remembered.iter().map(|term| term.mean * term.decay.powi(whole)).sum()
            };
            let first = own.first_mean() / zielke.first_mean() - 1.0;
            // As long as anything is left.
            let whole = [3, 10, 100, 1000, 10_000].into_iter().filter(|&n| f64::from(n) * step < 0.2);
            let later: Vec<f64> = whole.map(|n| after(&own, n) / after(&zielke, n) - 1.0).collect();
            let (rate, weight) = Profile::new(EddyViscosity::LAMINAR, step).weights().next().unwrap();
            println!(
                "step {step:e}: {} terms, first mean {first:+.1e}, later {later:?}, slowest {rate:.3} {weight:.4}",
                own.remembered.len()
            );
            assert!(first.abs() < 0.02 && later.iter().all(|off| off.abs() < 0.01), "{step:e}: {first} {later:?}");
            assert!((rate / 26.3746 - 1.0).abs() < 5e-3 && (weight - 1.0).abs() < 0.01, "{rate} {weight}");
        }
    }

    /// `R⁺` of a smooth pipe, by Colebrook.
    fn smooth(reynolds: f64) -> EddyViscosity {
        let slope = turbulent_friction_factor(reynolds, 0.0) / (2.0 * 9.81);
        // A pipe of 1 m in which the velocity is 1 m/s.
        EddyViscosity::of_flow(reynolds, slope, 1.0, 1.0 / reynolds)
    }

    /// The steady profile loses what Darcy and Weisbach say: the wall is shifted until it does.
    #[test]
    fn the_steady_profile_has_the_given_friction() {
        for reynolds in [1e4_f64, 1e5, 1e6] {
            let profile = Profile::new(smooth(reynolds), 1e-6);
            // 2 R τ/(ρνV) = f Re/8.
            let exact = turbulent_friction_factor(reynolds, 0.0) * reynolds / 8.0;
            let off = profile.steady_shear() / exact - 1.0;
            println!("Re {reynolds:e}: the rings' friction is {:+.2}% off, {:?}", 100.0 * off, smooth(reynolds));
            assert!(off.abs() < 0.01, "{reynolds}: {off}");
        }
    }

    /// Vardy and Brown (2003) let the viscosity rise linearly from the wall, so steeply that the steady flow has its
    /// friction. From that their weighting function follows. Behind the five regions' viscous sublayer there is less.
    #[test]
    fn a_linear_rise_has_vardy_and_browns_weights_and_a_sublayer_less() {
        for (reynolds, slope) in [(5e3_f64, 0.098), (1e4, 0.132), (1e5, 0.211), (1e6, 0.256)] {
            let shear = reynolds.powf((15.29 / reynolds.powf(0.0567)).log10()) / 12.86;
            let theirs = |theta: f64| (-shear * theta).exp() / (2.0 * (std::f64::consts::PI * theta).sqrt());
            let five = smooth(reynolds);
            let rings = cells((1.5e-3 / shear.sqrt()).min(0.3 * five.finest()), 2.0);
            let rising = Profile::in_rings(|y| 1.0 + slope / five.finest() * y, &rings);
            let friction = rising.steady_shear() / (turbulent_friction_factor(reynolds, 0.0) * reynolds / 8.0);
            assert!((friction - 1.0).abs() < 0.01, "{reynolds}: the linear rise has {friction} of the friction");
            let compared = [rising, Profile::in_rings(|y| five.total(y), &rings)].map(|profile| {
                let at = |theta: f64| profile.weights().map(|(n, m)| m * (-n * theta).exp()).sum::<f64>();
                // ∫ W dθ: theirs is ½ B*^-½.
                let whole = profile.weights().map(|(n, m)| m / n).sum::<f64>() * 2.0 * shear.sqrt();
                (whole, [1e-3, 1e-2, 0.1, 1.0].map(|x| at(x / shear) / theirs(x / shear)))
            });
            println!(
                "Re {reynolds:e}: integral and W at B*θ = 0.001, 0.01, 0.1, 1 over theirs, linear rise, five regions: {compared:.2?}"
            );
            let [(linear, _), (sublayer, _)] = compared;
            assert!((linear - 1.0).abs() < 0.2 && (0.5..0.8).contains(&sublayer), "{reynolds}: {compared:?}");
        }
    }

    /// The rings marched directly, by implicit Euler steps with the slope as multiplier: another grid, no eigenvectors.
    #[test]
    fn eigenvectors_move_as_the_rings_equations_say() {
        let viscosity = smooth(1e4);
        let (steps, theta) = (4000, 2e-3);
        let edges: Vec<f64> = cells(2e-3, 3.0).iter().rev().map(|y| 1.0 - y).collect();
        let n = edges.len() - 1;
        let middle: Vec<f64> = edges.windows(2).map(|e| 0.5 * (e[0] + e[1])).collect();
        let area: Vec<f64> = edges.windows(2).map(|e| e[1] * e[1] - e[0] * e[0]).collect();
        let passes: Vec<f64> = (0..n)
            .map(|j| {
                let next = middle.get(j + 1).copied().unwrap_or(1.0);
                let flux = |x: f64| (next - middle[j]) / 64.0 / (x * viscosity.total(1.0 - x));
                2.0 / (0..64).map(|i| flux(middle[j] + (next - middle[j]) * (i as f64 + 0.5) / 64.0)).sum::<f64>()
            })
            .collect();
        let dt = theta / f64::from(steps);
        // Solves (M/dt + K) x = b.
        let solve = |b: &[f64]| {
            let low = |j: usize| if j == 0 { 0.0 } else { -passes[j - 1] };
            let diagonal = |j: usize| area[j] / dt + passes[j] - low(j);
            let (mut c, mut d) = (vec![0.0; n], vec![0.0; n]);
            for j in 0..n {
                let (c0, d0) = if j == 0 { (0.0, 0.0) } else { (c[j - 1], d[j - 1]) };
                let by = diagonal(j) - low(j) * c0;
                c[j] = -passes[j] / by;
                d[j] = (b[j] - low(j) * d0) / by;
            }
            for j in (0..n - 1).rev() {
                d[j] -= c[j] * d[j + 1];
            }
            d
        };
        let mean = |v: &[f64]| v.iter().zip(&area).map(|(v, a)| v * a).sum::<f64>();
        let of_slope = solve(&area);
        let mut v = steady(&area, &passes).0;
        let wall = |v: &[f64]| passes[n - 1] * v[n - 1];
        let before = wall(&v);
        let profile = Profile::in_rings(|y| viscosity.total(y), &cells(4e-4, 2.0));
        let mut moving = profile.at_rest(1.0);
        for i in 1..=steps {
            // The flow is stopped over the first quarter.
            let target = (1.0 - 4.0 * f64::from(i) / f64::from(steps)).max(0.0);
            moving.advance(dt, target);
            let kept: Vec<f64> = v.iter().zip(&area).map(|(v, a)| v * a / dt).collect();
            let free = solve(&kept);
            let slope = (target - mean(&free)) / mean(&of_slope);
            v = free.iter().zip(&of_slope).map(|(free, by)| free + slope * by).collect();
            if i % 500 == 0 {
                let (own, marched) = (profile.steady_shear() * target + moving.unsteady_shear_m_s(), wall(&v));
                assert!((own - marched).abs() < 5e-3 * before, "step {i}: {own} {marched}, steady {before}");
            }
        }
        // Back flow near the wall, forward flow in the core.
        let at_end = moving.velocity_m_s();
        assert!(at_end[0] > 0.05 && at_end.iter().any(|&v| v < -0.05), "{at_end:?}");
    }
}
