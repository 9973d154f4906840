//! Checks whether a rig file is consistent: each number is compared with what the others imply.

use crate::number::significant;
use crate::rig::device::{Encoding, Protocol};
use crate::rig::friction::LAMINAR_REYNOLDS;
use crate::rig::friction::darcy_friction_factor;
use crate::rig::types::{Constraint, Pipe, Rig, Sensor, SensorKind, SteadyState};
use crate::rig::water::WaterProperties;
use crate::units::GRAVITY_M_S2;

/// Reynolds numbers that differ by less count as equal: 1 °C changes them by 2 %, a flow meter by its percent.
const REYNOLDS_WARNING: f64 = 0.04;
const REYNOLDS_CONTRADICTION: f64 = 0.08;
/// Standard atmosphere, Pa.
pub const ATMOSPHERE_PA: f64 = 101_325.0;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Checked, and in order.
    Fine,
    /// Possible, but worth a look.
    Warning,
    /// Two numbers that cannot both be right.
    Contradiction,
}

impl Level {
    /// As shown to users.
    pub fn word(self) -> &'static str {
        match self {
            Level::Fine => "fine",
            Level::Warning => "warning",
            Level::Contradiction => "contradiction",
        }
    }
}

/// One finding on a rig or a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// How bad it is.
    pub level: Level,
    /// What was checked, e.g. `closing time`.
    pub subject: String,
    /// The finding with its numbers, as a sentence.
    pub message: String,
    /// The numbers alone, each under a name that carries its unit.
    pub numbers: Vec<(&'static str, f64)>,
}

impl Finding {
    /// A finding; `numbers` may stay empty.
    pub fn new(
        level: Level,
        subject: impl Into<String>,
        message: impl Into<String>,
        numbers: &[(&'static str, f64)],
    ) -> Self {
        Finding { level, subject: subject.into(), message: message.into(), numbers: numbers.to_vec() }
    }
}

/// All findings on the rig alone, in the order of the file.
pub fn check(rig: &Rig) -> Vec<Finding> {
    let water = rig.fluid.properties(rig.fluid.temperature_degc);
    let mut findings = Vec::new();
    findings.extend(rig.pipes.iter().filter_map(check_size));
    findings.extend(rig.pipes.iter().map(|pipe| check_wave_speed(pipe, &water)));
    findings.extend(rig.pipes.iter().filter(|p| p.material().viscoelastic).map(check_constraint));
    findings.push(check_closing_time(rig, &water));
    findings.extend(rig.sensors.iter().filter_map(|sensor| check_counts(rig, sensor)));
    findings.extend(coarse_counts(rig));
    for state in &rig.steady {
        let water = rig.fluid.properties(state.temperature_degc.unwrap_or(rig.fluid.temperature_degc));
        findings.extend(check_steady(rig, state, &water));
    }
    findings
}

/// Longest and widest pipe that there could be, m, and diameters that one is at least long: a wave in a shorter one is
/// not plane.
const LONGEST_M: f64 = 1e7;
const WIDEST_M: f64 = 30.0;
const LEAST_DIAMETERS: f64 = 5.0;

/// A length or a diameter that no pipe has.
fn check_size(pipe: &Pipe) -> Option<Finding> {
    let (length_m, diameter_m) = (pipe.length_m, pipe.inner_diameter_m);
    let why = match () {
        () if length_m > LONGEST_M => "no pipeline is that long",
        () if diameter_m > WIDEST_M => "no pipe is that wide",
        () if length_m < LEAST_DIAMETERS * diameter_m => "a pipe that short has no plane waves",
        () => return None,
    };
    let message = format!("{length_m} m long and {diameter_m} m wide: {why}; is it in another unit?");
    let numbers = [("length_m", length_m), ("inner_diameter_m", diameter_m)];
    Some(Finding::new(Level::Contradiction, format!("size of pipe '{}'", pipe.name), message, &numbers))
}

/// Travel time of a wave from the valve to the supply and back, s: 2 Σ L/a.
pub fn return_time_s(rig: &Rig, water: &WaterProperties) -> f64 {
    rig.way_pipes().map(|p| 2.0 * p.length_m / p.wave_speed_start(water).0).sum()
}

/// Steady wall friction between two positions, m: Darcy–Weisbach with the file's friction factor or Colebrook–White's.
pub fn friction_loss_m(rig: &Rig, from_m: f64, to_m: f64, flow_m3_s: f64, water: &WaterProperties) -> f64 {
    let mut start_m = 0.0;
    let mut loss_m = 0.0;
    for pipe in rig.way_pipes() {
        let end_m = start_m + pipe.length_m;
        let stretch_m = (to_m.min(end_m) - from_m.max(start_m)).max(0.0);
        loss_m += stretch_m * friction_slope(pipe, flow_m3_s, water);
        start_m = end_m;
    }
    loss_m
}

/// Head lost per length, with the sign of the flow.
fn friction_slope(pipe: &Pipe, flow_m3_s: f64, water: &WaterProperties) -> f64 {
    let velocity = flow_m3_s / pipe.area_m2();
    if velocity == 0.0 {
        return 0.0;
    }
    let factor = pipe.friction_factor.unwrap_or_else(|| {
        let roughness = pipe.roughness_m.unwrap_or(0.0) / pipe.inner_diameter_m;
        darcy_friction_factor(pipe.reynolds(water, flow_m3_s), roughness)
    });
    factor * velocity * velocity.abs() / (2.0 * GRAVITY_M_S2 * pipe.inner_diameter_m)
}

fn check_wave_speed(pipe: &Pipe, water: &WaterProperties) -> Finding {
    let subject = format!("wave speed of '{}'", pipe.name);
    if let Some(given) = pipe.wave_speed_m_s {
        return judge_wave_speed(pipe, subject, given, 0.0, water);
    }
    let [lo, hi] = pipe.material_wave_speeds_m_s(water);
    let (start, ..) = pipe.wave_speed_start(water);
    let material = &pipe.material;
    let message = format!(
        "not given; it will start at {start:.0} m/s, within the {lo:.0}-{hi:.0} m/s of Korteweg's law for {material}"
    );
    Finding::new(Level::Fine, subject, message, &[("start_m_s", start), ("lo_m_s", lo), ("hi_m_s", hi)])
}

/// A fit's creep and modulus depend on how the pipe is held, and no record shows that.
fn check_constraint(pipe: &Pipe) -> Finding {
    let c1 = pipe.constraint_coefficient();
    let [free, upstream, anchored] =
        [Constraint::Free, Constraint::AnchoredUpstream, Constraint::Anchored].map(|held| pipe.coefficient_if(held));
    let message = format!(
        "c1 = {c1:.3}, 1 if the file gives no constraint; for this wall c1 is {free:.3} held \"free\", {upstream:.3} \"anchored-upstream\", \
         {anchored:.3} \"anchored\". Fitted J scale with 1/c1 and moduli with c1, and no record shows how the pipe is held"
    );
    let numbers = [("c1", c1), ("free", free), ("anchored_upstream", upstream), ("anchored", anchored)];
    Finding::new(Level::Fine, format!("constraint of '{}'", pipe.name), message, &numbers)
}

/// A wave speed with a larger relative uncertainty tells nothing about the wall.
const TELLS_NOTHING: f64 = 0.5;

/// Compares a wave speed with those that the wall allows; `slack` is its relative uncertainty. Only a speed within them
/// gives the wall's modulus.
pub fn judge_wave_speed(pipe: &Pipe, subject: String, given: f64, slack: f64, water: &WaterProperties) -> Finding {
    let [lo, hi] = pipe.material_wave_speeds_m_s(water);
    let sound = water.sound_speed_m_s();
    let (least, most) = (given * (1.0 - slack), given * (1.0 + slack));
    let (level, place) = match () {
        () if least >= sound => (Level::Contradiction, "is faster than sound in the water, and outside"),
        () if least > 1.15 * hi => (Level::Contradiction, "is far above"),
        () if most < 0.5 * lo => (Level::Contradiction, "is far below"),
        () if slack > TELLS_NOTHING => (Level::Warning, "is too uncertain to compare with"),
        () if least > hi => (Level::Warning, "is above"),
        () if most < lo => (Level::Warning, "is below"),
        () if (lo..=hi).contains(&given) => (Level::Fine, "is within"),
        () => (Level::Fine, "agrees within its error with"),
    };
    let inside = slack <= TELLS_NOTHING && (lo..=hi).contains(&given);
    let modulus = pipe.youngs_modulus_for_wave_speed(water, given).filter(|_| inside);
    let means = modulus.map(|e| format!("; it means E = {:.2} GPa", e * 1e-9)).unwrap_or_default();
    let uncertain = if slack > 0.0 { format!(" ± {:.0}", given * slack) } else { String::new() };
    let material = &pipe.material;
    let message =
        format!("{given:.0}{uncertain} m/s {place} the {lo:.0}-{hi:.0} m/s of Korteweg's law for {material}{means}");
    let mut numbers = vec![("given_m_s", given), ("lo_m_s", lo), ("hi_m_s", hi)];
    numbers.extend(modulus.map(|e| ("youngs_modulus_pa", e)));
    Finding::new(level, subject, message, &numbers)
}

fn check_closing_time(rig: &Rig, water: &WaterProperties) -> Finding {
    let (closing, back) = (rig.valve.closing_time_s, return_time_s(rig, water));
    let numbers = [("closing_time_s", closing), ("return_time_s", back)];
    let compared = format!("{closing} s against 2L/a = {back:.3} s");
    let (level, message) = if closing > back {
        let share = 100.0 * back / closing;
        let words = format!(
            "{compared}: not a quick closure; the wave is back {share:.0} % of the way, and the surge stays below Joukowsky's"
        );
        (Level::Warning, words)
    } else {
        (Level::Fine, format!("{compared}: a quick closure"))
    };
    Finding::new(level, "closing time", message, &numbers)
}

/// A count of more than this head hides what a test is for, m: a surge has some ten metres, its noise a hundredth.
const COARSE_M: f64 = 0.2;

/// Pressure sensors whose counts are so coarse that the file has most likely forgotten their `scale`, which is 1
/// without it.
pub fn coarse_counts(rig: &Rig) -> Vec<Finding> {
    let water = rig.fluid.properties(rig.fluid.temperature_degc);
    let of = |sensor: &Sensor| {
        let wiring = sensor.wiring.as_ref()?;
        let device = rig.devices.iter().find(|d| d.name == wiring.device)?;
        // A printed number or a float has digits behind the point.
        let counts = match device.protocol {
            Protocol::Frames => true,
            Protocol::Lines { .. } => false,
            Protocol::ModbusRtu { .. } => wiring.register.is_some_and(|r| r.encoding != Encoding::F32),
        };
        let pa = |v: f64| sensor.unit.to_si(v, water.density_kg_m3);
        let step_m = (pa(wiring.scale) - pa(0.0)).abs() / (water.density_kg_m3 * GRAVITY_M_S2);
        (counts && step_m > COARSE_M).then(|| {
            let message = format!(
                "one count is {} {}, {} m of head: give 'scale', the {} of one count",
                wiring.scale,
                sensor.unit,
                significant(step_m, 3),
                sensor.unit
            );
            Finding::new(Level::Warning, format!("counts of '{}'", sensor.name), message, &[("step_m", step_m)])
        })
    };
    rig.pressure_sensors().filter_map(|(_, sensor)| of(sensor)).collect()
}

/// Frames carry 16-bit counts: these must cover the sensor's range and resolve its accuracy.
fn check_counts(rig: &Rig, sensor: &Sensor) -> Option<Finding> {
    let (wiring, [lo, hi]) = (sensor.wiring.as_ref()?, sensor.range?);
    let device = rig.devices.iter().find(|d| d.name == wiring.device)?;
    if device.protocol != Protocol::Frames {
        return None;
    }
    let [from, to] = rig.count_ends(sensor)?;
    let slack = 0.001 * (hi - lo);
    let unit = sensor.unit;
    let reach = format!(
        "16-bit counts reach from {} to {} {unit}, the sensor from {lo} to {hi} {unit}",
        significant(from, 4),
        significant(to, 4)
    );
    let numbers = [("counts_from", from), ("counts_to", to), ("range_lo", lo), ("range_hi", hi)];
    let (level, message) = if from > lo + slack || to < hi - slack {
        (Level::Warning, format!("{reach}: the counts end first; change 'scale' or 'offset'"))
    } else {
        (Level::Fine, reach)
    };
    Some(Finding::new(level, format!("counts of '{}'", sensor.name), message, &numbers))
}

fn check_steady(rig: &Rig, state: &SteadyState, water: &WaterProperties) -> Vec<Finding> {
    let flow = state.flow_m3_s;
    let on = |subject: &str| format!("{subject}, {}", state.name);
    let mut findings = Vec::new();
    if let (Some(reported), Some(pipe)) = (state.reynolds_number, rig.pipes.first()) {
        findings.push(check_reynolds(pipe, on("Reynolds number"), reported, flow, water));
    }
    if let (Some(reported), Some(pipe)) = (state.wave_speed_m_s, rig.pipes.first()) {
        findings.push(judge_wave_speed(pipe, on("wave speed"), reported, 0.0, water));
    }
    for pipe in &rig.pipes {
        findings.extend(check_friction_factor(pipe, on(&format!("friction factor of '{}'", pipe.name)), flow, water));
    }
    if let Some(supply) = state.supply_head_m {
        findings.push(check_supply(rig, on("friction loss"), supply, flow, water));
        findings.extend(check_surge(rig, on("surge"), supply, flow, water));
    }
    for sensor in rig.sensors.iter().filter(|s| s.kind == SensorKind::Flow) {
        let shown = sensor.unit.from_si(flow, water.density_kg_m3);
        findings.extend(check_meter(sensor, on(&format!("range of '{}'", sensor.name)), shown));
    }
    findings
}

fn check_reynolds(pipe: &Pipe, subject: String, reported: f64, flow: f64, water: &WaterProperties) -> Finding {
    let expected = pipe.reynolds(water, flow);
    let implied_mm = 1e3 * pipe.inner_diameter_m * expected / reported;
    let off = (reported / expected).ln().abs();
    let level = match off {
        off if off > REYNOLDS_CONTRADICTION => Level::Contradiction,
        off if off > REYNOLDS_WARNING => Level::Warning,
        _ => Level::Fine,
    };
    let message = format!(
        "{reported:.0} reported; {:.2} m3/h in {:.1} mm give {expected:.0}. The reported one implies a diameter of {implied_mm:.1} mm",
        flow * 3600.0,
        pipe.inner_diameter_m * 1e3,
    );
    let numbers = [("reported", reported), ("expected", expected), ("implied_diameter_mm", implied_mm)];
    Finding::new(level, subject, message, &numbers)
}

/// Compares the file's constant friction factor with that of a smooth pipe at this flow, the least possible.
fn check_friction_factor(pipe: &Pipe, subject: String, flow: f64, water: &WaterProperties) -> Option<Finding> {
    let given = pipe.friction_factor?;
    let reynolds = pipe.reynolds(water, flow);
    let smooth = darcy_friction_factor(reynolds, 0.0);
    let new = darcy_friction_factor(reynolds, pipe.material().roughness_m / pipe.inner_diameter_m);
    let numbers = [("given", given), ("smooth", smooth), ("new_pipe", new), ("reynolds_number", reynolds)];
    let compared = format!(
        "{given} given; a smooth pipe has {smooth:.4} at Re {reynolds:.0}, a new one of {} {new:.4}",
        pipe.material
    );
    let (level, message) = if given < 0.9 * smooth {
        (Level::Contradiction, format!("{compared}: no pipe has less friction than a smooth one"))
    } else if given > 1.5 * new {
        (Level::Warning, format!("{compared}: it includes bends and fittings, or the diameter is wrong"))
    } else {
        (Level::Fine, compared)
    };
    Some(Finding::new(level, subject, message, &numbers))
}

fn check_supply(rig: &Rig, subject: String, supply_m: f64, flow: f64, water: &WaterProperties) -> Finding {
    let available = supply_m - rig.valve.discharge_head_m;
    let loss = friction_loss_m(rig, 0.0, rig.length_m(), flow, water);
    let numbers = [("loss_m", loss), ("available_m", available)];
    let compared =
        format!("wall friction takes {loss:.1} m at {:.2} m3/h; the supply gives {available:.1} m", flow * 3600.0);
    let (level, message) = if loss > available {
        (Level::Contradiction, format!("{compared}: this flow is impossible"))
    } else if loss > 0.8 * available {
        (Level::Warning, format!("{compared}: next to nothing is left for the valve"))
    } else {
        (Level::Fine, compared)
    };
    Finding::new(level, subject, message, &numbers)
}

/// Would a quick closure drive the pressure at the valve out of the sensors' ranges, or make the water boil?
fn check_surge(rig: &Rig, subject: String, supply_m: f64, flow: f64, water: &WaterProperties) -> Option<Finding> {
    let pipe = rig.pipe_at_valve();
    let velocity = flow / pipe.area_m2();
    let joukowsky = pipe.wave_speed_start(water).0 * velocity / GRAVITY_M_S2;
    // a slow linear closure: the rigid-column share of Joukowsky's head (Michaud), with the same flow
    let share = (return_time_s(rig, water) / rig.valve.closing_time_s).min(1.0);
    let elevation = rig.elevation_m(rig.valve_place());
    let weight = water.density_kg_m3 * GRAVITY_M_S2;
    // after the closure the pressure swings about the head of the supply
    let gauge_pa = |head_m: f64| (head_m - elevation) * weight;
    let (peak, trough) = (gauge_pa(supply_m + share * joukowsky), gauge_pa(supply_m - share * joukowsky));
    let numbers = [("surge_m", share * joukowsky), ("peak_pa", peak), ("trough_pa", trough)];
    let swing = format!(
        "closing stops {velocity:.2} m/s: {:.1} m above and below the supply's {supply_m:.1} m",
        share * joukowsky
    );
    let near_valve = |s: &&Sensor| s.kind == SensorKind::Pressure && rig.on_way_m(s.place()) > 0.9 * rig.length_m();
    let saturated = rig.sensors.iter().filter(near_valve).find_map(|s| {
        let [_, hi] = s.range?;
        let shown = s.unit.from_si(peak, water.density_kg_m3);
        (shown > hi).then(|| format!("; '{}' would need to show {shown:.0} {}, it ends at {hi}", s.name, s.unit))
    });
    let boils = trough + ATMOSPHERE_PA < water.vapour_pressure_pa;
    let boiling = if boils { "; the trough falls below vapour pressure: expect vapour-cavity" } else { "" };
    let level = if saturated.is_some() || boils { Level::Warning } else { Level::Fine };
    Some(Finding::new(level, subject, swing + &saturated.unwrap_or_default() + boiling, &numbers))
}

/// Compares a flow, in the sensor's unit, with the meter's range.
pub fn check_meter(sensor: &Sensor, subject: String, shown: f64) -> Option<Finding> {
    let [lo, hi] = sensor.range?;
    let unit = sensor.unit;
    let numbers = [("flow", shown), ("range_lo", lo), ("range_hi", hi)];
    let (level, message) = if shown > hi || shown < lo {
        (
            Level::Contradiction,
            format!("{shown:.3} {unit} on a meter of {lo} to {hi} {unit}: it cannot have measured that"),
        )
    } else {
        (Level::Fine, format!("{shown:.3} {unit} on a meter of {lo} to {hi} {unit}"))
    };
    Some(Finding::new(level, subject, message, &numbers))
}

/// Flow regime: laminar, turbulent, or the uncertain range between.
pub fn flow_regime(reynolds: f64) -> &'static str {
    match reynolds.abs() {
        re if re <= LAMINAR_REYNOLDS => "laminar",
        re if re < 4000.0 => "between laminar and turbulent: friction is uncertain",
        _ => "turbulent",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_forgotten_scale_is_reported() {
        let text = include_str!("../../../rigs/demo-hdpe.toml");
        let steps = |text: &str| coarse_counts(&Rig::from_toml(text, "x.toml").unwrap());
        assert!(steps(text).is_empty());
        let forgotten = text.replacen("unit = \"kPa\"", "unit = \"bar\"", 1).replacen("scale = 0.02 ", "# ", 1);
        let found = steps(&forgotten);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].message.contains("one count is 1 bar, 10.2 m of head: give 'scale'"), "{found:?}");
    }

    #[test]
    fn a_wave_speed_is_judged_by_its_error_too() {
        let rig = Rig::from_toml(include_str!("../../../rigs/adelaide-copper.toml"), "x.toml").unwrap();
        let water = rig.fluid.properties(20.0);
        let [lo, hi] = rig.pipes[0].material_wave_speeds_m_s(&water);
        let middle = 0.5 * (lo + hi);
        for (speed, slack, level, words, modulus) in [
            (middle, 0.0, Level::Fine, "is within the", true),
            (middle, 0.1, Level::Fine, "is within the", true),
            (1.06 * hi, 0.11, Level::Fine, "agrees within its error with the", false),
            (1.06 * hi, 0.01, Level::Warning, "is above the", false),
            (0.8 * lo, 0.01, Level::Warning, "is below the", false),
            (middle, 0.6, Level::Warning, "is too uncertain to compare with the", false),
            (0.1 * lo, 0.01, Level::Contradiction, "is far below the", false),
            (3.0 * hi, 0.01, Level::Contradiction, "faster than sound", false),
        ] {
            let found = judge_wave_speed(&rig.pipes[0], "wave".into(), speed, slack, &water);
            assert_eq!(found.level, level, "{found:?}");
            assert!(found.message.contains(words), "{found:?}");
            assert_eq!(found.message.contains("it means E ="), modulus, "{found:?}");
            assert_eq!(found.numbers.iter().any(|n| n.0 == "youngs_modulus_pa"), modulus, "{found:?}");
        }
    }
}
