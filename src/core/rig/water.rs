//! Properties of liquid water at about 1 atm, 0–100 °C, each from a published correlation.
//!
//! | property | correlation | stated accuracy |
//! | --- | --- | --- |
//! | density | Kell (1975, J. Chem. Eng. Data 20, 97) | 0.01 kg/m³ up to 100 °C |
//! | viscosity | IAPWS 2008 at 0.1 MPa: Huber et al. (2009, J. Phys. Chem. Ref. Data 38, 101), eq. 15 | 1 % |
//! | sound speed | Bilaniuk & Wong (1993, J. Acoust. Soc. Am. 93, 1609; corrected 1996), ITS-90 | 0.05 m/s |
//! | vapour pressure | IAPWS-IF97, region 4 (Wagner et al. 2000) | 0.03 % |
//!
//! The bulk modulus is the isentropic one, ρ·(sound speed)²: a water hammer is over before heat flows.

use crate::rig::types::Fluid;

/// Properties of the liquid at one temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaterProperties {
    /// Density, kg/m³.
    pub density_kg_m3: f64,
    /// Kinematic viscosity, m²/s.
    pub kinematic_viscosity_m2_s: f64,
    /// Isentropic bulk modulus, Pa.
    pub bulk_modulus_pa: f64,
    /// Absolute vapour pressure, Pa.
    pub vapour_pressure_pa: f64,
}

impl WaterProperties {
    /// Speed of sound in the unbounded liquid, m/s: no wave in a pipe is faster.
    pub fn sound_speed_m_s(&self) -> f64 {
        (self.bulk_modulus_pa / self.density_kg_m3).sqrt()
    }
}

impl Fluid {
    /// Properties at a temperature in °C. The correlations hold from 0 to 100 °C; temperatures beyond get the values of
    /// the nearer end.
    pub fn properties(&self, temperature_degc: f64) -> WaterProperties {
        let t = temperature_degc.clamp(0.0, 100.0);
        let density_kg_m3 = density(t);
        WaterProperties {
            density_kg_m3,
            kinematic_viscosity_m2_s: dynamic_viscosity(t) / density_kg_m3,
            bulk_modulus_pa: density_kg_m3 * sound_speed(t).powi(2),
            vapour_pressure_pa: vapour_pressure(t),
        }
    }
}

/// The polynomial Σ cᵢ xⁱ.
fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// kg/m³ at t °C.
fn density(t: f64) -> f64 {
    const KELL: [f64; 6] = [999.839_52, 16.945_176, -7.987_040_1e-3, -46.170_461e-6, 105.563_02e-9, -280.542_53e-12];
    polynomial(&KELL, t) / (1.0 + 16.879_850e-3 * t)
}

/// Pa·s at t °C.
fn dynamic_viscosity(t: f64) -> f64 {
    const HUBER: [(f64, f64); 4] = [(280.68, -1.9), (511.45, -7.7), (61.131, -19.6), (0.459_03, -40.0)];
    let reduced = (t + 273.15) / 300.0;
    HUBER.iter().map(|(a, b)| a * reduced.powf(*b)).sum::<f64>() * 1e-6
}

/// m/s at t °C.
fn sound_speed(t: f64) -> f64 {
    const BILANIUK_WONG: [f64; 6] =
        [1.402_387_44e3, 5.038_361_71, -5.811_729_16e-2, 3.346_381_17e-4, -1.482_596_72e-6, 3.165_850_20e-9];
    polynomial(&BILANIUK_WONG, t)
}

/// Pa at t °C.
fn vapour_pressure(t: f64) -> f64 {
    const N: [f64; 10] = [
        0.116_705_214_527_67e4,
        -0.724_213_167_032_06e6,
        -0.170_738_469_400_92e2,
        0.120_208_247_024_70e5,
        -0.323_255_503_223_33e7,
        0.149_151_086_135_30e2,
        -0.482_326_573_615_91e4,
        0.405_113_405_420_57e6,
        -0.238_555_575_678_49,
        0.650_175_348_447_98e3,
    ];
    let kelvin = t + 273.15;
    let theta = kelvin + N[8] / (kelvin - N[9]);
    let a = theta * theta + N[0] * theta + N[1];
    let b = N[2] * theta * theta + N[3] * theta + N[4];
    let c = N[5] * theta * theta + N[6] * theta + N[7];
    1e6 * (2.0 * c / (-b + (b * b - 4.0 * a * c).sqrt())).powi(4)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(property: fn(f64) -> f64, table: &[(f64, f64)], tolerance: f64) {
        for &(t, published) in table {
            let value = property(t);
            assert!((value - published).abs() <= tolerance * published, "{t} degC: {value} against {published}");
        }
    }

    /// CRC Handbook / IAPWS-95 at 101.325 kPa.
    #[test]
    fn density_agrees_with_tables() {
        let table = [
            (0.0, 999.843),
            (4.0, 999.975),
            (20.0, 998.207),
            (25.0, 997.047),
            (40.0, 992.216),
            (60.0, 983.20),
            (80.0, 971.79),
            (100.0, 958.37),
        ];
        check(density, &table, 2e-5);
    }

    /// ISO/TR 3666: 1.0016 mPa·s at 20 °C; the others from IAPWS 2008 at 0.1 MPa.
    #[test]
    fn viscosity_agrees_with_tables() {
        let table = [
            (0.0, 1.792e-3),
            (20.0, 1.0016e-3),
            (25.0, 0.8900e-3),
            (40.0, 0.6527e-3),
            (60.0, 0.4660e-3),
            (80.0, 0.3540e-3),
            (100.0, 0.2816e-3),
        ];
        check(dynamic_viscosity, &table, 2e-3);
    }

    /// Del Grosso & Mader (1972) and NIST: 1402.39 at 0, 1482.34 at 20, 1496.70 at 25, maximum 1555.1 near 74 °C.
    #[test]
    fn sound_speed_agrees_with_tables() {
        check(sound_speed, &[(0.0, 1402.39), (20.0, 1482.34), (25.0, 1496.70), (74.0, 1555.14), (100.0, 1543.1)], 1e-4);
    }

    /// The release's own verification value at 300 K, and the steam tables.
    #[test]
    fn vapour_pressure_agrees_with_the_release_and_steam_tables() {
        check(vapour_pressure, &[(26.85, 3_536.589_41)], 1e-8);
        check(
            vapour_pressure,
            &[(0.01, 611.657), (20.0, 2339.3), (25.0, 3169.8), (50.0, 12_352.0), (100.0, 101_418.0)],
            2e-4,
        );
    }

    #[test]
    fn bulk_modulus_is_that_of_the_textbooks() {
        let water = Fluid { name: "water".into(), temperature_degc: 20.0 }.properties(20.0);
        assert!((water.bulk_modulus_pa / 2.19e9 - 1.0).abs() < 0.005, "{}", water.bulk_modulus_pa);
        assert!((water.kinematic_viscosity_m2_s / 1.0034e-6 - 1.0).abs() < 2e-3);
        assert!((water.sound_speed_m_s() - 1482.34).abs() < 0.1);
    }
}
