//! `surgescope rig new`: a rig file from what a person knows of the pipe, and from the columns of a logger's file.

use std::borrow::Cow;
use std::io::{IsTerminal as _, stderr, stdin};
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde_json::{Value, json};

use crate::cli::args::import_options::{ForeignArgs, flow};
use crate::cli::args::values::{not_negative, pair};
use crate::cli::commands::rig::check;
use crate::cli::console::ask::{BACK, Dialogue};
use crate::cli::console::document::say_document;
use crate::cli::console::numbers::measure;
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell};
use crate::draft::{contradictions, place, sensors_of, without_pressure};
use crate::report::advice::quoted;
use crate::report::rig_drawing;
use crate::rig::check::{Finding, Level, check as check_rig};
use crate::rig::draft::{Draft, DraftSensor, Told};
use crate::rig::material::{MATERIALS, Material};
use crate::rig::sizes::{EXAMPLES, PipeSize, pipe_size};
use crate::rig::{Rig, Sensor, SensorKind, quantity_of, spelled_unit};
use crate::shown::Shown as _;
use crate::storage::import::{Line, SourceFile, SourceOptions, check_names, read_source};
use crate::storage::nearest::nearest;
use crate::storage::output;
use crate::units::{Quantity, Unit};

/// Write a rig file: asks what is not given, and takes the sensors from a file of the test.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A file of a test (CSV, Excel, TDMS, MCAP): its columns become the sensors.
    file: Option<PathBuf>,
    /// The rig file to write; must not exist.
    #[arg(short, long, value_name = "RIG", default_value = "rig.toml")]
    output: PathBuf,
    /// Name of the rig [default: that of the rig file].
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Material of the wall: HDPE, PVC, copper, steel, …
    #[arg(long, value_name = "MATERIAL", value_parser = material)]
    material: Option<&'static Material>,
    /// Length from the supply to the valve, m.
    #[arg(long, value_name = "M", value_parser = above_0("m"), allow_negative_numbers = true)]
    length_m: Option<f64>,
    /// Size of the pipe instead of diameter and wall: '63 SDR11', 22x1.5, DN50, 'NPS 2', 'copper 3/4 L'.
    #[arg(long, value_name = "SIZE", conflicts_with_all = ["inner_diameter_mm", "wall_thickness_mm"])]
    pipe: Option<String>,
    /// Inner diameter, mm.
    #[arg(long, value_name = "MM", value_parser = above_0("mm"), allow_negative_numbers = true)]
    inner_diameter_mm: Option<f64>,
    /// Thickness of the wall, mm.
    #[arg(long, value_name = "MM", value_parser = above_0("mm"), allow_negative_numbers = true)]
    wall_thickness_mm: Option<f64>,
    /// Temperature of the water, °C [default: that of the file, or 20].
    #[arg(long = "temperature-degC", value_name = "DEGC", value_parser = not_negative, allow_negative_numbers = true)]
    temperature_degc: Option<f64>,
    /// What feeds the pipe [default: reservoir].
    #[arg(long, value_name = "SUPPLY", value_parser = supplies())]
    supply: Option<String>,
    /// Nominal closing time of the valve, s [default: as the file shows it, or 0.1].
    #[arg(long, value_name = "S", value_parser = above_0("s"), allow_negative_numbers = true)]
    closing_time_s: Option<f64>,
    /// Head behind the valve, m [default: 0].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    discharge_head_m: Option<f64>,
    /// Distance of a sensor from the supply, m; without a file, a pressure sensor to add. Several may be given.
    #[arg(long, value_name = "NAME=M", value_parser = sensor_at)]
    sensor: Vec<(String, f64)>,
    /// Unit of the pressures: of columns that state none, that --scale brings to it, and of sensors that --sensor adds [default: as the values
    /// show it, otherwise bar].
    #[arg(long, value_name = "UNIT", value_parser = pressure_unit)]
    unit: Option<Unit>,
    #[command(flatten)]
    foreign: ForeignArgs,
    /// Ask nothing: assume what is not given, and report it.
    #[arg(short, long)]
    yes: bool,
}

/// A number above 0 in a unit, or with its own unit behind it.
fn above_0(unit: &'static str) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| measure(text, unit).and_then(|v| if v > 0.0 { Ok(v) } else { Err("must be above 0".to_owned()) })
}

/// A sensor and its distance from the supply, m.
fn sensor_at(text: &str) -> Result<(String, f64), String> {
    let (name, place) = pair(text)?;
    Ok((name, measure(&place, "m")?))
}

/// What feeds a pipe, in the words of a rig file.
fn supply(text: &str) -> Result<String, String> {
    let word = text.to_lowercase();
    let known = if word == "tank" { "reservoir" } else { word.as_str() };
    SUPPLIES.contains(&known).then(|| known.to_owned()).ok_or("write reservoir or pump".to_owned())
}

/// The supplies as options take them, by which shells complete them.
fn supplies() -> impl TypedValueParser<Value = String> {
    let known = SUPPLIES.map(|word| PossibleValue::new(word).aliases((word == SUPPLIES[0]).then_some("tank")));
    PossibleValuesParser::new(known).try_map(|word| supply(&word))
}

const SUPPLIES: [&str; 2] = ["reservoir", "pump"];

/// Runs it.
///
/// # Errors
/// What is missing and may not be asked; a file that cannot be read or written.
pub fn run(mut args: Args, json: bool) -> CommandResult {
    if args.output.exists() {
        return Err(format!("{} exists already: name another file with -o", args.output.shown()).into());
    }
    let asks = !args.yes && !json && stdin().is_terminal() && stderr().is_terminal();
    let ask = Ask { asks, dialogue: Dialogue::default() };
    let source = guessing(&args.foreign);
    // A file that cannot be read costs no answers; one that only counts its samples lacks but one.
    let read = match args.file.as_deref().map(|file| read_source(file, &source)) {
        Some(Err(error)) if asks && error.lacks_rate() => None,
        read => read.transpose()?,
    };
    if let (Some(file), Some(read)) = (&args.file, &read) {
        check_names(read, file, None, &source)?;
    }
    if asks {
        tell!(
            "Enter takes what stands in brackets, {BACK} goes back to the question before. Ctrl-C leaves; nothing is written before the last answer."
        );
    }
    let Drafted { draft, left_out, foreign, read } = ask.dialogue.ask(|| drafted(&args, read.as_ref(), &ask))?;
    args.foreign = foreign;
    let source = guessing(&args.foreign);
    let text = draft.text();
    let rig = Rig::from_toml(&text, &args.output.shown())?;
    output::write(&args.output, &text)?;
    let mut findings = check_rig(&rig);
    let doubts = read.as_deref().map_or(Ok(Vec::new()), |read| contradictions(&rig, read, &source));
    let doubts = doubts.unwrap_or_else(|error| vec![format!("no closure can be seen in the file: {error}")]);
    let assumed = draft.assumed();
    for line in &assumed {
        tell!("assumed: {line}");
    }
    if !left_out.is_empty() {
        tell!(
            "left out, because they look like no sensor: {} (a column of volts or mA becomes one by --scale, as in --scale 'NAME=1..5 -> 0..10 bar')",
            left_out.join(", ")
        );
    }
    if json {
        let sensor = |(s, told): (&Sensor, &DraftSensor)| {
            json!({ "name": s.name, "position_m": s.position_m, "unit": s.unit.symbol,
                "unit_guessed": !told.unit.why.is_empty(), "position_guessed": !told.position_m.why.is_empty() })
        };
        let sensors: Vec<Value> = rig.sensors.iter().zip(&draft.sensors).map(sensor).collect();
        say_document(
            json!({ "rig": args.output, "assumed": assumed, "left_out": left_out, "doubts": doubts, "sensors": sensors }),
        )?;
    } else {
        let doubtful = |doubt: String| Finding::new(Level::Warning, "the file", doubt, &[]);
        findings.extend(doubts.into_iter().map(doubtful));
        say_text!(format!("{}\n{}", check::table(&findings), rig_drawing::text(&rig)));
        say!("{}: a rig with {}", args.output.shown(), sensors_in_words(&rig));
    }
    if !json {
        tell!("next: {}", next(&args));
    }
    Ok(Outcome::Done)
}

/// How the file is read: what its options leave open is guessed.
fn guessing(foreign: &ForeignArgs) -> SourceOptions {
    SourceOptions { guess: true, ..foreign.clone().options() }
}

/// What the answers make.
struct Drafted<'a> {
    draft: Draft,
    /// Columns that look like no sensor.
    left_out: Vec<String>,
    /// How the file is read, with what was answered.
    foreign: ForeignArgs,
    read: Option<Cow<'a, SourceFile>>,
}

/// All questions. Where there is a file that was not `read`, it lacks the rate of its samples.
fn drafted<'a>(args: &Args, read: Option<&'a SourceFile>, ask: &Ask) -> Result<Drafted<'a>, AnyError> {
    let mut foreign = args.foreign.clone();
    let mut read = read.map(Cow::Borrowed);
    if let (Some(file), None) = (&args.file, &read) {
        foreign.rate = Some(ask.dialogue.number("no column holds times; samples per second", "Hz", [1e-3, 1e7])?);
        let counted = read_source(file, &guessing(&foreign))?;
        check_names(&counted, file, None, &guessing(&foreign))?;
        read = Some(Cow::Owned(counted));
    }
    let shown = read.as_deref();
    if let (Some(file), Some(read)) = (&args.file, shown)
        && let Some(columns) = without_pressure(read, &guessing(&foreign), args.unit, &args.sensor)
    {
        foreign.scale.extend(ask.transducers(&columns)?);
        if without_pressure(read, &guessing(&foreign), args.unit, &args.sensor).is_some() {
            return Err(no_pressure(file, &columns).into());
        }
    }
    let mut draft = pipe(args, ask)?;
    let mut left_out = Vec::new();
    if let Some(read) = shown {
        let sensors = |foreign: &ForeignArgs| sensors_of(read, &draft, &guessing(foreign), args.unit, &args.sensor);
        let mut found = sensors(&foreign);
        if foreign.flow.is_none() && !found.0.iter().any(|s| s.kind == SensorKind::Flow) {
            foreign.flow = ask.flow()?;
            found = sensors(&foreign);
        }
        (draft.sensors, left_out) = found;
        place(&mut draft, read, &guessing(&foreign));
    }
    confirmed(&mut draft, args, ask)?;
    Ok(Drafted { draft, left_out, foreign, read })
}

fn no_pressure(file: &Path, columns: &[String]) -> String {
    format!(
        "{}: no column looks like a pressure; the columns are {}. Give the place of the one that is, as in --sensor '{first}=12.5'; of a column of \
         volts or milliamperes give the ranges, too, as in --scale '{first}=1..5 -> 0..10 bar' (or its line, '{first}=2.5*x-2.5 bar')",
        file.shown(),
        columns.join(", "),
        first = columns.first().map_or("NAME", String::as_str)
    )
}

/// What to give where nothing states the unit of a sensor.
fn unstated_units(sensors: &[DraftSensor]) -> Option<String> {
    let open = |is_pressure: bool| {
        sensors.iter().filter(move |s| !s.unit.why.is_empty() && (s.kind == SensorKind::Pressure) == is_pressure)
    };
    let pressures: Vec<&str> = open(true).map(|s| s.name.as_str()).collect();
    let mut remedies = Vec::new();
    if !pressures.is_empty() {
        remedies.push(format!("that of the pressures ({}) with --unit, as in --unit bar", pressures.join(", ")));
    }
    remedies.extend(open(false).map(|s| {
        let (kind, name, usual) = (s.kind.name(), &s.name, s.unit.value.symbol);
        format!("that of '{name}' ({kind}) with --scale, as in --scale '{name}={usual}', or leave it out with --ignore '{name}'")
    }));
    let why = sensors.iter().find(|s| !s.unit.why.is_empty())?.unit.why.as_str();
    Some(format!("{why}. Give the unit: {}", remedies.join("; ")))
}

/// What to do next, as a command.
fn next(args: &Args) -> String {
    let rig = quoted(&args.output.shown());
    match &args.file {
        Some(file) => {
            let recording = quoted(&format!("{}.mcap", stem(file)));
            format!("surgescope import {} --rig {rig}{} -o {recording}", quoted(&file.shown()), args.foreign)
        }
        None => format!("surgescope simulate --rig {rig} -o run.mcap"),
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn sensors_in_words(rig: &Rig) -> String {
    rig.sensors.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ")
}

/// Pipe, ends and water, without sensors.
fn pipe(args: &Args, ask: &Ask) -> Result<Draft, AnyError> {
    let material = match args.material {
        Some(material) => material,
        None => ask.material()?,
    };
    let length_m = ask.number("length from the supply to the valve", "m", "--length-m", args.length_m, [0.1, 1e6])?;
    let (inner_diameter_mm, wall_thickness_mm) = match (args.inner_diameter_mm, args.wall_thickness_mm) {
        (Some(inner), Some(wall)) => (inner, wall),
        (inner, wall) => {
            let size = match (&args.pipe, inner.is_some() || wall.is_some()) {
                (Some(size), _) => Some(pipe_size(size)?),
                (None, true) => None,
                (None, false) => ask.size()?,
            };
            match size {
                Some(size) => {
                    let (inner, wall) = (1e3 * size.inner_diameter_m, 1e3 * size.wall_thickness_m);
                    // Sizes go by the outer diameter; who gave the inner one sees it here.
                    if ask.dialogue.is_new() {
                        tell!("pipe: {:.1} mm outside, {inner:.1} mm inside, wall {wall:.2} mm", inner + 2.0 * wall);
                    }
                    (inner, wall)
                }
                None => {
                    let inner =
                        ask.number("inner diameter", "mm", "--inner-diameter-mm (or --pipe)", inner, [1.0, 1e4])?;
                    let option = "--wall-thickness-mm (or --pipe)";
                    (inner, ask.number("thickness of the wall", "mm", option, wall, [0.01, inner])?)
                }
            }
        }
    };
    let or = |given: Option<f64>, usual| given.map_or_else(|| Told::assumed(usual, "not given"), Told::given);
    Ok(Draft {
        name: args.name.clone().unwrap_or_else(|| stem(&args.output)),
        temperature_degc: or(args.temperature_degc, 20.0),
        material: material.name.to_owned(),
        length_m,
        inner_diameter_mm,
        wall_thickness_mm,
        supply: match &args.supply {
            Some(supply) => Told::given(supply.clone()),
            None => ask.supply()?,
        },
        closing_time_s: or(args.closing_time_s, 0.1),
        discharge_head_m: args.discharge_head_m.unwrap_or(0.0),
        sensors: Vec::new(),
    })
}

/// The places that the user gives, and those that he confirms, with temperature and closing time.
fn confirmed(draft: &mut Draft, args: &Args, ask: &Ask) -> Result<(), AnyError> {
    let length_m = draft.length_m;
    for (name, place_m) in &args.sensor {
        match draft.sensors.iter_mut().find(|s| s.name == *name) {
            Some(sensor) => sensor.position_m = Told::given(*place_m),
            None if args.file.is_none() => draft.sensors.push(DraftSensor {
                name: name.clone(),
                kind: SensorKind::Pressure,
                unit: Told::given(args.unit.unwrap_or(Unit::BAR)),
                position_m: Told::given(*place_m),
            }),
            None => {
                let known: Vec<&str> = draft.sensors.iter().map(|s| s.name.as_str()).collect();
                return Err(format!("--sensor {name}: the file has no such column; it has {}", known.join(", ")).into());
            }
        }
    }
    if draft.sensors.is_empty() {
        let position_m = Told::assumed(length_m, "no file and no --sensor: one pressure sensor at the valve");
        let (name, unit) = ("P1".to_owned(), Told::given(args.unit.unwrap_or(Unit::BAR)));
        draft.sensors.push(DraftSensor { name, kind: SensorKind::Pressure, unit, position_m });
    }
    ask.units(&mut draft.sensors)?;
    ask.confirm("temperature of the water", "°C", &mut draft.temperature_degc, [0.0, 100.0])?;
    ask.confirm("closing time of the valve", "s", &mut draft.closing_time_s, [1e-4, 1e4])?;
    for sensor in draft.sensors.iter_mut().filter(|s| s.kind == SensorKind::Pressure) {
        let question = format!("{}: distance from the supply", sensor.name);
        ask.confirm(&question, "m", &mut sensor.position_m, [0.0, length_m])?;
    }
    ask.agree(&args.output)
}

/// Questions on the terminal, where there is one and nobody forbade them.
struct Ask {
    asks: bool,
    dialogue: Dialogue,
}

impl Ask {
    /// A number that has no default.
    fn number(
        &self,
        question: &str,
        unit: &str,
        option: &str,
        given: Option<f64>,
        range: [f64; 2],
    ) -> Result<f64, AnyError> {
        match given {
            Some(value) => Ok(value),
            None if self.asks => self.dialogue.number(question, unit, range),
            None => Err(format!("{question}, {unit}: give it with {option}").into()),
        }
    }

    /// Shows what was assumed and why, and takes what the user makes of it.
    fn confirm(&self, question: &str, unit: &str, told: &mut Told<f64>, range: [f64; 2]) -> Result<(), AnyError> {
        if self.asks && !told.why.is_empty() {
            let usual = (1e6 * told.value).round() / 1e6;
            // Enter leaves it an assumption.
            if let Some(value) =
                self.dialogue.other_number(&format!("{question} ({})", told.why), unit, usual, range)?
            {
                *told = Told::given(value);
            }
        }
        Ok(())
    }

    /// The last question, from which one may still go back.
    fn agree(&self, rig: &Path) -> Result<(), AnyError> {
        if !self.asks {
            return Ok(());
        }
        let question = format!("Enter writes {}, {BACK} goes back", rig.shown());
        let written = |text: &str| if text.is_empty() { Ok(()) } else { Err(format!("press Enter, or write {BACK}")) };
        self.dialogue.line(&question, None, written)
    }

    /// The units that nothing states: once for all pressures, and for each other sensor.
    fn units(&self, sensors: &mut [DraftSensor]) -> Result<(), AnyError> {
        let is_open = |s: &DraftSensor| !s.unit.why.is_empty();
        if let (false, Some(text)) = (self.asks, unstated_units(sensors)) {
            return Err(text.into());
        }
        while let Some(first) = sensors.iter().find(|s| is_open(s)).cloned() {
            let same = |s: &DraftSensor| is_open(s) && s.kind == first.kind && s.unit == first.unit;
            let names: Vec<String> = sensors.iter().filter(|s| same(s)).map(|s| s.name.clone()).collect();
            let quantity = quantity_of(first.kind);
            let known = |text: &str| spelled_unit(text, quantity).ok_or_else(|| format!("'{text}' is no unit of it"));
            let question = format!("unit of {} ({})", names.join(", "), first.unit.why);
            let unit = self.dialogue.line(&question, Some(first.unit.value.symbol), known)?;
            sensors.iter_mut().filter(|s| same(s)).for_each(|s| s.unit = Told::given(unit));
        }
        Ok(())
    }

    /// A size of the pipe, if the user has one.
    fn size(&self) -> Result<Option<PipeSize>, AnyError> {
        if !self.asks {
            return Ok(None);
        }
        if self.dialogue.is_new() {
            tell!("sizes: {EXAMPLES}; the first number of 22x1.5 is the outer diameter");
        }
        self.dialogue.line("size of the pipe (Enter alone: diameter and wall are asked for)", None, |text| match text {
            "" => Ok(None),
            text => pipe_size(text).map(Some),
        })
    }

    /// Which columns are transducers of pressure, and their lines.
    fn transducers(&self, columns: &[String]) -> Result<Vec<(String, Line)>, AnyError> {
        let mut lines = Vec::new();
        if !self.asks {
            return Ok(lines);
        }
        if self.dialogue.is_new() {
            tell!(
                "No column looks like a pressure. Where one is in volts or mA, write its ranges, such as 1..5 -> 0..10 bar, or its line, 2.5*x-2.5 bar."
            );
        }
        for (i, column) in columns.iter().enumerate() {
            let needed = lines.is_empty() && i + 1 == columns.len();
            let line = |text: &str| match text {
                "" if needed => Err(format!("one column must be a pressure; {BACK} goes back")),
                "" => Ok(None),
                text => text.parse().map(Some),
            };
            let line = self.dialogue.line(&format!("{column} (empty: no pressure)"), None, line)?;
            lines.extend(line.map(|line| (column.clone(), line)));
        }
        Ok(lines)
    }

    /// The flow of a test that no column has.
    fn flow(&self) -> Result<Option<(f64, Unit)>, AnyError> {
        if !self.asks {
            return Ok(None);
        }
        let question = "flow before the closure, if you measured it by hand, such as 0.25 L/s (empty: not known)";
        self.dialogue.line(question, None, |text| if text.is_empty() { Ok(None) } else { flow(text).map(Some) })
    }

    fn material(&self) -> Result<&'static Material, AnyError> {
        if !self.asks {
            return Err(format!("material of the wall: give it with --material; {}", known_materials()).into());
        }
        if self.dialogue.is_new() {
            tell!("materials: {}", known_materials());
        }
        self.dialogue.line("material of the wall", None, material)
    }

    fn supply(&self) -> Result<Told<String>, AnyError> {
        if !self.asks {
            return Ok(Told::assumed(SUPPLIES[0].to_owned(), "not given"));
        }
        self.dialogue.line("what feeds the pipe (reservoir or pump)", Some(SUPPLIES[0]), supply).map(Told::given)
    }
}

fn material(text: &str) -> Result<&'static Material, String> {
    let near =
        || nearest(text, MATERIALS.iter().map(|m| m.name)).map_or(String::new(), |n| format!(" (did you mean {n}?)"));
    Material::by_name(text).ok_or_else(|| format!("'{text}' is not a known material{}; {}", near(), known_materials()))
}

fn known_materials() -> String {
    format!("known are {}", MATERIALS.iter().map(|m| m.name).collect::<Vec<_>>().join(", "))
}

fn pressure_unit(text: &str) -> Result<Unit, String> {
    spelled_unit(text, Quantity::Pressure).ok_or_else(|| "write a unit of pressure, such as bar, kPa or psi".into())
}
