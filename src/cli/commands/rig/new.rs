//! `surgescope rig new`: a rig file from what a person knows of the pipe, and from the columns of a logger's file.

use std::borrow::Cow;
use std::io::{IsTerminal as _, stderr, stdin};
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde_json::{Value, json};

use crate::cli::args::import_options::ForeignArgs;
use crate::cli::args::values::{not_negative, pair};
use crate::cli::commands::rig::check;
use crate::cli::console::ask::{BACK, Dialogue};
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell};
use crate::draft::answers::{
    Amiss, Answers, CLOSING_TIME, Drafted, INNER_DIAMETER, LENGTH, Measured, PLACE, RATE, SUPPLIES, TEMPERATURE, WALL,
    flow, known_materials, material, no_pressure, supply,
};
use crate::draft::{LIKE_THE_AIR, Said, WRITTEN, checked, epanet, has_flow, network, without_pressure};
use crate::report::advice::quoted;
use crate::report::rig_drawing;
use crate::rig::check::{Finding, Level, check as check_rig};
use crate::rig::draft::{Draft, DraftSensor, Told};
use crate::rig::material::Material;
use crate::rig::sizes::{EXAMPLES, PipeSize, pipe_size};
use crate::rig::{Rig, Sensor, SensorKind, quantity_of, spelled_unit};
use crate::shown::Shown as _;
use crate::storage::import::{Line, SourceFile, SourceOptions, check_names, line_like, read_source};
use crate::storage::nearest::listed;
use crate::storage::{LogError, output};
use crate::text_file::read_text;
use crate::units::written::measure;
use crate::units::{Quantity, Unit};

/// Write a rig file: asks what is not given, and takes the sensors from a file of the test.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Files of a test (CSV, Excel, TDMS, MCAP): their columns become the sensors. Several are parts of one run, or its
    /// sensors. Or a network of EPANET (.inp).
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
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
    /// Of a network: the valve that closes, or the dead end where the flow is shut off.
    #[arg(long, value_name = "NAME")]
    valve: Option<String>,
    /// Head behind the valve, m [default: 0].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    discharge_head_m: Option<f64>,
    /// Distance of a sensor from the supply, m; without a file, a pressure sensor to add. Several may be given.
    #[arg(long, value_name = "NAME=M", value_parser = sensor_at)]
    sensor: Vec<(String, f64)>,
    /// Unit of the pressures: of columns that state none, that --scale brings to it, and of sensors that --sensor adds
    /// [default: as the values show it, otherwise bar].
    #[arg(long, value_name = "UNIT", value_parser = pressure_unit)]
    unit: Option<Unit>,
    #[command(flatten)]
    foreign: ForeignArgs,
    /// Ask nothing: assume what is not given, and report it.
    #[arg(short, long)]
    yes: bool,
}

/// Of a network, where nothing is given: temperature of the water, °C, and closing time, s.
const TEMPERATURE_DEGC: f64 = 20.0;
const CLOSING_TIME_S: f64 = 0.1;

/// A number above 0 in a unit, or with its own unit behind it.
fn above_0(unit: &'static str) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| measure(text, unit).and_then(|v| if v > 0.0 { Ok(v) } else { Err("must be above 0".to_owned()) })
}

/// A sensor and its distance from the supply, m.
fn sensor_at(text: &str) -> Result<(String, f64), String> {
    let (name, place) = pair(text)?;
    Ok((name, measure(&place, "m")?))
}

/// The supplies as options take them, by which shells complete them.
fn supplies() -> impl TypedValueParser<Value = String> {
    let known = SUPPLIES.map(|word| PossibleValue::new(word).aliases((word == SUPPLIES[0]).then_some("tank")));
    PossibleValuesParser::new(known).try_map(|word| supply(&word))
}

/// Runs it.
///
/// # Errors
/// What is missing and may not be asked; a file that cannot be read or written.
pub fn run(mut args: Args, json: bool) -> CommandResult {
    if args.output.exists() {
        return Err(format!("{} exists already: name another file with -o", args.output.shown()).into());
    }
    if let Some(file) = args.files.iter().find(|file| file.extension().is_some_and(|e| e.eq_ignore_ascii_case("inp"))) {
        return of_network(&args, file, json);
    }
    let asks = !args.yes && !json && stdin().is_terminal() && stderr().is_terminal();
    let ask = Ask { asks, dialogue: Dialogue::default() };
    let source = guessing(&args.foreign);
    // A file that cannot be read costs no answers; one that only counts its samples lacks but one.
    let read = match read_all(&args.files, &source) {
        Err(error) if asks && error.lacks_rate() => None,
        read => read?,
    };
    if let (Some(file), Some(read)) = (args.files.first(), &read) {
        check_names(read, file, None, &source)?;
    }
    if asks {
        tell!(
            "Enter takes what stands in brackets, {BACK} goes back to the question before. Ctrl-C leaves; nothing is written before the last answer."
        );
    }
    let Answered { drafted: Drafted { draft, left_out }, foreign, read } =
        ask.dialogue.ask(|| answered(&args, read.as_ref(), &ask))?;
    args.foreign = foreign;
    let source = guessing(&args.foreign);
    let text = draft.text();
    let rig = Rig::from_toml(&text, &args.output.shown())?;
    let checked = read.as_deref().map(|read| checked(&rig, read, &source, &mut Vec::new()));
    let misread = checked.as_ref().and_then(|checked| checked.misread.as_ref()).filter(|_| !asks);
    if let (Some(file), Some(text)) = (args.files.first(), misread) {
        return Err(format!("{}: {text}", file.shown()).into());
    }
    output::write(&args.output, &text)?;
    let mut findings = check_rig(&rig);
    let doubts = checked.map_or(Ok(Vec::new()), |checked| checked.doubts);
    let doubts = doubts.unwrap_or_else(|error| vec![format!("no closure can be seen in the file: {error}")]);
    let assumed = draft.assumed();
    for line in &assumed {
        tell!("assumed: {line}");
    }
    if !left_out.is_empty() {
        tell!(
            "left out, because they look like no sensor: {} (a column of volts or mA becomes one by --scale, as in --scale 'NAME=1..5 -> 0..10 bar', a pressure by its place, as in --sensor 'NAME=12.5')",
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

/// A rig file from a network of EPANET.
fn of_network(args: &Args, file: &Path, json: bool) -> CommandResult {
    let wrong = |what: &str| format!("{}: {what}", file.shown());
    if args.files.len() > 1 {
        return Err(wrong("a network is read alone").into());
    }
    let (Some(material), Some(wall_thickness_mm)) = (args.material, args.wall_thickness_mm) else {
        return Err(wrong("the file says nothing of the walls: add --material and --wall-thickness-mm").into());
    };
    let stem = args.output.file_stem().map_or_else(|| "rig".into(), |stem| stem.to_string_lossy());
    let network = epanet::read(&read_text(file)?).map_err(|fault| wrong(&fault.to_string()))?;
    let told = network::Told {
        name: args.name.as_deref().unwrap_or(&stem),
        temperature_degc: args.temperature_degc.unwrap_or(TEMPERATURE_DEGC),
        material: material.name,
        wall_thickness_mm,
        valve: args.valve.as_deref(),
        closing_time_s: args.closing_time_s.unwrap_or(CLOSING_TIME_S),
        unit: args.unit.map_or("bar", |unit| unit.symbol),
    };
    let network::Drafted { text, mut assumed } = network::draft(&network, &told).map_err(|what| wrong(&what))?;
    let rig = Rig::from_toml(&text, &args.output.shown())?;
    output::write(&args.output, &text)?;
    let default = |given: bool, words: String| (!given).then_some(words);
    assumed.extend(default(args.temperature_degc.is_some(), format!("water of {TEMPERATURE_DEGC} °C")));
    assumed.extend(default(args.closing_time_s.is_some(), format!("a closing time of {CLOSING_TIME_S} s")));
    assumed.iter().for_each(|line| tell!("assumed: {line}"));
    network.left_out.iter().for_each(|line| tell!("left out: {line}"));
    if json {
        let sensors: Vec<Value> =
            rig.sensors.iter().map(|s| json!({ "name": s.name, "unit": s.unit.symbol })).collect();
        say_document(
            json!({ "rig": args.output, "assumed": assumed, "left_out": network.left_out, "doubts": [], "sensors": sensors }),
        )?;
    } else {
        say_text!(check::table(&check_rig(&rig)));
        say!("{}: a rig with {} nodes and {} pipes", args.output.shown(), rig.graph.nodes.len(), rig.pipes.len());
    }
    Ok(Outcome::Done)
}

/// What the files hold together; none where there is no file.
fn read_all(files: &[PathBuf], source: &SourceOptions) -> Result<Option<SourceFile>, LogError> {
    let parts: Vec<SourceFile> = files.iter().map(|file| read_source(file, source)).collect::<Result<_, _>>()?;
    let Some(last) = files.last() else { return Ok(None) };
    SourceFile::continued(parts).map(Some).map_err(|why| LogError::SourceFile { path: last.clone(), why })
}

/// How the file is read: what its options leave open is guessed.
fn guessing(foreign: &ForeignArgs) -> SourceOptions {
    SourceOptions { guess: true, ..foreign.clone().options() }
}

/// What the questions ended with.
struct Answered<'a> {
    drafted: Drafted,
    /// How the file is read, with what was answered.
    foreign: ForeignArgs,
    read: Option<Cow<'a, SourceFile>>,
}

/// All questions. Where there is a file that was not `read`, it lacks the rate of its samples.
fn answered<'a>(args: &Args, read: Option<&'a SourceFile>, ask: &Ask) -> Result<Answered<'a>, AnyError> {
    let mut foreign = args.foreign.clone();
    let mut read = read.map(Cow::Borrowed);
    if let (Some(file), None) = (args.files.first(), &read) {
        foreign.rate = Some(ask.dialogue.number(&format!("no column holds times; {}", RATE.words), &RATE)?);
        read = read_all(&args.files, &guessing(&foreign))?.map(Cow::Owned);
        if let Some(counted) = &read {
            check_names(counted, file, None, &guessing(&foreign))?;
        }
    }
    let mut answers = given(args, &foreign);
    let refused = |amiss: Amiss| match (args.files.first(), &amiss) {
        (Some(file), Amiss::NoPressure { .. }) => format!("{}: {amiss}", file.shown()),
        _ => amiss.to_string(),
    };
    if let Some(read) = &read
        && let Some(columns) = without_pressure(read, &answers.columns)
    {
        foreign.scale.extend(ask.transducers(&columns)?);
        answers.columns.source = guessing(&foreign);
        if without_pressure(read, &answers.columns).is_some() {
            return Err(refused(no_pressure(read, columns)).into());
        }
    }
    ask.pipe(&mut answers, args.pipe.as_deref())?;
    if let Some(read) = &read
        && !has_flow(read, &answers.columns)
    {
        foreign.flow = ask.flow()?;
        answers.columns.source = guessing(&foreign);
    }
    let mut drafted = answers.drafted(read.as_deref()).map_err(refused)?;
    confirmed(&mut drafted.draft, args, ask)?;
    Ok(Answered { drafted, foreign, read })
}

/// What the options answer.
fn given(args: &Args, foreign: &ForeignArgs) -> Answers {
    Answers {
        name: args.name.clone().unwrap_or_else(|| stem(&args.output)),
        material: args.material,
        length_m: args.length_m,
        inner_diameter_mm: args.inner_diameter_mm,
        wall_thickness_mm: args.wall_thickness_mm,
        temperature_degc: args.temperature_degc,
        supply: args.supply.clone(),
        closing_time_s: args.closing_time_s,
        discharge_head_m: args.discharge_head_m,
        columns: Said { source: guessing(foreign), unit: args.unit, places: args.sensor.clone(), kinds: Vec::new() },
    }
}

/// What to give where nothing states the unit of a sensor.
fn unstated_units(sensors: &[DraftSensor]) -> Option<String> {
    let open = |is_pressure: bool| {
        sensors.iter().filter(move |s| !s.unit.why.is_empty() && (s.kind == SensorKind::Pressure) == is_pressure)
    };
    // a unit that is written and not known is for nobody to replace
    let written = |s: &&DraftSensor| s.unit.why.starts_with(WRITTEN);
    let pressures: Vec<String> = open(true).filter(|s| !written(s)).map(|s| s.name.clone()).collect();
    let mut remedies: Vec<String> = Vec::new();
    remedies.extend(open(true).filter(written).map(|s| {
        let (name, line) = (&s.name, line_like(&s.unit.why, "bar"));
        format!("what the numbers of '{name}' stand for with --scale, as in --scale '{name}={line}' with its number")
    }));
    if !pressures.is_empty() {
        remedies.push(format!("that of the pressures ({}) with --unit (bar, kPa, psi, m(H2O), …)", listed(&pressures)));
    }
    remedies.extend(open(false).map(|s| {
        let (kind, name, usual) = (s.kind.name(), &s.name, s.unit.value.symbol);
        format!("that of '{name}' ({kind}) with --scale, as in --scale '{name}={usual}', or leave it out with --ignore '{name}'")
    }));
    let why = sensors.iter().find(|s| !s.unit.why.is_empty())?.unit.why.as_str();
    let what = if why.starts_with(WRITTEN) { "Give" } else { "Give the unit:" };
    Some(format!("{why}. {what} {}", remedies.join("; ")))
}

/// What to do next, as a command.
fn next(args: &Args) -> String {
    let rig = quoted(&args.output.shown());
    match args.files.first() {
        Some(file) => {
            let recording = quoted(&format!("{}.mcap", stem(file)));
            let files = args.files.iter().map(|file| quoted(&file.shown()).to_string()).collect::<Vec<_>>().join(" ");
            format!("surgescope import {files} --rig {rig}{} -o {recording}", args.foreign)
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

/// What to give where nothing says where several pressure sensors stand: all are assumed at one place.
fn unknown_places(sensors: &[DraftSensor]) -> Option<String> {
    let unseen = |s: &&DraftSensor| s.position_m.why.starts_with("no front can be seen");
    let assumed = || sensors.iter().filter(|s| s.kind == SensorKind::Pressure).filter(unseen);
    let first = assumed().find(|s| assumed().filter(|o| o.position_m == s.position_m).count() > 1)?;
    let names: Vec<&str> = assumed().filter(|o| o.position_m == first.position_m).map(|s| s.name.as_str()).collect();
    Some(format!(
        "nothing says where {} are: {}. Name the file with the closure as well, or give their distances from the supply in m, as in --sensor '{}={}'",
        names.join(" and "),
        first.position_m.why.trim_end_matches(": at the valve"),
        names[0],
        first.position_m.value
    ))
}

/// What to give of a pressure that stays at that of the air.
fn barometer(sensors: &[DraftSensor]) -> Option<String> {
    let DraftSensor { name, position_m, .. } = sensors.iter().find(|s| s.position_m.why.starts_with(LIKE_THE_AIR))?;
    Some(format!(
        "'{name}': {}. If it measures the air, leave it out with --ignore '{name}'; if it stands at the pipe, give its place, as in --sensor '{name}={}'",
        position_m.why.trim_end_matches(": at the supply"),
        position_m.value
    ))
}

/// What the user confirms of what was assumed.
fn confirmed(draft: &mut Draft, args: &Args, ask: &Ask) -> Result<(), AnyError> {
    let place = PLACE.up_to(draft.length_m);
    ask.units(&mut draft.sensors)?;
    let open = unknown_places(&draft.sensors).or_else(|| barometer(&draft.sensors));
    if let (false, Some(text)) = (ask.asks, open) {
        return Err(text.into());
    }
    ask.confirm(TEMPERATURE.words, &TEMPERATURE, &mut draft.temperature_degc)?;
    ask.confirm(CLOSING_TIME.words, &CLOSING_TIME, &mut draft.closing_time_s)?;
    for sensor in draft.sensors.iter_mut().filter(|s| s.kind == SensorKind::Pressure) {
        ask.confirm(&format!("{}: {}", sensor.name, place.words), &place, &mut sensor.position_m)?;
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
    fn number(&self, asked: &Measured, option: &str, given: Option<f64>) -> Result<f64, AnyError> {
        match given {
            Some(value) => Ok(value),
            None if self.asks => self.dialogue.number(asked.words, asked),
            None => Err(format!("{}, {}: give it with {option}", asked.words, asked.unit).into()),
        }
    }

    /// Pipe and ends, where the options do not say them.
    fn pipe(&self, answers: &mut Answers, size: Option<&str>) -> Result<(), AnyError> {
        if answers.material.is_none() {
            answers.material = Some(self.material()?);
        }
        answers.length_m = Some(self.number(&LENGTH, "--length-m", answers.length_m)?);
        let (inner, wall) = (answers.inner_diameter_mm, answers.wall_thickness_mm);
        let size = match size {
            Some(size) => Some(pipe_size(size)?),
            None if inner.is_some() || wall.is_some() => None,
            None => self.size()?,
        };
        let (inner, wall) = match size {
            Some(size) => {
                let (inner, wall) = (1e3 * size.inner_diameter_m, 1e3 * size.wall_thickness_m);
                // Sizes go by the outer diameter; who gave the inner one sees it here.
                if self.dialogue.is_new() {
                    tell!("pipe: {:.1} mm outside, {inner:.1} mm inside, wall {wall:.2} mm", inner + 2.0 * wall);
                }
                (inner, wall)
            }
            None => {
                let inner = self.number(&INNER_DIAMETER, "--inner-diameter-mm (or --pipe)", inner)?;
                (inner, self.number(&WALL.up_to(inner), "--wall-thickness-mm (or --pipe)", wall)?)
            }
        };
        (answers.inner_diameter_mm, answers.wall_thickness_mm) = (Some(inner), Some(wall));
        if answers.supply.is_none() {
            answers.supply = self.supply()?;
        }
        Ok(())
    }

    /// Shows what was assumed and why, and takes what the user makes of it.
    fn confirm(&self, question: &str, asked: &Measured, told: &mut Told<f64>) -> Result<(), AnyError> {
        if self.asks && !told.why.is_empty() {
            let usual = (1e6 * told.value).round() / 1e6;
            // Enter leaves it an assumption.
            if let Some(value) = self.dialogue.other_number(&format!("{question} ({})", told.why), asked, usual)? {
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

    fn supply(&self) -> Result<Option<String>, AnyError> {
        if !self.asks {
            return Ok(None);
        }
        self.dialogue.line("what feeds the pipe (reservoir or pump)", Some(SUPPLIES[0]), supply).map(Some)
    }
}

fn pressure_unit(text: &str) -> Result<Unit, String> {
    spelled_unit(text, Quantity::Pressure).ok_or_else(|| "write a unit of pressure, such as bar, kPa or psi".into())
}
