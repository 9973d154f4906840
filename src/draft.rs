//! What a file of a test tells of its rig: sensors, units, likely places, temperature, closing time; and what a person
//! says of it.

pub mod answers;
pub mod epanet;
pub mod form;
pub mod network;
pub mod reading;
pub mod remark;

use std::path::Path;

use crate::extent::ends;
use crate::number::{duration, significant};
use crate::recording::Recording;
use crate::rig::check::ATMOSPHERE_PA;
use crate::rig::draft::{Draft, DraftSensor, Told};
use crate::rig::{Coupling, Rig, Sensor, SensorKind, quantity_of};
use crate::robust::median;
use crate::signal::doubts::doubts;
use crate::signal::faults::{Fault, SensorFault, examine, in_words};
use crate::signal::levels::temperature_degc;
use crate::signal::window::used;
use crate::signal::{Features, SensorFeatures, inspect};
use crate::storage::import::unit_warnings::PLAUSIBLE_PA;
use crate::storage::import::{
    Bound, Repair, SourceFile, SourceOptions, Track, bind, is_electric, is_nameless, kind_of, kind_of_name,
};
use crate::storage::nearest::listed;
use crate::units::{GRAVITY_M_S2, Quantity, UNITS, Unit};

/// Units of a pressure that states none, and up to which median it is taken for each: a laboratory's line has 0.5 to 20
/// bar.
const PRESSURES: [(&str, f64); 3] = [("bar", 20.0), ("kPa", 2e3), ("Pa", f64::INFINITY)];
/// Units of a flow that states none, the likeliest first, and the velocities that it may mean, m/s.
const FLOWS: [&str; 4] = ["L/s", "m3/h", "L/min", "m3/s"];
const VELOCITIES_M_S: [f64; 2] = [0.03, 6.0];

/// A column without a name whose values differ by less than this share of their size is no pressure of a test.
const LEAST_SPREAD: f64 = 0.05;

/// A column of so many equal values is constant.
const LEAST_CONSTANT: usize = 20;

/// How the reason begins where a unit is written that is not known.
pub const WRITTEN: &str = "the file has it in";

/// How the reason begins where a pressure stays at that of the air.
pub const LIKE_THE_AIR: &str = "no front passes it, and it stays at the pressure of the air";
/// Pressures of the air, Pa, and those of a sensor in it that counts from them.
const AIR_PA: [std::ops::Range<f64>; 2] = [8.5e4..1.1e5, -5e3..5e3];

/// A transducer that rings, or whose zero is off, may show less than a vacuum, but not so many atmospheres below that
/// of the day.
const BELOW_VACUUM: f64 = 2.0;

/// Two wave speeds agree within this factor: creep and a leak lower the first rise.
const SAME_RISE: f64 = 1.5;

/// A flow ends below this share of what it was.
const STOPPED: f64 = 0.05;

/// Of a column without a name only its numbers speak: what swings is a pressure, what the closure stops is a flow.
fn kind_of_numbers(values: &[f64]) -> Option<SensorKind> {
    let (low, high) = ends(values);
    let part = (values.len() / 50).max(1);
    let [first, last] = [&values[..part], &values[values.len() - part..]].map(|v| median(&mut v.to_vec()).abs());
    if high - low <= LEAST_SPREAD * high.abs().max(low.abs()) {
        return None;
    }
    Some(if last < STOPPED * first { SensorKind::Flow } else { SensorKind::Pressure })
}

fn is_constant(values: &[f64]) -> bool {
    values.len() > LEAST_CONSTANT && values.iter().all(|v| *v == values[0])
}

/// What a person says of a file's columns.
#[derive(Debug, Clone, Default)]
pub struct Said {
    /// How the file is read: names, lines of transducers, the flow by hand.
    pub source: SourceOptions,
    /// Unit of the pressures that state none.
    pub unit: Option<Unit>,
    /// Distances of sensors from the supply, m.
    pub places: Vec<(String, f64)>,
    /// What columns measure, by their full names.
    pub kinds: Vec<(String, SensorKind)>,
}

/// The columns that are no sensor, where none is a pressure.
pub fn without_pressure(file: &SourceFile, said: &Said) -> Option<Vec<String>> {
    let kinds: Vec<_> = file.tracks.iter().map(|track| meant(track, said).map(|(kind, _)| kind)).collect();
    let others = file.tracks.iter().zip(&kinds).filter(|(_, kind)| kind.is_none()).map(|(track, _)| track.name.clone());
    (!kinds.contains(&Some(SensorKind::Pressure))).then(|| others.collect())
}

/// Whether a column is a flow, or one was measured by hand.
pub fn has_flow(file: &SourceFile, said: &Said) -> bool {
    let is_flow = |track| meant(track, said).is_some_and(|(kind, _)| kind == SensorKind::Flow);
    said.source.flow.is_some() || file.tracks.iter().any(is_flow)
}

/// What a column is called as a sensor.
fn name_of<'a>(track: &'a Track, source: &'a SourceOptions) -> &'a String {
    source.map.iter().find(|(from, _)| track.is_called(from)).map_or(&track.short, |(_, to)| to)
}

/// What a column measures, and its unit where something states it.
pub fn meant(track: &Track, said: &Said) -> Option<(SensorKind, Option<Told<Unit>>)> {
    let source = &said.source;
    let nameless = is_nameless(&track.name);
    let called = name_of(track, source);
    let line = source.scales.iter().find(|(name, _)| track.is_called(name) || name == called);
    let by_scale = line.and_then(|(_, line)| {
        let told = match line.unit.or(said.unit) {
            Some(unit) => Told::given(unit),
            None => Told::assumed(Unit::BAR, "its line states no unit, as '250*x-125 kPa' would"),
        };
        let measures = |kind: &SensorKind| quantity_of(*kind) == told.value.quantity;
        Some((SensorKind::ALL.into_iter().find(measures)?, Some(told)))
    });
    // only a pressure has a place to give; and who only names a sensor means a pressure
    let is_placed = said.places.iter().any(|(name, _)| name == called || track.is_called(name));
    let is_mapped = source.map.iter().any(|(from, _)| track.is_called(from));
    let pressure = |is: bool| is.then_some((SensorKind::Pressure, None));
    let known = kind_of(track).map(|(kind, unit)| (kind, unit.map(Told::given)));
    if let Some((_, kind)) = said.kinds.iter().find(|(name, _)| *name == track.name) {
        let unit = by_scale.or(known).filter(|(other, _)| quantity_of(*other) == quantity_of(*kind));
        return Some((*kind, unit.and_then(|(_, unit)| unit)));
    }
    let kind = by_scale
        .or(known.filter(|(_, unit)| unit.is_some()))
        .or_else(|| pressure(is_placed))
        .or_else(|| Some((kind_of_name(called)?, None)))
        .or_else(|| pressure(is_mapped))
        .or_else(|| Some((kind_of_numbers(&track.series.value)?, None)).filter(|_| nameless))
        .filter(|_| line.is_some() || !track.unit.as_deref().is_some_and(is_electric));
    // what never changes sees nothing of the test, unless somebody says that it is a sensor all the same
    let is_said = line.is_some() || is_placed || is_mapped;
    let is_seen = |kind: &SensorKind| *kind != SensorKind::Pressure || is_said || !is_constant(&track.series.value);
    let kind = kind.filter(|(kind, _)| is_seen(kind));
    kind.filter(|_| track.series.value.len() > 1 && !source.ignore.iter().any(|name| track.is_called(name)))
}

/// The sensors of a file's columns, and the columns that are none. Pressures stand at the valve until [`place`] puts
/// them elsewhere.
///
/// A `unit` that the user gives is that of the pressures that state none. What the options scale is in their unit,
/// otherwise a pressure in it, or in bar.
pub fn sensors_of(file: &SourceFile, draft: &Draft, said: &Said) -> (Vec<DraftSensor>, Vec<String>) {
    let (source, unit) = (&said.source, said.unit);
    let (mut sensors, mut others): (Vec<DraftSensor>, Vec<String>) = (Vec::new(), Vec::new());
    let mut unstated: Vec<(usize, f64)> = Vec::new();
    for track in &file.tracks {
        let called = name_of(track, source);
        match meant(track, said) {
            Some((kind, stated)) => {
                let name = free_name(called, &sensors);
                let level = median(&mut track.series.value.clone()).abs();
                if kind == SensorKind::Pressure && stated.is_none() && track.unit.is_none() {
                    unstated.push((sensors.len(), level));
                }
                let unit = stated.unwrap_or_else(|| unit_of(track, kind, level, draft));
                let position_m = match kind {
                    SensorKind::Flow => Told::assumed(0.0, "the file does not say: at the supply"),
                    SensorKind::Temperature => Told::given(0.0),
                    _ => Told::given(draft.length_m),
                };
                let column = Some(track.name.clone());
                sensors.push(DraftSensor { name, kind, unit, position_m, column });
            }
            None => others.push(track.name.clone()),
        }
    }
    if let Some((_, unit)) = source.flow
        && !sensors.iter().any(|s| s.kind == SensorKind::Flow)
    {
        let (name, unit, position_m) = (free_name("Q", &sensors), Told::given(unit), Told::given(draft.length_m));
        sensors.push(DraftSensor { name, kind: SensorKind::Flow, unit, position_m, column: None });
    }
    // One logger writes all its pressures in one unit.
    let largest = unstated.iter().map(|(_, level)| *level).fold(0.0, f64::max);
    let medians: Vec<String> = unstated.iter().map(|(_, level)| significant(*level, 4)).collect();
    for (i, _) in &unstated {
        sensors[*i].unit = match unit {
            Some(given) => Told::given(given),
            None => guessed_pressure(largest, format!("no unit is stated; the medians are {}", listed(&medians))),
        };
    }
    (sensors, others)
}

/// The unit of a pressure by its size.
fn guessed_pressure(level: f64, why: String) -> Told<Unit> {
    let symbol = PRESSURES.iter().find(|(_, most)| level <= *most).map_or("kPa", |(symbol, _)| symbol);
    Told::assumed(symbol.parse().unwrap_or(Unit::BAR), why)
}

/// Puts the pressure sensors where the front that passes them says, and takes temperature and closing time from the
/// record.
pub fn place(draft: &mut Draft, file: &SourceFile, source: &SourceOptions) {
    let alone = draft.sensors.iter().filter(|s| s.kind == SensorKind::Pressure).count() == 1;
    let found = match seen_from_valve(draft, file, source) {
        Ok(found) => found,
        Err(error) => {
            let why = if alone {
                "the one pressure that everybody records".into()
            } else {
                format!("no front can be seen ({error})")
            };
            let at_valve = |s: &mut DraftSensor| s.position_m.why = format!("{why}: at the valve");
            draft.sensors.iter_mut().filter(|s| s.kind == SensorKind::Pressure).for_each(at_valve);
            if let Ok(recording) = drafted(draft, file, source) {
                take_temperature(draft, temperature_degc(&recording));
            }
            return;
        }
    };
    choose_flow_unit(draft, &found);
    let length_m = draft.length_m;
    let first_s = found.sensors.iter().filter_map(|s| s.front_arrival_s).map(|e| e.value).fold(f64::INFINITY, f64::min);
    // The wave speed to the supply and back needs no sensor between the ends.
    let speeds = &found.wave_speed;
    let there_and_back = speeds.crossings.map(|c| c.value).or(speeds.joukowsky.map(|e| e.value));
    let speed_m_s = there_and_back.or(found.period.map(|p| 4.0 * length_m / p.value));
    for sensor in draft.sensors.iter_mut().filter(|s| s.kind == SensorKind::Pressure) {
        let seen = found.sensors.iter().find(|s| s.name == sensor.name);
        let later_s = seen.and_then(|s| s.front_arrival_s).map(|e| e.value - first_s);
        let place = match (later_s, speed_m_s) {
            (Some(0.0), _) if alone => Told::assumed(length_m, "the one pressure that everybody records: at the valve"),
            (Some(0.0), _) => Told::assumed(length_m, "the front arrives here first, so it is at the valve"),
            (Some(later_s), Some(speed_m_s)) => {
                let place_m = (length_m - speed_m_s * later_s).clamp(0.0, length_m);
                let why = format!("the front arrives {:.1} ms after the first: measure it", 1e3 * later_s);
                Told::assumed((10.0 * place_m).round() / 10.0, why)
            }
            (None, Some(_)) if first_s.is_finite() && seen.is_some_and(|s| is_air(s.steady_before_m.value)) => {
                Told::assumed(0.0, format!("{LIKE_THE_AIR}: at the supply"))
            }
            (None, Some(_)) if first_s.is_finite() => Told::assumed(0.0, "no front passes it: at the supply"),
            _ => Told::assumed(length_m, "no front can be seen: at the valve"),
        };
        sensor.position_m = place;
    }
    take_temperature(draft, found.temperature_degc);
    if let (Some(end_s), false) = (found.closure.end_s, draft.closing_time_s.why.is_empty()) {
        let closing_s = (1e3 * (end_s - found.closure.start_s)).round() / 1e3;
        if closing_s > 0.0 {
            draft.closing_time_s = Told::assumed(closing_s, "as the first rise shows it");
        }
    }
}

/// Whether a steady head, m, is that of the air.
fn is_air(head_m: f64) -> bool {
    AIR_PA.iter().any(|air| air.contains(&(head_m * WATER_KG_M3 * GRAVITY_M_S2)))
}

/// Density of water, kg/m³, to a percent.
const WATER_KG_M3: f64 = 1000.0;

fn take_temperature(draft: &mut Draft, degc: f64) {
    if !draft.temperature_degc.why.is_empty() && draft.sensors.iter().any(|s| s.kind == SensorKind::Temperature) {
        draft.temperature_degc = Told::assumed((10.0 * degc).round() / 10.0, "as the file says");
    }
}

/// The unit of a flow that states none: that in which the first rise (Joukowsky) gives the speed at which the wave
/// travels.
fn choose_flow_unit(draft: &mut Draft, found: &Features) {
    let speeds = (found.wave_speed.joukowsky, found.wave_speed.crossings);
    let (Some(rise), Some(travel)) = speeds else { return };
    // A length in feet or a wrong wall would choose a wrong unit.
    let rig = Rig::from_toml(&draft.text(), "draft");
    let fits = |rig: &Rig| {
        let water = rig.fluid.properties(found.temperature_degc);
        rig.pipes.iter().all(|p| (p.wave_speed_start(&water).1..=p.wave_speed_start(&water).2).contains(&travel.value))
    };
    if !rig.is_ok_and(|rig| fits(&rig)) {
        return;
    }
    for sensor in draft.sensors.iter_mut().filter(|s| s.kind == SensorKind::Flow && !s.unit.why.is_empty()) {
        let size = |unit: Unit| unit.to_si(1.0, 1000.0);
        let wanted = size(sensor.unit.value) * rise.value / travel.value;
        let apart = |unit: &Unit| (size(*unit) / wanted).ln().abs();
        let flows = UNITS.into_iter().filter(|u| u.quantity == Quantity::Flow);
        let nearest = flows.min_by(|a, b| apart(a).total_cmp(&apart(b))).filter(|unit| apart(unit) < SAME_RISE.ln());
        if let Some(unit) = nearest {
            let why = "no unit is stated; in this one the first rise fits the wave speed";
            sensor.unit = Told::assumed(unit, why);
        }
    }
}

/// What the file of a rig shows that was made for it.
#[derive(Debug)]
pub struct Checked {
    /// Where it contradicts the rig, a sentence each: most likely an answer was in another unit. An error where no
    /// closure can be seen in it.
    pub doubts: Result<Vec<String>, String>,
    /// What to give of sensors whose readings cannot be what the file says, and of which nobody said what they stand
    /// for.
    pub misread: Option<Misread>,
}

/// Checks a file on the rig that was made for it. What is converted or guessed on the way is added to `repairs`.
pub fn checked(rig: &Rig, file: &SourceFile, source: &SourceOptions, repairs: &mut Vec<Repair>) -> Checked {
    let (recording, scaled) = match recorded(rig, file, source, repairs) {
        Ok(bound) => (used(bound.recording).0, bound.scaled),
        Err(error) => return Checked { doubts: Err(error), misread: None },
    };
    let (features, faults) = examine(&recording);
    let misread = misread(&recording, &faults, &scaled);
    let doubts = features.map_err(|e| e.to_string()).map(|features| {
        let mut found = doubts(rig, &features);
        found.extend((!faults.is_empty()).then(|| in_words(&faults)));
        found
    });
    Checked { doubts, misread }
}

/// Pressures whose readings cannot be what a file says.
#[derive(Debug, thiserror::Error)]
#[error(
    "{says}. Say what the numbers of '{sensor}' stand for with option `scale '{sensor}=FACTOR*x {unit}'` and its number, keep them as they are with option `scale '{sensor}={unit}'`, or leave it out with option `ignore '{sensor}'`"
)]
pub struct Misread {
    /// The first of them.
    pub sensor: String,
    unit: Unit,
    /// What all of them show, in a sentence or more.
    pub says: String,
}

/// Pressures whose readings cannot be what the file says; of those that are `scaled` somebody said what they stand for.
/// `recording` is what is [`used`](crate::signal::window::used) of one.
pub fn misread(recording: &Recording, faults: &[SensorFault], scaled: &[bool]) -> Option<Misread> {
    let rig = &recording.rig;
    let density = rig.fluid.properties(rig.fluid.temperature_degc).density_kg_m3;
    let strange = |(i, sensor): (usize, &Sensor)| {
        let fault = faults.iter().find(|f| f.sensor == sensor.name);
        if let Some(fault) = fault.filter(|f| matches!(f.fault, Fault::Inverted | Fault::WrongUnit)) {
            return Some(format!("{}: {}", fault.fault.words(), fault.says));
        }
        let values = Some(&recording.series[i].value).filter(|v| sensor.coupling == Coupling::Dc && !v.is_empty())?;
        let shows = |value: f64, what: &str| format!("strange: it shows {value} {}, {what}", sensor.unit);
        let level = median(&mut values.clone());
        if sensor.range.is_some_and(|[low, high]| (low..=high).contains(&level)) {
            return None;
        }
        if sensor.unit.to_si(level, density) > PLAUSIBLE_PA[1] {
            return Some(shows(level, "more than a laboratory pipe withstands"));
        }
        let lowest = values.iter().copied().fold(f64::INFINITY, f64::min);
        (sensor.unit.to_si(lowest, density) < -BELOW_VACUUM * ATMOSPHERE_PA)
            .then(|| shows(lowest, "less than a vacuum; empty its cell where it stands for no value"))
    };
    let pressures = rig.pressure_sensors().filter(|(i, _)| !scaled.get(*i).copied().unwrap_or(false));
    let found: Vec<(&Sensor, String)> =
        pressures.filter_map(|(i, sensor)| Some((sensor, strange((i, sensor))?))).collect();
    let (Sensor { name, unit, .. }, _) = *found.first()?;
    // what several have in common may be the flow's
    let one = |group: &[(&Sensor, String)]| match group {
        [(sensor, says)] => format!("sensor {} is {says}", sensor.name),
        _ => {
            let names: Vec<&str> = group.iter().map(|(sensor, _)| sensor.name.as_str()).collect();
            format!("sensors {} are {}", names.join(", "), group[0].1)
        }
    };
    let says: Vec<String> = found.chunk_by(|(_, a), (_, b)| a == b).map(one).collect();
    Some(Misread { sensor: name.clone(), unit: *unit, says: says.join("; ") })
}

/// The features of the file, the period that of the sensor that the front reaches first. A record without a steady
/// beginning has no first front: the first rise in it may be any.
fn seen_from_valve(draft: &Draft, file: &SourceFile, source: &SourceOptions) -> Result<Features, String> {
    let found = seen(draft, file, source)?;
    if let Some(lead_s) = found.short_lead_s(draft.length_m) {
        return Err(format!("the record begins {} before the first rise", duration(lead_s)));
    }
    if let Some(sensor) = found.sensors.iter().find(|s| s.missing_at_front_s.is_some()) {
        return Err(format!("samples of {} are missing within a period of its front", sensor.name));
    }
    let arrival = |s: &&SensorFeatures| s.front_arrival_s.map_or(f64::INFINITY, |e| e.value);
    let first = found.sensors.iter().min_by(|a, b| arrival(a).total_cmp(&arrival(b))).map(|s| s.name.clone());
    let first = first.ok_or("no sensor")?;
    let mut moved = draft.clone();
    let others = moved.sensors.iter_mut().filter(|s| s.kind == SensorKind::Pressure && s.name != first);
    others.for_each(|s| s.position_m.value = 0.5 * draft.length_m);
    seen(&moved, file, source).or(Ok(found))
}

/// The features of the file on the rig as it is drafted.
fn seen(draft: &Draft, file: &SourceFile, source: &SourceOptions) -> Result<Features, String> {
    inspect(&drafted(draft, file, source)?).map_err(|e| e.to_string())
}

/// What is used of the file, on the rig as it is drafted.
fn drafted(draft: &Draft, file: &SourceFile, source: &SourceOptions) -> Result<Recording, String> {
    let rig = Rig::from_toml(&draft.text(), "draft").map_err(|e| e.to_string())?;
    recorded(&rig, file, source, &mut Vec::new()).map(|bound| used(bound.recording).0)
}

/// The file on a rig.
fn recorded(rig: &Rig, file: &SourceFile, source: &SourceOptions, repairs: &mut Vec<Repair>) -> Result<Bound, String> {
    bind(file.clone(), Path::new("the file"), rig, source, repairs).map_err(|e| e.to_string())
}

/// The heading as a sensor's name: no column without a heading, and none twice.
fn free_name(heading: &str, taken: &[DraftSensor]) -> String {
    let plain = heading.replace([',', '"'], " ");
    let plain = if plain.trim().is_empty() { format!("P{}", taken.len() + 1) } else { plain.trim().into() };
    let is_taken = |name: &str| taken.iter().any(|s| s.name == name) || name == "time_s";
    let mut names = std::iter::once(plain.clone()).chain((2..).map(|i| format!("{plain} {i}")));
    names.find(|name| !is_taken(name)).unwrap_or(plain)
}

/// The unit of a column that states none, by its median.
fn unit_of(track: &Track, kind: SensorKind, level: f64, draft: &Draft) -> Told<Unit> {
    let why = match &track.unit {
        Some(unit) => {
            format!("{WRITTEN} '{unit}', which is no unit that is known; its median is {}", significant(level, 4))
        }
        None => format!("no unit is stated; its median is {}", significant(level, 4)),
    };
    let area_m2 = std::f64::consts::FRAC_PI_4 * (1e-3 * draft.inner_diameter_mm).powi(2);
    let flows = |symbol: &&&str| {
        let flow_m3_s = symbol.parse::<Unit>().map_or(f64::NAN, |u| u.to_si(level, 1000.0));
        (VELOCITIES_M_S[0]..=VELOCITIES_M_S[1]).contains(&(flow_m3_s / area_m2))
    };
    let symbol = match kind {
        SensorKind::Pressure => return guessed_pressure(level, why),
        SensorKind::Flow => FLOWS.iter().find(flows).map_or("L/s", |symbol| symbol),
        SensorKind::Temperature if level > 200.0 => "K",
        SensorKind::Temperature => "degC",
        SensorKind::ValvePosition if level > 1.5 => "%",
        SensorKind::ValvePosition => "1",
        // only the edges of a trigger count
        SensorKind::Trigger => return Told::given(Unit::ONE),
    };
    Told::assumed(symbol.parse().unwrap_or(UNITS[0]), why)
}
