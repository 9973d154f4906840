//! The questions about a rig, whoever asks them, and the draft that the answers and the file of a test make.

use crate::draft::{Said, place, sensors_of, without_pressure};
use crate::rig::draft::{Draft, DraftSensor, Told};
use crate::rig::material::{MATERIALS, Material};
use crate::rig::{SensorKind, spelled_unit};
use crate::storage::import::source::NAMELESS;
use crate::storage::import::{SourceFile, Track, is_electric, line_like};
use crate::storage::nearest::{listed, nearest};
use crate::units::written::{measure, number};
use crate::units::{Quantity, Unit};

/// A question whose answer is a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// What is asked for.
    pub words: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The least and the largest answer.
    pub range: [f64; 2],
}

impl Measured {
    const fn new(words: &'static str, unit: &'static str, range: [f64; 2]) -> Measured {
        Measured { words, unit, range }
    }

    /// The same with another largest answer.
    #[must_use]
    pub fn up_to(self, most: f64) -> Measured {
        Measured { range: [self.range[0], most], ..self }
    }

    /// An answer as a person writes it: with a decimal comma, or with another unit behind it.
    ///
    /// # Errors
    /// What to write instead.
    pub fn parse(&self, text: &str) -> Result<f64, String> {
        let (unit, [low, high]) = (self.unit, self.range);
        match measure(text, unit) {
            _ if text.trim().is_empty() => Err(format!("type a number in {unit}")),
            Ok(value) if (low..=high).contains(&value) => Ok(value),
            Ok(_) => Err(format!("it must be from {low} to {high} {unit}")),
            Err(error) => Err(error),
        }
    }
}

/// Length of the pipe.
pub const LENGTH: Measured = Measured::new("length from the supply to the valve", "m", [0.1, 1e6]);
/// Its inner diameter.
pub const INNER_DIAMETER: Measured = Measured::new("inner diameter", "mm", [1.0, 1e4]);
/// Its wall, which is no thicker than the pipe is wide.
pub const WALL: Measured = Measured::new("thickness of the wall", "mm", [0.01, 1e4]);
/// Temperature of the water.
pub const TEMPERATURE: Measured = Measured::new("temperature of the water", "°C", [0.0, 100.0]);
/// Closing time of the valve.
pub const CLOSING_TIME: Measured = Measured::new("closing time of the valve", "s", [1e-4, 1e4]);
/// Head behind the valve.
pub const DISCHARGE_HEAD: Measured = Measured::new("head behind the valve", "m", [-1e4, 1e4]);
/// Place of a sensor.
pub const PLACE: Measured = Measured::new("distance from the supply", "m", [0.0, 1e6]);
/// Rate of samples that are only counted.
pub const RATE: Measured = Measured::new("samples per second", "Hz", [1e-3, 1e7]);

/// Why a usual answer is taken that nothing else speaks for.
pub const NOT_GIVEN: &str = "not given";
/// What feeds a pipe.
pub const SUPPLIES: [&str; 2] = ["reservoir", "pump"];

/// A material of the wall by its name.
///
/// # Errors
/// The known ones, and the nearest.
pub fn material(text: &str) -> Result<&'static Material, String> {
    let near =
        || nearest(text, MATERIALS.iter().map(|m| m.name)).map_or(String::new(), |n| format!(" (did you mean {n}?)"));
    Material::by_name(text).ok_or_else(|| format!("'{text}' is not a known material{}; {}", near(), known_materials()))
}

/// The materials, for messages.
pub fn known_materials() -> String {
    format!("known are {}", MATERIALS.iter().map(|m| m.name).collect::<Vec<_>>().join(", "))
}

/// What feeds a pipe, in the words of a rig file.
///
/// # Errors
/// Those words.
pub fn supply(text: &str) -> Result<String, String> {
    let word = text.to_lowercase();
    let known = if word == "tank" { SUPPLIES[0] } else { word.as_str() };
    SUPPLIES.contains(&known).then(|| known.to_owned()).ok_or("write reservoir or pump".to_owned())
}

/// A flow with its unit, such as `0.25 L/s`.
///
/// # Errors
/// What it may look like.
pub fn flow(text: &str) -> Result<(f64, Unit), String> {
    let wrong = || format!("'{text}': write a flow with its unit, such as 0.25 L/s or 15 L/min");
    let (value, unit) = text.trim().split_at(text.trim().find(char::is_alphabetic).ok_or_else(wrong)?);
    let value = number(value).ok().filter(|v| *v > 0.0).ok_or_else(wrong)?;
    spelled_unit(unit.trim(), Quantity::Flow).map(|unit| (value, unit)).ok_or_else(wrong)
}

/// What a person says of a rig and of the file of a test; what is not said is none.
#[derive(Debug, Clone, Default)]
pub struct Answers {
    /// Name of the rig.
    pub name: String,
    /// Material of the wall.
    pub material: Option<&'static Material>,
    /// Length, m.
    pub length_m: Option<f64>,
    /// Inner diameter, mm.
    pub inner_diameter_mm: Option<f64>,
    /// Wall, mm.
    pub wall_thickness_mm: Option<f64>,
    /// Temperature of the water, °C.
    pub temperature_degc: Option<f64>,
    /// What feeds the pipe, one of [`SUPPLIES`].
    pub supply: Option<String>,
    /// Closing time, s.
    pub closing_time_s: Option<f64>,
    /// Head behind the valve, m.
    pub discharge_head_m: Option<f64>,
    /// What the columns of the file are.
    pub columns: Said,
}

/// What answers make.
#[derive(Debug, Clone)]
pub struct Drafted {
    /// The rig to be.
    pub draft: Draft,
    /// Columns that look like no sensor.
    pub left_out: Vec<String>,
}

/// Why answers make no rig.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Amiss {
    /// A question that has no usual answer.
    #[error("{0} is not known yet")]
    Open(&'static str),
    /// No column is a pressure.
    #[error("no column looks like a pressure; the columns are {}. Of one that is, give {}", listed(.columns), .remedies.join("; "))]
    NoPressure {
        /// The columns that are no sensor.
        columns: Vec<String>,
        /// What to give of them, one for each kind of column.
        remedies: Vec<String>,
    },
    /// A place for a column that the file does not have.
    #[error("option `sensor {name}`: the file has no such column; it has {known}")]
    NoColumn {
        /// The name.
        name: String,
        /// Sensors of the file.
        known: String,
    },
}

/// What to give of columns of which none is a pressure yet.
pub fn no_pressure(file: &SourceFile, columns: Vec<String>) -> Amiss {
    let others = || file.tracks.iter().filter(|track| columns.contains(&track.name));
    let unit = |track: &Track| track.unit.clone().unwrap_or_default();
    // a column without a heading goes by its place
    let called = |track: &Track| match (track.name.trim(), track.place) {
        ("", Some(place)) => format!("{NAMELESS}{place}"),
        _ => track.name.clone(),
    };
    let first =
        |is: &dyn Fn(&str) -> bool| others().find(|track| is(&unit(track))).map(|track| (called(track), unit(track)));
    let volts = first(&is_electric).map(|(name, unit)| {
        format!(
            "the ranges of its transducer, for it is in '{unit}', as in option `scale '{name}={}'` (or its line, '{name}=2.5*x-2.5 bar')",
            line_like(&unit, "bar")
        )
    });
    let unknown = first(&|unit| !unit.is_empty() && !is_electric(unit)).map(|(name, unit)| {
        format!(
            "what its numbers stand for, if it is in '{unit}', as in option `scale '{name}={}'` with its number",
            line_like(&unit, "bar")
        )
    });
    let bare = first(&str::is_empty).map(|(name, _)| {
        format!(
            "its place and its unit, as in option `sensor '{name}=12.5'` and option `unit` (bar, kPa, psi, m(H2O), …)"
        )
    });
    let remedies = volts.into_iter().chain(unknown).chain(bare).collect();
    Amiss::NoPressure { columns, remedies }
}

impl Answers {
    /// The rig that the answers make of a file, or without one: what is not said and has a usual answer is assumed,
    /// with the reason.
    ///
    /// # Errors
    /// See [`Amiss`].
    pub fn drafted(&self, file: Option<&SourceFile>) -> Result<Drafted, Amiss> {
        let mut draft = self.pipe()?;
        let mut left_out = Vec::new();
        if let Some(file) = file {
            if let Some(columns) = without_pressure(file, &self.columns) {
                return Err(no_pressure(file, columns));
            }
            (draft.sensors, left_out) = sensors_of(file, &draft, &self.columns);
            place(&mut draft, file, &self.columns.source);
        }
        self.put(&mut draft, file)?;
        Ok(Drafted { draft, left_out })
    }

    /// Pipe, ends and water, without sensors.
    fn pipe(&self) -> Result<Draft, Amiss> {
        let or = |given: Option<f64>, usual| given.map_or_else(|| Told::assumed(usual, NOT_GIVEN), Told::given);
        let needed = |given: Option<f64>, asked: Measured| given.ok_or(Amiss::Open(asked.words));
        let supply = self.supply.clone().map(Told::given);
        Ok(Draft {
            name: self.name.clone(),
            temperature_degc: or(self.temperature_degc, 20.0),
            material: self.material.ok_or(Amiss::Open("material of the wall"))?.name.to_owned(),
            length_m: needed(self.length_m, LENGTH)?,
            inner_diameter_mm: needed(self.inner_diameter_mm, INNER_DIAMETER)?,
            wall_thickness_mm: needed(self.wall_thickness_mm, WALL)?,
            supply: supply.unwrap_or_else(|| Told::assumed(SUPPLIES[0].to_owned(), NOT_GIVEN)),
            closing_time_s: or(self.closing_time_s, 0.1),
            discharge_head_m: self.discharge_head_m.unwrap_or(0.0),
            sensors: Vec::new(),
        })
    }

    /// Sensors at the places that are given; without a file, each of them is a pressure.
    fn put(&self, draft: &mut Draft, file: Option<&SourceFile>) -> Result<(), Amiss> {
        let pressure = |name: &str, position_m| DraftSensor {
            name: name.to_owned(),
            kind: SensorKind::Pressure,
            unit: Told::given(self.columns.unit.unwrap_or(Unit::BAR)),
            position_m,
            column: None,
        };
        let called = |column: &Option<String>, name: &str| {
            let track = file.and_then(|file| file.tracks.iter().find(|track| Some(&track.name) == column.as_ref()));
            track.is_some_and(|track| track.is_called(name))
        };
        for (name, place_m) in &self.columns.places {
            match draft.sensors.iter_mut().find(|s| s.name == *name || called(&s.column, name)) {
                Some(sensor) => sensor.position_m = Told::given(*place_m),
                None if file.is_none() => draft.sensors.push(pressure(name, Told::given(*place_m))),
                None => {
                    let known: Vec<&str> = draft.sensors.iter().map(|s| s.name.as_str()).collect();
                    return Err(Amiss::NoColumn { name: name.clone(), known: known.join(", ") });
                }
            }
        }
        if draft.sensors.is_empty() {
            let why = "no file and no place is given: one pressure sensor at the valve";
            draft.sensors.push(pressure("P1", Told::assumed(draft.length_m, why)));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_taken_as_people_write_them() {
        assert_eq!((LENGTH.parse("328 ft").map(f64::round), LENGTH.parse("80,5")), (Ok(100.0), Ok(80.5)));
        for (asked, text, words) in [
            (LENGTH, "", "type a number in m"),
            (LENGTH, "0", "from 0.1 to 1000000 m"),
            (TEMPERATURE, "20 F", "in °C"),
            (PLACE.up_to(100.0), "101", "from 0 to 100 m"),
        ] {
            let why = asked.parse(text).unwrap_err();
            assert!(why.contains(words), "{text}: {why}");
        }
        assert_eq!((supply("Tank").unwrap(), supply("pump").unwrap()), ("reservoir".to_owned(), "pump".to_owned()));
        assert!(supply("well").is_err() && material("coper").unwrap_err().contains("did you mean copper?"));
        assert!(
            flow("0.25 L/s").is_ok_and(|(value, unit)| (value, unit.symbol) == (0.25, "L/s")) && flow("0.25").is_err()
        );
    }

    #[test]
    fn a_rig_without_its_length_is_none_and_one_without_a_file_has_a_sensor_at_the_valve() {
        let mut answers = Answers {
            name: "line".into(),
            material: material("copper").ok(),
            inner_diameter_mm: Some(19.0),
            wall_thickness_mm: Some(1.5),
            ..Answers::default()
        };
        assert_eq!(answers.drafted(None).unwrap_err(), Amiss::Open(LENGTH.words));
        answers.length_m = Some(80.0);
        let draft = answers.drafted(None).unwrap().draft;
        assert_eq!((draft.sensors.len(), draft.sensors[0].position_m.value), (1, 80.0));
        assert!(draft.assumed().iter().any(|line| line.contains("at the valve")), "{:?}", draft.assumed());
    }
}
