//! From a recording to its features.

use crate::recording::Recording;
use crate::rig::Rig;
use crate::signal::error::SignalError;
use crate::signal::features::{Estimate, Features, SensorFeatures, WaveSpeeds};
use crate::signal::front::NoFront;
use crate::signal::spectrum::Spectrum;
use crate::signal::station::{Station, clear_stations, stations};
use crate::signal::trace::Trace;
use crate::signal::wavespeed::ThereAndBack;
use crate::signal::{closure, extrema, levels, onset, wavespeed};

/// A slow closure leaves an oscillation with sharp tops; what is sharp in it, as a share of its period. Chosen.
const SHARP: f64 = 0.2;

/// Finds everything that a recording shows without a model.
pub fn inspect(recording: &Recording) -> Result<Features, SignalError> {
    let temperature_degc = levels::temperature_degc(recording);
    inspect_stations(recording, &stations(recording, temperature_degc), temperature_degc)
}

/// The same of stations at hand.
pub(crate) fn inspect_stations(
    recording: &Recording,
    stations: &[Station],
    temperature_degc: f64,
) -> Result<Features, SignalError> {
    let rig = &recording.rig;
    if stations.is_empty() {
        return Err(SignalError::NoPressure { sensors: rig.pressure_sensors().count() });
    }
    let clear = clear_stations(stations);
    let Some(&reference) = clear.first() else { return Err(why_none(rig, stations)) };
    let Ok(front) = &reference.front else { return Err(why_none(rig, stations)) };

    let length_m = rig.length_m();
    let guess_s = reference.period_s();
    let water = rig.fluid.properties(temperature_degc);
    let cycle_m = rig.cycle_m(&water);
    // Where pipes branch, what comes back first comes from a branch, and the period is that of no line: only the
    // arrival at two sensors tells a speed.
    let branches = rig.graph.lines.len() > 1;
    let of_cycle = guess_s.map(|t| Estimate { value: cycle_m / t, standard_error: f64::NAN });
    let nominal = Estimate { value: rig.wave_speed_start(&water).0, standard_error: f64::NAN };
    let about = if branches { Some(nominal) } else { of_cycle };
    let ThereAndBack { crossings, smear, slow } =
        wavespeed::there_and_back(&clear, length_m, about, rig.pipes.len() > 1);
    let (crossings, slow) = if branches { (None, false) } else { (crossings, slow) };
    let arrival = wavespeed::arrival(&clear, smear, about.map(|a| a.value)).filter(|_| !slow);
    let step_s = reference.coarse.step_s;
    // without a match the half fall is the next best measure of 2L/a
    let rough = 2.0 * reference.place_m / ((front.half_fall - front.onset) * step_s).max(step_s);
    let speed = crossings.map(|c| c.value).or(arrival.map(|a| a.value)).or(about.map(|a| a.value)).unwrap_or(rough);
    let speed_error = crossings.map_or(0.3, |c| c.standard_error / c.value).max(0.005);
    let from_valve_s = (length_m - reference.place_m).max(0.0) / speed;

    let (bend, bend_error) = onset::bend(&reference.coarse, front, reference.coarse_sd_m)
        .unwrap_or((front.onset, (0.1 * front.rise).max(1.0)));
    let onset = Estimate {
        value: reference.coarse.time_s(bend) - from_valve_s,
        standard_error: (bend_error * step_s).hypot(speed_error * from_valve_s),
    };
    let back = 2.0 * reference.place_m / speed / step_s;
    // behind a joint the head is no mirror image of itself
    let shut = if slow && rig.pipes.len() == 1 { closure::shut(reference) } else { None };
    let end = shut.or((!slow).then(|| front.knee(&reference.coarse, back)));
    let closed_s = end.map(|at| reference.coarse.time_s(at) - from_valve_s);
    let closure = closure::closure(recording, onset, slow, closed_s);

    let guess_s = guess_s.unwrap_or(cycle_m / speed);
    // the rise of a slow closure is no half cycle: the oscillation begins when it ends
    let free_s = shut.map_or(onset.value, |at| reference.coarse.time_s(at));
    let cycles = extrema::half_cycles(&reference.trace, free_s, guess_s, reference.noise.white_sd_m);
    let period = extrema::period(&cycles);
    let period_s = period.map_or(guess_s, |p| p.value);
    let of_period = period.map(|t| {
        let value = cycle_m / t.value;
        Estimate { value, standard_error: value * t.standard_error / t.value }
    });
    let of_period = of_period.filter(|_| !branches);

    let fundamental_hz = period.and_then(|t| fundamental_hz(&reference.trace, free_s, t.value));

    let flow_m3_s = levels::flow_m3_s(recording, closure.start_s.min(onset.value));
    let area = rig.pipe_at_valve().area_m2();
    let steady_velocity_m_s = flow_m3_s
        .map(|q| Estimate { value: q.value / area, standard_error: q.standard_error / area })
        .filter(|v| v.value.is_finite());
    let joukowsky =
        steady_velocity_m_s.filter(|_| !slow).and_then(|v| wavespeed::joukowsky(reference, speed, v, smear));

    let sharp_s = (front.rise * step_s).min(SHARP * period_s);
    let mut sensors: Vec<SensorFeatures> = stations
        .iter()
        .map(|station| sensor_features(recording, station, &cycles, onset.value, period_s, sharp_s))
        .collect();
    same_cycles(&mut sensors, &clear, sharp_s);
    let reference = stations.iter().position(|s| s.sensor == reference.sensor).unwrap_or(0);
    Ok(Features {
        closure,
        temperature_degc,
        flow_m3_s,
        steady_velocity_m_s,
        damping_per_cycle: sensors[reference].damping_per_cycle.clone(),
        sensors,
        reference,
        period,
        fundamental_hz,
        wave_speed: WaveSpeeds { joukowsky, crossings, arrival, period: of_period },
    })
}

/// Periods that are looked at for the spectrum: of what decays, later ones hold only noise and slow changes.
const SPECTRUM_PERIODS: f64 = 10.0;

/// Where the spectrum of a free oscillation of about this period peaks, Hz.
fn fundamental_hz(trace: &Trace, from_s: f64, period_s: f64) -> Option<f64> {
    let inside = trace.index(from_s)..trace.index(from_s + SPECTRUM_PERIODS * period_s);
    let head_m = trace.head_m.get(inside)?;
    let time_s: Vec<f64> = (0..head_m.len()).map(|i| i as f64 * trace.step_s).collect();
    let lowest_hz = 0.5 / period_s;
    Spectrum::of(&time_s, head_m)?.peak_hz(lowest_hz, 0.5 / trace.step_s)
}

fn why_none(rig: &Rig, stations: &[Station]) -> SignalError {
    let short = stations.iter().find(|s| matches!(s.front, Err(NoFront::NoReturn)));
    let station = short.or_else(|| stations.iter().max_by(|a, b| a.place_m.total_cmp(&b.place_m)));
    let Some(station) = station else { return SignalError::NoPressure { sensors: 0 } };
    let head = &station.trace.head_m;
    let lowest = head.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = head.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sensor = rig.sensors[station.sensor].name.clone();
    if short.is_some() {
        let risen = head.iter().position(|h| *h > 0.5 * (lowest + highest)).unwrap_or(0);
        return SignalError::TooShort { sensor, left_s: (head.len() - risen) as f64 * station.trace.step_s };
    }
    let duration_s = station.trace.len() as f64 * station.trace.step_s;
    SignalError::NoClosure { sensor, duration_s, swing_m: highest - lowest }
}

fn sensor_features(
    recording: &Recording,
    station: &Station,
    cycles: &extrema::HalfCycles,
    start_s: f64,
    period_s: f64,
    sharp_s: f64,
) -> SensorFeatures {
    let place = &recording.rig.sensors[station.sensor];
    let Station { trace, noise, .. } = station;
    let front_arrival_s = station.front.as_ref().ok().map(|front| {
        let (at, error) = onset::bend(&station.coarse, front, station.coarse_sd_m)
            .unwrap_or((front.onset, (0.1 * front.rise).max(1.0)));
        Estimate { value: station.coarse.time_s(at), standard_error: error * station.coarse.step_s }
    });
    let lead = match &station.front {
        Ok(_) => station.lead.clone(),
        Err(_) => 0..trace.index(start_s),
    };
    let base_m = station.front.as_ref().map_or(trace.head_m[0], |f| f.base_m);
    let newest = (5.0f64.max(2.0 * period_s) / trace.step_s) as usize;
    let extrema = extrema::extrema(trace, cycles, start_s, half_width(trace.step_s, sharp_s));
    // A front that lies in a gap is sought behind it, and so is its return. A gap in a steady stretch, with one head on
    // both sides, hides none, nor does one that is short against the period.
    let missing_at_front_s = front_arrival_s.and_then(|front| {
        let at = trace.index(front.value);
        let hides = |[from, to]: &[usize; 2]| {
            let jump_m = trace.head_m[(to + 1).min(trace.len() - 1)] - trace.head_m[from.saturating_sub(1)];
            let is_steady = *to < at && jump_m.abs() < JUMP * noise.white_sd_m;
            let is_short = ((to - from) as f64) * trace.step_s < SHORT * period_s;
            !is_steady && !is_short
        };
        let near = trace.index(front.value - period_s)..trace.index(front.value + 0.5 * period_s + trace.step_s);
        let gaps = trace.bridged(near).into_iter().filter(hides);
        gaps.max_by_key(|[from, to]| to - from).map(|gap| gap.map(|i| trace.time_s(i as f64)))
    });
    SensorFeatures {
        sensor: station.sensor,
        name: place.name.clone(),
        position_m: place.position_m,
        samples: recording.series[station.sensor].time_s.len(),
        interval_s: trace.step_s,
        begin_s: trace.time_s(0.0),
        end_s: trace.time_s((trace.len() - 1) as f64),
        noise: noise.clone(),
        steady_before_m: levels::before(&trace.head_m[lead], base_m, newest, noise),
        steady_after_m: levels::after(trace, start_s, period_s, noise),
        front_arrival_s,
        missing_at_front_s,
        first_peak: extrema.first().copied().filter(|e| e.peak),
        damping_per_cycle: Vec::new(),
        extrema,
    }
}

/// Two samples of one steady head differ by less than so many times their noise.
const JUMP: f64 = 6.0;
/// A gap of a smaller share of the period moves no front by more than what is known of it.
const SHORT: f64 = 0.01;

/// Samples on either side over which extrema are smoothed: a tenth of the sharpest that there is.
fn half_width(step_s: f64, sharp_s: f64) -> usize {
    ((0.1 * sharp_s / step_s) as usize).min(200)
}

/// Leaves each sensor the half cycles whose extrema stand out from the noise at all that have a clear front; a sensor
/// without one, as at the supply, keeps its own.
fn same_cycles(sensors: &mut [SensorFeatures], clear: &[&Station], sharp_s: f64) {
    let resolved = |s: &SensorFeatures| {
        let averaged = 2 * half_width(s.interval_s, sharp_s) + 1;
        extrema::resolved(&s.extrema, 4.0 * s.noise.white_sd_m / (averaged as f64).sqrt())
    };
    let is_clear = |s: &&SensorFeatures| clear.iter().any(|c| c.sensor == s.sensor);
    let common = sensors.iter().filter(is_clear).map(&resolved).min().unwrap_or(0);
    for sensor in sensors {
        let own = resolved(sensor).min(common);
        sensor.extrema.retain(|e| e.half_cycle() < own);
        sensor.damping_per_cycle = extrema::damping(&sensor.extrema);
    }
}
