//! Wall materials: where the search for wave speed and creep starts, and where it ends.
//!
//! Young's moduli are those of fast loading at about 20 °C; the ranges span grades, temperatures of 0–60 °C for
//! plastics and the spread between sources. Sources: Wylie & Streeter, *Fluid Transients in Systems* (1993) and
//! Thorley, *Fluid Transients in Pipeline Systems* (2004) for moduli and Poisson's ratios of pipes; for plastics under
//! water hammer Covas et al. (2004, J. Hydraul. Res. 42(5); PE: J₀ 0.70 1/GPa, ν 0.46) and Soares et al. (2008, J.
//! Hydraul. Eng. 134(9); PVC); for PPR the data sheets of pipe makers (0.8–0.9 GPa slow) and the wave speeds of 410–470
//! m/s in the rig of `rigs/paper-ppr.toml`; roughnesses of new pipes after Moody (1944) and makers' data; densities after
//! makers' data sheets. They are starts and bounds, not measurements of your pipe.

/// What is known of a wall material before any test.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name as in rig files.
    pub name: &'static str,
    /// Other spellings.
    pub aliases: &'static [&'static str],
    /// Typical Young's modulus under fast loading, Pa.
    pub youngs_modulus_pa: f64,
    /// Range of Young's modulus `[lo, hi]`, Pa.
    pub youngs_modulus_range_pa: [f64; 2],
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density, kg/m³.
    pub density_kg_m3: f64,
    /// Roughness of a new pipe, m; a hint, the solver takes a pipe as smooth unless its file says otherwise.
    pub roughness_m: f64,
    /// Does the wall creep noticeably within a water-hammer test?
    pub viscoelastic: bool,
}

/// Start and bounds of one Kelvin–Voigt element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Creep {
    /// Start of the creep compliance of an element, 1/Pa.
    pub compliance_start_per_pa: f64,
    /// Its bounds, 1/Pa.
    pub compliance_bounds_per_pa: [f64; 2],
    /// Bounds of the retardation time as multiples of the period 4L/a.
    pub tau_range_periods: [f64; 2],
}

impl Material {
    /// The material of that name or alias, whatever its case; `None` if unknown.
    pub fn by_name(name: &str) -> Option<&'static Material> {
        let name = name.trim();
        let same = |other: &&str| other.eq_ignore_ascii_case(name);
        MATERIALS.iter().find(|m| same(&m.name) || m.aliases.iter().any(same))
    }

    /// Start and bounds of a creep element, as multiples of the instantaneous compliance 1/E.
    ///
    /// Plastics: elements found by Covas et al. (2005) on PE are 0.04–0.15 of 1/E, those used for PPR 0.1 and 0.9.
    /// Metals creep by well under a percent of their elastic strain, so bounds there leave room for the search and no
    /// more.
    pub fn creep(&self) -> Creep {
        let instantaneous = 1.0 / self.youngs_modulus_pa;
        let (start, lo, hi) = if self.viscoelastic { (0.1, 1e-3, 3.0) } else { (1e-3, 1e-5, 0.05) };
        Creep {
            compliance_start_per_pa: start * instantaneous,
            compliance_bounds_per_pa: [lo * instantaneous, hi * instantaneous],
            tau_range_periods: [0.01, 10.0],
        }
    }
}

const fn plastic(
    name: &'static str,
    aliases: &'static [&'static str],
    youngs_gpa: [f64; 3],
    poisson_ratio: f64,
    density_kg_m3: f64,
) -> Material {
    material(name, aliases, youngs_gpa, [poisson_ratio, density_kg_m3], 0.0015, true)
}

/// `youngs_gpa` is `[lo, typical, hi]`, `poisson_and_density` Poisson's ratio and kg/m³.
const fn material(
    name: &'static str,
    aliases: &'static [&'static str],
    youngs_gpa: [f64; 3],
    poisson_and_density: [f64; 2],
    roughness_mm: f64,
    viscoelastic: bool,
) -> Material {
    Material {
        name,
        aliases,
        youngs_modulus_pa: youngs_gpa[1] * 1e9,
        youngs_modulus_range_pa: [youngs_gpa[0] * 1e9, youngs_gpa[2] * 1e9],
        poisson_ratio: poisson_and_density[0],
        density_kg_m3: poisson_and_density[1],
        roughness_m: roughness_mm * 1e-3,
        viscoelastic,
    }
}

/// Every material that a rig file may name.
pub static MATERIALS: [Material; 23] = [
    plastic("HDPE", &["PE-HD", "PE100", "PE-100"], [0.5, 1.4, 3.0], 0.46, 955.0),
    plastic("MDPE", &["PE-MD", "PE80", "PE-80"], [0.4, 1.1, 2.5], 0.46, 940.0),
    plastic("LDPE", &["PE-LD"], [0.1, 0.3, 1.0], 0.46, 920.0),
    plastic("PE", &["polyethylene"], [0.3, 1.3, 3.0], 0.46, 950.0),
    plastic("PEX", &["PE-X"], [0.3, 0.8, 2.0], 0.46, 940.0),
    plastic("PPR", &["PP-R"], [0.5, 1.1, 2.5], 0.42, 905.0),
    plastic("PP", &["polypropylene", "PP-H", "PPH"], [0.6, 1.4, 3.0], 0.42, 905.0),
    plastic("PB", &["polybutylene"], [0.2, 0.5, 1.5], 0.46, 930.0),
    plastic("PVC", &["PVC-U", "uPVC", "U-PVC"], [2.0, 3.1, 5.0], 0.42, 1400.0),
    plastic("PVC-O", &["oPVC"], [2.5, 4.0, 6.0], 0.42, 1400.0),
    plastic("CPVC", &["PVC-C"], [1.8, 3.0, 5.0], 0.40, 1550.0),
    plastic("ABS", &[], [1.2, 2.2, 3.5], 0.38, 1050.0),
    plastic("PMMA", &["acrylic", "plexiglass", "perspex"], [2.0, 3.3, 6.5], 0.37, 1190.0),
    plastic("polycarbonate", &["PC"], [1.8, 2.4, 3.5], 0.38, 1200.0),
    material("GRP", &["FRP", "GFRP", "fiberglass"], [5.0, 20.0, 50.0], [0.28, 1850.0], 0.01, true),
    material("copper", &["Cu", "Kupfer", "cuivre"], [100.0, 120.0, 137.0], [0.34, 8930.0], 0.0015, false),
    material("brass", &["Messing", "laiton"], [90.0, 105.0, 120.0], [0.34, 8500.0], 0.0015, false),
    material("steel", &["carbon steel", "Stahl", "acier"], [185.0, 206.0, 218.0], [0.30, 7850.0], 0.045, false),
    material("galvanised steel", &["galvanized steel"], [185.0, 205.0, 218.0], [0.30, 7850.0], 0.15, false),
    material("stainless steel", &["inox", "Edelstahl"], [180.0, 195.0, 212.0], [0.29, 7930.0], 0.015, false),
    material("ductile iron", &["DI", "Gusseisen"], [145.0, 168.0, 185.0], [0.28, 7050.0], 0.1, false),
    material("cast iron", &["grey iron"], [70.0, 105.0, 170.0], [0.25, 7200.0], 0.26, false),
    material("aluminium", &["aluminum", "Alu"], [64.0, 70.0, 76.0], [0.33, 2700.0], 0.0015, false),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_aliases_are_found_whatever_their_case_and_are_unique() {
        assert_eq!(Material::by_name("hdpe").unwrap().name, "HDPE");
        assert_eq!(Material::by_name(" Aluminum ").unwrap().name, "aluminium");
        assert!(Material::by_name("unobtainium").is_none());
        for m in &MATERIALS {
            for name in m.aliases.iter().chain([&m.name]) {
                assert_eq!(Material::by_name(name).unwrap().name, m.name, "'{name}' names two materials");
            }
        }
    }

    #[test]
    fn starts_lie_within_bounds() {
        for m in &MATERIALS {
            let ([lo, hi], creep) = (m.youngs_modulus_range_pa, m.creep());
            assert!(lo < m.youngs_modulus_pa && m.youngs_modulus_pa < hi, "{}", m.name);
            assert!(m.poisson_ratio > 0.0 && m.poisson_ratio < 0.5, "{}", m.name);
            let [j_lo, j_hi] = creep.compliance_bounds_per_pa;
            assert!(j_lo < creep.compliance_start_per_pa && creep.compliance_start_per_pa < j_hi, "{}", m.name);
        }
    }

    /// The elements calibrated on the Imperial College PE rig (Covas et al. 2005) must be within reach of the search.
    #[test]
    fn published_creep_of_polyethylene_lies_within_the_bounds() {
        let [lo, hi] = Material::by_name("PE").unwrap().creep().compliance_bounds_per_pa;
        for j in [1.057e-10, 1.054e-10, 0.9051e-10, 0.2617e-10, 0.7456e-10] {
            assert!(lo < j && j < hi, "{j}");
        }
    }
}
