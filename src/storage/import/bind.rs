//! Tracks of a file become series of a rig's sensors: by name, by what a user says, and in the sensor's unit.

use std::path::Path;

use crate::number::significant;
use crate::recording::{Recording, RunInfo, Series};
use crate::rig::check::ATMOSPHERE_PA;
use crate::rig::{Rig, Sensor, SensorKind, quantity_of, spelled_unit};
use crate::storage::error::{CsvProblem, LogError};
use crate::storage::import::kinds::{Known, guessed, is_electric, line_like, pressure_unit};
use crate::storage::import::source::{Repair, SourceFile, SourceOptions, Track};
use crate::storage::nearest::{listed, nearest};
use crate::storage::sink::program;
use crate::units::{Quantity, UNITS, Unit};

/// A file on the sensors of a rig; of each sensor its track.
#[derive(Debug, Clone)]
pub struct Bound {
    /// The samples.
    pub recording: Recording,
    /// The name of its column, channel or field, where it has one.
    pub columns: Vec<Option<String>>,
    /// Whether somebody said what its numbers stand for.
    pub scaled: Vec<bool>,
}

/// Brings a file's tracks to the sensors of a rig. Sensors that it has no track of stay empty; what was converted or
/// left out is added to `repairs`.
///
/// # Errors
/// A track that is no sensor (in a table), two tracks of one sensor, a unit that the sensor cannot have, a name in the
/// options that is not there.
pub fn bind(
    mut file: SourceFile,
    path: &Path,
    rig: &Rig,
    options: &SourceOptions,
    repairs: &mut Vec<Repair>,
) -> Result<Bound, LogError> {
    let table = !file.spare_tracks;
    let fault = |problem: CsvProblem| match table {
        true => LogError::Csv { path: path.into(), line: None, problem: Box::new(problem) },
        false => LogError::SourceFile { path: path.into(), why: problem.to_string() },
    };
    let density = rig.fluid.properties(rig.fluid.temperature_degc).density_kg_m3;
    let before = |i: usize, from: &String| options.map[..i].iter().any(|(other, _)| other == from);
    if let Some((_, (from, _))) = options.map.iter().enumerate().find(|(i, (from, _))| before(*i, from)) {
        let why = format!("option `map` assigns '{from}' to two sensors; keep one");
        return Err(LogError::SourceFile { path: path.into(), why });
    }
    if let Some(flow) = options.flow {
        let track = by_hand(flow, &file, rig).map_err(|why| LogError::SourceFile { path: path.into(), why })?;
        let text =
            format!("'{}' is the flow that was measured by hand, {} {}: one reading", track.name, flow.0, flow.1);
        repairs.push(Repair::new("flow", 1, None, text));
        file.tracks.push(track);
    }
    let names: Vec<(String, String)> = file.tracks.iter().map(|t| (t.name.clone(), t.short.clone())).collect();
    let mut series = vec![Series::default(); rig.sensors.len()];
    let mut taken: Vec<Option<String>> = vec![None; rig.sensors.len()];
    let mut scaled = vec![false; rig.sensors.len()];
    let (mut spare, mut unwanted) = (Vec::new(), 0);
    let ignored = |track: &Track| options.ignore.iter().any(|name| track.is_called(name) || name == "*");
    let known = |track: &Track| match sensor_of(track, rig, options) {
        Ok(Some(sensor)) => Known::Sensor(sensor),
        Ok(None) if !ignored(track) => Known::Nothing,
        _ => Known::Ignored,
    };
    let guesses = if options.guess { guessed(&file.tracks, rig, &options.elsewhere, known) } else { Vec::new() };
    for (at, mut track) in file.tracks.into_iter().enumerate() {
        let guess = guesses.iter().find(|(track, _)| *track == at).map(|(_, place)| *place);
        let named = sensor_of(&track, rig, options).map_err(fault)?;
        // a numbered name may hide a second column of one sensor
        let again = track.shares.as_ref().and_then(|name| rig.sensors.iter().position(|s| s.name == *name));
        let Some(place) = named.or(guess).or(again.filter(|_| !ignored(&track))) else {
            if table && !options.guess && !ignored(&track) {
                return Err(fault(unknown(&track, rig)));
            }
            unwanted += usize::from(ignored(&track));
            spare.push(track.name);
            continue;
        };
        // of several groups with a channel of one name, the one that --map names
        let says = |(from, to): &&(String, String)| *to == rig.sensors[place].name && !track.is_called(from);
        let is_there = |from: &String| names.iter().any(|(name, short)| name == from || short == from);
        let is_mapped = options.map.iter().any(|(from, _)| track.is_called(from));
        if !table && !is_mapped && options.map.iter().find(says).is_some_and(|(from, _)| is_there(from)) {
            spare.push(track.name);
            continue;
        }
        if let Some(other) = &taken[place] {
            let (a, b, sensor) = (other, &track.name, &rig.sensors[place].name);
            let why = format!(
                "'{a}' and '{b}' are both the sensor '{sensor}': choose one with option `map` or option `ignore`"
            );
            return Err(LogError::SourceFile { path: path.into(), why });
        }
        if track.name != rig.sensors[place].name {
            let text = format!("'{}' is the sensor '{}'", track.name, rig.sensors[place].name);
            repairs.push(Repair { guessed: named.is_none(), ..Repair::new("name", 1, None, text) });
        }
        taken[place] = Some(track.name.clone());
        repairs.append(&mut track.repairs);
        scaled[place] = scale(&mut track, &rig.sensors[place], options);
        series[place] =
            converted(track, &rig.sensors[place], density, scaled[place], options.guess, repairs).map_err(fault)?;
    }
    if taken.iter().all(Option::is_none) {
        return Err(no_sensor(path, rig, &spare, table));
    }
    if !spare.is_empty() {
        let text = format!("left out, because no sensor has this name: {}", listed(&spare));
        let guessed = table && options.guess;
        // what nobody said to leave out is lost
        let lost = table && unwanted < spare.len();
        repairs.push(Repair { guessed, lost, ..Repair::new("left-out", spare.len(), None, text) });
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let run = RunInfo {
        start_unix_ns: file.start.map_or(0, |s| s.unix_ns),
        source: format!("import {name}"),
        program: program(),
        notes: file.notes,
        csv: None,
    };
    Ok(Bound { recording: Recording { rig: rig.clone(), series, run }, columns: taken, scaled })
}

/// A flow that was measured by hand, as one reading of the rig's flow sensor at the start of the record.
fn by_hand((value, unit): (f64, Unit), file: &SourceFile, rig: &Rig) -> Result<Track, String> {
    let sensor = rig.sensors.iter().find(|s| s.kind == SensorKind::Flow).ok_or_else(|| {
        format!(
            "option `flow`: rig '{}' has no flow sensor to take it; add one to the rig file (kind = \"flow\", at the place where it was measured)",
            rig.name
        )
    })?;
    if file.tracks.iter().any(|track| track.is_called(&sensor.name)) {
        return Err(format!(
            "option `flow`: the file has '{}' already; leave the option out, or ignore the column",
            sensor.name
        ));
    }
    let starts = file.tracks.iter().filter_map(|track| track.series.time_s.first().copied());
    let begin_s = starts.fold(f64::INFINITY, f64::min);
    let series = Series { time_s: vec![begin_s], value: vec![value], ..Series::default() };
    let name = sensor.name.clone();
    Ok(Track {
        short: name.clone(),
        name,
        unit: Some(unit.symbol.to_owned()),
        series,
        repairs: Vec::new(),
        shares: None,
        place: None,
    })
}

/// Names in the options that a file has no column of, and that are no sensor of the rig, are slips of the pen.
///
/// # Errors
/// Names the first.
pub fn check_names(file: &SourceFile, path: &Path, rig: Option<&Rig>, options: &SourceOptions) -> Result<(), LogError> {
    let is_there = |name: &str| {
        file.tracks.iter().any(|track| track.is_called(name)) || file.others.iter().any(|other| other == name)
    };
    let is_sensor = |name: &str| {
        rig.is_some_and(|rig| rig.sensors.iter().any(|s| s.name == name))
            || options.map.iter().any(|(_, to)| to == name)
    };
    let mapped = options.map.iter().map(|(from, _)| ("map", from)).find(|(_, name)| !is_there(name));
    let ignored = options.ignore.iter().map(|name| ("ignore", name)).find(|(_, name)| *name != "*" && !is_there(name));
    let scaled =
        options.scales.iter().map(|(name, _)| ("scale", name)).find(|(_, name)| !is_there(name) && !is_sensor(name));
    let Some((option, name)) = mapped.or(ignored).or(scaled) else { return Ok(()) };
    let names: Vec<String> = file.tracks.iter().map(|track| track.short.clone()).collect();
    let meant =
        nearest(name, names.iter().map(String::as_str)).map_or(String::new(), |n| format!("; did you mean '{n}'?"));
    let why = format!("option `{option}`: there is no '{name}' in it; it has {}{meant}", listed(&names));
    Err(LogError::SourceFile { path: path.into(), why })
}

/// Every sensor of the rig must be in one of the files, which have these `columns`, or among those `without` samples.
///
/// # Errors
/// Names the first that is not.
pub fn require_sensors(
    parts: &[&Recording],
    rig: &Rig,
    without: &[String],
    columns: &[String],
) -> Result<(), LogError> {
    for name in without {
        if !rig.sensors.iter().any(|s| s.name == *name) {
            let why = format!("rig '{}' has no such sensor", rig.name);
            return Err(LogError::Sensors(Box::new(CsvProblem::BadWithout { sensor: name.clone(), why })));
        }
    }
    let recorded = |i: usize| parts.iter().any(|p| p.series.get(i).is_some_and(|s| !s.time_s.is_empty()));
    let missing = rig.sensors.iter().enumerate().find(|(i, s)| !recorded(*i) && !without.contains(&s.name));
    if let Some((_, sensor)) = missing {
        return Err(LogError::Sensors(Box::new(CsvProblem::MissingColumn {
            sensor: sensor.name.clone(),
            kind: sensor.kind.name(),
            rig: rig.name.clone(),
            found: if columns.is_empty() { "none".into() } else { listed(columns) },
            hint: ".".into(),
        })));
    }
    if !rig.pressure_sensors().any(|(i, _)| recorded(i)) {
        return Err(LogError::Sensors(Box::new(CsvProblem::NoPressure)));
    }
    Ok(())
}

/// Brings the numbers of a track to the unit of the line that the user gives, or to the sensor's; whether there is one.
fn scale(track: &mut Track, sensor: &Sensor, options: &SourceOptions) -> bool {
    let given = options.scales.iter().find(|(name, _)| track.is_called(name) || *name == sensor.name);
    // volts stay volts until a line makes something else of them
    let volts = track.unit.as_deref().is_some_and(is_electric);
    if let Some((_, line)) = given.filter(|(_, line)| !(volts && line.is_unit_alone())) {
        track.series.value.iter_mut().for_each(|v| *v = line.scale * *v + line.offset);
        track.unit = line.unit.map(|unit| unit.symbol.to_owned());
    }
    given.is_some()
}

fn sensor_of(track: &Track, rig: &Rig, options: &SourceOptions) -> Result<Option<usize>, CsvProblem> {
    let place = |name: &str| rig.sensors.iter().position(|s| s.name == name);
    if let Some((_, sensor)) = options.map.iter().find(|(from, _)| track.is_called(from)) {
        return place(sensor)
            .map(Some)
            .ok_or_else(|| unknown(&Track { name: sensor.clone(), ..Track::default() }, rig));
    }
    if options.ignore.iter().any(|name| track.is_called(name)) {
        return Ok(None);
    }
    Ok(place(&track.name).or_else(|| place(&track.short)))
}

fn unknown(track: &Track, rig: &Rig) -> CsvProblem {
    let known: Vec<&str> = rig.sensors.iter().map(|s| s.name.as_str()).collect();
    let meant = nearest(&track.name, known.iter().copied());
    CsvProblem::UnknownColumn {
        column: track.name.clone(),
        rig: rig.name.clone(),
        hint: meant
            .map_or(".".into(), |n| format!("; did you mean '{n}'? Then add option `map '{}={n}'`.", track.name)),
        known: known.join(", "),
    }
}

fn no_sensor(path: &Path, rig: &Rig, spare: &[String], table: bool) -> LogError {
    let sensors: Vec<&str> = rig.sensors.iter().map(|s| s.name.as_str()).collect();
    let first = spare.first().map_or("NAME", String::as_str);
    let what = if table { "columns" } else { "channels" };
    let sensor = sensors.first().copied().unwrap_or("P1");
    let why = format!(
        "none of its {what} is a sensor of rig '{}', which has {}. Assign them, as in option `map '{first}={sensor}'`; the file has {}",
        rig.name,
        sensors.join(", "),
        listed(spare)
    );
    LogError::SourceFile { path: path.into(), why }
}

/// The samples in the sensor's unit. That of the atmosphere under an absolute pressure is a guess.
fn converted(
    track: Track,
    sensor: &Sensor,
    density: f64,
    is_scaled: bool,
    guess: bool,
    repairs: &mut Vec<Repair>,
) -> Result<Series, CsvProblem> {
    let mut series = track.series;
    let Some(text) = track.unit else { return Ok(series) };
    let quantity = quantity_of(sensor.kind);
    let found = match quantity {
        // What a line gives counts from the atmosphere, whatever the name says.
        Quantity::Pressure if !is_scaled => pressure_unit(&track.short, &text),
        _ => spelled_unit(&text, quantity).map(|unit| (unit, false)),
    };
    let (from, is_absolute) = match found {
        Some((_, true)) if !guess => return Err(CsvProblem::Absolute { column: track.name, unit: text }),
        Some(found) => found,
        // a trigger may be a voltage: only its edges count
        None if quantity == Quantity::Ratio => return Ok(series),
        None => {
            let known: Vec<&str> = UNITS.iter().filter(|u| u.quantity == quantity).map(|u| u.symbol).collect();
            let kind = sensor.kind.name();
            let name = &track.short;
            let remedy = format!("'{name}={}'", line_like(&text, sensor.unit.symbol));
            return Err(CsvProblem::WrongUnit {
                column: track.name,
                unit: text,
                kind,
                known: known.join(", "),
                remedy,
            });
        }
    };
    let under_pa = if is_absolute { ATMOSPHERE_PA } else { 0.0 };
    if is_absolute {
        let name = &sensor.name;
        let off = significant(from.from_si(ATMOSPHERE_PA, density), 6);
        let text = format!(
            "'{}' is absolute: the standard atmosphere, {off} {from}, is taken off (for that of your day: option `scale '{name}=x-{off} {from}'`)",
            track.name
        );
        repairs.push(Repair::guess("absolute", text));
    }
    if from.symbol == sensor.unit.symbol && !is_absolute {
        return Ok(series);
    }
    for value in &mut series.value {
        *value = sensor.unit.from_si(from.to_si(*value, density) - under_pa, density);
    }
    if from.symbol != sensor.unit.symbol {
        let text =
            format!("'{}' is converted from {text} to {}, the unit of '{}'", track.name, sensor.unit, sensor.name);
        repairs.push(Repair::new("unit", 1, None, text));
    }
    Ok(series)
}
