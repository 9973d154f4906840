//! How two rigs differ: in the line itself, or only in what measures it.

use crate::number::rounded;
use crate::rig::types::Rig;

/// Differences that matter to a model, in words; empty if there are none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Differences {
    /// Of pipes, supply, valve and fluid: a different line, so a model does not apply.
    pub line: Vec<String>,
    /// Of sensors: the same line, measured differently.
    pub sensors: Vec<String>,
}

/// Differences of `other` from `rig`, as said of `other`: "length 40 m, not 35". Names of rigs and pipes, devices,
/// wiring and reported steady states do not count.
pub fn differences(rig: &Rig, other: &Rig) -> Differences {
    let mut found = Differences::default();
    if rig.pipes.len() != other.pipes.len() {
        found.line.push(format!("{} pipes, not {}", other.pipes.len(), rig.pipes.len()));
    }
    for (a, b) in rig.pipes.iter().zip(&other.pipes) {
        let of = if rig.pipes.len() > 1 { format!("pipe '{}': ", b.name) } else { String::new() };
        let mut number = |what: &str, unit: &str, one: f64, two: f64| {
            if (one - two).abs() > 1e-9 * one.abs().max(two.abs()) {
                found.line.push(format!("{of}{what} {} {unit}, not {}", rounded(two), rounded(one)));
            }
        };
        number("length", "m", a.length_m, b.length_m);
        number("inner diameter", "mm", a.inner_diameter_m * 1e3, b.inner_diameter_m * 1e3);
        number("wall", "mm", a.wall_thickness_m * 1e3, b.wall_thickness_m * 1e3);
        number("elevation at its start", "m", a.elevation_start_m, b.elevation_start_m);
        number("elevation at its end", "m", a.elevation_end_m, b.elevation_end_m);
        if a.material != b.material {
            found.line.push(format!("{of}made of {}, not {}", b.material, a.material));
        }
        if a.constraint != b.constraint {
            found.line.push(format!("{of}held in another way"));
        }
        if (a.friction_factor, a.roughness_m) != (b.friction_factor, b.roughness_m) {
            found.line.push(format!("{of}another friction factor or roughness"));
        }
    }
    if rig.upstream != other.upstream {
        found.line.push("another kind of supply".to_owned());
    }
    if rig.fluid.name != other.fluid.name {
        found.line.push(format!("filled with {}, not {}", other.fluid.name, rig.fluid.name));
    }
    for sensor in &other.sensors {
        match rig.sensors.iter().find(|s| s.name == sensor.name) {
            None => found.sensors.push(format!("{} is new", sensor.name)),
            Some(known) if known.position_m != sensor.position_m => found
                .sensors
                .push(format!("{} stands at {} m, not at {} m", sensor.name, sensor.position_m, known.position_m)),
            Some(_) => {}
        }
    }
    let gone = rig.sensors.iter().filter(|s| !other.sensors.iter().any(|o| o.name == s.name));
    found.sensors.extend(gone.map(|s| format!("{} is not there", s.name)));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_pipe_and_another_sensor_are_told_apart() {
        let text = include_str!("../../../rigs/imperial-pe.toml");
        let rig = Rig::from_toml(text, "rig.toml").unwrap();
        assert_eq!(differences(&rig, &rig), Differences::default());
        let mut other = rig.clone();
        other.name = "the same under another name".into();
        other.sensors[0].name = "P9".into();
        let found = differences(&rig, &other);
        assert!(found.line.is_empty() && found.sensors.len() == 2, "{found:?}");
        other.pipes[0].length_m += 1.0;
        other.pipes[0].material = "steel".into();
        let line = differences(&rig, &other).line;
        assert_eq!(line, ["length 278 m, not 277", "made of steel, not PE"]);
    }
}
