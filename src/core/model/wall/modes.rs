//! The two pairs of waves of a pipe whose wall may move along its axis.
//!
//! They do not see each other. Their speeds `λ1` and `λ2`, and what each of them carries of the other's quantity:
//!
//! ```text
//! (c² - λ²)(ct² - λ²) = 2ν² r (D/2e) c² λ²
//! pressure waves  s = -α H, α = ν (D/2e) λ1²/(ct² - λ1²);   stress waves  H = β s, β = 2ν r/(λ2²/c² - 1)
//! ```
//!
//! The wave speed of the line's own scheme *is* `λ1`. With `h` and `q` for head and flow of the pressure waves, `S` for
//! the sum of the two stress waves and `J` for the one downstream less the one upstream,
//!
//! ```text
//! H = h + β S,   s = S - α h,   u = (α r/A) q - (g r/λ2) J,   A (V - u) = (1 - α r) q + (A g (β + r)/λ2) J
//! ```

use crate::model::error::ModelError;
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
    /// Head whose push on the pipe's section the dry friction all along this pipe just holds, m.
    pub floor_m: f64,
}

/// Both pairs of waves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Modes {
    pub(crate) alpha: f64,
    pub(crate) beta: f64,
    /// `λ2`, m/s.
    pub(crate) stress_speed_m_s: f64,
    pub(crate) density_ratio: f64,
    pub(crate) area_m2: f64,
    /// Cross-section of the water over that of the wall.
    pub(crate) thrust: f64,
}

impl Modes {
    /// Velocity of the wall per stress that a wave carries.
    pub(crate) fn per_stress(&self) -> f64 {
        GRAVITY_M_S2 * self.density_ratio / self.stress_speed_m_s
    }

    /// Velocity of the wall per flow of a pressure wave.
    pub(crate) fn per_flow(&self) -> f64 {
        self.alpha * self.density_ratio / self.area_m2
    }

    /// Share of a pressure wave's flow that goes through a moving end.
    pub(crate) fn through(&self) -> f64 {
        1.0 - self.alpha * self.density_ratio
    }

    /// Flow through a moving end per stress that a wave carries.
    pub(crate) fn flow_per_stress(&self) -> f64 {
        self.area_m2 * GRAVITY_M_S2 * (self.beta + self.density_ratio) / self.stress_speed_m_s
    }

    /// Cross-section of the wall, m².
    pub(crate) fn wall_m2(&self) -> f64 {
        self.area_m2 / self.thrust
    }
}

impl Wall {
    /// The waves where those of pressure travel at `wave_speed_m_s`.
    ///
    /// # Errors
    /// A stress wave no faster than a pressure wave.
    pub(crate) fn modes(&self, wave_speed_m_s: f64) -> Result<Modes, ModelError> {
        let Wall { poisson_ratio: nu, stress_speed_m_s: ct, density_ratio: r, wall_ratio, .. } = *self;
        let a = wave_speed_m_s;
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
            floor_m: 0.0,
        };
        let modes = wall.modes(slow).unwrap();
        assert!((slow - 1024.7).abs() < 0.1 && (modes.stress_speed_m_s - 5280.5).abs() < 0.5, "{slow} {modes:?}");
    }
}
