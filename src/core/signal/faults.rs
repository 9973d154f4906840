//! Faults of pressure sensors that no physics explains: a sensor that does not follow, a wrong sign, place, unit or
//! clock.
//!
//! Every rule asks for what no effect of the catalogue can do, and leaves the rest to the diagnosis: a gain of a few
//! percent, a lag or a shifted clock is an effect, a factor of a hundred is a unit.

use serde::Serialize;

use crate::extent::ends;
use crate::number::{duration, error_m, significant};
use crate::recording::Recording;
use crate::rig::check::ATMOSPHERE_PA;
use crate::rig::{Coupling, Rig};
use crate::robust::NOT_BY_CHANCE;
use crate::signal::error::SignalError;
use crate::signal::features::Features;
use crate::signal::front::Front;
use crate::signal::inspect::inspect_stations;
use crate::signal::levels::{finite, flow_m3_s, temperature_degc};
use crate::signal::station::{Station, stations};

/// What is wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Fault {
    /// It does not respond.
    Flat,
    /// It stops responding during the record.
    Stuck,
    /// Its peaks or troughs are cut off.
    Clipped,
    /// Its sign is wrong.
    Inverted,
    /// It stands where the rig file has another one.
    Swapped,
    /// Its values are in another unit.
    WrongUnit,
    /// Its times are in another unit.
    WrongTimeUnit,
    /// Its resolution is coarse against the wave. A model can be fitted all the same.
    Coarse,
}

/// A faulty sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorFault {
    /// Its name.
    pub sensor: String,
    /// What is wrong with it.
    pub fault: Fault,
    /// What shows it, in a sentence.
    pub says: String,
}

impl SensorFault {
    /// Its record cannot be compared with a model.
    pub fn forbids_a_fit(&self) -> bool {
        self.fault != Fault::Coarse
    }
}

/// Faults in a sentence each, with what to do. A fault that several sensors share is one sentence.
pub fn in_words(faults: &[SensorFault]) -> String {
    let mut alike: Vec<(Vec<&str>, &SensorFault)> = Vec::new();
    for fault in faults {
        match alike.iter_mut().find(|(_, one)| one.fault == fault.fault && one.says == fault.says) {
            Some((sensors, _)) => sensors.push(&fault.sensor),
            None => alike.push((vec![&fault.sensor], fault)),
        }
    }
    let one = |(sensors, fault): &(Vec<&str>, &SensorFault)| match sensors[..] {
        [sensor] => format!("sensor {sensor} is {}: {}", fault.fault.words(), fault.says),
        _ => format!("sensors {} are {}: {}", sensors.join(", "), fault.fault.words(), fault.says),
    };
    let mut words = alike.iter().map(one).collect::<Vec<_>>().join("; ");
    // A unit or a clock that several have in common is no sensor's own.
    let common = |(sensors, fault): &&(Vec<&str>, &SensorFault)| {
        sensors.len() > 1 && matches!(fault.fault, Fault::WrongUnit | Fault::WrongTimeUnit)
    };
    let own = alike.iter().filter(|group| group.1.forbids_a_fit() && !common(group));
    let own: Vec<&str> = own.flat_map(|(sensors, _)| sensors.iter().copied()).collect();
    if !own.is_empty() {
        words += &format!(". Mend it, or leave it out with option `ignore {}`", own.join(","));
    }
    words
}

impl Fault {
    /// What to call a sensor that has it.
    pub fn words(self) -> &'static str {
        match self {
            Fault::Flat => "flat",
            Fault::Stuck => "stuck",
            Fault::Clipped => "clipped",
            Fault::Inverted => "inverted",
            Fault::Swapped => "swapped with another",
            Fault::WrongUnit => "in a wrong unit",
            Fault::WrongTimeUnit => "timed wrongly, or misplaced",
            Fault::Coarse => "coarse",
        }
    }
}

/// Fewer samples tell nothing.
const LEAST_SAMPLES: usize = 20;
/// Share of the expected swing below which a sensor does not respond.
const NO_RESPONSE: f64 = 0.05;
/// Share of the pipe from the supply in which a wave may be too short for a sensor to see.
const NEAR_SUPPLY: f64 = 0.1;
/// Share of its swing that a sensor must have moved by just before, or another one meanwhile, for a stop to be seen.
const STILL_MOVING: f64 = 0.2;
/// A wave may take so many times as long to a sensor as the rig's wave speed says.
const LATE: f64 = 2.0;
/// Factor between a sensor and the others, in steady pressure and front alike, from which it is a unit. No effect is
/// that large; the smallest factor between two units of pressure in use is 6.9 (kPa and psi).
const OTHER_UNIT: f64 = 4.5;
/// Factor between measured and possible travel times from which it is a unit: minutes and seconds are 60 apart.
const OTHER_TIME_UNIT: f64 = 20.0;
/// Steps of the resolution that the first front should have.
const FINE_STEPS: f64 = 20.0;

/// What a recording shows, and the faults of its sensors, from one look at its signals.
pub fn examine(recording: &Recording) -> (Result<Features, SignalError>, Vec<SensorFault>) {
    let temperature = temperature_degc(recording);
    let seen = stations(recording, temperature);
    let features = inspect_stations(recording, &seen, temperature);
    let mut faults = faults_of(recording, &seen, temperature);
    if let (true, Ok(features)) = (faults.is_empty(), &features) {
        faults = unit_by_flow(&recording.rig, features);
    }
    (features, faults)
}

/// The faults of all pressure sensors, in the rig's order; at most one a sensor. A long recording takes long: pass what
/// is [`used`](crate::signal::window::used) of it.
pub fn sensor_faults(recording: &Recording) -> Vec<SensorFault> {
    examine(recording).1
}

fn faults_of(recording: &Recording, seen: &[Station], temperature_degc: f64) -> Vec<SensorFault> {
    let scene = Scene::new(recording, seen, temperature_degc);
    let by_time = scene.time_units();
    let swapped = scene.swapped();
    let mut found: Vec<SensorFault> = Vec::new();
    for (i, station) in seen.iter().enumerate() {
        let fault = scene
            .flat(station)
            .or_else(|| by_time.iter().find(|(at, _)| *at == i).map(|(_, says)| (Fault::WrongTimeUnit, says.clone())))
            .or_else(|| scene.inverted(i))
            .or_else(|| scene.held(station))
            .or_else(|| scene.unit(i))
            .or_else(|| swapped.iter().find(|(at, _)| *at == i).map(|(_, says)| (Fault::Swapped, says.clone())))
            .or_else(|| scene.coarse(station));
        found.extend(fault.map(|(fault, says)| SensorFault { sensor: scene.name(station).to_owned(), fault, says }));
    }
    found
}

type Found = Option<(Fault, String)>;

struct Scene<'a> {
    recording: &'a Recording,
    rig: &'a Rig,
    stations: &'a [Station],
    /// Nominal wave speed, mean over the pipes, m/s.
    speed_m_s: f64,
    density_kg_m3: f64,
    /// First onset of a front, s.
    start_s: f64,
    /// What stopping the flow at once makes, `aV/g`, m; none without a flow.
    rise_m: Option<f64>,
}

impl<'a> Scene<'a> {
    fn new(recording: &'a Recording, stations: &'a [Station], temperature_degc: f64) -> Self {
        let rig = &recording.rig;
        let water = rig.fluid.properties(temperature_degc);
        let (speed_m_s, ..) = rig.wave_speed_start(&water);
        let onset_s = |s: &Station| Some(s.coarse.time_s(s.front.as_ref().ok()?.onset));
        let start_s = stations.iter().filter_map(onset_s).fold(f64::INFINITY, f64::min);
        let velocity = flow_m3_s(recording, start_s).map(|flow| flow.value / rig.pipes[rig.pipes.len() - 1].area_m2());
        let rise_m = velocity.map(|v| speed_m_s * v / crate::units::GRAVITY_M_S2).filter(|rise_m| *rise_m > 0.0);
        Scene { recording, rig, stations, speed_m_s, density_kg_m3: water.density_kg_m3, start_s, rise_m }
    }

    fn name(&self, station: &Station) -> &'a str {
        &self.rig.sensors[station.sensor].name
    }

    fn values(&self, station: &Station) -> (Vec<f64>, Vec<f64>) {
        finite(&self.recording.series[station.sensor]).unzip()
    }

    /// The clear fronts of the other stations.
    fn others(&self, i: usize) -> impl Iterator<Item = (&'a Station, &'a Front)> + '_ {
        let rest = self.stations.iter().enumerate().filter(move |(k, _)| *k != i);
        rest.filter_map(|(_, s)| Some((s, s.front.as_ref().ok()?)))
    }

    fn flat(&self, station: &Station) -> Found {
        let sensor = &self.rig.sensors[station.sensor];
        let (_, values) = self.values(station);
        let (low, high) = ends(&values);
        if values.len() < LEAST_SAMPLES {
            return None;
        }
        if low == high {
            return Some((Fault::Flat, format!("all {} samples are {low} {}", values.len(), sensor.unit)));
        }
        let swing = |s: &Station| ends(&s.trace.head_m).1 - ends(&s.trace.head_m).0;
        let highest = self.stations.iter().filter(|s| s.front.is_ok()).map(swing).fold(0.0, f64::max);
        let share = station.place_m / self.rig.length_m();
        let own = swing(station);
        // a front that shows, however small, is one in another unit
        (station.front.is_err() && share > NEAR_SUPPLY && own < NO_RESPONSE * share * highest).then(|| {
            (
                Fault::Flat,
                format!(
                    "it moves by {} m of head in all, while another sensor moves by {} m",
                    error_m(own),
                    error_m(highest)
                ),
            )
        })
    }

    /// A run of equal samples where the pressure moves.
    fn held(&self, station: &Station) -> Found {
        let sensor = &self.rig.sensors[station.sensor];
        let (times, values) = self.values(station);
        // what the wave has not reached yet does not move
        let latest_s = self.start_s + LATE * (self.rig.length_m() - station.place_m) / self.speed_m_s;
        let own_s = station.front.as_ref().ok().map(|front| station.coarse.time_s(front.onset));
        let begins_s = own_s.filter(|own_s| *own_s < latest_s).unwrap_or(self.start_s);
        let first = times.partition_point(|t| *t < begins_s);
        let after = values.get(first..).filter(|v| v.len() > LEAST_SAMPLES)?;
        let (low, high) = ends(&values);
        let swing = high - low;
        let runs = runs(after);
        let &(start, length) = runs.iter().max_by_key(|(_, length)| *length)?;
        // equal neighbours elsewhere say how often chance makes them
        let equal: usize = runs.iter().map(|(_, n)| n - 1).sum::<usize>() - (length - 1);
        let pairs = (after.len() - length).max(1);
        let share = (equal as f64 + 0.5) / (pairs as f64 + 1.0);
        if length < LEAST_SAMPLES || (length as f64 - 1.0) * -share.ln() < (after.len() as f64).ln() + NOT_BY_CHANCE {
            return None;
        }
        let level = after[start];
        let unit = sensor.unit;
        let (from_s, to_s) = (times[first + start], times[first + start + length - 1]);
        if level == low || level == high {
            let cut: Vec<_> = runs.iter().filter(|(at, n)| after[*at] == level && *n > 5).collect();
            // a quiet sensor of coarse resolution may show a plateau by equal samples, but only once: the next peak is
            // lower
            let apart = cut.windows(2).any(|pair| {
                let between = &after[pair[0].0..pair[1].0];
                ends(between).1 - ends(between).0 > STILL_MOVING * swing
            });
            let lead = &values[..first];
            let loud = lead.windows(2).filter(|w| w[0] == w[1]).count() < lead.len() / 2;
            let last = start + length == after.len();
            if (apart || loud) && !last {
                let end = if level == high { "above" } else { "below" };
                let says = format!(
                    "it shows nothing {end} {} {unit}, for {} at once from {} s on",
                    significant(level, 4),
                    duration(to_s - from_s),
                    significant(from_s, 4)
                );
                return Some((Fault::Clipped, says));
            }
        }
        let before = &after[start.saturating_sub(length)..start];
        let moved_before = !before.is_empty() && ends(before).1 - ends(before).0 > STILL_MOVING * swing;
        let mut others = self.stations.iter().filter(|s| s.sensor != station.sensor && s.front.is_ok()).peekable();
        let moves = |s: &Station| {
            let (a, b) = (s.trace.index(from_s), s.trace.index(to_s));
            let part = s.trace.head_m.get(a..b).filter(|p| !p.is_empty());
            let all = ends(&s.trace.head_m);
            part.is_some_and(|p| ends(p).1 - ends(p).0 > STILL_MOVING * (all.1 - all.0))
        };
        let stuck = if others.peek().is_some() { others.any(moves) } else { moved_before };
        stuck.then(|| {
            (
                Fault::Stuck,
                format!(
                    "it shows {} {unit} without a change from {} s to {} s, while the pressure moves",
                    significant(level, 4),
                    significant(from_s, 4),
                    significant(to_s, 4)
                ),
            )
        })
    }

    fn inverted(&self, i: usize) -> Found {
        let station = &self.stations[i];
        let sensor = &self.rig.sensors[station.sensor];
        let dc = sensor.coupling != Coupling::Ac;
        let first = station.trace.head_m.iter().take(LEAST_SAMPLES).sum::<f64>()
            / station.trace.len().min(LEAST_SAMPLES) as f64;
        let absolute_pa =
            (first - self.rig.sensor_elevation_m(sensor)) * self.density_kg_m3 * crate::units::GRAVITY_M_S2
                + ATMOSPHERE_PA;
        if dc && absolute_pa < 0.0 {
            let says = format!("its steady pressure is {:.1} kPa absolute, below a vacuum", absolute_pa * 1e-3);
            return Some((Fault::Inverted, says));
        }
        let (other, front) = self.others(i).max_by(|a, b| a.0.place_m.total_cmp(&b.0.place_m))?;
        let at = |points: f64| station.trace.index(other.coarse.time_s(points));
        let lead = station.trace.head_m.get(..at(front.onset))?;
        let during = station.trace.head_m.get(at(front.onset)..at(front.half_fall))?;
        if lead.len() < 3 || during.is_empty() {
            return None;
        }
        let base = crate::robust::median(&mut lead[lead.len().saturating_sub(2000)..].to_vec());
        let (low, high) = ends(during);
        let height = front.height_m();
        (low - base < -0.4 * height && high - base < 0.3 * height).then(|| {
            (
                Fault::Inverted,
                format!(
                    "its head falls by {} m where that of {} rises by {} m",
                    error_m(base - low),
                    self.name(other),
                    error_m(height)
                ),
            )
        })
    }

    fn unit(&self, i: usize) -> Found {
        let station = &self.stations[i];
        let front = station.front.as_ref().ok()?;
        let steady = |s: &Station, f: &Front| f.base_m - self.rig.sensor_elevation_m(&self.rig.sensors[s.sensor]);
        let others: Vec<(&Station, &Front)> = self.others(i).collect();
        if others.is_empty() {
            return None;
        }
        let median = |of: &dyn Fn(&Station, &Front) -> f64| {
            crate::robust::median(&mut others.iter().map(|(s, f)| of(s, f)).collect::<Vec<_>>())
        };
        let by_front = front.height_m() / median(&|_, f| f.height_m());
        let by_level = steady(station, front) / median(&steady);
        let away =
            by_front > 0.0 && by_front.ln().abs() > OTHER_UNIT.ln() && (0.4..2.5).contains(&(by_level / by_front));
        if !away {
            return None;
        }
        let [(other, other_front)] = others[..] else {
            let says = format!(
                "its steady pressure is {} times and its first front {} times that of the others",
                significant(by_level, 2),
                significant(by_front, 2)
            );
            return Some((Fault::WrongUnit, says));
        };
        // Of two sensors, the flow tells which is wrong. Without it, one sentence for both says that one is.
        let off = |f: &Front| self.rise_m.map(|rise_m| (f.height_m() / rise_m).ln().abs());
        if off(front).zip(off(other_front)).is_some_and(|(own, other)| own < other) {
            return None;
        }
        let (large, small) = if by_front > 1.0 { (station, other) } else { (other, station) };
        let says = format!(
            "the first front of {} is {} times that of {}",
            self.name(large),
            significant(by_front.max(1.0 / by_front), 2),
            self.name(small)
        );
        Some((Fault::WrongUnit, if self.rise_m.is_some() { says } else { says + ": one of the two is" }))
    }

    /// Stations whose times are in another unit: the wave would be far too fast or slow, or the record far longer than
    /// the others.
    fn time_units(&self) -> Vec<(usize, String)> {
        // the period does not depend on how long the valve takes; a record too short for it has the first peak
        let pace = |s: &Station| {
            let front = s.front.as_ref().ok()?;
            let there_and_back_s = (front.half_fall - front.onset) * s.coarse.step_s;
            let of_peak = (s.place_m > 0.0).then(|| 2.0 * s.place_m / there_and_back_s / self.speed_m_s);
            s.period_s().map(|t| 4.0 * self.rig.length_m() / t / self.speed_m_s).or(of_peak)
        };
        let odd = |ratio: f64| !(1.0 / OTHER_TIME_UNIT..=OTHER_TIME_UNIT).contains(&ratio);
        let all = self.stations.iter().enumerate();
        all.filter_map(|(i, s)| {
            let ratio = pace(s).filter(|r| *r > 0.0 && odd(*r))?;
            let speed = ratio * self.speed_m_s;
            Some((
                i,
                format!(
                    "by its times and its place the wave travels at {} m/s, where this pipe has about {:.0} m/s",
                    significant(speed, 3),
                    self.speed_m_s
                ),
            ))
        })
        .collect()
    }

    /// Pairs of which each shows what belongs to the other's place: the wave comes to it in the wrong order, and stays
    /// for the other's time.
    fn swapped(&self) -> Vec<(usize, String)> {
        let fronts: Vec<(usize, &Station, f64, f64)> = (self.stations.iter().enumerate())
            .filter_map(|(i, s)| {
                let f = s.front.as_ref().ok()?;
                Some((i, s, s.coarse.time_s(f.onset), (f.half_fall - f.onset) * s.coarse.step_s))
            })
            .collect();
        let mut found: Vec<(usize, String)> = Vec::new();
        for (k, (i, a, arrival_a, stay_a)) in fronts.iter().enumerate() {
            for (j, b, arrival_b, stay_b) in &fronts[k + 1..] {
                let later_s = (a.place_m - b.place_m) / self.speed_m_s;
                let steps = later_s.abs() / a.coarse.step_s.max(b.coarse.step_s);
                let order = (arrival_b - arrival_a) / later_s;
                let stay = (stay_a - stay_b) / (2.0 * later_s);
                if steps > 4.0 && order < -0.5 && stay < -0.5 {
                    let says = |own: &Station, other: &Station| {
                        format!(
                            "it shows what belongs to the place of {}, and that one what belongs to {}",
                            self.name(other),
                            self.name(own)
                        )
                    };
                    found.extend([(*i, says(a, b)), (*j, says(b, a))]);
                }
            }
        }
        found
    }

    fn coarse(&self, station: &Station) -> Found {
        let step_m = station.noise.quantum_m?;
        let height = station.front.as_ref().ok()?.height_m();
        (step_m * FINE_STEPS > height).then(|| {
            (
                Fault::Coarse,
                format!("its resolution is {} m, and the first front {} m", error_m(step_m), error_m(height)),
            )
        })
    }
}

/// What the flow says of all pressures at once, where the rise over the velocity gives a wave speed that is off by a
/// factor between units: units or times are wrong, and where the pipe should have the speed of the rise, it is the
/// times.
fn unit_by_flow(rig: &Rig, features: &Features) -> Vec<SensorFault> {
    let speeds = &features.wave_speed;
    let (Some(rise), Some(wave)) = (speeds.joukowsky, speeds.crossings) else { return Vec::new() };
    let factor = rise.value / wave.value;
    if factor < OTHER_UNIT && factor * OTHER_UNIT > 1.0 {
        return Vec::new();
    }
    let (speed_m_s, ..) = rig.wave_speed_start(&rig.fluid.properties(features.temperature_degc));
    let (of_rise, of_wave) = ((rise.value / speed_m_s).ln().abs(), (wave.value / speed_m_s).ln().abs());
    let (fault, says) = if of_rise < of_wave {
        let says = format!(
            "by the times the wave travels at {} m/s, but by the first rise and the flow at {}, and this pipe has about {:.0} m/s: the rate of the \
             samples, the unit of the times or the length of the pipe is wrong",
            significant(wave.value, 3),
            significant(rise.value, 3),
            speed_m_s
        );
        (Fault::WrongTimeUnit, says)
    } else {
        let says = format!(
            "the first rise is {} times what the flow makes: the unit or the scale of the pressures or of the flow is wrong",
            significant(factor, 2)
        );
        (Fault::WrongUnit, says)
    };
    let pressure = rig.pressure_sensors();
    pressure.map(|(_, s)| SensorFault { sensor: s.name.clone(), fault, says: says.clone() }).collect()
}

/// Start and length of each run of equal values.
fn runs(values: &[f64]) -> Vec<(usize, usize)> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for (i, v) in values.iter().enumerate() {
        match found.last_mut() {
            Some((start, length)) if values[*start] == *v => *length += 1,
            _ => found.push((i, 1)),
        }
    }
    found
}
