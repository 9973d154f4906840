//! Checks the samples of each sensor: complete, in range, dense enough, and physically possible.

use crate::number::significant;
use crate::rig::check::{ATMOSPHERE_PA, Finding, Level};
use crate::rig::{Coupling, Rig, Sensor, SensorKind, WaterProperties};
use crate::signal::check::track::{Front, SAMPLES_OF_A_FRONT, Track};

pub(crate) fn check_presence(sensor: &Sensor, tracks: &[Track<'_>]) -> Option<Finding> {
    let subject = format!("samples of '{}'", sensor.name);
    let Some(track) = tracks.iter().find(|t| t.sensor.name == sensor.name) else {
        let message = "the recording holds none";
        return Some(Finding::new(Level::Warning, subject, message, &[("samples", 0.0)]));
    };
    let gaps = &track.series.gaps;
    let lost_s: f64 = gaps.iter().map(|g| g.to_s - g.from_s).sum();
    let numbers = [("samples", track.series.value.len() as f64), ("gaps", gaps.len() as f64), ("lost_s", lost_s)];
    let message = format!("{} gaps, {lost_s:.3} s lost", gaps.len());
    (!gaps.is_empty()).then(|| Finding::new(Level::Warning, subject, message, &numbers))
}

/// Samples at the end of the range, or of the 16-bit counts: the sensor stopped following there.
pub(crate) fn check_saturation(rig: &Rig, track: &Track<'_>) -> Option<Finding> {
    let sensor = track.sensor;
    let ends = rig.ends(sensor);
    let value = &track.series.value;
    let at_end = value.iter().filter(|v| ends.reached_by(**v)).count();
    if at_end == 0 {
        return None;
    }
    let share = 100.0 * at_end as f64 / value.len() as f64;
    let shown = match sensor.range {
        Some([lo, hi]) => format!("the range of {lo} to {hi} {}", sensor.unit),
        None => "what its counts can hold".to_owned(),
    };
    let message = format!("{at_end} samples ({share:.2} %) at the end of {shown}: the true value went beyond");
    let numbers = [("samples", at_end as f64), ("percent", share)];
    Some(Finding::new(Level::Warning, format!("saturation of '{}'", sensor.name), message, &numbers))
}

/// The closure, and the travel time to the nearest other pressure sensor, must each take several samples.
pub(crate) fn check_sample_rate(
    rig: &Rig,
    front: &Front<'_>,
    all: &[Front<'_>],
    water: &WaterProperties,
) -> Option<Finding> {
    let sensor = front.track.sensor;
    let interval = front.track.interval_s()?;
    let closing = rig.valve.closing_time_s;
    let apart = |other: &Front<'_>| {
        travel_s(rig, rig.on_way_m(sensor.place()), rig.on_way_m(other.track.sensor.place()), water)
    };
    let nearest = all.iter().map(apart).filter(|t| *t > 0.0).min_by(f64::total_cmp);
    let shortest = nearest.map_or(closing, |t| t.min(closing));
    let samples = shortest / interval;
    let what = if shortest < closing { "the travel time to the next sensor" } else { "the closure" };
    let message = format!(
        "{} kHz: {samples:.0} samples over {what} ({} s){}",
        significant(1e-3 / interval, 4),
        significant(shortest, 3),
        if samples < SAMPLES_OF_A_FRONT { "; 10 or more are needed to locate a front" } else { "" }
    );
    let level = if samples < SAMPLES_OF_A_FRONT { Level::Warning } else { Level::Fine };
    let numbers = [("interval_s", interval), ("closing_time_s", closing), ("samples", samples)];
    Some(Finding::new(level, format!("sample rate of '{}'", sensor.name), message, &numbers))
}

/// Travel time of a wave between two positions, s, at the rig's wave speeds.
fn travel_s(rig: &Rig, a_m: f64, b_m: f64, water: &WaterProperties) -> f64 {
    let (from, to) = (a_m.min(b_m), a_m.max(b_m));
    let mut start = 0.0;
    let mut time = 0.0;
    for pipe in rig.way_pipes() {
        let end = start + pipe.length_m;
        time += (to.min(end) - from.max(start)).max(0.0) / pipe.wave_speed_start(water).0;
        start = end;
    }
    time
}

/// Water boils before its pressure falls below vapour pressure.
pub(crate) fn check_vapour(track: &Track<'_>, water: &WaterProperties) -> Option<Finding> {
    let sensor = track.sensor;
    if sensor.kind != SensorKind::Pressure || sensor.coupling == Coupling::Ac {
        return None;
    }
    let lowest = track.series.value.iter().copied().fold(f64::INFINITY, f64::min);
    let absolute = sensor.unit.to_si(lowest, water.density_kg_m3) + ATMOSPHERE_PA;
    let slack = sensor.unit.to_si(sensor.accuracy(lowest), water.density_kg_m3).abs() + 3e3;
    let below = water.vapour_pressure_pa - absolute;
    let (kpa, vapour) = (absolute * 1e-3, water.vapour_pressure_pa * 1e-3);
    let lowest_is = format!("{kpa:.1} kPa absolute at the lowest, vapour pressure is {vapour:.1} kPa");
    let (level, message) = if below > slack {
        (Level::Contradiction, format!("{lowest_is}: the sensor's zero is off, or it rings"))
    } else if below > -slack {
        (Level::Warning, format!("{lowest_is}: the column separates; expect vapour-cavity"))
    } else {
        return None;
    };
    let numbers = [("lowest_pa", absolute), ("vapour_pressure_pa", water.vapour_pressure_pa)];
    Some(Finding::new(level, format!("lowest pressure of '{}'", sensor.name), message, &numbers))
}
