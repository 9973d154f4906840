//! The nodes of a rig file, and how its pipes join them.

use std::collections::HashMap;
use std::ops::Range;

use crate::rig::graph::{Closing, Drive, Graph, Line, Node, NodeKind, Opening, Pump, PumpCurve};
use crate::rig::table::{FINITE, Limits, NOT_NEGATIVE, POSITIVE, Section, Source, nearest, share};
use crate::rig::types::Valve;
use crate::rig::unique::Names;

pub(crate) const KEYS: &[&str] = &[
    "name",
    "kind",
    "elevation_m",
    "at",
    "demand_m3_h",
    "head_m",
    "area_m2",
    "closing_time_s",
    "closing_time_tolerance_percent",
    "closing_start_s",
    "characteristic",
    "discharge_head_m",
    "cda_mm2",
    "opening",
    "curve_m3_h_m",
    "suction_head_m",
    "speed",
    "trip_s",
    "inertia_kg_m2",
    "speed_rpm",
    "efficiency_percent",
    "bypass",
];

const EFFICIENCY: Limits = Limits { holds: |v| v > 0.0 && v <= 100.0, words: "a percentage above 0, at most 100" };
const SHARE: Limits = Limits { holds: |v| (0.0..=1.0).contains(&v), words: "a share from 0 to 1" };

/// The kinds of node, as rig files spell them, and the keys of each beside `name`, `kind`, `elevation_m` and `at`.
const KINDS: [(&str, &[&str]); 7] = [
    ("junction", &["demand_m3_h", "cda_mm2", "opening", "discharge_head_m"]),
    ("reservoir", &["head_m"]),
    ("tank", &["head_m", "area_m2"]),
    ("dead-end", &[]),
    (
        "valve",
        &[
            "closing_time_s",
            "closing_time_tolerance_percent",
            "closing_start_s",
            "characteristic",
            "discharge_head_m",
            "cda_mm2",
            "opening",
        ],
    ),
    ("check-valve", &[]),
    (
        "pump",
        &[
            "curve_m3_h_m",
            "suction_head_m",
            "speed",
            "trip_s",
            "inertia_kg_m2",
            "speed_rpm",
            "efficiency_percent",
            "bypass",
        ],
    ),
];
const OF_ALL: [&str; 4] = ["name", "kind", "elevation_m", "at"];

/// The nodes of a file, as far as they are read.
pub(crate) struct Nodes<'a> {
    sections: &'a [Section<'a>],
    read: Vec<Option<ReadNode>>,
    by_name: HashMap<&'a str, usize>,
}

struct ReadNode {
    node: Node,
    kind: &'static str,
    elevation_m: Option<f64>,
    valve: Option<Valve>,
}

impl<'a> Nodes<'a> {
    pub(crate) fn read(sections: &'a [Section<'a>]) -> Nodes<'a> {
        let mut names = Names::new("node");
        let read = sections.iter().map(|section| read_node(section, &mut names)).collect();
        let named = |(i, section): (usize, &'a Section<'a>)| section.peek_text("name").map(|name| (name, i));
        Nodes { sections, read, by_name: sections.iter().enumerate().filter_map(named).collect() }
    }

    /// The node that a key names; reports one that is not there.
    pub(crate) fn named(&self, section: &Section<'_>, key: &str, words: &str) -> Option<usize> {
        let text = section.required_text(key, words)?;
        let found = self.by_name.get(text.value).copied();
        if found.is_none() {
            let near = nearest(text.value, self.by_name.keys().copied());
            let hint = near.map(|near| format!("; did you mean \"{near}\"?")).unwrap_or_default();
            section.fault_at(&text.place, format!("there is no node '{}'{hint}", text.value));
        }
        found
    }

    /// Elevation of a node, if it is there and has one, m.
    pub(crate) fn elevation_of(&self, name: &str) -> Option<f64> {
        self.read[*self.by_name.get(name)?].as_ref()?.elevation_m
    }

    /// The graph of pipes with their lengths between these nodes, and its valve; `None` if there is none, which is then
    /// reported.
    pub(crate) fn join(
        self,
        source: &Source<'_>,
        ends: &[(usize, usize)],
        lengths_m: &[f64],
    ) -> Option<(Graph, Valve)> {
        let read: Vec<ReadNode> = self.read.into_iter().collect::<Option<_>>()?;
        let closing: Vec<usize> = (0..read.len()).filter(|&n| read[n].valve.is_some()).collect();
        let name = |n: usize| read[n].node.name.clone();
        let valve = match closing[..] {
            [valve] => valve,
            [one, other, ..] => {
                let message = "both have a 'closing_time_s' and no 'cda_mm2': the first that closes goes without, for the flow before the closure \
                               gives its area; give the other one 'cda_mm2'";
                self.sections[other].fault(format!("'{}' and '{}' {message}", name(one), name(other)));
                return None;
            }
            [] => {
                source.report(
                    None,
                    "no valve closes first: give the [[node]] of kind \"valve\" that does a 'closing_time_s' and no 'cda_mm2', for the flow \
                     before the closure gives its area",
                );
                return None;
            }
        };
        let mut counts = vec![(0, 0); read.len()];
        for &(from, to) in ends {
            counts[from].1 += 1;
            counts[to].0 += 1;
        }
        for (n, section) in self.sections.iter().enumerate() {
            let (into, from) = counts[n];
            if let Some(wrong) = wrong_ends(&read[n], n == valve, into, from) {
                section.fault(format!("{} '{}' {wrong}", read[n].kind, name(n)));
            }
        }
        let levels = read.iter().map(|r| levels(&r.node.kind)).sum::<usize>();
        for (section, node) in self.sections.iter().zip(&read) {
            if levels > 1 && node.node.kind == (NodeKind::Reservoir { head_m: None }) {
                section.fault(format!(
                    "missing key 'head_m' of reservoir '{}': the rig has more than one level, so each needs its own",
                    node.node.name
                ));
            }
        }
        let lines = ends.iter().enumerate().map(|(i, &(from, to))| Line { from, to, pipes: i..i + 1 }).collect();
        let valve_data = read[valve].valve.clone();
        let graph = Graph::new(read.into_iter().map(|r| r.node).collect(), lines, lengths_m, valve);
        let reached = graph.distances(valve, lengths_m);
        for (n, section) in self.sections.iter().enumerate() {
            if reached[n].0.is_infinite() && counts[n] != (0, 0) {
                section.fault(format!(
                    "no pipe leads from '{}' to the valve '{}'",
                    graph.nodes[n].name, graph.nodes[valve].name
                ));
            }
        }
        if !graph.nodes.iter().any(|node| node.kind.feeds()) {
            source.report(
                None,
                "nothing feeds the pipes: there must be a [[node]] of kind \"reservoir\", \"tank\" or \"pump\"",
            );
        }
        Some((graph, valve_data?))
    }
}

/// How many levels of water a node brings, that must be known against each other.
fn levels(kind: &NodeKind) -> usize {
    match kind {
        NodeKind::Reservoir { .. } | NodeKind::Tank { .. } => 1,
        NodeKind::Pump(pump) => usize::from(pump.suction_head_m.is_some()),
        kind => usize::from(kind.opening().is_some_and(|opening| opening.discharge_head_m.is_some())),
    }
}

/// What is wrong with the number of pipes that end at a node and begin there.
fn wrong_ends(read: &ReadNode, closes: bool, into: usize, from: usize) -> Option<String> {
    let passed = read.node.kind.is_passed();
    match &read.node.kind {
        _ if into + from == 0 => Some("joins no pipe: a [[pipe]] needs its name in 'from' or 'to'".to_owned()),
        NodeKind::Junction { .. } if read.kind == "dead-end" && into + from > 1 => {
            Some(format!("joins {} pipes; a junction does that", into + from))
        }
        NodeKind::Valve if closes && into != 1 => Some(format!("closes, so one pipe must end there ('to'); {into} do")),
        NodeKind::Pump(pump) if from == 0 || (into == 0) != pump.suction_head_m.is_some() => Some(
            "needs a pipe that begins there ('from'), and either a pipe that ends there ('to') or a 'suction_head_m'"
                .to_owned(),
        ),
        NodeKind::Opening(opening) if into == 0 || (from == 0) != opening.discharge_head_m.is_some() => Some(
            "needs a pipe that ends there ('to'), and either one that begins there ('from') or a 'discharge_head_m'"
                .to_owned(),
        ),
        _ if passed && !closes && (into == 0 || from == 0) && read.kind == "check-valve" => {
            Some("needs a pipe that ends there ('to') and one that begins there ('from')".to_owned())
        }
        _ => None,
    }
}

fn read_node(section: &Section<'_>, names: &mut Names) -> Option<ReadNode> {
    let name = section.required_text("name", "the node's name");
    names.check(section, name.as_ref());
    let kinds: Vec<(&str, usize)> = KINDS.iter().enumerate().map(|(i, (name, _))| (*name, i)).collect();
    let Some(kind) = section.required_choice("kind", &kinds) else {
        report_values(section);
        return None;
    };
    let (kind, own) = KINDS[kind.value];
    for key in KEYS.iter().filter(|key| !own.contains(key) && !OF_ALL.contains(key)) {
        if let Some(place) = section.place_of(key) {
            section.fault_at(&place, format!("a {kind} has no '{key}'"));
        }
    }
    let elevation_m = section.number("elevation_m", &FINITE);
    let head_m = section.number("head_m", &FINITE);
    let mut valve = None;
    let kind_read = match kind {
        "reservoir" => Some(NodeKind::Reservoir { head_m }),
        "tank" => {
            let head_m = section.required("head_m", "the tank's level before the closure", head_m);
            let area_m2 = section.required_number("area_m2", &POSITIVE);
            head_m.zip(area_m2).map(|(head_m, area_m2)| NodeKind::Tank { head_m, area_m2 })
        }
        "valve" => match (read_closing(section), section.place_of("cda_mm2")) {
            (Some(closing), None) => {
                refuse(section, &["closing_start_s"], "with 'cda_mm2': the one without closes first, at time 0");
                valve = Some(Valve {
                    closing_time_s: closing.time_s,
                    discharge_head_m: section.number("discharge_head_m", &FINITE).unwrap_or(0.0),
                    closing_time_tolerance: closing.time_tolerance,
                    characteristic: closing.characteristic,
                });
                Some(NodeKind::Valve)
            }
            (closing, _) => read_opening(section).map(|opening| NodeKind::Opening(Opening { closing, ..opening })),
        },
        "pump" => read_pump(section).map(NodeKind::Pump),
        "check-valve" => Some(NodeKind::CheckValve),
        _ => {
            let demand_m3_s = section.number("demand_m3_h", &FINITE).unwrap_or(0.0) / 3600.0;
            let opens = ["cda_mm2", "opening", "discharge_head_m"].iter().any(|key| section.place_of(key).is_some());
            let outlet = if opens { Some(read_opening(section)?) } else { None };
            // Into the air at its own height.
            let outlet = outlet.map(|opening| Opening {
                discharge_head_m: opening.discharge_head_m.or(elevation_m).or(Some(0.0)),
                ..opening
            });
            Some(NodeKind::Junction { demand_m3_s, outlet })
        }
    };
    let node = Node { name: name?.value.to_owned(), kind: kind_read?, at: section.pair("at") };
    Some(ReadNode { node, kind, elevation_m, valve })
}

/// Reports keys that another valve has.
fn refuse(section: &Section<'_>, keys: &[&str], of: &str) {
    for key in keys {
        if let Some(place) = section.place_of(key) {
            section.fault_at(&place, format!("'{key}' is of a valve {of}"));
        }
    }
}

/// How a valve closes; none where it does not.
fn read_closing(section: &Section<'_>) -> Option<Closing> {
    if section.place_of("closing_time_s").is_none() {
        let of_closing = ["closing_time_tolerance_percent", "closing_start_s", "characteristic"];
        refuse(section, &of_closing, "that closes: give its 'closing_time_s'");
        return None;
    }
    refuse(section, &["opening"], "without 'closing_time_s'");
    Some(Closing {
        start_s: section.number("closing_start_s", &NOT_NEGATIVE).unwrap_or(0.0),
        time_s: section.number("closing_time_s", &POSITIVE)?,
        time_tolerance: share(section, "closing_time_tolerance_percent"),
        characteristic: characteristic(section),
    })
}

/// The relative opening of a valve over its stroke; empty where the file has none.
pub(crate) fn characteristic(section: &Section<'_>) -> Vec<(f64, f64)> {
    let words = "a list [[0, 1], …, [1, 0]] of shares of the stroke, which increase, and relative openings from 0 to 1";
    let Some(points) = section.points("characteristic", words) else { return Vec::new() };
    let ends = (points.first(), points.last()) == (Some(&(0.0, 1.0)), Some(&(1.0, 0.0)));
    let fine = ends && points.windows(2).all(|w| w[1].0 > w[0].0) && points.iter().all(|p| (SHARE.holds)(p.1));
    if let (false, Some(place)) = (fine, section.place_of("characteristic")) {
        section.fault_at(&place, format!("'characteristic' must be {words}"));
    }
    points
}

/// Reports what is wrong with the values of a node whose kind is not known.
fn report_values(section: &Section<'_>) {
    let limits: [(&str, &Limits); 13] = [
        ("elevation_m", &FINITE),
        ("demand_m3_h", &FINITE),
        ("head_m", &FINITE),
        ("area_m2", &POSITIVE),
        ("closing_time_s", &POSITIVE),
        ("closing_start_s", &NOT_NEGATIVE),
        ("discharge_head_m", &FINITE),
        ("cda_mm2", &POSITIVE),
        ("suction_head_m", &FINITE),
        ("trip_s", &NOT_NEGATIVE),
        ("inertia_kg_m2", &POSITIVE),
        ("speed_rpm", &POSITIVE),
        ("efficiency_percent", &EFFICIENCY),
    ];
    limits.into_iter().for_each(|(key, limits)| _ = section.number(key, limits));
    _ = section.pair("at");
    _ = share(section, "closing_time_tolerance_percent");
    _ = (over_time(section, "opening", &SHARE), over_time(section, "speed", &NOT_NEGATIVE), characteristic(section));
    _ = section.points("curve_m3_h_m", CURVE);
}

/// What a pump's curve is.
const CURVE: &str =
    "a list [[m3/h, m], …] of one point, or of three of which the first has no flow, with heads that fall";

fn read_opening(section: &Section<'_>) -> Option<Opening> {
    let words =
        "the opening's area times its discharge coefficient (the valve that closes first has 'closing_time_s' instead)";
    let cda_mm2 = section.required("cda_mm2", words, section.number("cda_mm2", &POSITIVE));
    let opening = over_time(section, "opening", &SHARE).unwrap_or_else(|| vec![(0.0, 1.0)]);
    let discharge_head_m = section.number("discharge_head_m", &FINITE);
    Some(Opening { cda_m2: cda_mm2? * 1e-6, opening, discharge_head_m, closing: None })
}

fn read_pump(section: &Section<'_>) -> Option<Pump> {
    let points = section.required("curve_m3_h_m", CURVE, section.points("curve_m3_h_m", CURVE))?;
    let points: Vec<(f64, f64)> = points.into_iter().map(|(q, h)| (q / 3600.0, h)).collect();
    let curve = PumpCurve::through(&points);
    if let (None, Some(place)) = (curve, section.place_of("curve_m3_h_m")) {
        section.fault_at(&place, format!("'curve_m3_h_m' must be {CURVE}"));
    }
    let bypass = section.choice("bypass", &[("check-valve", 0.0)]);
    let least_m = bypass.map_or(f64::NEG_INFINITY, |least| least.value);
    let speed = over_time(section, "speed", &NOT_NEGATIVE);
    let drive = match (section.number("trip_s", &NOT_NEGATIVE), speed) {
        (Some(_), Some(_)) => {
            section.fault("give 'speed' or 'trip_s', not both");
            return None;
        }
        (None, speed) => Drive::Speed(speed.unwrap_or_else(|| vec![(0.0, 1.0)])),
        (Some(at_s), None) => {
            let inertia_kg_m2 = section.required_number("inertia_kg_m2", &POSITIVE);
            let speed_rpm = section.required_number("speed_rpm", &POSITIVE);
            let efficiency = section.required_number("efficiency_percent", &EFFICIENCY);
            let speed_rad_s = speed_rpm? * std::f64::consts::TAU / 60.0;
            Drive::Trip { at_s, inertia_kg_m2: inertia_kg_m2?, speed_rad_s, efficiency: efficiency? / 100.0 }
        }
    };
    Some(Pump {
        curve: PumpCurve { least_m, ..curve? },
        suction_head_m: section.number("suction_head_m", &FINITE),
        drive,
    })
}

/// A number, or a list of times and numbers.
fn over_time(section: &Section<'_>, key: &str, limits: &Limits) -> Option<Vec<(f64, f64)>> {
    let place: Range<usize> = section.place_of(key)?;
    if section.is_number(key) {
        return section.number(key, limits).map(|value| vec![(0.0, value)]);
    }
    let words = "a number, or a list [[s, 1], …] of times that increase and values";
    let points = section.points(key, words)?;
    let fine = points.windows(2).all(|w| w[1].0 > w[0].0) && points.iter().all(|p| (limits.holds)(p.1));
    if !fine {
        section.fault_at(&place, format!("'{key}' must be {words}; each value must be {}", limits.words));
    }
    fine.then_some(points)
}

#[cfg(test)]
mod tests {
    use crate::rig::{NodeKind, Place, Rig};

    const BRANCHED: &str = include_str!("../../../rigs/branched.toml");

    #[test]
    fn a_branched_rig_is_read() {
        let rig = Rig::from_toml(BRANCHED, "rig.toml").unwrap();
        assert_eq!((rig.graph.nodes.len(), rig.graph.lines.len(), rig.length_m()), (4, 3, 420.0));
        assert_eq!(rig.graph.way, [(0, false), (1, false)]);
        assert_eq!(rig.valve_place(), Place { line: 1, position_m: 120.0 });
        let places: Vec<(usize, f64)> = rig.sensors.iter().map(|s| (s.line, s.position_m)).collect();
        assert_eq!(places, [(1, 120.0), (0, 150.0), (2, 83.0), (0, 10.0)]);
        // A sensor on a branch is as far before the valve as a wave comes.
        assert_eq!(rig.on_way_m(rig.sensors[2].place()), 420.0 - 203.0);
        assert_eq!(rig.at_way_m(350.0), Place { line: 1, position_m: 50.0 });
        assert!(matches!(rig.graph.nodes[3].kind, NodeKind::Junction { demand_m3_s: 0.0, outlet: None }));
    }

    #[test]
    fn what_is_no_network_is_refused_with_its_line() {
        let error = |from: &str, to: &str| {
            let text = BRANCHED.replacen(from, to, 1);
            assert_ne!(text, BRANCHED, "{from}");
            Rig::from_toml(&text, "rig.toml").unwrap_err().to_string()
        };
        let end = "name = \"end\"\nkind = \"dead-end\"";
        for (from, to, says) in [
            ("to = \"valve\"", "to = \"vlave\"", "there is no node 'vlave'; did you mean \"valve\"?"),
            ("to = \"valve\"", "to = \"tee\"", "the pipe ends at the node where it begins"),
            ("from = \"tee\"\nto = \"end\"", "", "missing key 'from' in [[pipe]]; it is the name of a [[node]]"),
            (
                end,
                "name = \"end\"\nkind = \"valve\"\nclosing_time_s = 1",
                "'valve' and 'end' both have a 'closing_time_s' and no 'cda_mm2'",
            ),
            (
                "closing_time_s = 0.05",
                "closing_time_s = 0.05\ncda_mm2 = 9\ndischarge_head_m = 0",
                "no valve closes first",
            ),
            ("closing_time_s = 0.05", "closing_time_s = 0.05\nclosing_start_s = 1", "without closes first, at time 0"),
            (
                "closing_time_s = 0.05",
                "closing_time_s = 0.05\ncharacteristic = [[0, 1], [1, 0.1]]",
                "a list [[0, 1], …, [1, 0]]",
            ),
            (
                end,
                "name = \"end\"\nkind = \"valve\"\ncda_mm2 = 3\nclosing_start_s = 1",
                "that closes: give its 'closing_time_s'",
            ),
            (end, "name = \"end\"\nkind = \"valve\"", "missing key 'cda_mm2' in [[node]]"),
            (end, "name = \"end\"\nkind = \"valve\"\ncda_mm2 = 3", "valve 'end' needs a pipe that ends there"),
            (end, "name = \"end\"\nkind = \"reservoir\"", "missing key 'head_m' of reservoir 'tank'"),
            (end, "name = \"end\"\nkind = \"dead-end\"\nhead_m = 3", "a dead-end has no 'head_m'"),
            (end, "name = \"end\"\nkind = \"dead\"", "did you mean \"dead-end\"?"),
            (end, "name = \"end\"\nkind = \"check-valve\"", "check-valve 'end' needs a pipe that ends there"),
            ("closing_time_s = 0.05", "cda_mm2 = 9\ndischarge_head_m = 0", "no valve closes"),
            ("kind = \"reservoir\"", "kind = \"junction\"", "nothing feeds the pipes"),
            ("from = \"tank\"\nto = \"tee\"", "from = \"tank\"\nto = \"end\"", "dead-end 'end' joins 2 pipes"),
            (
                "pipe = \"main\"\nposition_m = 150.0",
                "",
                "the sensor stands nowhere: give 'pipe' and 'position_m', or 'node'",
            ),
            (
                "pipe = \"main\"\nposition_m = 150.0",
                "pipe = \"mian\"\nposition_m = 1",
                "there is no pipe 'mian'; did you mean \"main\"?",
            ),
            ("position_m = 150.0", "position_m = 301.0", "which goes from 0 at 'tank' to 300 m at 'tee'"),
            ("position_m = 150.0", "node = \"tee\"", "give 'pipe' with 'position_m', or 'node', not both"),
            ("pipe = \"main\"\nposition_m = 10.0", "node = \"tee\"", "a flow is that in a pipe"),
            ("[fluid]", "[upstream]\nkind = \"reservoir\"\n[fluid]", "a rig with [[node]] has no [upstream]"),
        ] {
            let said = error(from, to);
            assert!(said.contains(says), "{to}: {said}");
        }
        let apart = format!(
            "{BRANCHED}\n[[node]]\nname = \"a\"\nkind = \"junction\"\n[[node]]\nname = \"b\"\nkind = \"junction\"\n[[pipe]]\nname = \"apart\"\n\
             from = \"a\"\nto = \"b\"\nlength_m = 3\ninner_diameter_mm = 50\nwall_thickness_mm = 3\nmaterial = \"steel\"\n"
        );
        let said = Rig::from_toml(&apart, "rig.toml").unwrap_err().to_string();
        assert!(said.contains("no pipe leads from 'a' to the valve 'valve'"), "{said}");
        let series = include_str!("../../../rigs/demo-hdpe.toml").replacen("length_m", "from = \"x\"\nlength_m", 1);
        let said = Rig::from_toml(&series, "rig.toml").unwrap_err().to_string();
        assert!(said.contains("'from' names a [[node]], and the file has none"), "{said}");
    }
}
