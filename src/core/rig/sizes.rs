//! Sizes of pipes as they are sold: `63 SDR11`, `22x1.5`, `DN50`, `NPS 2`, `copper 3/4 L`.

/// Inner diameter and wall thickness of a pipe, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PipeSize {
    /// Inner diameter, m.
    pub inner_diameter_m: f64,
    /// Wall thickness, m.
    pub wall_thickness_m: f64,
}

/// Steel pipes by nominal diameter, mm: outer diameter and wall of the medium series of EN 10255.
const DN: [(u32, f64, f64); 9] = [
    (15, 21.3, 2.6),
    (20, 26.9, 2.6),
    (25, 33.7, 3.2),
    (32, 42.4, 3.2),
    (40, 48.3, 3.2),
    (50, 60.3, 3.6),
    (65, 76.1, 3.6),
    (80, 88.9, 4.0),
    (100, 114.3, 4.5),
];
/// Pipes by nominal size in inches, schedule 40 of ASME B36.10M, mm.
const NPS: [(&str, f64, f64); 8] = [
    ("1/2", 21.3, 2.77),
    ("3/4", 26.7, 2.87),
    ("1", 33.4, 3.38),
    ("1-1/4", 42.2, 3.56),
    ("1-1/2", 48.3, 3.68),
    ("2", 60.3, 3.91),
    ("3", 88.9, 5.49),
    ("4", 114.3, 6.02),
];
/// Copper tubes of ASTM B88 by nominal size in inches: outer diameter and the walls of types K, L and M, mm.
const COPPER: [(&str, f64, [f64; 3]); 6] = [
    ("1/2", 15.9, [1.24, 1.02, 0.71]),
    ("3/4", 22.2, [1.65, 1.14, 0.81]),
    ("1", 28.6, [1.65, 1.27, 0.89]),
    ("1-1/4", 34.9, [1.65, 1.40, 1.07]),
    ("1-1/2", 41.3, [1.83, 1.52, 1.24]),
    ("2", 54.0, [2.11, 1.78, 1.47]),
];

/// What a size may look like, for messages.
pub const EXAMPLES: &str = "63 SDR11 (outer diameter in mm), 22x1.5 (outer diameter x wall in mm), DN50 (steel, EN 10255), NPS 2 (schedule 40), \
                            copper 3/4 L (ASTM B88)";

/// The pipe of a size.
///
/// # Errors
/// What sizes look like, where this is none.
pub fn pipe_size(text: &str) -> Result<PipeSize, String> {
    let wrong = || format!("'{text}' is not a known pipe size: write it like {EXAMPLES}");
    let plain = text.trim().to_lowercase().replace(',', ".");
    let (outer_mm, wall_mm) = sized(&plain).ok_or_else(wrong)?;
    let inner_mm = outer_mm - 2.0 * wall_mm;
    let is_pipe = wall_mm > 0.0 && inner_mm > 0.0 && outer_mm.is_finite();
    let size = PipeSize { inner_diameter_m: 1e-3 * inner_mm, wall_thickness_m: 1e-3 * wall_mm };
    is_pipe.then_some(size).ok_or_else(wrong)
}

/// Outer diameter and wall, mm.
fn sized(text: &str) -> Option<(f64, f64)> {
    let number = |part: &str| part.trim().trim_start_matches("od").trim_end_matches("mm").trim().parse::<f64>().ok();
    if let Some((outer, ratio)) = text.split_once("sdr") {
        let (outer, ratio) = (number(outer)?, number(ratio)?);
        // Walls are rounded up to a tenth of a millimetre (ISO 4065).
        return Some((outer, (10.0 * outer / ratio - 1e-9).ceil() / 10.0));
    }
    if let Some(rest) = text.strip_prefix("dn") {
        let nominal: u32 = rest.trim().parse().ok()?;
        return DN.iter().find(|(dn, ..)| *dn == nominal).map(|(_, outer, wall)| (*outer, *wall));
    }
    if let Some(rest) = text.strip_prefix("nps") {
        let nominal = rest.trim().trim_end_matches("sch40").trim_end_matches("sch 40").trim();
        return NPS.iter().find(|(nps, ..)| *nps == nominal).map(|(_, outer, wall)| (*outer, *wall));
    }
    if let Some(rest) = text.strip_prefix("copper") {
        let (nominal, kind) = rest.trim().rsplit_once(' ')?;
        let kind = ["k", "l", "m"].iter().position(|k| *k == kind)?;
        return COPPER.iter().find(|(size, ..)| *size == nominal.trim()).map(|(_, outer, walls)| (*outer, walls[kind]));
    }
    let (outer, wall) = text.split_once(['x', '×'])?;
    Some((number(outer)?, number(wall)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mm(text: &str) -> [f64; 2] {
        let size = pipe_size(text).unwrap();
        [size.inner_diameter_m, size.wall_thickness_m].map(|v| (1e6 * v).round() / 1e3)
    }

    #[test]
    fn sizes_are_those_of_the_standards() {
        // ISO 4427: 5.8 mm for 63 mm of SDR 11.
        assert_eq!(mm("63 SDR11"), [51.4, 5.8]);
        assert_eq!(mm("110mm sdr 17"), [97.0, 6.5]);
        assert_eq!(mm("22x1"), [20.0, 1.0]);
        assert_eq!(mm("22,0 × 1,5 mm"), [19.0, 1.5]);
        assert_eq!(mm("DN 50"), [53.1, 3.6]);
        assert_eq!(mm("NPS 2 SCH40"), [52.48, 3.91]);
        assert_eq!(mm("Copper 3/4 L"), [19.92, 1.14]);
    }

    #[test]
    fn what_is_no_size_is_refused_with_examples() {
        for text in ["", "50", "DN51", "22x0", "22x11", "63 SDR0", "63 SDR", "copper 9 L", "nps 7", "nanx1"] {
            assert!(pipe_size(text).unwrap_err().contains("63 SDR11"), "{text}");
        }
    }
}
