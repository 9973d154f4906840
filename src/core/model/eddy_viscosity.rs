//! Viscosity of a turbulent pipe flow over the distance from its wall: the five regions of Kita, Adachi & Hirose (1980,
//! Bull. JSME 23:656-664), which Vardy & Hwang (1991, J. Hydraul. Res. 29:669-684) took to water hammer.
//!
//! In wall units, `y⁺ = y u*/ν` and `R⁺ = R u*/ν` with the shear velocity `u*`, the whole viscosity over that of the
//! water is
//!
//! ```text
//! 1                         y⁺ ≤ 1/C_B                    at the wall
//! C_B y⁺                    y⁺ ≤ C_B/C_m                  buffer
//! C_m y⁺²                   y⁺ ≤ κ/(C_m + κ²/(4 C_c R⁺))  buffer
//! κ y⁺ (1 - κ y⁺/(4 C_c R⁺))  y⁺ ≤ 2 C_c R⁺/κ             logarithmic
//! C_c R⁺                    beyond                        core
//! ```
//!
//! A wall that is rough, or a factor of friction that is given, shifts it: `y⁺ + Δ` stands for `y⁺` (Rotta 1962, Prog.
//! Aeronaut. Sci. 2:1-219), and `Δ` is the one with which the steady profile carries the rig's flow at the rig's
//! friction. It is frozen: in a transient the turbulence stays that of the flow before the closure, which holds as long
//! as waves are fast against its growth and decay (Ghidaoui, Mansour & Zhao 2002, J. Hydraul. Eng. 128:917-924).

use crate::model::rings::cells;
use crate::units::GRAVITY_M_S2;

const KAPPA: f64 = 0.41;
const C_B: f64 = 0.19;
const C_M: f64 = 0.011;
const C_C: f64 = 0.077;

/// Halvings of the interval in which the shift lies: to rounding.
const HALVINGS: usize = 60;

/// Whole viscosity over that of the water.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EddyViscosity {
    /// `R⁺`; 0 where the flow is laminar.
    radius_plus: f64,
    /// `Δ`, in wall units.
    shift_plus: f64,
}

impl EddyViscosity {
    /// Laminar flow: none.
    pub const LAMINAR: EddyViscosity = EddyViscosity { radius_plus: 0.0, shift_plus: 0.0 };

    /// Of a smooth pipe with radius `R⁺ = R u*/ν`.
    pub fn smooth(radius_plus: f64) -> EddyViscosity {
        EddyViscosity { radius_plus, shift_plus: 0.0 }
    }

    /// Of a turbulent flow of this Reynolds number `V D/ν` that loses so much head per metre. Where no shift gives that
    /// flow, because it loses less than a laminar one, it is laminar.
    pub fn of_flow(reynolds: f64, slope: f64, diameter_m: f64, viscosity_m2_s: f64) -> EddyViscosity {
        // u*² = g D/4 times the slope.
        let shear_m_s = (0.25 * GRAVITY_M_S2 * diameter_m * slope).sqrt();
        EddyViscosity::carrying(0.5 * diameter_m * shear_m_s / viscosity_m2_s, reynolds)
    }

    /// Of a pipe with radius `R⁺ = R u*/ν` whose steady flow has this Reynolds number.
    fn carrying(radius_plus: f64, reynolds: f64) -> EddyViscosity {
        let (mut low, mut high) = (-radius_plus, radius_plus);
        let cells = cells(EddyViscosity::smooth(radius_plus).finest(), FINE);
        for _ in 0..HALVINGS {
            let shift_plus = 0.5 * (low + high);
            let flows_more = EddyViscosity { radius_plus, shift_plus }.reynolds_over(&cells) > reynolds;
            *(if flows_more { &mut low } else { &mut high }) = shift_plus;
        }
        EddyViscosity { radius_plus, shift_plus: high }
    }

    /// Whole viscosity at a distance from the wall, a part of the radius, over that of the water.
    pub fn total(&self, distance: f64) -> f64 {
        let r = self.radius_plus;
        let y = distance * r + self.shift_plus;
        let whole = if y <= C_B / C_M {
            C_B * y
        } else if y <= KAPPA / (C_M + KAPPA * KAPPA / (4.0 * C_C * r)) {
            C_M * y * y
        } else if y <= 2.0 * C_C * r / KAPPA {
            KAPPA * y * (1.0 - KAPPA * y / (4.0 * C_C * r))
        } else {
            C_C * r
        };
        whole.max(1.0)
    }

    /// Reynolds number of the steady flow: `2 R⁺² ∫ ρ³/n dρ`, from the shear `ρ u*²` at the part `ρ` of the radius.
    pub fn reynolds(&self) -> f64 {
        self.reynolds_over(&cells(self.finest(), FINE))
    }

    /// The same, integrated over these cells.
    fn reynolds_over(&self, cells: &[f64]) -> f64 {
        let over = |[from, to]: [f64; 2]| {
            let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
            let at = |x: f64| (1.0 - middle - half * x).powi(3) / self.total(middle + half * x);
            let x = 0.6f64.sqrt();
            half * (5.0 * at(-x) + 8.0 * at(0.0) + 5.0 * at(x)) / 9.0
        };
        let integral: f64 = cells.windows(2).map(|y| over([y[0], y[1]])).sum();
        2.0 * self.radius_plus * self.radius_plus * integral
    }

    /// Thickness over which it changes at the wall, a part of the radius: one wall unit.
    pub(crate) fn finest(&self) -> f64 {
        1.0 / self.radius_plus.max(1.0)
    }
}

/// Cells of the integral are so many times finer than those of a profile.
const FINE: f64 = 4.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::turbulent_friction_factor;

    /// `R⁺` of a Darcy factor: `u* = V √(f/8)`.
    fn radius_plus(reynolds: f64, factor: f64) -> f64 {
        0.5 * reynolds * (factor / 8.0).sqrt()
    }

    #[test]
    fn regions_meet_and_a_shift_carries_the_flow_asked_for() {
        for reynolds in [4e3, 1e4, 1e5, 1e6, 1e7] {
            let smooth = EddyViscosity::smooth(radius_plus(reynolds, turbulent_friction_factor(reynolds, 0.0)));
            let steps: Vec<f64> = (0..=20_000).map(|i| smooth.total(f64::from(i) / 2e4)).collect();
            let r = smooth.radius_plus;
            assert!(steps.windows(2).all(|w| (w[1] - w[0]).abs() <= 1e-9 + 1.2 * r / 2e4), "{reynolds}");
            assert_eq!(steps[0], 1.0);
            for factor in [0.9, 1.0, 1.3, 2.0] {
                let r = radius_plus(reynolds, factor * turbulent_friction_factor(reynolds, 0.0));
                let found = EddyViscosity::carrying(r, reynolds);
                assert!((found.reynolds() / reynolds - 1.0).abs() < 1e-9, "{reynolds} {factor} {found:?}");
            }
        }
    }

    #[test]
    fn the_smooth_wall_takes_what_colebrook_says() {
        for (reynolds, most) in [(1e4, 0.1), (1e5, 0.01), (1e6, 0.01), (1e7, 0.01)] {
            // The shear velocity at which the five regions carry the flow.
            let (mut low, mut high) = (1.0, reynolds);
            for _ in 0..80 {
                let r: f64 = 0.5 * (low + high);
                *(if EddyViscosity::smooth(r).reynolds() > reynolds { &mut high } else { &mut low }) = r;
            }
            let factor = 8.0 * (2.0 * low / reynolds).powi(2);
            let off = factor / turbulent_friction_factor(reynolds, 0.0) - 1.0;
            println!("Re {reynolds:e}: f {factor:.5}, {:+.2}% off Colebrook's", 100.0 * off);
            assert!(off.abs() < most, "{reynolds}: {off}");
        }
    }

    #[test]
    fn less_than_laminar_friction_is_laminar() {
        let flow = EddyViscosity::carrying(radius_plus(1e4, 0.5 * 64.0 / 1e4), 1e4);
        assert!((0..100).all(|i| flow.total(0.01 * f64::from(i)) == 1.0));
    }
}
