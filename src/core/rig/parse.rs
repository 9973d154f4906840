//! From the text of a rig file to a [`Rig`]: every key, its unit and its permissible values.

use std::path::Path;

use toml::de::{DeTable, DeValue};

use crate::rig::device::Port;
use crate::rig::error::RigError;
use crate::rig::graph::Graph;
use crate::rig::network::Nodes;
use crate::rig::own_effects::{OwnEffects, alone, remember};
use crate::rig::table::Limits;
use crate::rig::table::{At, FINITE, NOT_NEGATIVE, POSITIVE, Section, Source, nearest, share};
use crate::rig::types::{Constraint, Fluid, Pipe, Rig, SteadyState, Tolerance, Upstream, Valve};
use crate::rig::unique::Names;
use crate::rig::{live, material, network, sensors};
use crate::shown::Shown as _;
use crate::text_file::read_text;

const TOP: &[&str] =
    &["name", "fluid", "pipe", "upstream", "downstream", "sensor", "device", "steady", "tolerance", "node", "effects"];
const FLUID: &[&str] = &["name", "temperature_degC"];
const PIPE: &[&str] = &[
    "name",
    "length_m",
    "inner_diameter_mm",
    "wall_thickness_mm",
    "material",
    "wave_speed_m_s",
    "friction_factor",
    "roughness_mm",
    "poisson_ratio",
    "constraint",
    "elevation_start_m",
    "elevation_end_m",
    "length_tolerance_percent",
    "inner_diameter_tolerance_percent",
    "wall_thickness_tolerance_percent",
    "from",
    "to",
];
const UPSTREAM: &[&str] = &["kind"];
const DOWNSTREAM: &[&str] =
    &["kind", "closing_time_s", "discharge_head_m", "closing_time_tolerance_percent", "characteristic"];
const STEADY: &[&str] =
    &["name", "flow_m3_h", "supply_head_m", "temperature_degC", "reynolds_number", "wave_speed_m_s"];

const TOLERANCE: &[&str] = &["length_percent", "diameter_percent", "position_percent"];

/// Which keys belong in which table.
const HOMES: [(&str, &[&str]); 9] = [
    ("[[pipe]]", PIPE),
    ("[[sensor]]", sensors::KEYS),
    ("[[device]]", live::DEVICE_KEYS),
    ("[downstream]", DOWNSTREAM),
    ("[fluid]", FLUID),
    ("[upstream]", UPSTREAM),
    ("[[steady]]", STEADY),
    ("[tolerance]", TOLERANCE),
    ("[[node]]", network::KEYS),
];

const TEMPERATURE: Limits = Limits { holds: |v| (0.0..=100.0).contains(&v), words: "a temperature from 0 to 100 degC" };
const POISSON: Limits = Limits { holds: |v| v > 0.0 && v < 0.5, words: "a number between 0 and 0.5" };
const FRICTION: Limits = Limits { holds: |v| (0.0..=1.0).contains(&v), words: "a Darcy friction factor from 0 to 1" };
const WAVE_SPEED: Limits = Limits {
    holds: |v| v > 0.0 && v <= 1600.0,
    words: "a wave speed above 0, at most 1600 m/s (that of water alone is 1400-1560)",
};

impl Rig {
    /// Reads a rig file. Errors give the path as the caller wrote it.
    pub fn load(path: &Path) -> Result<Rig, RigError> {
        let text = read_text(path).map_err(|source| RigError::Read { path: path.into(), source })?;
        let mut rig = Rig::from_toml(&text, &path.shown())?;
        // a file of this computer says where its commands are at home
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        for device in &mut rig.devices {
            if let Port::Command(command) = &mut device.port {
                command.folder = Some(folder.to_owned());
            }
        }
        rig.with_effects_beside(folder)
    }

    /// Reads the text of a rig file; errors name the file `file_name`.
    ///
    /// # Errors
    /// [`RigError::Invalid`] with every problem found.
    pub fn from_toml(text: &str, file_name: &str) -> Result<Rig, RigError> {
        Rig::of(Source::new(text), file_name)
    }

    /// The same of a rig file that is stored in a recording: names and sizes that older versions allowed are no errors
    /// there.
    ///
    /// # Errors
    /// As [`Rig::from_toml`].
    pub fn from_stored(text: &str, file_name: &str) -> Result<Rig, RigError> {
        Rig::of(Source::stored(text), file_name)
    }

    fn of(source: Source<'_>, file_name: &str) -> Result<Rig, RigError> {
        let rig = read(&source);
        match rig {
            Some(rig) if source.is_clean() => Ok(rig),
            _ => Err(RigError::Invalid { file: file_name.to_owned(), problems: source.into_problems() }),
        }
    }
}

/// Reads all tables; `None` if one is missing or faulty, which `source` then reports.
fn read(source: &Source<'_>) -> Option<Rig> {
    if is_time_series(source.text) {
        source.report(
            Some(0..0),
            "this looks like a time series, not a rig file: give the TOML file that describes the rig",
        );
        return None;
    }
    let (document, errors) = DeTable::parse_recoverable(source.text);
    if !errors.is_empty() {
        for error in errors {
            source.report(error.span(), format!("not valid TOML: {}", error.message().trim_end()));
        }
        return None;
    }
    let top = document.get_ref();
    let keys: Vec<&str> = top.keys().map(|key| key.get_ref().as_ref()).collect();
    if !keys.is_empty() && !keys.iter().any(|key| TOP.contains(key)) {
        let has = keys.join(", ");
        source.report(None, format!("this describes no rig: it has {has}, and a rig file has {}", TOP.join(", ")));
        return None;
    }
    let file = Section::open(source, "the rig file", top, 0..0, TOP, &HOMES);
    let name = file.required_text("name", "the rig's name");

    let fluid = single(source, top, "fluid", "[fluid]", FLUID).and_then(|section| read_fluid(&section));
    let tolerance = top.contains_key("tolerance").then(|| single(source, top, "tolerance", "[tolerance]", TOLERANCE));
    let usual = tolerance.flatten().map_or(USUAL, |section| read_tolerance(&section));
    let node_sections = many(source, top, "node", "[[node]]", network::KEYS);
    let pipe_sections = many(source, top, "pipe", "[[pipe]]", PIPE);
    let has_nodes = top.contains_key("node");
    let nodes = has_nodes.then(|| Nodes::read(&node_sections));
    let pipes = read_pipes(&pipe_sections, usual.0, nodes.as_ref());
    if pipes.is_none() && !top.contains_key("pipe") {
        source.report(None, "missing [[pipe]]: at least one pipe, from the supply to the valve");
    }
    let devices = live::read_devices(&many(source, top, "device", "[[device]]", live::DEVICE_KEYS));
    let joined = match nodes {
        Some(nodes) => read_network(source, top, &pipe_sections, nodes, pipes.as_deref()),
        None => read_series(source, top, &pipe_sections, pipes.as_deref()),
    };
    let layout = joined.as_ref().zip(pipes.as_deref());
    let layout = layout.map(|(joined, pipes)| sensors::Layout { graph: &joined.graph, pipes, has_nodes });
    let sensor_sections = many(source, top, "sensor", "[[sensor]]", sensors::KEYS);
    let sensors = sensors::read_sensors(&sensor_sections, layout.as_ref(), usual.1, &devices);
    // a faulty sensor might have been the pressure sensor
    if sensors.len() == sensor_sections.len() {
        sensors::check_pressure(source, &sensors, joined.as_ref().map(|joined| &joined.upstream));
    }
    let steady = many(source, top, "steady", "[[steady]]", STEADY).iter().filter_map(read_steady).collect();

    let own_effects = read_effects(source, top)?;

    let Joined { graph, upstream, valve } = joined?;
    Some(Rig {
        name: name?.value.to_owned(),
        fluid: fluid?,
        graph,
        pipes: pipes?,
        upstream: upstream.value,
        valve,
        sensors,
        devices: devices.into_iter().filter_map(|(_, device)| device).collect(),
        steady,
        source: alone(source.text).to_owned(),
        own_effects,
    })
}

/// The effects that a recording keeps behind the rig's text.
fn read_effects(source: &Source<'_>, top: &DeTable<'_>) -> Option<OwnEffects> {
    let Some((key, table)) = top.get_key_value("effects") else { return Some(OwnEffects::new()) };
    let text = |value: &DeValue<'_>| value.as_str().map(str::to_owned);
    let kept = alone(source.text).len() < source.text.len();
    let effects = table.get_ref().as_table().filter(|_| kept).and_then(|table| {
        table.iter().map(|(name, value)| Some((name.get_ref().to_string(), text(value.get_ref())?))).collect()
    });
    if effects.is_none() {
        let message = "only recordings have effects in the text of their rig: write each into a file effects/NAME.toml beside the rig file";
        source.report(Some(key.span()), message);
    }
    effects.inspect(remember)
}

/// How the pipes are joined, and what is at their ends.
struct Joined {
    graph: Graph,
    upstream: At<Upstream>,
    valve: Valve,
}

/// Pipes in series, from `[upstream]` to `[downstream]`.
fn read_series<'a>(
    source: &'a Source<'a>,
    top: &'a DeTable<'a>,
    pipe_sections: &[Section<'_>],
    pipes: Option<&[Pipe]>,
) -> Option<Joined> {
    for (section, key) in pipe_sections.iter().flat_map(|section| [(section, "from"), (section, "to")]) {
        if let Some(place) = section.place_of(key) {
            section.fault_at(
                &place,
                format!("'{key}' names a [[node]], and the file has none; without nodes the pipes are in series"),
            );
        }
    }
    let upstream = single(source, top, "upstream", "[upstream]", UPSTREAM).and_then(|section| {
        let kinds = [("reservoir", Upstream::Reservoir), ("pump", Upstream::Pump), ("measured", Upstream::Measured)];
        section.required_choice("kind", &kinds)
    });
    let valve = single(source, top, "downstream", "[downstream]", DOWNSTREAM).and_then(|section| {
        let kind = section.required_choice("kind", &[("valve", ())]);
        let closing_time_s = section.required_number("closing_time_s", &POSITIVE);
        let discharge_head_m = section.number("discharge_head_m", &FINITE).unwrap_or(0.0);
        let closing_time_tolerance = share(&section, "closing_time_tolerance_percent");
        let characteristic = network::characteristic(&section);
        kind?;
        Some(Valve { closing_time_s: closing_time_s?, discharge_head_m, closing_time_tolerance, characteristic })
    });
    Some(Joined { graph: Graph::in_series(pipes?.len()), upstream: upstream?, valve: valve? })
}

/// Pipes between nodes.
fn read_network(
    source: &Source<'_>,
    top: &DeTable<'_>,
    pipe_sections: &[Section<'_>],
    nodes: Nodes<'_>,
    pipes: Option<&[Pipe]>,
) -> Option<Joined> {
    for key in ["upstream", "downstream"] {
        if let Some(value) = top.get(key) {
            let message =
                format!("a rig with [[node]] has no [{key}]: its nodes say what feeds the pipes and what closes them");
            source.report(Some(value.span()), message);
        }
    }
    let end = |section: &Section<'_>, key: &str| nodes.named(section, key, "the name of a [[node]]");
    let mut ends = Vec::new();
    for section in pipe_sections {
        let (from, to) = (end(section, "from"), end(section, "to"));
        if let (Some(from), Some(place)) = (from, section.place_of("to"))
            && to == Some(from)
        {
            section.fault_at(&place, "the pipe ends at the node where it begins");
            continue;
        }
        ends.push(from.zip(to));
    }
    let ends: Vec<(usize, usize)> = ends.into_iter().collect::<Option<_>>()?;
    let lengths_m: Vec<f64> = pipes?.iter().map(|p| p.length_m).collect();
    if ends.len() != lengths_m.len() {
        return None;
    }
    let (graph, valve) = nodes.join(source, &ends, &lengths_m)?;
    Some(Joined { graph, upstream: At { value: Upstream::Reservoir, place: 0..0 }, valve })
}

/// Whether the first line with content names the columns of a CSV file. A line of TOML has a bracket or an equals sign.
fn is_time_series(text: &str) -> bool {
    let lines = || text.trim_start_matches('\u{feff}').lines().filter(|l| !l.trim().is_empty() && !l.starts_with('#'));
    let first = lines().next().unwrap_or_default();
    let columns = |line: &str| line.split([',', ';', '\t']).count();
    !first.contains(['=', '[']) && columns(first) > 1 && lines().nth(1).is_none_or(|l| columns(l) == columns(first))
}

/// The only table of a name; reports it if it is missing.
fn single<'a>(
    source: &'a Source<'a>,
    top: &'a DeTable<'a>,
    key: &str,
    heading: &'static str,
    keys: &'static [&'static str],
) -> Option<Section<'a>> {
    let Some(value) = top.get(key) else {
        source.report(None, format!("missing {heading}"));
        return None;
    };
    let DeValue::Table(table) = value.get_ref() else {
        source.report(Some(value.span()), format!("'{key}' must be one table: write {heading}"));
        return None;
    };
    Some(Section::open(source, heading, table, value.span(), keys, &HOMES))
}

/// All tables of a name, in the order of the file.
fn many<'a>(
    source: &'a Source<'a>,
    top: &'a DeTable<'a>,
    key: &str,
    heading: &'static str,
    keys: &'static [&'static str],
) -> Vec<Section<'a>> {
    let Some(value) = top.get(key) else { return Vec::new() };
    let wrong =
        |place| source.report(Some(place), format!("'{key}' must be a list of tables: write {heading} before each"));
    let DeValue::Array(items) = value.get_ref() else {
        wrong(value.span());
        return Vec::new();
    };
    let mut sections = Vec::new();
    for item in items.iter() {
        match item.get_ref() {
            DeValue::Table(table) => sections.push(Section::open(source, heading, table, item.span(), keys, &HOMES)),
            _ => wrong(item.span()),
        }
    }
    sections
}

fn read_fluid(section: &Section<'_>) -> Option<Fluid> {
    let name = section.required_choice("name", &[("water", "water")]);
    let temperature_degc = section.required_number("temperature_degC", &TEMPERATURE);
    Some(Fluid { name: name?.value.to_owned(), temperature_degc: temperature_degc? })
}

fn read_pipes(sections: &[Section<'_>], usual: Tolerance, nodes: Option<&Nodes<'_>>) -> Option<Vec<Pipe>> {
    let mut names = Names::new("pipe");
    let mut end_m = 0.0;
    let mut pipes = Vec::new();
    for (i, section) in sections.iter().enumerate() {
        let at = |key: &str| nodes.and_then(|nodes| nodes.elevation_of(section.peek_text(key)?));
        let joins_m = if nodes.is_some() { at("from") } else { (i > 0).then_some(end_m) };
        let pipe = read_pipe(section, &mut names, (joins_m, at("to")), usual);
        end_m = pipe.as_ref().map_or(end_m, |p| p.elevation_end_m);
        pipes.push(pipe);
    }
    let pipes: Option<Vec<Pipe>> = pipes.into_iter().collect();
    pipes.filter(|p| !p.is_empty())
}

/// `joins_at_m` and `ends_at_m` are the elevations of what the pipe joins, where they are known.
fn read_pipe(
    section: &Section<'_>,
    names: &mut Names,
    (joins_at_m, ends_at_m): (Option<f64>, Option<f64>),
    usual: Tolerance,
) -> Option<Pipe> {
    let name = section.required_text("name", "the pipe's name");
    names.check(section, name.as_ref());
    let length_m = section.required_number("length_m", &POSITIVE);
    let diameter_mm = section.required_number("inner_diameter_mm", &POSITIVE);
    let wall_mm = section.required_number("wall_thickness_mm", &POSITIVE);
    if let (Some(d), Some(e), Some(place)) = (diameter_mm, wall_mm, section.place_of("wall_thickness_mm"))
        && e > d / 2.0
    {
        let radius = d / 2.0;
        section.fault_at(
            &place,
            format!("the wall ({e} mm) is thicker than the inner radius ({radius} mm); 'wall_thickness_mm' and 'inner_diameter_mm' are both in mm"),
        );
    }
    let material = section.required_text("material", "the name of the wall's material").and_then(|text| {
        let found = material::Material::by_name(text.value);
        if found.is_none() {
            let names = || material::MATERIALS.iter().map(|m| m.name);
            let near = nearest(text.value, names()).map(|n| format!("; did you mean \"{n}\"?")).unwrap_or(".".into());
            let known = names().collect::<Vec<_>>().join(", ");
            let message = format!("unknown material \"{}\"{near} Known are {known}", text.value);
            section.fault_at(&text.place, message);
        }
        found
    });
    let roughness_mm = section.number("roughness_mm", &NOT_NEGATIVE);
    let friction_factor = section.number("friction_factor", &FRICTION);
    if let (Some(place), Some(_)) = (section.place_of("roughness_mm"), section.place_of("friction_factor")) {
        section.fault_at(&place, "give 'friction_factor' or 'roughness_mm', not both");
    }
    if let (Some(r), Some(d), Some(place)) = (roughness_mm, diameter_mm, section.place_of("roughness_mm"))
        && r > 0.1 * d
    {
        section.fault_at(&place, format!("a roughness of {r} mm is over a tenth of the diameter ({d} mm)"));
    }
    let before = if section.place_of("from").is_some() { "its node is" } else { "the one before it ends" };
    let elevation_start_m = section.number("elevation_start_m", &FINITE).or(joins_at_m).unwrap_or(0.0);
    if let (Some(place), Some(end)) = (section.place_of("elevation_start_m"), joins_at_m)
        && (elevation_start_m - end).abs() > 1e-3
    {
        section.fault_at(&place, format!("the pipe starts at {elevation_start_m} m, but {before} at {end} m"));
    }
    let elevation_end_m = section.number("elevation_end_m", &FINITE).or(ends_at_m).unwrap_or(elevation_start_m);
    if let (Some(place), Some(end)) = (section.place_of("elevation_end_m"), ends_at_m)
        && (elevation_end_m - end).abs() > 1e-3
    {
        section.fault_at(&place, format!("the pipe ends at {elevation_end_m} m, but its node is at {end} m"));
    }
    let rise_m = (elevation_end_m - elevation_start_m).abs();
    if let Some(l) = length_m
        && rise_m > l
    {
        section.fault(format!("a pipe of {l} m cannot rise or fall by {rise_m} m"));
    }
    Some(Pipe {
        name: name?.value.to_owned(),
        length_m: length_m?,
        inner_diameter_m: diameter_mm? * 1e-3,
        wall_thickness_m: wall_mm? * 1e-3,
        material: material?.name.to_owned(),
        wave_speed_m_s: section.number("wave_speed_m_s", &WAVE_SPEED),
        friction_factor,
        roughness_m: roughness_mm.map(|r| r * 1e-3),
        poisson_ratio: section.number("poisson_ratio", &POISSON),
        constraint: read_constraint(section),
        elevation_start_m,
        elevation_end_m,
        tolerance: Tolerance {
            length: share(section, "length_tolerance_percent").unwrap_or(usual.length),
            diameter: share(section, "inner_diameter_tolerance_percent").unwrap_or(usual.diameter),
            wall: share(section, "wall_thickness_tolerance_percent").unwrap_or(usual.wall),
        },
    })
}

/// A word or the coefficient c₁ itself; without the key c₁ = 1.
fn read_constraint(section: &Section<'_>) -> Constraint {
    let words = [
        ("free", Constraint::Free),
        ("anchored-upstream", Constraint::AnchoredUpstream),
        ("anchored", Constraint::Anchored),
    ];
    if section.is_text("constraint") {
        return section.choice("constraint", &words).map_or(Constraint::Coefficient(1.0), |c| c.value);
    }
    let coefficient = Limits {
        holds: |v| v > 0.0 && v <= 10.0,
        words: "\"free\", \"anchored-upstream\", \"anchored\" or a number above 0, at most 10",
    };
    Constraint::Coefficient(section.number("constraint", &coefficient).unwrap_or(1.0))
}

/// Tolerances of all pipes, and that of the sensors' places as a share of the length of all pipes: those of a tape
/// along a pipe with bends, and of bore and wall of pipes as they are sold.
const USUAL: (Tolerance, f64) = (Tolerance { length: 0.005, diameter: 0.01, wall: 0.05 }, 0.003);

/// The rig's own in place of [`USUAL`].
fn read_tolerance(section: &Section<'_>) -> (Tolerance, f64) {
    let (usual, position) = USUAL;
    let tolerance = Tolerance {
        length: share(section, "length_percent").unwrap_or(usual.length),
        diameter: share(section, "diameter_percent").unwrap_or(usual.diameter),
        wall: usual.wall,
    };
    (tolerance, share(section, "position_percent").unwrap_or(position))
}

fn read_steady(section: &Section<'_>) -> Option<SteadyState> {
    let name = section.required_text("name", "a name for the steady state");
    let flow_m3_h = section.required_number("flow_m3_h", &POSITIVE);
    let supply_head_m = section.number("supply_head_m", &POSITIVE);
    let temperature_degc = section.number("temperature_degC", &TEMPERATURE);
    let reynolds_number = section.number("reynolds_number", &POSITIVE);
    let wave_speed_m_s = section.number("wave_speed_m_s", &WAVE_SPEED);
    Some(SteadyState {
        name: name?.value.to_owned(),
        flow_m3_s: flow_m3_h? / 3600.0,
        supply_head_m,
        temperature_degc,
        reynolds_number,
        wave_speed_m_s,
    })
}
