//! Does a recording agree with its rig? What was measured is held against what the rig file says.

use crate::recording::{Recording, Series};
use crate::rig::check::{
    ATMOSPHERE_PA, Finding, Level, check_meter, flow_regime, friction_loss_m, judge_wave_speed, reynolds_number,
};
use crate::rig::{Coupling, Pipe, Rig, Sensor, SensorKind, WaterProperties};
use crate::units::GRAVITY_M_S2;

/// Share of the largest deviation from the steady pressure at which a front counts as arrived.
const ARRIVAL: f64 = 0.05;
/// A recording shows a closure when the pressure leaves its steady value by this many times its noise.
const SIGNAL_TO_NOISE: f64 = 10.0;
/// What a sensor may be off where its accuracy is not given: percent of its steady reading.
const DEFAULT_ACCURACY_PERCENT: f64 = 0.5;
/// A wave speed beyond those of the walls by this factor is no matter of their modulus.
const FAR_OFF: f64 = 1.3;
/// Samples that a closure and a travel from sensor to sensor should be seen in.
const SAMPLES_OF_A_FRONT: f64 = 10.0;

/// All findings on a recording under a rig, that of its own or another one. The findings on the rig alone come from
/// [`crate::rig::check::check`].
pub fn check_recording(rig: &Rig, recording: &Recording) -> Vec<Finding> {
    let mut findings = vec![compare_rigs(rig, &recording.rig)];
    let tracks = tracks(rig, recording);
    findings.extend(rig.sensors.iter().filter_map(|sensor| check_presence(sensor, &tracks)));
    findings.extend(tracks.iter().filter_map(check_saturation));

    let water = rig.fluid.properties(temperature_degc(rig, &tracks));
    let pressures: Vec<Front> =
        tracks.iter().filter(|t| t.sensor.kind == SensorKind::Pressure).map(Front::find).collect();
    let start_s = pressures.iter().filter_map(|f| f.arrival_s).min_by(f64::total_cmp);
    if start_s.is_none() && !pressures.is_empty() {
        let message = "no pressure sensor leaves its steady value: the recording shows no closure";
        findings.push(Finding::new(Level::Warning, "closure", message, &[]));
    }
    findings.extend(pressures.iter().filter_map(|front| check_sample_rate(rig, front, &pressures, &water)));
    findings.extend(tracks.iter().filter_map(|track| check_vapour(track, &water)));
    findings.extend(check_travel(rig, &pressures, &water));
    findings.extend(check_speeds(rig, recording, &water));
    for track in tracks.iter().filter(|t| t.sensor.kind == SensorKind::Flow) {
        findings.extend(check_flow(rig, track, start_s, &pressures, &water));
    }
    findings
}

/// A sensor with the samples that it recorded (at least one).
struct Track<'a> {
    sensor: &'a Sensor,
    series: &'a Series,
}

fn tracks<'a>(rig: &'a Rig, recording: &'a Recording) -> Vec<Track<'a>> {
    let recorded = |name: &str| recording.rig.sensors.iter().position(|s| s.name == name);
    let series = |sensor: &Sensor| recording.series.get(recorded(&sensor.name)?).filter(|s| !s.value.is_empty());
    rig.sensors.iter().filter_map(|sensor| Some(Track { sensor, series: series(sensor)? })).collect()
}

impl Track<'_> {
    /// Mean of the samples up to a time, or of all; `None` where there are none.
    fn mean_until(&self, end_s: Option<f64>) -> Option<f64> {
        let end = end_s.map_or(self.series.value.len(), |end| self.series.time_s.partition_point(|t| *t < end));
        // a sensor slower than the steady stretch is long: its first sample stands for it
        let values = self.series.value.get(..end.max(1))?;
        Some(values.iter().sum::<f64>() / values.len() as f64)
    }

    fn interval_s(&self) -> Option<f64> {
        let mut steps: Vec<f64> = self.series.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        median(&mut steps)
    }

    /// What the sensor may be off, in its unit.
    fn accuracy(&self, reading: f64) -> f64 {
        match (self.sensor.accuracy_percent_fs, self.sensor.range) {
            (Some(percent), Some([lo, hi])) => percent / 100.0 * (hi - lo),
            _ => DEFAULT_ACCURACY_PERCENT / 100.0 * reading.abs(),
        }
    }
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn temperature_degc(rig: &Rig, tracks: &[Track<'_>]) -> f64 {
    let thermometer = tracks.iter().find(|t| t.sensor.kind == SensorKind::Temperature);
    let mean = thermometer.and_then(|t| Some(t.sensor.unit.to_si(t.mean_until(None)?, 1000.0)));
    mean.filter(|t| (0.0..=100.0).contains(t)).unwrap_or(rig.fluid.temperature_degc)
}

/// The steady pressure of a sensor and the first wave that reaches it.
struct Front<'a> {
    track: &'a Track<'a>,
    /// Steady value, in the sensor's unit.
    steady: f64,
    /// Standard deviation of the noise, in the sensor's unit.
    noise: f64,
    /// Samples that the steady value rests on.
    steady_samples: usize,
    /// When the wave arrives; `None` without one.
    arrival_s: Option<f64>,
}

impl<'a> Front<'a> {
    fn find(track: &'a Track<'a>) -> Self {
        let value = &track.series.value;
        let first = value.len().min((value.len() / 50).max(20));
        let baseline = median(&mut value[..first].to_vec()).unwrap_or_default();
        // noise from successive differences: drift and the wave itself hardly enter their median
        let mut steps: Vec<f64> = value.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let noise = median(&mut steps).unwrap_or_default() / (0.6745 * std::f64::consts::SQRT_2);
        let swing = value.iter().map(|v| (v - baseline).abs()).fold(0.0, f64::max);
        // a pump's pulsation before the closure is no front
        let unrest = value.iter().take(first).map(|v| (v - baseline).abs()).fold(0.0, f64::max);
        let threshold = (ARRIVAL * swing).max(5.0 * noise).max(2.0 * unrest);
        let arrival = (swing > SIGNAL_TO_NOISE * noise && swing > threshold)
            .then(|| value.iter().position(|v| (v - baseline).abs() > threshold))
            .flatten();
        let before = arrival.unwrap_or(value.len()).max(1);
        let steady = value.iter().take(before).sum::<f64>() / before.min(value.len().max(1)) as f64;
        let arrival_s = arrival.and_then(|i| track.series.time_s.get(i).copied());
        Front { track, steady, noise, steady_samples: before, arrival_s }
    }

    /// Steady head above the datum and what it may be off, m; `None` for a sensor that sees no steady pressure.
    fn steady_head_m(&self, rig: &Rig, water: &WaterProperties) -> Option<(f64, f64)> {
        let sensor = self.track.sensor;
        if sensor.coupling == Coupling::Ac {
            return None;
        }
        let metres = |shown: f64| sensor.unit.to_si(shown, water.density_kg_m3) / (water.density_kg_m3 * GRAVITY_M_S2);
        let elevation = sensor.elevation_m.unwrap_or_else(|| rig.elevation_m(sensor.position_m));
        let random = 3.0 * self.noise / (self.steady_samples as f64).sqrt();
        Some((metres(self.steady) + elevation, metres(self.track.accuracy(self.steady) + random)))
    }
}

fn compare_rigs(given: &Rig, recorded: &Rig) -> Finding {
    let subject = "rig of the recording";
    if given.source == recorded.source {
        return Finding::new(Level::Fine, subject, "the same as the one given, to the letter", &[]);
    }
    let units = |rig: &Rig| rig.sensors.iter().map(|s| (s.name.clone(), s.unit.symbol)).collect::<Vec<_>>();
    let recorded_units = units(recorded);
    for (name, unit) in units(given) {
        if let Some((_, other)) = recorded_units.iter().find(|(n, u)| *n == name && *u != unit) {
            let message = format!("'{name}' is in {unit} in the rig given, its samples were recorded in {other}");
            return Finding::new(Level::Contradiction, subject, message, &[]);
        }
    }
    let differing: Vec<&str> = [
        ("fluid", given.fluid != recorded.fluid),
        ("pipe", format!("{:?}", given.pipes) != format!("{:?}", recorded.pipes)),
        ("upstream", given.upstream != recorded.upstream),
        ("downstream", given.valve != recorded.valve),
        ("sensor", format!("{:?}", given.sensors) != format!("{:?}", recorded.sensors)),
        ("device", given.devices != recorded.devices),
    ]
    .into_iter()
    .filter_map(|(table, differs)| differs.then_some(table))
    .collect();
    if differing.is_empty() {
        return Finding::new(Level::Fine, subject, "says the same as the one given, in other words", &[]);
    }
    let message = format!("differs from the one given in: {}; the one given is used here", differing.join(", "));
    Finding::new(Level::Warning, subject, message, &[])
}

fn check_presence(sensor: &Sensor, tracks: &[Track<'_>]) -> Option<Finding> {
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

/// Samples at the end of the range, or of the 16-bit counts, are where a sensor stopped following.
fn check_saturation(track: &Track<'_>) -> Option<Finding> {
    let sensor = track.sensor;
    let [lo, hi] = sensor.range?;
    let edge = 0.001 * (hi - lo);
    let value = &track.series.value;
    // a flow or a valve at rest at its zero is no saturation
    let low_counts = sensor.kind == SensorKind::Pressure || sensor.kind == SensorKind::Temperature;
    let at_end = value.iter().filter(|v| **v >= hi - edge || (low_counts && **v <= lo + edge)).count();
    if at_end == 0 {
        return None;
    }
    let share = 100.0 * at_end as f64 / value.len() as f64;
    let message = format!(
        "{at_end} samples ({share:.2} %) at the end of the range of {lo} to {hi} {}: the true value went beyond",
        sensor.unit
    );
    let numbers = [("samples", at_end as f64), ("percent", share)];
    Some(Finding::new(Level::Warning, format!("saturation of '{}'", sensor.name), message, &numbers))
}

/// The closure, and the way to the nearest other pressure sensor, must each take several samples.
fn check_sample_rate(rig: &Rig, front: &Front<'_>, all: &[Front<'_>], water: &WaterProperties) -> Option<Finding> {
    let sensor = front.track.sensor;
    let interval = front.track.interval_s()?;
    let closing = rig.valve.closing_time_s;
    let apart = |other: &Front<'_>| travel_s(rig, sensor.position_m, other.track.sensor.position_m, water);
    let nearest = all.iter().map(apart).filter(|t| *t > 0.0).min_by(f64::total_cmp);
    let shortest = nearest.map_or(closing, |t| t.min(closing));
    let samples = shortest / interval;
    let what = if shortest < closing { "the way to the next sensor" } else { "the closure" };
    let message = format!(
        "{:.4} kHz: {samples:.0} samples over {what} ({shortest:.4} s){}",
        1e-3 / interval,
        if samples < SAMPLES_OF_A_FRONT { "; 10 or more are wanted to place a front" } else { "" }
    );
    let level = if samples < SAMPLES_OF_A_FRONT { Level::Warning } else { Level::Fine };
    let numbers = [("interval_s", interval), ("closing_time_s", closing), ("samples", samples)];
    Some(Finding::new(level, format!("sample rate of '{}'", sensor.name), message, &numbers))
}

/// Time of a wave between two positions, s, at the rig's wave speeds.
fn travel_s(rig: &Rig, a_m: f64, b_m: f64, water: &WaterProperties) -> f64 {
    let (from, to) = (a_m.min(b_m), a_m.max(b_m));
    let mut start = 0.0;
    let mut time = 0.0;
    for pipe in &rig.pipes {
        let end = start + pipe.length_m;
        time += (to.min(end) - from.max(start)).max(0.0) / pipe.wave_speed_start(water).0;
        start = end;
    }
    time
}

/// Water boils before its pressure falls below that of its vapour.
fn check_vapour(track: &Track<'_>, water: &WaterProperties) -> Option<Finding> {
    let sensor = track.sensor;
    if sensor.kind != SensorKind::Pressure || sensor.coupling == Coupling::Ac {
        return None;
    }
    let lowest = track.series.value.iter().copied().fold(f64::INFINITY, f64::min);
    let absolute = sensor.unit.to_si(lowest, water.density_kg_m3) + ATMOSPHERE_PA;
    let slack = sensor.unit.to_si(track.accuracy(lowest), water.density_kg_m3).abs() + 3e3;
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

/// The speed of the first wave between neighbouring sensors of one pipe against that of its material.
fn check_travel(rig: &Rig, fronts: &[Front<'_>], water: &WaterProperties) -> Vec<Finding> {
    let mut arrived: Vec<(f64, f64, &Front<'_>)> =
        fronts.iter().filter_map(|f| Some((f.track.sensor.position_m, f.arrival_s?, f))).collect();
    arrived.sort_by(|a, b| b.0.total_cmp(&a.0));
    let pair = |w: &[(f64, f64, &Front<'_>)]| {
        let [(near_m, near_s, near), (far_m, far_s, far)] = w else { return None };
        let pipe = pipe_between(rig, *far_m, *near_m)?;
        let (apart_m, later_s) = (near_m - far_m, far_s - near_s);
        let names = format!("wave from '{}' to '{}'", near.track.sensor.name, far.track.sensor.name);
        let interval = near.track.interval_s()?.max(far.track.interval_s()?);
        if apart_m <= 0.0 || apart_m / pipe.wave_speed_start(water).0 < SAMPLES_OF_A_FRONT * interval {
            return None; // too near to each other to tell
        }
        if later_s <= interval {
            let message = format!(
                "arrives {:.4} s early, but it comes from the valve: sensors swapped, a clock off, or another source",
                -later_s
            );
            return Some(Finding::new(Level::Contradiction, names, message, &[("delay_s", later_s)]));
        }
        // each arrival is a sample uncertain, and the front has changed its shape on the way
        let slack = (2.0 * interval + 0.05 * rig.valve.closing_time_s) / later_s;
        Some(judge_wave_speed(pipe, names, apart_m / later_s, slack, water))
    };
    arrived.windows(2).filter_map(pair).collect()
}

/// The wave speed of the recording's features, mean over all pipes, against what their walls allow. Only what no gas, support or
/// slip of a diameter explains is a contradiction.
fn check_speeds(rig: &Rig, recording: &Recording, water: &WaterProperties) -> Vec<Finding> {
    let Some(features) = recording.clone().on_rig(rig.clone()).ok().and_then(|r| super::inspect(&r).ok()) else {
        return Vec::new();
    };
    // a wave speed that the rig file gives is known better than the material
    let mean = |end: usize, pick: fn(f64, f64) -> f64| {
        let speed = |p: &Pipe| p.material_wave_speeds_m_s(water)[end];
        let travel = |p: &Pipe| p.length_m / p.wave_speed_m_s.map_or(speed(p), |given| pick(speed(p), given));
        rig.length_m() / rig.pipes.iter().map(travel).sum::<f64>()
    };
    let (lo, hi) = (mean(0, f64::min), mean(1, f64::max));
    let crossings = features.wave_speed.crossings.map(|c| (c.value, c.standard_error));
    let arrival = features.wave_speed.arrival.map(|a| (a.value, a.standard_error));
    let judge = |(name, speed): (&str, Option<(f64, f64)>)| {
        let (value, error) = speed?;
        let (above, below) = (value > FAR_OFF * hi && value - error > hi, value < lo / FAR_OFF && value + error < lo);
        let message = format!(
            "{value:.0} ± {error:.0} m/s, where the walls allow {lo:.0}-{hi:.0} m/s: are the times in seconds, and length, wall and \
             material those of this pipe?"
        );
        let numbers = [("wave_speed_m_s", value), ("lo_m_s", lo), ("hi_m_s", hi)];
        (above || below).then(|| Finding::new(Level::Contradiction, format!("wave speed by {name}"), message, &numbers))
    };
    [("the period of the first peak", crossings), ("the arrival at two sensors", arrival)]
        .into_iter()
        .filter_map(judge)
        .collect()
}

fn pipe_between(rig: &Rig, from_m: f64, to_m: f64) -> Option<&Pipe> {
    let mut start = 0.0;
    rig.pipes.iter().find(|pipe| {
        let inside = from_m >= start - 1e-6 && to_m <= start + pipe.length_m + 1e-6;
        start += pipe.length_m;
        inside
    })
}

/// The steady flow: its regime, the meter's range, and the friction between pressure sensors that it asks for.
fn check_flow(
    rig: &Rig,
    track: &Track<'_>,
    start_s: Option<f64>,
    fronts: &[Front<'_>],
    water: &WaterProperties,
) -> Vec<Finding> {
    let name = &track.sensor.name;
    let Some(shown) = track.mean_until(start_s) else { return Vec::new() };
    let flow = track.sensor.unit.to_si(shown, water.density_kg_m3);
    let mut findings: Vec<Finding> =
        check_meter(track.sensor, format!("range of '{name}'"), shown).into_iter().collect();
    for pipe in &rig.pipes {
        let reynolds = reynolds_number(pipe, flow, water);
        let velocity = flow / pipe.area_m2();
        let level = if (2320.0..4000.0).contains(&reynolds.abs()) { Level::Warning } else { Level::Fine };
        let message = format!("Re {reynolds:.0} at {velocity:.3} m/s, {}", flow_regime(reynolds));
        let numbers = [("reynolds_number", reynolds), ("velocity_m_s", velocity)];
        findings.push(Finding::new(level, format!("flow in '{}' by '{name}'", pipe.name), message, &numbers));
    }
    let mut heads: Vec<(&Sensor, f64, f64)> =
        fronts.iter().filter_map(|f| f.steady_head_m(rig, water).map(|(h, off)| (f.track.sensor, h, off))).collect();
    heads.sort_by(|a, b| a.0.position_m.total_cmp(&b.0.position_m));
    if let [first, .., last] = &heads[..] {
        findings.push(check_loss(rig, *first, *last, flow, water));
    }
    findings
}

fn check_loss(
    rig: &Rig,
    (up, up_m, up_off): (&Sensor, f64, f64),
    (down, down_m, down_off): (&Sensor, f64, f64),
    flow: f64,
    water: &WaterProperties,
) -> Finding {
    let measured = up_m - down_m;
    let expected = friction_loss_m(rig, up.position_m, down.position_m, flow, water);
    // a percent of the diameter is five of the loss, bends and joints add theirs
    let slack = up_off + down_off + 0.15 * expected.abs();
    let off = measured - expected;
    let subject = format!("steady loss from '{}' to '{}'", up.name, down.name);
    let compared = format!(
        "{measured:.2} m measured, {expected:.2} m by wall friction; the sensors and the pipe's data allow for ±{slack:.2} m"
    );
    let (level, message) = if off.abs() <= slack {
        (Level::Fine, compared)
    } else if off.abs() <= 3.0 * slack {
        (Level::Warning, format!("{compared}: look at offsets, elevations and roughness"))
    } else {
        (
            Level::Contradiction,
            format!(
                "{compared}: a zero or gain, an elevation, the flow or the diameter is wrong, or a local loss lies between them"
            ),
        )
    };
    let numbers = [("measured_m", measured), ("expected_m", expected), ("allowed_m", slack)];
    Finding::new(level, subject, message, &numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Gap, RunInfo};

    const SPEED: f64 = 384.0;

    fn demo() -> Rig {
        Rig::from_toml(include_str!("../../tests/rigs/hdpe-63.toml"), "hdpe-63.toml").unwrap()
    }

    /// A steady flow of 6 m³/h with the friction that belongs to it; at 0.5 s a wave of 200 kPa leaves the valve.
    fn run(rig: &Rig) -> Recording {
        let water = rig.fluid.properties(18.0);
        let flow = 6.0 / 3600.0;
        let times: Vec<f64> = (0..4000).map(|i| f64::from(i) * 5e-4).collect();
        let value = |sensor: &Sensor, i: usize, t: f64| match sensor.kind {
            SensorKind::Pressure => {
                let loss_kpa = friction_loss_m(rig, 0.0, sensor.position_m, flow, &water) * 9.79;
                let ramp = ((t - 0.5 - (120.0 - sensor.position_m) / SPEED) / 0.08).clamp(0.0, 1.0);
                245.0 - loss_kpa + 200.0 * ramp + 0.05 * (i as f64 * 1.7).sin()
            }
            SensorKind::Flow => 6.0,
            SensorKind::Temperature => 18.0,
            SensorKind::Trigger | SensorKind::ValvePosition => f64::from(u8::from(t > 0.5)),
        };
        let series = |sensor: &Sensor| Series {
            value: times.iter().enumerate().map(|(i, t)| value(sensor, i, *t)).collect(),
            time_s: times.clone(),
            gaps: Vec::new(),
        };
        Recording { rig: rig.clone(), series: rig.sensors.iter().map(series).collect(), run: RunInfo::default() }
    }

    fn level(findings: &[Finding], subject: &str) -> Level {
        let found = findings.iter().find(|f| f.subject.starts_with(subject));
        found.unwrap_or_else(|| panic!("nothing on '{subject}' in {findings:#?}")).level
    }

    #[test]
    fn a_recording_that_fits_its_rig_is_fine_throughout() {
        let rig = demo();
        let findings = check_recording(&rig, &run(&rig));
        let not_fine: Vec<_> = findings.iter().filter(|f| f.level != Level::Fine).collect();
        assert!(not_fine.is_empty(), "{not_fine:#?}");
        let wave = findings.iter().find(|f| f.subject == "wave from 'P1' to 'P2'").unwrap();
        assert!((wave.numbers[0].1 / SPEED - 1.0).abs() < 0.01, "{wave:?}");
        assert_eq!(level(&findings, "steady loss from 'P3' to 'P1'"), Level::Fine);
        assert_eq!(level(&findings, "flow in 'main' by 'Q1'"), Level::Fine);
    }

    #[test]
    fn a_flow_that_the_meter_cannot_show_contradicts_its_range_and_the_loss() {
        let rig = demo();
        let mut recording = run(&rig);
        recording.series[3].value.fill(20.0);
        let findings = check_recording(&rig, &recording);
        assert_eq!(level(&findings, "range of 'Q1'"), Level::Contradiction);
        assert_eq!(level(&findings, "steady loss from 'P3' to 'P1'"), Level::Contradiction);
    }

    #[test]
    fn a_flow_between_laminar_and_turbulent_is_a_warning() {
        let rig = demo();
        let mut recording = run(&rig);
        recording.series[3].value.fill(0.4); // Re about 2600
        assert_eq!(level(&check_recording(&rig, &recording), "flow in 'main' by 'Q1'"), Level::Warning);
    }

    /// A closed valve that rings: a square wave of period 4L/a.
    #[test]
    fn times_in_milliseconds_contradict_the_wall() {
        let rig = demo();
        let mut recording = run(&rig);
        for (sensor, series) in rig.sensors.iter().zip(&mut recording.series) {
            if sensor.kind != SensorKind::Pressure {
                continue;
            }
            let front = |t: f64| (t / 0.02).clamp(0.0, 1.0);
            let (to, back) = ((120.0 - sensor.position_m) / SPEED, (120.0 + sensor.position_m) / SPEED);
            for (i, (t, v)) in series.time_s.iter().zip(&mut series.value).enumerate() {
                let since = t - 0.5;
                let echoes = |k: i32| {
                    let delay = f64::from(k) * 240.0 / SPEED;
                    let sign = if k % 2 == 0 { 200.0 } else { -200.0 };
                    sign * (front(since - to - delay) - front(since - back - delay))
                };
                *v = 245.0 + (0..4).map(echoes).sum::<f64>() + 0.05 * (i as f64 * 1.7).sin();
            }
        }
        let said = |recording: &Recording| {
            let findings = check_recording(&rig, recording);
            findings.into_iter().filter(|f| f.subject.starts_with("wave speed by")).collect::<Vec<_>>()
        };
        assert_eq!(said(&recording), []);
        recording.series.iter_mut().flat_map(|s| &mut s.time_s).for_each(|t| *t *= 1000.0);
        let found = said(&recording);
        assert_eq!(found.len(), 2, "{found:#?}");
        assert!(
            found.iter().all(|f| f.level == Level::Contradiction && f.message.contains("are the times in seconds"))
        );
    }

    #[test]
    fn swapped_sensors_are_noticed_by_the_wave_that_comes_too_early() {
        let rig = demo();
        let mut recording = run(&rig);
        recording.series.swap(0, 1);
        assert_eq!(level(&check_recording(&rig, &recording), "wave from 'P1' to 'P2'"), Level::Contradiction);
    }

    #[test]
    fn saturation_boiling_gaps_and_empty_columns_are_told() {
        let rig = demo();
        let mut recording = run(&rig);
        recording.series[0].value[3000] = 1000.0;
        recording.series[1].value[3000] = -180.0;
        recording.series[1].gaps.push(Gap { from_s: 1.0, to_s: 1.2, samples: Some(400) });
        recording.series[2] = Series::default();
        let findings = check_recording(&rig, &recording);
        assert_eq!(level(&findings, "saturation of 'P1'"), Level::Warning);
        assert_eq!(level(&findings, "lowest pressure of 'P2'"), Level::Contradiction, "below absolute vacuum");
        assert_eq!(level(&findings, "samples of 'P2'"), Level::Warning);
        assert_eq!(level(&findings, "samples of 'P3'"), Level::Warning);
        recording.series[1].value[3000] = -99.0;
        assert_eq!(level(&check_recording(&rig, &recording), "lowest pressure of 'P2'"), Level::Warning);
    }

    #[test]
    fn too_few_samples_for_a_front_and_a_recording_without_a_closure_are_told() {
        let rig = demo();
        let mut recording = run(&rig);
        for series in &mut recording.series {
            series.time_s = series.time_s.iter().step_by(40).copied().collect();
            series.value = series.value.iter().step_by(40).copied().collect();
        }
        assert_eq!(level(&check_recording(&rig, &recording), "sample rate of 'P1'"), Level::Warning);
        recording = run(&rig);
        for series in &mut recording.series[..3] {
            series.value.truncate(900);
            series.time_s.truncate(900);
        }
        assert_eq!(level(&check_recording(&rig, &recording), "closure"), Level::Warning);
    }

    #[test]
    fn a_rig_other_than_the_recorded_one_is_told() {
        let rig = demo();
        let recording = run(&rig);
        let text = |from: &str, to: &str| Rig::from_toml(&rig.source.replacen(from, to, 1), "x.toml").unwrap();
        let longer = text("length_m = 120.0", "length_m = 121.0");
        assert_eq!(level(&check_recording(&longer, &recording), "rig of the recording"), Level::Warning);
        let commented = text("[fluid]", "# tap\n[fluid]");
        assert_eq!(level(&check_recording(&commented, &recording), "rig of the recording"), Level::Fine);
        let bar = text("unit = \"kPa\"", "unit = \"bar\"");
        assert_eq!(level(&check_recording(&bar, &recording), "rig of the recording"), Level::Contradiction);
    }
}
