//! Warnings about a recording before any fit: numbers that cannot all be right.

use crate::number::{duration, error_m, plus_minus, significant};
use crate::rig::material::{MATERIALS, Material};
use crate::rig::{Pipe, Rig, WaterProperties};
use crate::signal::features::{Estimate, Features, SensorFeatures};

/// Wave speeds that differ by less agree: creep and unsteady friction smear the fronts from which they are read.
const SAME_SPEED: f64 = 0.15;
/// If Joukowsky's speed lies this far below the others, units are the likelier cause: nothing in a pipe lowers the
/// first rise as much.
const LOW_JOUKOWSKY: f64 = 0.35;
/// Faster than any wave in a water pipe, m/s.
const FASTEST_M_S: f64 = 1600.0;
/// Periods that differ by less agree: damping and unsteady friction move the peak of a spectrum.
const SAME_PERIOD: f64 = 0.1;
/// Least number of periods after the closure that a fit needs.
const LEAST_PERIODS: f64 = 2.0;
/// A wave may be so much faster than Korteweg's law allows: lengths, bores and walls are known to a few percent.
const FASTER_THAN_LAW: f64 = 1.03;
/// A foot, m.
const FOOT_M: f64 = 0.3048;
/// One sentence for each contradiction, with its likely causes; empty if there is none.
pub fn doubts(rig: &Rig, features: &Features) -> Vec<String> {
    let speeds = &features.wave_speed;
    let crossings = speeds.crossings.map(|c| Estimate { value: c.value, standard_error: c.standard_error });
    let mut found = Vec::new();
    if let (Some(c), Some(a)) = (crossings, speeds.arrival)
        && (a.value / c.value - 1.0).abs() > SAME_SPEED
        && apart(a, c)
    {
        found.push(format!(
            "the wave takes {} from sensor to sensor, but {} to the supply and back: is a sensor's clock \
             shifted (clock-skew), a position or the pipe's length wrong in the rig file, or is there air, which rounds the front?{}",
            shown(a),
            shown(c),
            fitting_place(rig, &features.sensors, c.value)
        ));
    }
    if let Some(j) = speeds.joukowsky {
        found.extend(doubt_joukowsky(j, crossings, creeps(rig)));
    }
    found.extend(doubt_period(features, crossings));
    if let Some(best) = speeds.best() {
        found.extend(doubt_bounds(rig, features.temperature_degc, best, speeds.arrival));
    }
    // a record too short for a period still has 4L/a
    let period_s = features.period.map(|p| p.value).or(speeds.best().map(|a| 4.0 * rig.length_m() / a.value));
    if let (Some(period_s), Some(sensor)) = (period_s, features.sensors.get(features.reference)) {
        let periods = (sensor.end_s - features.closure.start_s) / period_s;
        if periods < LEAST_PERIODS {
            found.push(format!(
                "only {periods:.1} periods were recorded after the closure: damping, creep and friction need {LEAST_PERIODS:.0} or \
                 more to be told apart; record for longer"
            ));
        }
        if let Some(lead_s) = features.short_lead_s(rig.length_m()) {
            found.push(format!(
                "no steady stretch stands before the first rise, the record begins {} before it: the closure lies before this record or at its very \
                 beginning, and head and noise before it are not known; import the part of the run before it as well, or let the recording run for a \
                 second or more before the valve closes",
                duration(lead_s)
            ));
        }
    }
    for sensor in &features.sensors {
        found.extend(doubt_vacuum(rig, sensor));
        if let Some([from_s, to_s]) = sensor.missing_at_front_s {
            let [from, to] = [from_s, to_s].map(|t| significant(t, 5));
            found.push(format!(
                "samples of {} are missing from {from} to {to} s, within a period of its front: the front may lie there, and its arrival, its rise, the \
                 steady head before it and the wave speeds from them are not to be relied on",
                sensor.name
            ));
        }
        if let Some(corners) = sensor.noise.corners {
            found.push(format!(
                "{} was interpolated: its samples lie on straight lines between points, one for every {:.0} of them (a curve read off a figure, \
                 or a logger that fills in). What neighbouring samples scatter by is no noise; {} m is taken instead, by which the points leave \
                 the lines between their neighbours",
                sensor.name,
                1.0 / corners.share,
                error_m(corners.sd_m)
            ));
        }
        if !sensor.noise.hum.is_empty() {
            let tones = sensor
                .noise
                .hum
                .iter()
                .map(|tone| format!("{} m at {} Hz", error_m(tone.amplitude_m), significant(tone.hz, 3)));
            found.push(format!(
                "{} hums as the mains do, by {}: a fit takes the hum out; shield or ground the sensor's wiring",
                sensor.name,
                tones.collect::<Vec<_>>().join(", ")
            ));
        }
        if let Some(line) = sensor.noise.lines.first() {
            found.push(format!(
                "{} oscillates at {} Hz by {} m even before the closure (a pump, or an alias of something faster): no model of a closure reproduces \
                 that, so it counts as missing physics; stop its source, or filter it before the converter",
                sensor.name,
                significant(line.hz, 3),
                error_m(line.amplitude_m)
            ));
        }
    }
    found
}

/// Where the last sensor would stand for its front to come with the wave that swings in the pipe.
fn fitting_place(rig: &Rig, sensors: &[SensorFeatures], speed_m_s: f64) -> String {
    let mut fronts: Vec<(f64, &SensorFeatures)> =
        sensors.iter().filter_map(|s| Some((s.front_arrival_s?.value, s))).collect();
    fronts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [(first_s, first), .., (last_s, last)] = fronts[..] else { return String::new() };
    let place_m = first.position_m - speed_m_s * (last_s - first_s);
    if !(0.0..=rig.length_m()).contains(&place_m) {
        return String::new();
    }
    let from_valve_m = rig.length_m() - last.position_m;
    if (place_m - from_valve_m).abs() < SAME_PLACE * rig.length_m() {
        let place = significant(from_valve_m, 4);
        return format!(" {} at {place} m would fit: was its place counted from the valve?", last.name);
    }
    format!(" {} at {} m would fit.", last.name, significant(place_m, 3))
}

/// Below a vacuum there is no pressure; a little more passes for a transducer that rings.
fn doubt_vacuum(rig: &Rig, sensor: &SensorFeatures) -> Option<String> {
    let lowest = sensor.extrema.iter().map(|e| e.head_m).min_by(f64::total_cmp)?
        - rig.elevation_m(rig.sensors[sensor.sensor].place());
    (lowest < -1.3 * ATMOSPHERE_M).then(|| {
        format!(
            "{} falls to {lowest:.0} m, and less than a vacuum, {:.0} m, is no pressure: its unit, its scale or its zero is wrong",
            sensor.name, -ATMOSPHERE_M
        )
    })
}

/// Two places within this share of the length may be the same.
const SAME_PLACE: f64 = 0.03;

/// The standard atmosphere as a head of water, m.
const ATMOSPHERE_M: f64 = 10.33;

fn shown(speed: Estimate) -> String {
    let digits = usize::from(speed.standard_error < 0.95);
    format!("{:.digits$} ± {:.digits$} m/s", speed.value, speed.standard_error)
}

/// Whether two values differ by more than two standard errors.
fn apart(a: Estimate, b: Estimate) -> bool {
    (a.value - b.value).abs() > 2.0 * a.standard_error.hypot(b.standard_error)
}

/// Whether a wall of the rig creeps under load.
fn creeps(rig: &Rig) -> bool {
    rig.pipes.iter().any(|pipe| pipe.material().viscoelastic)
}

fn doubt_joukowsky(j: Estimate, crossings: Option<Estimate>, creeps: bool) -> Option<String> {
    if j.value - j.standard_error > FASTEST_M_S {
        return Some(format!(
            "the first rise over the velocity implies a wave speed of {:.0} m/s, which no water pipe has: is the unit of the flow wrong, or the inner diameter, or does the recording start after the closure began?",
            j.value
        ));
    }
    let c = crossings.filter(|c| apart(j, *c))?;
    let ratio = j.value / c.value;
    let values = format!(
        "the first rise over the velocity (Joukowsky) implies {}, but the wave travels at {}",
        shown(j),
        shown(c)
    );
    if ratio > 1.0 + SAME_SPEED {
        return Some(format!(
            "{values}: the flow reads too low or the pressure too high; check the units and scales of flow and pressure, the inner diameter, and that \
             the times are in seconds"
        ));
    }
    if ratio < 1.0 - LOW_JOUKOWSKY {
        return Some(format!(
            "{values}: more than creep or a leak can explain; check the units and scales of flow and pressure, the inner diameter, and whether the \
             valve closed fully; air beside it does the same"
        ));
    }
    // creep during the closure lowers the first rise as much
    (ratio < 1.0 - SAME_SPEED && !creeps).then(|| format!("{values}: a leak, a wrong flow, or a slow closure?"))
}

/// Compares the wave speed of the whole record, 4L/T, with that of the first peak, and the period with that of the
/// spectrum.
fn doubt_period(features: &Features, crossings: Option<Estimate>) -> Option<String> {
    let period = features.period?;
    let found = format!("a cycle takes {} s", plus_minus(period.value, period.standard_error));
    if let Some(hz) = features.fundamental_hz.filter(|hz| (period.value * hz - 1.0).abs() > SAME_PERIOD) {
        return Some(format!(
            "{found}, but the spectrum of the head peaks at {} Hz, a period of {} s: echoes of a leak, a joint or a branch, a cavity, or another \
             source of pressure; look at the record before you trust period and damping",
            significant(hz, 4),
            significant(1.0 / hz, 4)
        ));
    }
    let (a, c) = (features.wave_speed.period?, crossings?);
    ((a.value / c.value - 1.0).abs() > SAME_SPEED && apart(a, c)).then(|| {
        format!(
            "{found}, which makes a wave speed of {} (4L/T), but the first wave travels at {}: gas, a cavity, strong creep, or a joint or branch that \
             reflects?",
            shown(a),
            shown(c)
        )
    })
}

/// Compares the mean wave speed (length by travel time) with what the walls allow.
fn doubt_bounds(rig: &Rig, temperature_degc: f64, best: Estimate, arrival: Option<Estimate>) -> Option<String> {
    let water = rig.fluid.properties(temperature_degc);
    let (_, lo, hi) = rig.wave_speed_start(&water);
    let (least, most) = (best.value - 2.0 * best.standard_error, best.value + 2.0 * best.standard_error);
    // Moduli of plastics depend on how fast they are strained. A branch makes the way to the supply look short, but not
    // that between sensors.
    let law = rig.fastest_by_law_m_s(&water);
    let is_known = !creeps(rig);
    let too_fast = |speed_m_s: f64| speed_m_s > FASTER_THAN_LAW * law;
    if is_known && too_fast(least) && arrival.is_none_or(|a| too_fast(a.value)) && least <= hi {
        let slips = slips(rig, &water, best.value, [lo, law]);
        return Some(format!(
            "the wave travels at {}, but Korteweg's law allows {law:.0} m/s at most for the rig's pipe, and no effect makes a wave faster: are the \
             pipe's length, wall and material right in the rig file?{slips}",
            shown(best)
        ));
    }
    let causes = if least > hi {
        "are the pipe's length, wall and material right in the rig file, and the times in seconds?"
    } else if most < lo {
        "is there gas in the water, or is the pipe's length, wall or material wrong in the rig file, or the times not in seconds?"
    } else {
        return None;
    };
    let slips = slips(rig, &water, best.value, [lo, hi]);
    Some(format!(
        "the wave travels at {}, but a fit allows {lo:.0} to {hi:.0} m/s for the rig's pipe: {causes}{slips}",
        shown(best)
    ))
}

/// What would make the wave speed fit: another length, feet taken as metres among them, or walls of other materials.
fn slips(rig: &Rig, water: &WaterProperties, speed_m_s: f64, [lo, hi]: [f64; 2]) -> String {
    let [shortest, longest] = [lo, hi].map(|fits| significant(rig.length_m() * fits / speed_m_s, 3));
    let mut found = format!(" A length from {shortest} to {longest} m would fit.");
    let from_feet = FOOT_M * speed_m_s;
    if (lo..=hi).contains(&from_feet) {
        let length_m = rig.length_m();
        found += &format!(
            " If its length is {length_m} feet, which are {:.2} m, the wave travels at {from_feet:.0} m/s: that fits.",
            FOOT_M * length_m
        );
    }
    let fits = |m: &&Material| {
        rig.pipes.iter().all(|pipe| {
            let pipe = Pipe { material: m.name.to_owned(), poisson_ratio: None, ..pipe.clone() };
            let [lo, hi] = pipe.material_wave_speeds_m_s(water);
            (lo..=hi).contains(&speed_m_s)
        })
    };
    let names: Vec<&str> = MATERIALS.iter().filter(fits).map(|m| m.name).collect();
    if !names.is_empty() {
        found += &format!(" A wall of this size would fit if it were of {}.", names.join(", "));
    }
    found
}
