//! The pipe wall: how it is held, and the wave speed that its stiffness gives.

use crate::rig::material::Material;
use crate::rig::types::{Constraint, Pipe, Rig};
use crate::rig::water::WaterProperties;
use crate::units::GRAVITY_M_S2;

/// Wall counts as thick below this ratio of inner diameter to thickness (Wylie & Streeter 1993).
const THICK_WALL_RATIO: f64 = 25.0;

/// How far the search for the wave speed may go beyond what the material's modulus allows: free gas and soft joints
/// slow a wave down; an overestimated diameter or wall supports make it look faster.
const SLOWER: f64 = 0.65;
const FASTER: f64 = 1.15;

impl Rig {
    /// The constraint coefficient that the creep of the walls assumes, in a sentence; none if no wall creeps.
    pub fn constraint_in_words(&self) -> Option<String> {
        let creeps = self.pipes.iter().filter(|p| p.material().viscoelastic);
        let each: Vec<String> = creeps.map(|p| format!("{:.4} in '{}'", p.constraint_coefficient(), p.name)).collect();
        (!each.is_empty()).then(|| {
            format!(
                "J assumes c1 = {} (`constraint` in the rig file, 1 without it) and scales with 1/c1: if the pipe is held otherwise, J and modulus are wrong by \
                 as much",
                each.join(", ")
            )
        })
    }
}

impl Pipe {
    /// Cross-section, m².
    pub fn area_m2(&self) -> f64 {
        std::f64::consts::FRAC_PI_4 * self.inner_diameter_m.powi(2)
    }

    /// Reynolds number of a flow, `4Q/(π D ν)`, signed like it.
    pub fn reynolds(&self, water: &WaterProperties, flow_m3_s: f64) -> f64 {
        4.0 * flow_m3_s / (std::f64::consts::PI * self.inner_diameter_m * water.kinematic_viscosity_m2_s)
    }

    /// Its wall material. A pipe read from a file always has one of the library; HDPE stands in for any other name.
    pub fn material(&self) -> &'static Material {
        Material::by_name(&self.material).unwrap_or(&crate::rig::material::MATERIALS[0])
    }

    /// Poisson's ratio: the file's, or the material's.
    pub fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio.unwrap_or(self.material().poisson_ratio)
    }

    /// Constraint coefficient c₁ of the hoop strain, `ε = c₁ D p/(2 e E)` (Wylie & Streeter 1993).
    ///
    /// Thin wall: 1 with expansion joints, 1 − ν/2 anchored upstream only, 1 − ν² anchored throughout. Thick wall (D/e
    /// < 25): `2e/D (1 + ν) + D/(D + e) · c₁(thin)`. A coefficient given in the file is used as it stands.
    pub fn constraint_coefficient(&self) -> f64 {
        self.coefficient_if(self.constraint)
    }

    /// The same if the pipe were held differently.
    pub fn coefficient_if(&self, held: Constraint) -> f64 {
        let nu = self.poisson_ratio();
        let thin = match held {
            Constraint::Coefficient(c1) => return c1,
            Constraint::Free => 1.0,
            Constraint::AnchoredUpstream => 1.0 - nu / 2.0,
            Constraint::Anchored => 1.0 - nu * nu,
        };
        let (d, e) = (self.inner_diameter_m, self.wall_thickness_m);
        if d / e < THICK_WALL_RATIO { 2.0 * e / d * (1.0 + nu) + d / (d + e) * thin } else { thin }
    }

    /// Wave speed by Korteweg's law, m/s: `a² = (K/ρ)/(1 + c₁ K D/(E e))`, with E in Pa.
    pub fn korteweg_wave_speed_m_s(&self, water: &WaterProperties, youngs_modulus_pa: f64) -> f64 {
        let softness = self.wall_ratio() * water.bulk_modulus_pa / youngs_modulus_pa;
        water.sound_speed_m_s() / (1.0 + softness).sqrt()
    }

    /// Young's modulus that gives a wave speed, Pa: Korteweg's law solved for E. `None` at or above the speed of sound
    /// in the water, where no elastic wall gives it.
    pub fn youngs_modulus_for_wave_speed(&self, water: &WaterProperties, wave_speed_m_s: f64) -> Option<f64> {
        let softness = (water.sound_speed_m_s() / wave_speed_m_s).powi(2) - 1.0;
        (wave_speed_m_s > 0.0 && softness > 0.0).then(|| self.wall_ratio() * water.bulk_modulus_pa / softness)
    }

    /// Wave speeds that the material's range of Young's modulus allows, `[lo, hi]` m/s.
    pub fn material_wave_speeds_m_s(&self, water: &WaterProperties) -> [f64; 2] {
        self.material().youngs_modulus_range_pa.map(|e| self.korteweg_wave_speed_m_s(water, e))
    }

    /// Start and bounds of the wave speed in a calibration, `(start, lo, hi)` m/s.
    ///
    /// The start is the file's `wave_speed_m_s` or Korteweg's for the typical modulus. The bounds are those of the
    /// material widened by 35 % down and 15 % up, stretched to hold the file's value with as much room, and end at the
    /// speed of sound in the water.
    pub fn wave_speed_start(&self, water: &WaterProperties) -> (f64, f64, f64) {
        let [lo, hi] = self.material_wave_speeds_m_s(water);
        let typical = self.korteweg_wave_speed_m_s(water, self.material().youngs_modulus_pa);
        let start = self.wave_speed_m_s.unwrap_or(typical);
        let hi = (FASTER * hi.max(start)).min(water.sound_speed_m_s()).max(start);
        (start, SLOWER * lo.min(start), hi)
    }

    /// c₁ D/e.
    fn wall_ratio(&self) -> f64 {
        self.constraint_coefficient() * self.inner_diameter_m / self.wall_thickness_m
    }
}

impl Rig {
    /// Mean wave speed from the supply to the valve, length by travel time, m/s: nominal, and the least and the
    /// greatest that a fit may take (see [`Pipe::wave_speed_start`]).
    pub fn wave_speed_start(&self, water: &WaterProperties) -> (f64, f64, f64) {
        let mean = |of: fn((f64, f64, f64)) -> f64| self.mean_speed_m_s(|pipe| of(pipe.wave_speed_start(water)));
        (mean(|s| s.0), mean(|s| s.1), mean(|s| s.2))
    }

    /// The greatest mean wave speed from the supply to the valve by Korteweg's law, m/s: that of the stiffest wall of
    /// its material, or the rig file's where that is faster.
    pub fn fastest_by_law_m_s(&self, water: &WaterProperties) -> f64 {
        let speed = |pipe: &Pipe| pipe.wave_speed_m_s.unwrap_or(0.0).max(pipe.material_wave_speeds_m_s(water)[1]);
        self.mean_speed_m_s(speed)
    }

    /// How far a wave comes at the mean speed (length by travel time) in one period of the lowest oscillation between
    /// the supply, whose head stays, and the shut valve, where nothing flows: 4L in one pipe. Joints of pipes in series
    /// reflect, so that the period is another than four travel times: that at which the flow at the valve vanishes,
    /// carried from the supply through each pipe of impedance `Z = a/(gA)` and phase `θ = ωL/a` by `H + ZQ tan θ`,
    /// `Q − H/Z tan θ` (Wylie & Streeter 1993, Fluid Transients in Systems, ch. 12). Wave speeds are nominal: only
    /// their ratios count.
    pub fn cycle_m(&self, water: &WaterProperties) -> f64 {
        let of = |pipe: &Pipe| {
            let speed_m_s = pipe.wave_speed_start(water).0;
            (pipe.length_m / speed_m_s, speed_m_s / (GRAVITY_M_S2 * pipe.area_m2()))
        };
        let pipes: Vec<(f64, f64)> = self.way_pipes().map(of).collect();
        let travel_s: f64 = pipes.iter().map(|(travel_s, _)| travel_s).sum();
        // the phase is that of all pipes together
        let flow_at_valve = |phase: f64| {
            let through = |(head, flow): (f64, f64), (own_s, impedance): &(f64, f64)| {
                let (sin, cos) = (phase * own_s / travel_s).sin_cos();
                (head * cos + impedance * flow * sin, flow * cos - head / impedance * sin)
            };
            pipes.iter().fold((0.0, 1.0), through).1
        };
        let step = std::f64::consts::PI / 256.0;
        let (mut below, mut above) = (0.0, step);
        while flow_at_valve(above) > 0.0 && above < std::f64::consts::TAU {
            (below, above) = (above, above + step);
        }
        for _ in 0..40 {
            let middle = 0.5 * (below + above);
            if flow_at_valve(middle) > 0.0 { below = middle } else { above = middle }
        }
        self.length_m() * std::f64::consts::TAU / above
    }

    /// Length by travel time, m/s.
    fn mean_speed_m_s(&self, of: impl Fn(&Pipe) -> f64) -> f64 {
        self.length_m() / self.way_pipes().map(|pipe| pipe.length_m / of(pipe)).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Fluid;
    use crate::rig::Graph;
    use crate::rig::types::Tolerance;

    fn pipe(material: &str, diameter_mm: f64, wall_mm: f64, constraint: Constraint) -> Pipe {
        Pipe {
            name: "main".into(),
            length_m: 100.0,
            inner_diameter_m: diameter_mm * 1e-3,
            wall_thickness_m: wall_mm * 1e-3,
            material: material.into(),
            wave_speed_m_s: None,
            friction_factor: None,
            roughness_m: None,
            poisson_ratio: None,
            constraint,
            elevation_start_m: 0.0,
            elevation_end_m: 0.0,
            tolerance: Tolerance { length: 0.0, diameter: 0.0, wall: 0.0 },
        }
    }

    fn water(t: f64) -> WaterProperties {
        Fluid { name: "water".into(), temperature_degc: t }.properties(t)
    }

    /// Two pipes of equal travel time: at the lowest oscillation `tan² θ = Z₂/Z₁` in each. One pipe, cut in two
    /// anywhere: 4L.
    #[test]
    fn joints_change_the_period() {
        let of = |length_m, diameter_mm| Pipe {
            length_m,
            wave_speed_m_s: Some(1000.0),
            ..pipe("steel", diameter_mm, 5.0, Constraint::Anchored)
        };
        let mut rig = Rig::from_toml(include_str!("../../../rigs/imperial-pe.toml"), "rig.toml").unwrap();
        for (pipes, exact_m) in [
            (vec![of(100.0, 50.0), of(100.0, 25.0)], std::f64::consts::TAU * 100.0 / 2f64.atan()),
            (vec![of(100.0, 25.0), of(100.0, 50.0)], std::f64::consts::TAU * 100.0 / 0.5f64.atan()),
            (vec![of(30.0, 50.0), of(170.0, 50.0)], 800.0),
            (vec![of(200.0, 50.0)], 800.0),
        ] {
            (rig.graph, rig.pipes) = (Graph::in_series(pipes.len()), pipes);
            let found_m = rig.cycle_m(&water(20.0));
            assert!((found_m / exact_m - 1.0).abs() < 1e-9, "{found_m} for {exact_m}");
        }
    }

    /// Adelaide's copper pipe: 1319 m/s measured (Bergant & Simpson 1999); Adamkowski's: 1298 m/s, D 16 mm, e 1 mm.
    #[test]
    fn metal_pipes_come_out_at_their_measured_wave_speed() {
        for (d, e, measured) in [(22.1, 1.63, 1319.0), (16.0, 1.0, 1298.0)] {
            let pipe = pipe("copper", d, e, Constraint::AnchoredUpstream);
            let a = pipe.korteweg_wave_speed_m_s(&water(20.0), 120e9);
            assert!((a / measured - 1.0).abs() < 0.02, "{a} against {measured}");
        }
    }

    #[test]
    fn imperial_college_polyethylene_is_within_reach_and_near_its_modulus() {
        let pipe = pipe("PE", 50.6, 6.3, Constraint::Coefficient(1.0));
        let (_, lo, hi) = pipe.wave_speed_start(&water(20.0));
        assert!(lo < 395.0 && 395.0 < hi);
        let e = pipe.youngs_modulus_for_wave_speed(&water(20.0), 395.0).unwrap();
        assert!((e / 1.43e9 - 1.0).abs() < 0.1, "1/J0 = 1.43 GPa against {e}");
    }

    #[test]
    fn korteweg_and_its_inverse_agree_and_end_at_the_sound_speed() {
        let (pipe, water) = (pipe("HDPE", 50.0, 4.0, Constraint::Anchored), water(15.0));
        let a = pipe.korteweg_wave_speed_m_s(&water, 1.3e9);
        assert!((pipe.youngs_modulus_for_wave_speed(&water, a).unwrap() / 1.3e9 - 1.0).abs() < 1e-12);
        assert_eq!(pipe.youngs_modulus_for_wave_speed(&water, 1500.0), None);
    }

    /// Wylie & Streeter's coefficients by hand: ν 0.46, D/e 10 (thick) and 40 (thin).
    #[test]
    fn constraint_coefficients_follow_wylie_and_streeter() {
        let c1 = |e: f64, constraint| pipe("HDPE", 100.0, e, constraint).constraint_coefficient();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} against {b}");
        near(c1(2.5, Constraint::Free), 1.0);
        near(c1(2.5, Constraint::AnchoredUpstream), 0.77);
        near(c1(2.5, Constraint::Anchored), 1.0 - 0.2116);
        near(c1(10.0, Constraint::Free), 0.292 + 1.0 / 1.1);
        near(c1(10.0, Constraint::AnchoredUpstream), 0.292 + 0.77 / 1.1);
        near(c1(10.0, Constraint::Anchored), 0.292 + 0.7884 / 1.1);
        near(c1(10.0, Constraint::Coefficient(0.8)), 0.8);
    }

    #[test]
    fn a_wave_speed_of_the_file_is_the_start_and_within_bounds() {
        let mut pipe = pipe("PPR", 14.0, 3.0, Constraint::Coefficient(1.0));
        for given in [120.0, 470.0, 1590.0] {
            pipe.wave_speed_m_s = Some(given);
            let (start, lo, hi) = pipe.wave_speed_start(&water(24.0));
            assert_eq!(start, given);
            assert!(lo < given && given <= hi, "{lo} {given} {hi}");
        }
    }
}
