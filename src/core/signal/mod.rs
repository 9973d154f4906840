//! From a recording to its features, without a model of the run: noise, steady levels, closure, extrema, period, damping and
//! the wave speed in three ways, each with its uncertainty. Heads are metres of the fluid column, g = 9.81 m/s².
//!
//! | file | what it finds |
//! | --- | --- |
//! | `trace` | the head on an even grid, gaps marked |
//! | `noise` | white and coloured noise, the converter's step |
//! | `front` | the first rise and fall of a sensor |
//! | `onset`, `closure` | when the closure starts and ends |
//! | `levels` | head before and after, flow, temperature |
//! | `matching`, `wavespeed` | delays between fronts, and the wave speed they give |
//! | `between` | the same front in two recordings |
//! | `extrema` | half cycles, period, damping |
//! | [`oscillation`](mod@oscillation) | the same of a head known without noise |
//! | [`spectrum`] | amplitude over frequency of a trace |
//! | [`check`] | does a recording agree with its rig |
//! | [`doubts`](mod@doubts) | numbers that cannot all be right, before a fit |

pub(crate) mod between;
pub mod check;
pub(crate) mod closure;
pub mod doubts;
pub(crate) mod extrema;
pub(crate) mod front;
pub mod harmonics;
pub(crate) mod levels;
pub(crate) mod matching;
pub(crate) mod noise;
pub(crate) mod onset;
pub mod oscillation;
pub(crate) mod project;
pub mod spectrum;
pub(crate) mod station;
#[cfg(test)]
pub(crate) mod testing;
pub(crate) mod trace;
pub(crate) mod wavespeed;

use crate::recording::Recording;
use crate::rig::{Rig, SensorKind};
pub use crate::signal::between::{FrontPair, front_pairs};
use crate::signal::front::NoFront;
pub use crate::signal::noise::Noise;
use crate::signal::station::Station;
use crate::signal::trace::Trace;
use crate::units::GRAVITY_M_S2;

/// A value with its standard error, in the same unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
}

/// What a recording shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    /// When the valve closed.
    pub closure: Closure,
    /// Temperature of the run, °C: its sensor's, or the rig file's.
    pub temperature_degc: f64,
    /// Flow before the closure, m³/s, where a flow sensor recorded it.
    pub flow_m3_s: Option<Estimate>,
    /// The same as velocity in the pipe at the valve, m/s.
    pub steady_velocity_m_s: Option<Estimate>,
    /// Each pressure sensor that recorded something, in the rig's order.
    pub sensors: Vec<SensorFeatures>,
    /// Index in `sensors` of the one nearest to the valve with a clear front: the closure, period and damping are read there.
    pub reference: usize,
    /// Period of the oscillation, s (4L/a, lengthened by creep, gas and unsteady friction).
    pub period: Option<Estimate>,
    /// Natural logarithm of how much the swing shrinks each cycle, at the reference sensor.
    pub damping_per_cycle: Vec<f64>,
    /// The wave speed in three ways.
    pub wave_speed: WaveSpeeds,
}

/// The valve's closure. Times are on the recording's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closure {
    /// Its start, s.
    pub start_s: f64,
    /// Standard error of the start, s.
    pub start_se_s: f64,
    /// Its end as seen, s: the valve position's, or the end of the first rise; none where the closure is slower than 2L/a.
    pub end_s: Option<f64>,
    /// The start comes from a trigger channel.
    pub from_trigger: bool,
    /// Where the pressure starts to rise at the valve, s.
    pub pressure_onset_s: f64,
}

/// What one pressure sensor shows.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorFeatures {
    /// Index among the rig's sensors.
    pub sensor: usize,
    /// Its name.
    pub name: String,
    /// Distance from the supply, m.
    pub position_m: f64,
    /// Number of samples recorded.
    pub samples: usize,
    /// Median sample interval, s.
    pub interval_s: f64,
    /// Time of its last sample, s.
    pub end_s: f64,
    /// Its noise, in m.
    pub noise: Noise,
    /// Head before the closure, m.
    pub steady_before_m: Estimate,
    /// Head over the last whole period of the record, m; none before two periods.
    pub steady_after_m: Option<Estimate>,
    /// When the front arrives, s; none where there is none (a sensor at the supply).
    pub front_arrival_s: Option<Estimate>,
    /// The first peak.
    pub first_peak: Option<Extremum>,
    /// All peaks and troughs in turn, until they drown in noise.
    pub extrema: Vec<Extremum>,
    /// Natural logarithm of how much the swing shrinks each cycle.
    pub damping_per_cycle: Vec<f64>,
}

/// A peak or a trough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremum {
    /// When, s on the recording's clock.
    pub time_s: f64,
    /// Head, m, lightly smoothed.
    pub head_m: f64,
    /// A peak rather than a trough.
    pub peak: bool,
    /// Cycle from 1.
    pub cycle: usize,
}

/// The wave speed in three ways, m/s; of several pipes, the mean one (length by travel time).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaveSpeeds {
    /// From the first rise over the velocity before; needs a flow sensor and a closure faster than 2L/a.
    pub joukowsky: Option<Estimate>,
    /// From the times before and after the first peak.
    pub crossings: Option<Crossings>,
    /// From the front's arrival at two sensors.
    pub arrival: Option<Estimate>,
}

/// The wave speed from the times before and after the first peak, m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossings {
    /// Best value: the falling front laid over the rising one.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Lowest value that another level or window gives.
    pub low: f64,
    /// Highest value that another level or window gives.
    pub high: f64,
    /// The closure takes longer than the wave's return to the sensor (2L/a at the valve), or nearly: the fall starts within the
    /// rise.
    pub slow_closure: bool,
}

impl WaveSpeeds {
    /// The best of them for a start: crossings, else arrival, else Joukowsky.
    pub fn best(&self) -> Option<Estimate> {
        let crossings = self.crossings.map(|c| Estimate { value: c.value, standard_error: c.standard_error });
        crossings.or(self.arrival).or(self.joukowsky)
    }
}

/// Why a recording has no features.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalError {
    /// No pressure sensor recorded anything.
    #[error(
        "no pressure sensor recorded at least eight samples in a row of times (the rig has {sensors} pressure sensors); \
         check the sensors' names and wiring in the rig file"
    )]
    NoPressure {
        /// Pressure sensors of the rig.
        sensors: usize,
    },
    /// Nothing happens.
    #[error(
        "no closure in this recording: over {duration_s:.3} s the head at {sensor} moves by {swing_m:.3} m only, within its \
         noise; record again with the valve closing while the recording runs"
    )]
    NoClosure {
        /// The sensor nearest to the valve.
        sensor: String,
        /// Duration, s.
        duration_s: f64,
        /// Highest minus lowest head, m.
        swing_m: f64,
    },
    /// The record ends before the wave comes back.
    #[error(
        "the recording is too short: after the head at {sensor} rises, {left_s:.3} s are left, in which it does not fall back; \
         record at least two periods (8L/a) after the closure"
    )]
    TooShort {
        /// The sensor nearest to the valve.
        sensor: String,
        /// Time from the rise to the end, s.
        left_s: f64,
    },
}

/// Finds everything that a recording shows without a model.
pub fn inspect(recording: &Recording) -> Result<Features, SignalError> {
    let rig = &recording.rig;
    let temperature_degc = crate::signal::levels::temperature_degc(recording);
    let stations = stations(recording, temperature_degc);
    if stations.is_empty() {
        return Err(SignalError::NoPressure { sensors: rig.pressure_sensors().count() });
    }
    let clear = clear_stations(&stations);
    let Some(&reference) = clear.first() else { return Err(why_none(rig, &stations)) };
    let Ok(front) = &reference.front else { return Err(why_none(rig, &stations)) };

    let (crossings, smear) = crate::signal::wavespeed::crossings(&clear, rig.length_m()).unzip();
    let smear = smear.unwrap_or(0.0);
    let crossings =
        crossings.map(|found| crate::signal::wavespeed::held_against_period(found, reference, rig.length_m()));
    let slow = crossings.is_none_or(|c| c.slow_closure);
    let arrival = crate::signal::wavespeed::arrival(&clear, smear);
    let step_s = reference.coarse.step_s;
    // without a match the half fall is the next best measure of 2L/a
    let rough = 2.0 * reference.place_m / ((front.half_fall - front.onset) * step_s).max(step_s);
    let speed = crossings.map(|c| c.value).or(arrival.map(|a| a.value)).unwrap_or(rough);
    let speed_error = crossings.map_or(0.3, |c| c.standard_error / c.value).max(0.005);
    let from_valve_s = (rig.length_m() - reference.place_m).max(0.0) / speed;

    let (bend, bend_error) = crate::signal::onset::bend(&reference.coarse, front, reference.coarse_sd_m)
        .unwrap_or((front.onset, (0.1 * front.rise).max(1.0)));
    let onset = Estimate {
        value: reference.coarse.time_s(bend) - from_valve_s,
        standard_error: (bend_error * step_s).hypot(speed_error * from_valve_s),
    };
    let back = 2.0 * reference.place_m / speed / step_s;
    let end_s = reference.coarse.time_s(front.knee(&reference.coarse, back)) - from_valve_s;
    let closure = crate::signal::closure::closure(recording, onset, (!slow).then_some(end_s));

    let guess_s = 4.0 * rig.length_m() / speed;
    let cycles =
        crate::signal::extrema::half_cycles(&reference.trace, onset.value, guess_s, reference.noise.white_sd_m);
    let period = crate::signal::extrema::period(&cycles);
    let period_s = period.map_or(guess_s, |p| p.value);

    let flow_m3_s = crate::signal::levels::flow_m3_s(recording, closure.start_s.min(onset.value));
    let area = rig.pipes.last().map_or(f64::NAN, |p| p.area_m2());
    let steady_velocity_m_s = flow_m3_s
        .map(|q| Estimate { value: q.value / area, standard_error: q.standard_error / area })
        .filter(|v| v.value.is_finite());
    let joukowsky = steady_velocity_m_s
        .filter(|_| !slow)
        .and_then(|v| crate::signal::wavespeed::joukowsky(reference, speed, v, smear));

    let sensors: Vec<SensorFeatures> = stations
        .iter()
        .map(|station| sensor_features(recording, station, &cycles, onset.value, period_s, front.rise * step_s))
        .collect();
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
        wave_speed: WaveSpeeds { joukowsky, crossings, arrival },
    })
}

/// Times (s, the recording's clock) and piezometric heads (m: gauge pressure over ρg at the run's temperature, plus the
/// sensor's elevation) of a pressure sensor, without samples that are no numbers. Empty for any other sensor.
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
    crate::signal::levels::finite(series)
        .map(|(t, v)| (t, place.unit.to_si(v, density) / (density * GRAVITY_M_S2) + elevation_m))
        .unzip()
}

/// Every pressure sensor that recorded something, in the rig's order.
fn stations(recording: &Recording, temperature_degc: f64) -> Vec<Station> {
    let pressure = recording.rig.pressure_sensors();
    pressure
        .filter_map(|(sensor, place)| {
            let (time_s, head_m) = heads(recording, sensor, temperature_degc);
            let trace = Trace::new(&time_s, &head_m)?;
            Some(Station::new(sensor, travel_place_m(&recording.rig, place.position_m, temperature_degc), trace))
        })
        .collect()
}

/// Distance from the supply in a pipe of one wave speed and the same length that takes the wave as long: of several
/// pipes the nominal wave speeds say how the time is shared out.
fn travel_place_m(rig: &Rig, position_m: f64, temperature_degc: f64) -> f64 {
    if rig.pipes.len() < 2 {
        return position_m;
    }
    let water = rig.fluid.properties(temperature_degc);
    let (mut start, mut to_place, mut whole) = (0.0, 0.0, 0.0);
    for pipe in &rig.pipes {
        let speed = pipe.wave_speed_start(&water).0;
        to_place += (position_m - start).clamp(0.0, pipe.length_m) / speed;
        whole += pipe.length_m / speed;
        start += pipe.length_m;
    }
    rig.length_m() * to_place / whole
}

/// The stations with a clear front, from the valve to the supply.
fn clear_stations(stations: &[Station]) -> Vec<&Station> {
    let height = |s: &Station| s.front.as_ref().map_or(0.0, |f| f.height_m());
    let highest = stations.iter().map(height).fold(0.0, f64::max);
    let mut clear: Vec<&Station> =
        stations.iter().filter(|s| s.place_m > 0.0 && s.front.is_ok() && height(s) > 0.1 * highest).collect();
    clear.sort_by(|a, b| b.place_m.total_cmp(&a.place_m));
    clear
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
    cycles: &crate::signal::extrema::HalfCycles,
    start_s: f64,
    period_s: f64,
    rise_s: f64,
) -> SensorFeatures {
    let place = &recording.rig.sensors[station.sensor];
    let Station { trace, noise, .. } = station;
    let front_arrival_s = station.front.as_ref().ok().map(|front| {
        let (at, error) = crate::signal::onset::bend(&station.coarse, front, station.coarse_sd_m)
            .unwrap_or((front.onset, (0.1 * front.rise).max(1.0)));
        Estimate { value: station.coarse.time_s(at), standard_error: error * station.coarse.step_s }
    });
    let lead = match &station.front {
        Ok(_) => station.lead.clone(),
        Err(_) => 0..trace.index(start_s),
    };
    let base_m = station.front.as_ref().map_or(trace.head_m[0], |f| f.base_m);
    let newest = (5.0f64.max(2.0 * period_s) / trace.step_s) as usize;
    let half_width = ((0.1 * rise_s / trace.step_s) as usize).min(200);
    let extrema = crate::signal::extrema::extrema(trace, cycles, start_s, half_width, noise.white_sd_m);
    SensorFeatures {
        sensor: station.sensor,
        name: place.name.clone(),
        position_m: place.position_m,
        samples: recording.series[station.sensor].time_s.len(),
        interval_s: trace.step_s,
        end_s: trace.time_s((trace.len() - 1) as f64),
        noise: *noise,
        steady_before_m: crate::signal::levels::before(&trace.head_m[lead], base_m, newest, noise),
        steady_after_m: crate::signal::levels::after(trace, start_s, period_s, noise),
        front_arrival_s,
        first_peak: extrema.first().copied().filter(|e| e.peak),
        damping_per_cycle: crate::signal::extrema::damping(&extrema),
        extrema,
    }
}
