//! Values that look like those of another unit: a warning, no change.

use crate::number::significant;
use crate::recording::Recording;
use crate::rig::{Coupling, Rig, Sensor};
use crate::storage::import::source::Repair;
use crate::units::Unit;

/// Steady gauge pressures of a laboratory lie between a hand of water and two hundred bar, Pa.
pub(crate) const PLAUSIBLE_PA: [f64; 2] = [1e3, 2e7];
/// Two sensors of one pipe whose steady pressures differ by more than this factor are in doubt.
const FAR_APART: f64 = 5.0;
/// Units that are proposed: the others are near one of them.
const USUAL: [&str; 6] = ["Pa", "kPa", "MPa", "bar", "psi", "m(H2O)"];
/// How near two steady pressures must come for a unit to be the explanation.
const NEAR: f64 = 1.5;

/// What to look at again in a recording: pressure sensors whose unit may be another one. AC-coupled sensors show no
/// steady pressure and are not judged.
pub fn unit_warnings(recording: &Recording) -> Vec<Repair> {
    let rig = &recording.rig;
    let density = rig.fluid.properties(rig.fluid.temperature_degc).density_kg_m3;
    let levels: Vec<(&Sensor, f64, f64)> = rig
        .pressure_sensors()
        .filter(|(_, s)| s.coupling == Coupling::Dc)
        .filter_map(|(i, s)| {
            let mut values = recording.series.get(i)?.value.clone();
            if values.is_empty() {
                return None;
            }
            let middle = values.len() / 2;
            let level = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
            Some((s, level, s.unit.to_si(level, density)))
        })
        .collect();
    let mut doubts: Vec<(Doubt, Repair)> = levels.iter().filter_map(|l| doubt(l, &levels, rig, density)).collect();
    // Of two sensors each is far from the other: one sentence asks about both.
    if let [(Doubt::Apart(one), _), (Doubt::Apart(other), _)] = doubts.as_slice()
        && levels.len() == 2
    {
        let shown = |(sensor, level, _): &(&Sensor, f64, f64)| {
            format!("'{}', {} {},", sensor.name, significant(*level, 4), sensor.unit)
        };
        let asked: Vec<&str> = [one, other].into_iter().flatten().map(String::as_str).collect();
        let hint = match asked[..] {
            [] => "check units, zeros and scales".to_string(),
            _ => format!("is {}? Then put the unit in the heading, or in the rig file", asked.join(", or ")),
        };
        let (one, other) = (shown(&levels[0]), shown(&levels[1]));
        let text = format!("the medians of {one} and {other} are far apart (rig '{}'): {hint}", rig.name);
        doubts = vec![(Doubt::Level, Repair::new("doubtful-unit", 1, None, text))];
    }
    doubts.into_iter().map(|(_, repair)| repair).collect()
}

/// Why a level is strange.
enum Doubt {
    /// By itself.
    Level,
    /// Beside the other sensors; what it would be in a unit that makes them agree.
    Apart(Option<String>),
}

fn doubt(own: &(&Sensor, f64, f64), all: &[(&Sensor, f64, f64)], rig: &Rig, density: f64) -> Option<(Doubt, Repair)> {
    let &(sensor, level, pa) = own;
    let others: Vec<f64> =
        all.iter().filter(|o| o.0.name != sensor.name).map(|o| o.2).filter(|p| *p > PLAUSIBLE_PA[0]).collect();
    let apart = |p: f64, q: f64| (p / q).max(q / p);
    let strange = match sensor.range {
        Some([low, high]) if level < low || level > high => {
            Some(format!("is outside of its range, {low} to {high} {}", sensor.unit))
        }
        _ if level != 0.0 && pa.abs() > PLAUSIBLE_PA[1] => {
            Some("is more than a laboratory pipe withstands".to_string())
        }
        _ if pa <= 0.0 => None,
        _ if !others.is_empty() && others.iter().all(|&o| apart(pa, o) > FAR_APART) => {
            Some("is far from that of the other sensors".to_string())
        }
        _ if others.is_empty() && pa < PLAUSIBLE_PA[0] && sensor.range.is_none() => {
            Some("is close to zero".to_string())
        }
        _ => None,
    }?;
    // the others say what it should be; without them, the range or what a laboratory has
    let fits = |value_pa: f64| match (others.is_empty(), sensor.range) {
        (false, _) => others.iter().any(|&o| value_pa > 0.0 && apart(value_pa, o) < NEAR),
        (true, Some([low, high])) => (low..=high).contains(&sensor.unit.from_si(value_pa, density)),
        (true, None) => (5e3..=2e6).contains(&value_pa),
    };
    let candidates = USUAL.iter().filter_map(|u| u.parse::<Unit>().ok()).filter(|u| *u != sensor.unit);
    let meant: Vec<&str> = candidates.filter(|u| fits(u.to_si(level, density))).map(|u| u.symbol).collect();
    let hint = match meant[..] {
        [] => "check the sensor's unit, zero and scale".to_string(),
        _ => format!(
            "is it in {}? Then put the unit in the heading, as in '{} ({})', or in the rig file",
            meant.join(" or "),
            sensor.name,
            meant[0]
        ),
    };
    let text = format!(
        "the median of '{}', {} {}, {strange} (rig '{}'): {hint}",
        sensor.name,
        significant(level, 4),
        sensor.unit,
        rig.name
    );
    let meant = (!meant.is_empty()).then(|| format!("'{}' in {}", sensor.name, meant.join(" or ")));
    let why = if strange.starts_with("is far") { Doubt::Apart(meant) } else { Doubt::Level };
    Some((why, Repair::new("doubtful-unit", 1, None, text)))
}
