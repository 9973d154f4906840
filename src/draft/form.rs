//! The questions about a rig as a form beside the table: each answer is a text, each remark stands beside its field.
//!
//! Nothing is taken in silence. What neither the file nor its reader can say is asked for; what has a usual answer is
//! shown with its reason.

use serde::{Deserialize, Serialize};

use crate::draft::answers::{
    Amiss, Answers, CLOSING_TIME, DISCHARGE_HEAD, Drafted, INNER_DIAMETER, LENGTH, Measured, NOT_GIVEN, PLACE,
    TEMPERATURE, WALL, flow, material, supply,
};
use crate::draft::reading::Reading;
use crate::draft::remark::{Remark, Weight, taken};
use crate::draft::{Misread, Said, checked, has_flow, meant};
use crate::rig::check::{Level, check};
use crate::rig::draft::{Draft, Told};
use crate::rig::sizes::{EXAMPLES, pipe_size};
use crate::rig::{Rig, SensorKind, quantity_of, spelled_unit};
use crate::storage::import::{Line, Repair, SourceFile, SourceOptions, is_electric};
use crate::units::{Quantity, Unit};

/// What a person has written; a field that was left empty is an empty text.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Form {
    /// Name of the rig.
    pub name: String,
    /// Material of the wall.
    pub material: String,
    /// Length, m.
    pub length: String,
    /// Size of the pipe; otherwise its inner diameter and wall.
    pub size: String,
    /// Inner diameter, mm.
    pub inner_diameter: String,
    /// Wall, mm.
    pub wall: String,
    /// `reservoir` or `pump`.
    pub supply: String,
    /// Temperature of the water, °C.
    pub temperature: String,
    /// Closing time, s.
    pub closing_time: String,
    /// Head behind the valve, m.
    pub discharge_head: String,
    /// Flow before the closure that was measured by hand, with its unit.
    pub flow: String,
    /// How the file is read.
    pub reading: Reading,
    /// What the person answers about columns.
    pub columns: Vec<Column>,
}

/// What the person answers about a column.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Column {
    /// Its full name.
    pub column: String,
    /// The kind of sensor that it is, as rig files spell it; `none`; or empty, as the file shows it.
    pub is: String,
    /// Unit of its numbers, or the line of its transducer with the unit behind it.
    pub unit: String,
    /// Distance from the supply, m.
    pub place: String,
}

/// A column as the reader understands it with these answers.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// What it measures; none where it is no sensor.
    pub kind: Option<SensorKind>,
    /// Unit of its samples, once it is known.
    pub unit: Option<Unit>,
    /// Distance from the supply, m; once the pipe is known, and where the kind has a place.
    pub position_m: Option<f64>,
}

/// A rig that can be written.
#[derive(Debug, Clone)]
pub struct Made {
    /// It.
    pub rig: Rig,
    /// Its file.
    pub text: String,
    /// How the file is read onto it.
    pub source: SourceOptions,
    /// What in the file contradicts the rig.
    pub doubts: Vec<String>,
    /// What is converted or guessed when the file is read onto the rig.
    pub repairs: Vec<Repair>,
}

/// What is known of the pipe, to be drawn.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Pipe {
    /// Length, m.
    pub length_m: Option<f64>,
    /// Inner diameter, mm.
    pub inner_diameter_mm: Option<f64>,
    /// Wall, mm.
    pub wall_thickness_mm: Option<f64>,
    /// Its material.
    pub material: Option<&'static str>,
    /// What feeds it.
    pub supply: Option<String>,
}

/// What a form makes of a file.
#[derive(Debug, Clone, Default)]
pub struct Filled {
    /// The pipe.
    pub pipe: Pipe,
    /// The columns, in the file's order.
    pub columns: Vec<Seen>,
    /// What there is to say of the fields.
    pub remarks: Vec<Remark>,
    /// The rig, where nothing is wrong or open.
    pub made: Option<Made>,
}

impl Form {
    /// The rig that the form makes of a file that was read as its [`reading`](Reading::options) says. A rig without a
    /// name is `called`.
    pub fn filled(&self, file: &SourceFile, called: &str) -> Filled {
        let mut remarks = Vec::new();
        let mut columns = self.said(file, &mut remarks);
        columns.source.flow = taken(&self.flow, "flow", flow, &mut remarks);
        let by_hand = columns.source.flow.take();
        if by_hand.is_some() && has_flow(file, &columns) {
            remarks.push(Remark::new(Weight::Wrong, "flow", "a column of the file is the flow already"));
        }
        columns.source.flow = by_hand;
        remarks.extend(self.reading.asked(&file.repairs));
        let seen = file.tracks.iter().map(|track| match meant(track, &columns) {
            Some((kind, unit)) => Seen { kind: Some(kind), unit: unit.map(|told| told.value), position_m: None },
            None => Seen::default(),
        });
        let mut seen: Vec<Seen> = seen.collect();
        if seen.iter().all(|column| column.kind != Some(SensorKind::Pressure)) {
            let says = "No column is a pressure yet: choose which one is. Of one in volts or milliamperes write the ranges as well.";
            remarks.push(Remark::new(Weight::Open, "columns", says));
        }
        let answers = self.answers(columns, called, &mut remarks);
        let places = self.places(file, &answers, &mut remarks);
        seen.iter_mut().zip(&places).for_each(|(column, place_m)| column.position_m = *place_m);
        let pipe = Pipe {
            length_m: answers.length_m,
            inner_diameter_mm: answers.inner_diameter_mm,
            wall_thickness_mm: answers.wall_thickness_mm,
            material: answers.material.map(|material| material.name),
            supply: answers.supply.clone(),
        };
        let made = match answers.drafted(Some(file)) {
            Ok(Drafted { mut draft, .. }) => {
                for sensor in &mut draft.sensors {
                    let at = file.tracks.iter().position(|track| Some(&track.name) == sensor.column.as_ref());
                    if let Some(place_m) = at.and_then(|at| places[at]) {
                        sensor.position_m = Told::given(place_m);
                    }
                }
                remarks.extend(assumed(&draft, file, answers.discharge_head_m.is_some(), &mut seen));
                self.made(&draft, file, &answers, &mut remarks)
            }
            Err(Amiss::Open(_) | Amiss::NoPressure { .. } | Amiss::NoColumn { .. }) => {
                self.ask_of_units(file, &seen, &mut remarks);
                None
            }
        };
        Filled { pipe, columns: seen, remarks, made }
    }

    fn of_column(&self, name: &str) -> Column {
        self.columns.iter().find(|column| column.column == name).cloned().unwrap_or_default()
    }

    /// The answers about the columns.
    fn said(&self, file: &SourceFile, remarks: &mut Vec<Remark>) -> Said {
        let mut said = Said { source: self.reading.options(remarks), ..Said::default() };
        for (i, track) in file.tracks.iter().enumerate() {
            let column = self.of_column(&track.name);
            let kind = |text: &str| match SensorKind::ALL.into_iter().find(|kind| kind.name() == text) {
                _ if text == "none" => Ok(None),
                Some(kind) => Ok(Some(kind)),
                None => Err("choose what the column is".to_owned()),
            };
            match taken(&column.is, &format!("columns.{i}.is"), kind, remarks) {
                Some(None) => {
                    said.source.ignore.push(track.name.clone());
                    continue;
                }
                Some(Some(kind)) => said.kinds.push((track.name.clone(), kind)),
                None => {}
            }
            let kind = said.kinds.iter().find(|(name, _)| *name == track.name).map(|(_, kind)| *kind);
            let kind = kind.or_else(|| Some(meant(track, &said)?.0));
            let line = taken(
                &column.unit,
                &format!("columns.{i}.unit"),
                |text| line_of(text, kind, track.unit.as_deref()),
                remarks,
            );
            said.source.scales.extend(line.map(|line| (track.name.clone(), line)));
        }
        said
    }

    /// The places that are given, by the file's columns.
    fn places(&self, file: &SourceFile, answers: &Answers, remarks: &mut Vec<Remark>) -> Vec<Option<f64>> {
        let asked = PLACE.up_to(answers.length_m.unwrap_or(PLACE.range[1]));
        let mut place = |(i, name): (usize, &str)| {
            taken(&self.of_column(name).place, &format!("columns.{i}.place"), |text| asked.parse(text), remarks)
        };
        file.tracks.iter().map(|track| track.name.as_str()).enumerate().map(&mut place).collect()
    }

    /// Units that nothing states, while the pipe is not known.
    fn ask_of_units(&self, file: &SourceFile, seen: &[Seen], remarks: &mut Vec<Remark>) {
        for (i, column) in seen.iter().enumerate() {
            let written = self.of_column(&file.tracks[i].name).unit;
            if let (Some(_), None, "") = (column.kind, column.unit, written.trim()) {
                remarks.push(Remark::new(Weight::Open, format!("columns.{i}.unit"), "the file does not say it"));
            }
        }
    }

    /// The answers about the pipe.
    fn answers(&self, columns: Said, called: &str, remarks: &mut Vec<Remark>) -> Answers {
        let mut number =
            |text: &str, field: &str, asked: Measured| taken(text, field, |text| asked.parse(text), remarks);
        let length_m = number(&self.length, "length", LENGTH);
        let temperature_degc = number(&self.temperature, "temperature", TEMPERATURE);
        let closing_time_s = number(&self.closing_time, "closing_time", CLOSING_TIME);
        let discharge_head_m = number(&self.discharge_head, "discharge_head", DISCHARGE_HEAD);
        let inner = number(&self.inner_diameter, "inner_diameter", INNER_DIAMETER);
        let wall = number(&self.wall, "wall", WALL.up_to(inner.unwrap_or(WALL.range[1])));
        let size = taken(&self.size, "size", pipe_size, remarks);
        let is_empty = |text: &str| text.trim().is_empty();
        let both = !is_empty(&self.inner_diameter) || !is_empty(&self.wall);
        if !is_empty(&self.size) && both {
            let says = "write either the size, or the inner diameter and the wall";
            remarks.push(Remark::new(Weight::Wrong, "size", says));
        }
        let (inner, wall) = match size {
            Some(size) => (Some(1e3 * size.inner_diameter_m), Some(1e3 * size.wall_thickness_m)),
            None => (inner, wall),
        };
        let mut open = |field: &str, text: &str, says: &str| {
            if is_empty(text) {
                remarks.push(Remark::new(Weight::Open, field, says));
            }
        };
        open("material", &self.material, "needed");
        open("length", &self.length, "needed");
        if is_empty(&self.size) && !both {
            open("size", &self.size, &format!("needed, as in {EXAMPLES}; or write inner diameter and wall"));
        } else if is_empty(&self.size) {
            open("inner_diameter", &self.inner_diameter, "needed");
            open("wall", &self.wall, "needed");
        }
        let name = self.name.trim();
        Answers {
            name: if name.is_empty() { called.to_owned() } else { name.to_owned() },
            material: taken(&self.material, "material", material, remarks),
            length_m,
            inner_diameter_mm: inner,
            wall_thickness_mm: wall,
            temperature_degc,
            supply: taken(&self.supply, "supply", supply, remarks),
            closing_time_s,
            discharge_head_m,
            columns,
        }
    }

    /// The rig of a draft, where nothing is wrong or open.
    fn made(&self, draft: &Draft, file: &SourceFile, answers: &Answers, remarks: &mut Vec<Remark>) -> Option<Made> {
        if remarks.iter().any(|remark| remark.weight != Weight::Assumed) {
            return None;
        }
        let text = draft.text();
        let rig = match Rig::from_toml(&text, "the rig") {
            Ok(rig) => rig,
            Err(error) => {
                remarks.push(Remark::new(Weight::Wrong, "rig", error.to_string()));
                return None;
            }
        };
        let source = bound_to(draft, file, answers);
        let findings = check(&rig).into_iter().filter(|finding| finding.level != Level::Fine);
        let mut doubts: Vec<String> =
            findings.map(|finding| format!("{}: {}", finding.subject, finding.message)).collect();
        let mut repairs = Vec::new();
        let checked = checked(&rig, file, &source, &mut repairs);
        if let Some(Misread { sensor, says, .. }) = checked.misread {
            let column = draft.sensors.iter().find(|s| s.name == sensor).and_then(|s| s.column.as_ref());
            let at = file.tracks.iter().position(|track| Some(&track.name) == column);
            let field = at.map_or("columns".to_owned(), |at| format!("columns.{at}.unit"));
            remarks.push(Remark::new(
                Weight::Open,
                field,
                format!("{says}. Write what its numbers stand for, or leave it out"),
            ));
            return None;
        }
        match checked.doubts {
            Ok(found) => doubts.extend(found),
            Err(error) => doubts.push(format!("no closure can be seen in the file: {error}")),
        }
        Some(Made { rig, text, source, doubts, repairs })
    }
}

/// The line of a column of a kind: a unit, or what a transducer's numbers stand for. Volts are no pressure without one.
fn line_of(text: &str, kind: Option<SensorKind>, written: Option<&str>) -> Result<Line, String> {
    let quantity = kind.map(quantity_of);
    if quantity == Some(Quantity::Ratio) {
        let unit = spelled_unit(text, Quantity::Ratio).ok_or_else(|| format!("'{text}': write 1 or %"))?;
        return Ok(Line { scale: 1.0, offset: 0.0, unit: Some(unit) });
    }
    let line: Line = text.parse()?;
    if let Some(volts) = written.filter(|unit| is_electric(unit) && line.is_unit_alone()) {
        return Err(format!("the column is in {volts}: write the ranges of its transducer, such as 1..5 -> 0..10 bar"));
    }
    let unit = line.unit.ok_or_else(|| format!("'{text}': write the unit of the result behind it, such as bar"))?;
    match kind {
        Some(kind) if quantity != Some(unit.quantity) => Err(format!("{unit} is no unit of a {}", kind.name())),
        _ => Ok(line),
    }
}

/// How a file is read onto the rig that was drafted from it.
fn bound_to(draft: &Draft, file: &SourceFile, answers: &Answers) -> SourceOptions {
    let column_of = |name: &str| draft.sensors.iter().find(|s| s.column.as_deref() == Some(name));
    let mut source = answers.columns.source.clone();
    for track in &file.tracks {
        match column_of(&track.name) {
            Some(sensor) if sensor.name != track.name => source.map.push((track.name.clone(), sensor.name.clone())),
            Some(_) => {}
            None if source.ignore.contains(&track.name) => {}
            None => source.ignore.push(track.name.clone()),
        }
    }
    source
}

/// What nobody said, beside its field: what is open of the units, and what is taken of the rest. Fills in what was
/// found of the columns.
fn assumed(draft: &Draft, file: &SourceFile, has_head: bool, seen: &mut [Seen]) -> Vec<Remark> {
    let mut remarks = Vec::new();
    let because =
        |why: &str| if why == NOT_GIVEN { " where nothing is written".to_owned() } else { format!(": {why}") };
    let mut take = |field: &str, told: &Told<f64>, unit: &str| {
        if !told.why.is_empty() {
            let says = format!("{} {unit} is taken{}", (1e4 * told.value).round() / 1e4, because(&told.why));
            remarks.push(Remark::new(Weight::Assumed, field, says));
        }
    };
    take("temperature", &draft.temperature_degc, "°C");
    take("closing_time", &draft.closing_time_s, "s");
    if !has_head {
        take("discharge_head", &Told::assumed(draft.discharge_head_m, NOT_GIVEN), "m");
    }
    for sensor in &draft.sensors {
        let Some(at) = file.tracks.iter().position(|track| Some(&track.name) == sensor.column.as_ref()) else {
            continue;
        };
        if matches!(sensor.kind, SensorKind::Pressure | SensorKind::Flow) {
            take(&format!("columns.{at}.place"), &sensor.position_m, "m");
            seen[at].position_m = Some(sensor.position_m.value);
        }
        seen[at].unit = Some(sensor.unit.value).filter(|_| sensor.unit.why.is_empty());
    }
    if !draft.supply.why.is_empty() {
        let says = format!("a {} is taken{}", draft.supply.value, because(&draft.supply.why));
        remarks.push(Remark::new(Weight::Assumed, "supply", says));
    }
    let sensors = draft.sensors.iter().filter(|sensor| !sensor.unit.why.is_empty());
    for sensor in sensors {
        let at = file.tracks.iter().position(|track| Some(&track.name) == sensor.column.as_ref());
        let says = format!("{}; is it {}?", sensor.unit.why, sensor.unit.value);
        remarks.extend(at.map(|at| Remark::new(Weight::Open, format!("columns.{at}.unit"), says)));
    }
    remarks
}
