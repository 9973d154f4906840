//! The sensors of a rig file.

use crate::rig::device::Device;
use crate::rig::graph::{Graph, Place};
use crate::rig::live::{Channels, read_wiring};
use crate::rig::table::{At, FINITE, Limits, NOT_NEGATIVE, POSITIVE, Section, Source, nearest};
use crate::rig::types::{Coupling, Pipe, Sensor, SensorKind, Upstream};
use crate::rig::unique::Names;
use crate::units::{Quantity, UNITS, Unit};

pub(crate) const KEYS: &[&str] = &[
    "name",
    "kind",
    "pipe",
    "node",
    "position_m",
    "position_tolerance_m",
    "unit",
    "range",
    "accuracy_percent_fs",
    "time_constant_s",
    "elevation_m",
    "coupling",
    "device",
    "channel",
    "scale",
    "offset",
    "register_kind",
    "encoding",
    "word_order",
];

/// Positions may be rounded: a sensor this little beyond the end stands at the end, m.
const POSITION_SLACK_M: f64 = 1e-6;
const PERCENT: Limits = Limits { holds: |v| v > 0.0 && v <= 100.0, words: "a percentage above 0, at most 100" };

/// The pipes on which sensors stand.
pub(crate) struct Layout<'a> {
    pub(crate) graph: &'a Graph,
    pub(crate) pipes: &'a [Pipe],
    /// Whether the file names its nodes: places are then on one pipe or at a node.
    pub(crate) has_nodes: bool,
}

impl Layout<'_> {
    fn length_m(&self, line: usize) -> f64 {
        self.pipes[self.graph.lines[line].pipes.clone()].iter().map(|p| p.length_m).sum()
    }

    /// The place at a node: at the end of the first line that ends there, else at the beginning of the first that
    /// begins there.
    fn at_node(&self, node: usize) -> Place {
        let lines = &self.graph.lines;
        match lines.iter().position(|line| line.to == node) {
            Some(line) => Place { line, position_m: self.length_m(line) },
            None => Place { line: lines.iter().position(|line| line.from == node).unwrap_or(0), position_m: 0.0 },
        }
    }
}

/// Reads all sensors; `usual` is the share of the pipes' length by which places are known.
pub(crate) fn read_sensors(
    sections: &[Section<'_>],
    layout: Option<&Layout<'_>>,
    usual: f64,
    devices: &[(String, Option<Device>)],
) -> Vec<Sensor> {
    let mut names = Names::new("sensor");
    let mut channels = Channels::default();
    let whole_m = |layout: &Layout| layout.graph.way.iter().map(|(line, _)| layout.length_m(*line)).sum();
    let usual_sd_m = usual * layout.map_or(0.0, whole_m);
    let read = |section| read_sensor(section, layout, usual_sd_m, devices, &mut names, &mut channels);
    sections.iter().filter_map(read).collect()
}

/// The rig must have a pressure sensor, and one at position 0 if it drives the model.
pub(crate) fn check_pressure(source: &Source<'_>, sensors: &[Sensor], upstream: Option<&At<Upstream>>) {
    let pressure = || sensors.iter().filter(|s| s.kind == SensorKind::Pressure);
    if pressure().next().is_none() {
        source.report(None, "no sensor has kind = \"pressure\"; there must be at least one [[sensor]] of that kind");
    }
    if let Some(upstream) = upstream.filter(|u| u.value == Upstream::Measured) {
        let drives = |s: &Sensor| s.position_m <= POSITION_SLACK_M && s.coupling == Coupling::Dc;
        if !pressure().any(drives) {
            let message = "kind = \"measured\" needs a pressure sensor with position_m = 0 and coupling = \"dc\" to drive the model";
            source.report(Some(upstream.place.clone()), message);
        }
    }
}

fn read_sensor(
    section: &Section<'_>,
    layout: Option<&Layout<'_>>,
    usual_sd_m: f64,
    devices: &[(String, Option<Device>)],
    names: &mut Names,
    channels: &mut Channels,
) -> Option<Sensor> {
    let name = section.required_text("name", "the sensor's name, also its column in CSV files");
    names.check(section, name.as_ref());
    if let Some(name) = &name {
        check_column_name(section, name);
    }
    let kinds = SensorKind::ALL.map(|kind| (kind.name(), kind));
    let kind = section.required_choice("kind", &kinds).map(|k| k.value);
    let place = if layout.is_some_and(|layout| layout.has_nodes) {
        read_place(section, kind, layout?)
    } else {
        let total_m = layout.map(|layout| layout.length_m(0));
        read_position(section, kind, total_m).map(Place::from)
    };
    let position_sd_m = section.number("position_tolerance_m", &NOT_NEGATIVE).unwrap_or(usual_sd_m);
    let unit = read_unit(section, kind);
    let range = section.interval("range");
    let accuracy_percent_fs = section.number("accuracy_percent_fs", &PERCENT);
    let time_constant_s = section.number("time_constant_s", &POSITIVE);
    let elevation_m = section.number("elevation_m", &FINITE);
    let coupling = section.choice("coupling", &[("dc", Coupling::Dc), ("ac", Coupling::Ac)]);
    if let Some(coupling) = &coupling {
        if kind.is_some_and(|k| k != SensorKind::Pressure) {
            section.fault_at(&coupling.place, "'coupling' is for sensors with kind = \"pressure\" only; leave it out");
        } else if coupling.value == Coupling::Ac && section.place_of("time_constant_s").is_none() {
            section.fault_at(&coupling.place, "coupling = \"ac\" needs 'time_constant_s', that of its high-pass");
        }
    }
    let name = name?;
    let wiring = read_wiring(section, name.value, devices, channels);
    Some(Sensor {
        name: name.value.to_owned(),
        kind: kind?,
        line: place?.line,
        position_m: place?.position_m,
        position_sd_m,
        unit: unit?,
        range,
        accuracy_percent_fs,
        time_constant_s,
        elevation_m,
        coupling: coupling.map_or(Coupling::Dc, |c| c.value),
        wiring,
    })
}

/// A name is the heading of a CSV column: no quoting, no clash with the time column.
fn check_column_name(section: &Section<'_>, name: &At<&str>) {
    let text = name.value;
    let problem = if text == "time_s" {
        "is the name of the time column"
    } else if text.contains([',', '"']) {
        "must not hold a comma or a quote"
    } else if text.trim() != text {
        "must not begin or end with a space"
    } else {
        return;
    };
    section.fault_at(
        &name.place,
        format!("the sensor's name heads its column in CSV files: '{}' {problem}", text.escape_debug()),
    );
}

/// A place in a network: along a pipe or at a node. Trigger and valve position are at the valve unless they say
/// otherwise, a temperature at the supply.
fn read_place(section: &Section<'_>, kind: Option<SensorKind>, layout: &Layout<'_>) -> Option<Place> {
    let Layout { graph, pipes, .. } = layout;
    if let (Some(_), Some(place)) = (section.place_of("node"), section.place_of("pipe")) {
        section.fault_at(&place, "give 'pipe' with 'position_m', or 'node', not both");
        return None;
    }
    let unknown = |at: &At<&str>, what: &str, near: Option<&str>| {
        let hint = near.map(|near| format!("; did you mean \"{near}\"?")).unwrap_or_default();
        section.fault_at(&at.place, format!("there is no {what} '{}'{hint}", at.value));
    };
    if let Some(node) = section.text("node") {
        let Some(n) = graph.nodes.iter().position(|n| n.name == node.value) else {
            unknown(&node, "node", nearest(node.value, graph.nodes.iter().map(|n| n.name.as_str())));
            return None;
        };
        if let Some(place) = section.place_of("position_m") {
            section.fault_at(&place, "'position_m' is along a 'pipe'; a sensor at a node has none");
        }
        if kind == Some(SensorKind::Flow) {
            section.fault_at(&node.place, "a flow is that in a pipe: give 'pipe' and 'position_m'");
        }
        return Some(layout.at_node(n));
    }
    let Some(pipe) = section.text("pipe") else {
        return match kind? {
            SensorKind::Trigger | SensorKind::ValvePosition => Some(layout.at_node(graph.valve)),
            SensorKind::Temperature => Some(layout.at_node(graph.supply())),
            SensorKind::Pressure | SensorKind::Flow => {
                section.fault("the sensor stands nowhere: give 'pipe' and 'position_m', or 'node'");
                None
            }
        };
    };
    let Some(line) = pipes.iter().position(|p| p.name == pipe.value) else {
        unknown(&pipe, "pipe", nearest(pipe.value, pipes.iter().map(|p| p.name.as_str())));
        return None;
    };
    let position_m = section.required_number("position_m", &FINITE)?;
    let length_m = layout.length_m(line);
    if !(-POSITION_SLACK_M..=length_m + POSITION_SLACK_M).contains(&position_m) {
        let ends = [graph.lines[line].from, graph.lines[line].to].map(|n| &graph.nodes[n].name);
        let message = format!(
            "position_m = {position_m} is not on pipe '{}', which goes from 0 at '{}' to {length_m} m at '{}'",
            pipe.value, ends[0], ends[1]
        );
        section.fault_at(&section.place_of("position_m")?, message);
        return None;
    }
    Some(Place { line, position_m: position_m.clamp(0.0, length_m) })
}

/// Default position of a sensor: flow and temperature at the supply, trigger and valve position at the valve.
fn read_position(section: &Section<'_>, kind: Option<SensorKind>, total_m: Option<f64>) -> Option<f64> {
    for (key, place) in ["pipe", "node"].into_iter().filter_map(|key| Some((key, section.place_of(key)?))) {
        section.fault_at(
            &place,
            format!("'{key}' is for rigs with [[node]] tables; here 'position_m' counts from the supply"),
        );
    }
    let given = section.number("position_m", &FINITE);
    if section.place_of("position_m").is_none() {
        return match kind? {
            SensorKind::Pressure => section.required("position_m", "the distance from the supply along the pipe", None),
            SensorKind::Flow | SensorKind::Temperature => Some(0.0),
            SensorKind::Trigger | SensorKind::ValvePosition => total_m,
        };
    }
    let (position, total) = (given?, total_m?);
    if position < -POSITION_SLACK_M || position > total + POSITION_SLACK_M {
        let place = section.place_of("position_m")?;
        let message = format!(
            "position_m = {position} is not on the pipe, which goes from 0 at the supply to {total} m at the valve"
        );
        section.fault_at(&place, message);
        return None;
    }
    Some(position.clamp(0.0, total))
}

fn read_unit(section: &Section<'_>, kind: Option<SensorKind>) -> Option<Unit> {
    let text = section.required_text("unit", "the unit of its samples")?;
    let quantity = kind.map(quantity_of);
    let fits = |u: &&Unit| quantity.is_none_or(|q| u.quantity == q);
    let found = UNITS.iter().filter(fits).find(|u| u.symbol == text.value).copied();
    if found.is_none() {
        let allowed = UNITS.iter().filter(fits).map(|u| u.symbol).collect::<Vec<_>>().join(", ");
        let problem = match text.value.parse::<Unit>() {
            Ok(_) => "does not fit the sensor's kind",
            Err(_) => "is not a known unit",
        };
        let meant = meant_unit(text.value, UNITS.iter().filter(fits).map(|u| u.symbol));
        let hint = meant.map(|u| format!("; did you mean \"{u}\"?")).unwrap_or_default();
        section.fault_at(&text.place, format!("unit \"{}\" {problem}; allowed here are {allowed}{hint}", text.value));
    }
    found
}

/// Other spellings of units, in lower case and without signs.
const OTHER_SPELLINGS: [(&str, &str); 71] = [
    ("c", "degC"),
    ("celsius", "degC"),
    ("kelvin", "K"),
    ("mwc", "m(H2O)"),
    ("mws", "m(H2O)"),
    ("mce", "m(H2O)"),
    ("mh20", "m(H2O)"),
    ("m", "m(H2O)"),
    ("lps", "L/s"),
    ("lpm", "L/min"),
    ("cmh", "m3/h"),
    ("m3hr", "m3/h"),
    ("lph", "L/h"),
    ("gallonmin", "gpm"),
    ("galmin", "gpm"),
    ("usgpm", "gpm"),
    ("fahrenheit", "degF"),
    ("f", "degF"),
    ("torr", "mmHg"),
    ("pascal", "Pa"),
    ("pascals", "Pa"),
    ("kilopascal", "kPa"),
    ("megapascal", "MPa"),
    ("bars", "bar"),
    ("millibar", "mbar"),
    ("nmm2", "MPa"),
    ("kgcm2", "kgf/cm2"),
    ("fth20", "ftH2O"),
    ("inwc", "inH2O"),
    ("mmwc", "mmH2O"),
    ("mmws", "mmH2O"),
    ("cmws", "cmH2O"),
    ("mbarg", "mbar"),
    ("percent", "%"),
    ("barg", "bar"),
    ("psig", "psi"),
    ("lbin2", "psi"),
    ("lbfin2", "psi"),
    ("lbsqin", "psi"),
    ("lbfsqin", "psi"),
    ("poundspersquareinch", "psi"),
    ("mb", "mbar"),
    ("cbar", "kPa"),
    ("centibar", "kPa"),
    ("decibar", "dbar"),
    ("hectopascal", "hPa"),
    ("at", "kgf/cm2"),
    ("atü", "kgf/cm2"),
    ("knm2", "kPa"),
    ("kpcm2", "kgf/cm2"),
    ("mca", "m(H2O)"),
    ("mwg", "m(H2O)"),
    ("mofwater", "m(H2O)"),
    ("ft", "ftH2O"),
    ("ftwc", "ftH2O"),
    ("ftofwater", "ftH2O"),
    ("бар", "bar"),
    ("мбар", "mbar"),
    ("кпа", "kPa"),
    ("атм", "atm"),
    ("кгссм2", "kgf/cm2"),
    ("帕", "Pa"),
    ("千帕", "kPa"),
    ("兆帕", "MPa"),
    ("巴", "bar"),
    ("cm3s", "mL/s"),
    ("ccs", "mL/s"),
    ("cm3min", "mL/min"),
    ("ccmin", "mL/min"),
    ("лмин", "L/min"),
    ("лс", "L/s"),
];

/// The unit of a quantity in any common spelling: `BAR`, `m³/h`, `°C`, `mWC`, `lpm`.
pub fn spelled_unit(text: &str, quantity: Quantity) -> Option<Unit> {
    // a thousandth of a pascal is no million of them
    let text = if text == "mPa" { "" } else { text };
    let allowed = UNITS.iter().filter(|u| u.quantity == quantity);
    let wanted = bare(text);
    let other = OTHER_SPELLINGS.iter().find(|(name, _)| *name == wanted).map(|(_, unit)| *unit);
    let exact = allowed.clone().find(|u| u.symbol == text);
    exact.or_else(|| allowed.clone().find(|u| bare(u.symbol) == wanted || other == Some(u.symbol))).copied()
}

/// A unit without its signs and case.
fn bare(text: &str) -> String {
    let plain = text.replace('³', "3").replace(['₂', '²'], "2").replace('°', "");
    plain.chars().filter(|c| c.is_alphanumeric() || *c == '%').collect::<String>().to_lowercase()
}

/// The permitted unit that a misspelt one probably means: another case, without its signs, a common name, or a slip.
fn meant_unit<'u>(text: &str, mut allowed: impl Iterator<Item = &'u str> + Clone) -> Option<&'u str> {
    let wanted = bare(text);
    let other = OTHER_SPELLINGS.iter().find(|(name, _)| *name == wanted).map(|(_, unit)| *unit);
    let known = allowed.clone().find(|u| bare(u) == wanted || other == Some(*u));
    known.or_else(|| nearest(text, allowed.by_ref()))
}

/// The quantity that a kind of sensor measures.
pub fn quantity_of(kind: SensorKind) -> Quantity {
    match kind {
        SensorKind::Pressure => Quantity::Pressure,
        SensorKind::Flow => Quantity::Flow,
        SensorKind::Temperature => Quantity::Temperature,
        SensorKind::ValvePosition | SensorKind::Trigger => Quantity::Ratio,
    }
}
