//! A pressure sensor with its trace, noise and first front, from which all features are read.

use crate::recording::Recording;
use crate::rig::{Rig, SensorKind};
use crate::signal::front;
use crate::signal::front::{Front, NoFront};
use crate::signal::levels::finite;
use crate::signal::noise::{Noise, noise, white_sd_of_whole};
use crate::signal::period::{Repeats, repeats};
use crate::signal::trace::Trace;
use crate::units::GRAVITY_M_S2;

/// Points that a front needs, and the oscillation after it; more only cost time, so they are averaged.
const POINTS_A_FRONT: f64 = 40.0;

/// A pressure sensor that recorded something.
#[derive(Debug, Clone)]
pub(crate) struct Station {
    /// Index among the rig's sensors.
    pub sensor: usize,
    /// Distance from the supply, m, each pipe counted by its nominal travel time (the real distance in a single pipe).
    pub place_m: f64,
    /// The record.
    pub trace: Trace,
    /// The trace averaged down to the points that its front needs.
    pub coarse: Trace,
    /// The first front in `coarse`.
    pub front: Result<Front, NoFront>,
    /// How the record repeats itself after the top of its first peak, in samples of `trace`.
    pub repeats: Option<Repeats>,
    /// The sensor's noise.
    pub noise: Noise,
    /// Standard deviation of the white noise of `coarse`, m.
    pub coarse_sd_m: f64,
    /// Range of samples of `trace` before the front.
    pub lead: std::ops::Range<usize>,
}

impl Station {
    pub fn new(sensor: usize, place_m: f64, trace: Trace) -> Station {
        let rough_sd_m = white_sd_of_whole(&trace.head_m);
        let found = |factor: usize| {
            let coarse = trace.decimated(factor);
            // averaging leaves more of coloured noise than of white noise
            let sd_m = (rough_sd_m / (factor as f64).sqrt()).max(white_sd_of_whole(&coarse.head_m));
            let front = front::find(&coarse, sd_m);
            (factor, coarse, front)
        };
        // averaging the noise reveals a slow front in loud noise
        let whole = found(1);
        let loud = !matches!(whole.2, Ok(_) | Err(NoFront::NoReturn)) && trace.len() > 64 * 50;
        let seen = if loud { [8, 64].into_iter().map(found).find(|f| f.2.is_ok()).unwrap_or(whole) } else { whole };
        let samples = |points: f64| points * seen.0 as f64;
        let rise = seen.2.as_ref().map_or(0.0, |f| samples(f.rise));
        let repeats =
            seen.2.as_ref().ok().and_then(|f| repeats(&trace.head_m[(samples(f.top) as usize).min(trace.len())..]));
        let shortest = repeats.map_or(rise, |r| rise.min(r.period));
        let fitting = ((shortest / POINTS_A_FRONT) as usize).max(1);
        let (factor, coarse, front) =
            if fitting == seen.0 { seen } else { Some(found(fitting)).filter(|f| f.2.is_ok()).unwrap_or(seen) };
        let lead = front.as_ref().map_or(0..0, |f| f.quiet.start * factor..(f.quiet.end * factor).min(trace.len()));
        let noise = noise(&trace.head_m[lead.clone()], &trace.head_m, trace.step_s);
        let coarse_sd_m = noise.white_sd_m / (factor as f64).sqrt();
        Station { sensor, place_m, trace, coarse, front, repeats, noise, coarse_sd_m, lead }
    }

    /// The period of its oscillation, s.
    pub fn period_s(&self) -> Option<f64> {
        self.repeats.map(|r| r.period * self.trace.step_s)
    }

    /// The trace on the grid of another one, for matching; the index shift is `shift` grid points.
    pub fn on_grid_of(&self, other: &Trace) -> Option<(Trace, f64)> {
        let own = &self.coarse;
        if (own.step_s / other.step_s - 1.0).abs() < 1e-9 {
            return Some((own.clone(), (own.start_s - other.start_s) / other.step_s));
        }
        let time: Vec<f64> = (0..own.len()).map(|i| own.time_s(i as f64)).collect();
        let count = ((own.len() - 1) as f64 * own.step_s / other.step_s) as usize + 1;
        let mut left = 0;
        let (mut times, mut heads) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for i in 0..count {
            let t = own.start_s + i as f64 * other.step_s;
            while left + 2 < time.len() && time[left + 1] <= t {
                left += 1;
            }
            if !own.intact(left..left + 2) {
                continue;
            }
            let part = (t - time[left]) / own.step_s;
            times.push(t);
            heads.push(own.head_m[left] + part * (own.head_m[left + 1] - own.head_m[left]));
        }
        let trace = Trace::new(&times, &heads)?;
        let shift = (trace.start_s - other.start_s) / other.step_s;
        Some((trace, shift))
    }
}

/// Times (s, the recording's clock) and piezometric heads (m: gauge pressure over ρg at the run's temperature, plus the
/// sensor's elevation) of a pressure sensor, finite samples only. Empty for any other sensor.
pub fn heads(recording: &Recording, sensor: usize, temperature_degc: f64) -> (Vec<f64>, Vec<f64>) {
    let rig = &recording.rig;
    let (Some(place), Some(series)) = (rig.sensors.get(sensor), recording.series.get(sensor)) else {
        return (Vec::new(), Vec::new());
    };
    if place.kind != SensorKind::Pressure {
        return (Vec::new(), Vec::new());
    }
    let density = rig.fluid.properties(temperature_degc).density_kg_m3;
    let elevation_m = rig.sensor_elevation_m(place);
    finite(series).map(|(t, v)| (t, place.unit.to_si(v, density) / (density * GRAVITY_M_S2) + elevation_m)).unzip()
}

/// Every pressure sensor that recorded something, in the rig's order.
pub(crate) fn stations(recording: &Recording, temperature_degc: f64) -> Vec<Station> {
    let pressure = recording.rig.pressure_sensors();
    pressure
        .filter_map(|(sensor, place)| {
            let (time_s, head_m) = heads(recording, sensor, temperature_degc);
            let trace = Trace::new(&time_s, &head_m)?;
            Some(Station::new(
                sensor,
                travel_place_m(&recording.rig, recording.rig.on_way_m(place.place()), temperature_degc),
                trace,
            ))
        })
        .collect()
}

/// Distance from the supply in a pipe of uniform wave speed and equal length with the same travel time. In several
/// pipes the nominal wave speeds share out the time.
fn travel_place_m(rig: &Rig, position_m: f64, temperature_degc: f64) -> f64 {
    if rig.pipes.len() < 2 {
        return position_m;
    }
    let water = rig.fluid.properties(temperature_degc);
    let (mut start, mut to_place, mut whole) = (0.0, 0.0, 0.0);
    for pipe in rig.way_pipes() {
        let speed = pipe.wave_speed_start(&water).0;
        to_place += (position_m - start).clamp(0.0, pipe.length_m) / speed;
        whole += pipe.length_m / speed;
        start += pipe.length_m;
    }
    rig.length_m() * to_place / whole
}

/// The stations with a clear front, from the valve to the supply.
pub(crate) fn clear_stations(stations: &[Station]) -> Vec<&Station> {
    let height = |s: &Station| s.front.as_ref().map_or(0.0, |f| f.height_m());
    let highest = stations.iter().map(height).fold(0.0, f64::max);
    let mut clear: Vec<&Station> =
        stations.iter().filter(|s| s.place_m > 0.0 && s.front.is_ok() && height(s) > 0.1 * highest).collect();
    clear.sort_by(|a, b| b.place_m.total_cmp(&a.place_m));
    clear
}
