//! A rig file from an EPANET network: valves and pumps, links there, become nodes to which pipes lead.

use std::fmt::Write as _;

use crate::draft::epanet::{Friction, Link, LinkKind, Network, Node, NodeKind};
use crate::rig::PumpCurve;
use crate::rig::draft::quoted;
use crate::units::GRAVITY_M_S2;

/// Velocity at which Hazen and Williams' friction is taken, m/s: Darcy's factor falls with its power of -0.148.
const TAKEN_AT_M_S: f64 = 1.0;

/// A message names no more nodes than this.
const MOST_NAMED: usize = 12;

/// What a network file does not say.
pub struct Told<'a> {
    /// Name of the rig.
    pub name: &'a str,
    /// Temperature of the water, °C.
    pub temperature_degc: f64,
    /// Material and thickness (mm) of all walls.
    pub material: &'a str,
    /// See `material`.
    pub wall_thickness_mm: f64,
    /// The valve that closes, or the dead end where the flow is shut off; where there is one valve, none.
    pub valve: Option<&'a str>,
    /// Its closing time, s.
    pub closing_time_s: f64,
    /// Symbol of the unit of its pressure sensor.
    pub unit: &'a str,
}

/// A rig file, with what was assumed.
pub struct Drafted {
    /// The file.
    pub text: String,
    /// What was assumed.
    pub assumed: Vec<String>,
}

/// A node of the rig: its name, its table's lines, and where it is drawn.
struct Made {
    name: String,
    lines: String,
    at: Option<[f64; 2]>,
}

/// Writes the rig file.
///
/// # Errors
/// No valve, or several and none named; what a rig file cannot have, with its name.
pub fn draft(network: &Network, told: &Told) -> Result<Drafted, String> {
    let Network { nodes, links, friction, .. } = network;
    let is_pipe = |link: &Link| matches!(link.kind, LinkKind::Pipe { .. });
    let mut pipes_at = vec![0; nodes.len()];
    links.iter().filter(|l| is_pipe(l)).flat_map(|l| l.ends).for_each(|n| pipes_at[n] += 1);
    let passed: Vec<&Link> = links.iter().filter(|l| !is_pipe(l)).collect();
    let closing = closing(network, told.valve)?;
    let mut assumed = Vec::new();
    let mut drawn_m3_s: Vec<f64> =
        nodes.iter().map(|n| if let NodeKind::Junction(drawn) = n.kind { drawn } else { 0.0 }).collect();

    // Where pipes begin and end: at their nodes, or at the valve or pump that takes a node's place, before it or behind
    // it.
    let mut place: Vec<Option<(usize, bool)>> = vec![None; nodes.len()];
    for (i, link) in passed.iter().enumerate() {
        for (end, behind) in link.ends.into_iter().zip([false, true]) {
            match nodes[end].kind {
                NodeKind::Junction(drawn) => {
                    let shut_off = closing == Closing::Link(link.name.as_str()) && behind && pipes_at[end] == 0;
                    if drawn != 0.0 && !shut_off {
                        let next = next_junction(network, end, closing).ok_or_else(|| {
                            format!(
                                "'{}' stands at the junction '{}', at which flow is drawn off: move the demand to a junction beside it",
                                link.name, nodes[end].name
                            )
                        })?;
                        drawn_m3_s[next] += std::mem::take(&mut drawn_m3_s[end]);
                        assumed.push(format!(
                            "the demand at '{}', where '{}' stands, is drawn off at '{}'",
                            nodes[end].name, link.name, nodes[next].name
                        ));
                    }
                    no_emitter(&nodes[end], &link.name)?;
                    if place[end].replace((i, behind)).is_some() {
                        return Err(format!(
                            "two valves or pumps meet at '{}': put a pipe between them",
                            nodes[end].name
                        ));
                    }
                }
                NodeKind::Reservoir(_) | NodeKind::Tank(..) if pipes_at[end] > 0 && behind => {
                    return Err(format!(
                        "'{}' leads into '{}' without a pipe: put one between them",
                        link.name, nodes[end].name
                    ));
                }
                NodeKind::Reservoir(_) | NodeKind::Tank(..) => {}
            }
        }
    }
    let taken: Vec<&str> = nodes.iter().map(|n| n.name.as_str()).collect();
    let name_of = |link: &Link| match taken.contains(&link.name.as_str()) {
        true => format!("{} {}", if matches!(link.kind, LinkKind::Pump { .. }) { "pump" } else { "valve" }, link.name),
        false => link.name.clone(),
    };
    let passed_names: Vec<String> = passed.iter().map(|link| name_of(link)).collect();

    let heights_m = heights(network, &mut assumed);
    let height_m = |n: usize| heights_m[n];
    let mut made: Vec<Made> = Vec::new();
    let closes = format!("kind = \"valve\"\nclosing_time_s = {}\n", told.closing_time_s);
    for (n, node) in nodes.iter().enumerate() {
        // Pumps take the level of the water that they stand in, valves that into which they lead.
        if place[n].is_some() || pipes_at[n] == 0 {
            continue;
        }
        let mut lines = match node.kind {
            NodeKind::Junction(_) if closing == Closing::End(n) => {
                no_emitter(node, &node.name)?;
                closes.clone()
            }
            NodeKind::Junction(_) => {
                let value = |key: &str, value: f64| match value {
                    0.0 => String::new(),
                    value => format!("{key} = {}\n", short(value)),
                };
                let demand = value("demand_m3_h", drawn_m3_s[n] * 3600.0);
                format!("kind = \"junction\"\n{demand}{}", value("cda_mm2", node.emitter_m2 * 1e6))
            }
            NodeKind::Reservoir(head_m) => format!("kind = \"reservoir\"\nhead_m = {}\n", short(head_m)),
            NodeKind::Tank(head_m, area_m2) => {
                format!("kind = \"tank\"\nhead_m = {}\narea_m2 = {}\n", short(head_m), short(area_m2))
            }
        };
        lines += &elevation(height_m(n));
        made.push(Made { name: node.name.clone(), lines, at: node.at });
    }
    for (link, name) in passed.iter().zip(&passed_names) {
        let [before, behind] = link.ends;
        let level = |n: usize| match nodes[n].kind {
            NodeKind::Reservoir(head_m) | NodeKind::Tank(head_m, _) => Some(head_m),
            NodeKind::Junction(_) => None,
        };
        let mut lines = match &link.kind {
            _ if closing == Closing::Link(link.name.as_str()) => closes.clone(),
            LinkKind::Pump { points, .. } if PumpCurve::through(points).is_none() => {
                return Err(format!(
                    "the pump '{}' needs a curve (HEAD) of one point, or of three of which the first has no flow, with heads that fall",
                    link.name
                ));
            }
            LinkKind::Pump { points, speed } => {
                let points: Vec<String> =
                    points.iter().map(|(q, h)| format!("[{}, {}]", short(q * 3600.0), short(*h))).collect();
                let suction = level(before).map_or(String::new(), |h| format!("suction_head_m = {}\n", short(h)));
                let speed = if *speed == 1.0 { String::new() } else { format!("speed = {}\n", short(*speed)) };
                format!("kind = \"pump\"\ncurve_m3_h_m = [{}]\n{speed}{suction}", points.join(", "))
            }
            // K v²/2g over the valve's bore.
            LinkKind::Valve { diameter_mm, kind, setting } if kind == "TCV" && *setting > 0.0 => {
                let cda_mm2 = std::f64::consts::FRAC_PI_4 * diameter_mm * diameter_mm / setting.sqrt();
                format!("kind = \"valve\"\ncda_mm2 = {}\n", short(cda_mm2))
            }
            LinkKind::Valve { kind, .. } => {
                return Err(format!(
                    "'{}' is a {kind}: of valves that do not close, only throttle valves (TCV) with a loss above 0 can be taken",
                    link.name
                ));
            }
            LinkKind::Pipe { .. } => continue,
        };
        let at_junction = [before, behind].into_iter().find(|&n| matches!(nodes[n].kind, NodeKind::Junction(_)));
        lines += &elevation(at_junction.map_or(0.0, height_m));
        if !matches!(link.kind, LinkKind::Pump { .. })
            && let Some(head_m) = level(behind)
        {
            let _ = writeln!(lines, "discharge_head_m = {}", short(head_m));
        }
        made.push(Made { name: name.clone(), lines, at: nodes[before].at.or(nodes[behind].at) });
    }

    // Whether a pipe must end at a node (or else begin there).
    let must_end = |n: usize| match place[n] {
        Some((_, behind)) => Some(!behind),
        None => (closing == Closing::End(n)).then_some(true),
    };
    for link in links.iter().filter(|link| is_pipe(link)) {
        let Laid::Halves(kind) = laid(link, link.ends.map(must_end))? else { continue };
        let [a, b] = link.ends;
        let lines = format!("kind = \"{kind}\"\n{}", elevation(0.5 * (height_m(a) + height_m(b))));
        let at = nodes[a].at.zip(nodes[b].at).map(|(a, b)| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
        made.push(Made { name: middle(link), lines, at });
    }
    let mut text = format!(
        "name = {}\n\n[fluid]\nname = \"water\"\ntemperature_degC = {}\n",
        quoted(told.name),
        told.temperature_degc
    );
    let all_drawn = made.iter().all(|node| node.at.is_some());
    for Made { name, lines, at } in &made {
        let at = at.filter(|_| all_drawn).map_or(String::new(), |[x, y]| format!("at = [{x:?}, {y:?}]\n"));
        let _ = write!(text, "\n[[node]]\nname = {}\n{lines}{at}", quoted(name));
    }
    for link in links {
        let LinkKind::Pipe { length_m, diameter_mm, roughness, minor, .. } = link.kind else { continue };
        let end = |n: usize| place[n].map_or(nodes[n].name.as_str(), |(i, _)| passed_names[i].as_str());
        let friction = match friction {
            Friction::Darcy => format!("roughness_mm = {}", short(roughness)),
            Friction::HazenWilliams | Friction::Manning => {
                // A minor loss is spread along its pipe.
                let spread = minor * diameter_mm * 1e-3 / length_m;
                format!("friction_factor = {}", short(darcy_factor(*friction, roughness, diameter_mm * 1e-3) + spread))
            }
        };
        let mut pipe = |name: &str, from: &str, to: &str, length_m: f64| {
            let _ = write!(
                text,
                "\n[[pipe]]\nname = {}\nfrom = {}\nto = {}\nlength_m = {}\ninner_diameter_mm = {}\nwall_thickness_mm = {}\nmaterial = {}\n{friction}\n",
                quoted(name),
                quoted(from),
                quoted(to),
                short(length_m),
                short(diameter_mm),
                told.wall_thickness_mm,
                quoted(told.material)
            );
        };
        let ([a, b], musts) = (link.ends, link.ends.map(must_end));
        match laid(link, musts)? {
            Laid::Whole([from, to]) => pipe(&link.name, end(from), end(to), length_m),
            Laid::Halves(_) => {
                let mut half = |name: &str, [from, to]: [&str; 2]| pipe(name, from, to, 0.5 * length_m);
                let middle = middle(link);
                half(&link.name, if musts[0] == Some(true) { [&middle, end(a)] } else { [end(a), &middle] });
                let second = if musts[1] == Some(false) { [end(b), &middle] } else { [&middle, end(b)] };
                half(&format!("{} behind", link.name), second);
            }
        }
    }
    let valve = match closing {
        Closing::End(n) => nodes[n].name.clone(),
        Closing::Link(name) => {
            passed.iter().position(|l| l.name == name).map_or_else(String::new, |i| passed_names[i].clone())
        }
    };
    let _ = write!(
        text,
        "\n[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nnode = {}\nunit = {}\n",
        quoted(&valve),
        quoted(told.unit)
    );
    assumed.push(format!("a pressure sensor P1 at '{valve}', which closes"));
    if *friction == Friction::HazenWilliams {
        assumed.push(format!("friction factors that have Hazen and Williams' loss at {TAKEN_AT_M_S} m/s"));
    }
    Ok(Drafted { text, assumed })
}

fn elevation(height_m: f64) -> String {
    if height_m == 0.0 { String::new() } else { format!("elevation_m = {}\n", short(height_m)) }
}

/// What closes: a valve by its name, or a dead end.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Closing<'a> {
    Link(&'a str),
    End(usize),
}

fn closing<'a>(network: &'a Network, named: Option<&str>) -> Result<Closing<'a>, String> {
    let mut links_at = vec![0; network.nodes.len()];
    network.links.iter().flat_map(|link| link.ends).for_each(|n| links_at[n] += 1);
    let a_pipe = |n: usize| {
        let mut own = network.links.iter().filter(|link| link.ends.contains(&n));
        links_at[n] == 1 && own.all(|link| matches!(link.kind, LinkKind::Pipe { .. }))
    };
    let valves = network.links.iter().filter(|link| matches!(link.kind, LinkKind::Valve { .. }));
    let valves: Vec<&str> = valves.map(|link| link.name.as_str()).collect();
    let is_end = |n: &usize| matches!(network.nodes[*n].kind, NodeKind::Junction(_)) && a_pipe(*n);
    let say = |what: &str| {
        let names: Vec<&str> = network.nodes.iter().map(|n| n.name.as_str()).collect();
        let ends: Vec<&str> = (0..names.len()).filter(is_end).map(|n| names[n]).collect();
        let or = |all: &[&str]| match all.len() {
            0 => "none".to_owned(),
            n if n > MOST_NAMED => format!("{}, … {n} in all", all[..MOST_NAMED].join(", ")),
            _ => all.join(", "),
        };
        format!(
            "{what}: give option `valve NAME`; the network has valves ({}) and dead ends where a flow can be shut off ({})",
            or(&valves),
            or(&ends)
        )
    };
    match named {
        Some(name) => {
            let end = (0..network.nodes.len()).find(|&n| network.nodes[n].name == name).filter(is_end);
            let valve = valves.iter().find(|v| **v == name).map(|v| Closing::Link(v));
            valve.or(end.map(Closing::End)).ok_or_else(|| say(&format!("'{name}' is no valve or dead end")))
        }
        None => match valves[..] {
            [valve] => Ok(Closing::Link(valve)),
            [] => Err(say("no valve says where the flow is shut off")),
            _ => Err(say("several valves could close")),
        },
    }
}

/// Elevations of the nodes, m. Of a reservoir only the level is known: the pipe is taken to lead away from it level.
/// The same holds for a node that no pipe is long enough to reach: pumps' ends often have no elevation in the file.
fn heights(network: &Network, assumed: &mut Vec<String>) -> Vec<f64> {
    let Network { nodes, links, .. } = network;
    let mut own: Vec<Vec<(usize, f64)>> = vec![Vec::new(); nodes.len()];
    for link in links {
        let (LinkKind::Pipe { length_m, .. }, [a, b]) = (&link.kind, link.ends) else { continue };
        own[a].push((b, *length_m));
        own[b].push((a, *length_m));
    }
    let is_reservoir = |n: usize| matches!(nodes[n].kind, NodeKind::Reservoir(_));
    let steep = |n: usize, (other, length_m): (usize, f64)| {
        !is_reservoir(other) && (nodes[n].elevation_m - nodes[other].elevation_m).abs() > length_m
    };
    let unknown = |n: usize| !own[n].is_empty() && (is_reservoir(n) || own[n].iter().all(|&pipe| steep(n, pipe)));
    let height = |n: usize| match own[n].iter().find(|(other, _)| unknown(n) && !unknown(*other)) {
        Some(&(other, _)) => nodes[other].elevation_m,
        None => nodes[n].elevation_m,
    };
    let told = (0..nodes.len()).filter(|&n| !is_reservoir(n) && unknown(n));
    assumed.extend(told.map(|n| {
        format!(
            "'{}' as high as the node beside it, for its pipes are too short for the file's elevation",
            nodes[n].name
        )
    }));
    (0..nodes.len()).map(height).collect()
}

/// The junction at the other end of a pipe from a valve or pump, where nothing else stands.
fn next_junction(network: &Network, at: usize, closing: Closing) -> Option<usize> {
    let links = &network.links;
    let is_pipe = |link: &&Link| matches!(link.kind, LinkKind::Pipe { .. });
    let far = links.iter().filter(|l| l.ends.contains(&at)).filter(is_pipe).map(|l| l.ends[0] + l.ends[1] - at);
    let plain = |&n: &usize| {
        let of_pipes = links.iter().filter(|l| l.ends.contains(&n)).all(|l| is_pipe(&l));
        n != at && of_pipes && closing != Closing::End(n) && matches!(network.nodes[n].kind, NodeKind::Junction(_))
    };
    { far }.find(plain)
}

fn no_emitter(node: &Node, stands: &str) -> Result<(), String> {
    if node.emitter_m2 == 0.0 {
        return Ok(());
    }
    Err(format!("'{stands}' stands at the junction '{}', which has an emitter: move it to another junction", node.name))
}

/// How a pipe lies: it leads to what stands before a valve or pump, and from what is behind.
enum Laid {
    /// From one node to the other.
    Whole([usize; 2]),
    /// In halves, with a node of this kind in its middle: a check valve, or a junction where both ends want the same
    /// direction.
    Halves(&'static str),
}

/// `must_end` says of each of its ends whether it must end there, or begin there.
fn laid(link: &Link, must_end: [Option<bool>; 2]) -> Result<Laid, String> {
    let [a, b] = link.ends;
    let forward = must_end[0] != Some(true) && must_end[1] != Some(false);
    let backward = must_end[0] != Some(false) && must_end[1] != Some(true);
    match link.kind {
        LinkKind::Pipe { check: true, .. } if forward => Ok(Laid::Halves("check-valve")),
        LinkKind::Pipe { check: true, .. } => Err(format!(
            "the check valve of the pipe '{}' lets no water to or from the valve or pump at its end",
            link.name
        )),
        _ if forward => Ok(Laid::Whole([a, b])),
        _ if backward => Ok(Laid::Whole([b, a])),
        _ => Ok(Laid::Halves("junction")),
    }
}

/// The node in the middle of a pipe.
fn middle(link: &Link) -> String {
    format!("middle {}", link.name)
}

/// Darcy's factor with the loss of Hazen and Williams at [`TAKEN_AT_M_S`], or of Manning.
fn darcy_factor(friction: Friction, coefficient: f64, diameter_m: f64) -> f64 {
    let area_m2 = std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m;
    let flow_m3_s = TAKEN_AT_M_S * area_m2;
    // Loss over length, with lengths in m and flows in m³/s.
    let slope = match friction {
        Friction::HazenWilliams => 10.667 * coefficient.powf(-1.852) * diameter_m.powf(-4.871) * flow_m3_s.powf(1.852),
        _ => 10.294 * coefficient * coefficient * diameter_m.powf(-16.0 / 3.0) * flow_m3_s * flow_m3_s,
    };
    2.0 * GRAVITY_M_S2 * diameter_m * slope / (TAKEN_AT_M_S * TAKEN_AT_M_S)
}

/// A number without the noise of conversions, as TOML has it.
fn short(value: f64) -> String {
    let text = format!("{value:.9e}").parse::<f64>().unwrap_or(value);
    format!("{text:?}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draft::epanet::read;
    use crate::rig::{self, Rig};

    /// Two pipes and a loop from a reservoir by a pump, a valve in the middle, a tank at the end.
    const NETWORK: &str = "[JUNCTIONS]\n A 0 0\n B 5 36\n C 0 0\n D 0 0\n E 0 7.2\n[RESERVOIRS]\n R 10\n S 1\n[TANKS]\n T 0 30 0 40 4\n[PIPES]\n\
        p1 B A 100 200 0.1 0 Open\n p2 B C 80 200 0.1 0 Open\n p3 T B 60 150 0.1 0 Open\n p4 D E 40 150 0.1 0 Open\n[PUMPS]\n 9 R A HEAD h\n\
        [VALVES]\n V C D 150 TCV 10\n[CURVES]\n h 100 50\n[OPTIONS]\n Units CMH\n Headloss D-W\n";

    fn told(valve: Option<&str>) -> Told<'_> {
        let (material, wall_thickness_mm) = ("steel", 4.0);
        Told {
            name: "net",
            temperature_degc: 20.0,
            material,
            wall_thickness_mm,
            valve,
            closing_time_s: 0.2,
            unit: "bar",
        }
    }

    #[test]
    fn valves_and_pumps_become_nodes() {
        let made = draft(&read(NETWORK).unwrap(), &told(None)).unwrap();
        let rig = Rig::from_toml(&made.text, "net.toml").unwrap_or_else(|e| panic!("{e}\n{}", made.text));
        let names: Vec<&str> = rig.graph.nodes.iter().map(|n| n.name.as_str()).collect();
        assert_eq!(names, ["B", "E", "T", "9", "V"]);
        let ends: Vec<(&str, &str)> = rig.graph.lines.iter().map(|l| (names[l.from], names[l.to])).collect();
        assert_eq!(ends, [("9", "B"), ("B", "V"), ("T", "B"), ("V", "E")]);
        assert!(matches!(&rig.graph.nodes[3].kind, rig::NodeKind::Pump(pump) if pump.suction_head_m == Some(10.0)));
        assert!(
            matches!(rig.graph.nodes[0].kind, rig::NodeKind::Junction { demand_m3_s, .. } if (demand_m3_s - 0.01).abs() < 1e-12)
        );
        assert_eq!((rig.valve.closing_time_s, rig.pipes[0].roughness_m), (0.2, Some(1e-4)));
        assert!((rig.pipes[2].elevation_end_m - 5.0).abs() < 1e-12);
        // Another end closes, to which its pipe is turned: the valve stays open, with its loss.
        let turned = NETWORK.replace("p4 D E", "p4 E D");
        let made = draft(&read(&turned).unwrap(), &told(Some("E"))).unwrap();
        let rig = Rig::from_toml(&made.text, "net.toml").unwrap_or_else(|e| panic!("{e}\n{}", made.text));
        let area_m2 = std::f64::consts::FRAC_PI_4 * 0.15 * 0.15;
        let valve = rig.graph.nodes.iter().find(|n| n.name == "V").unwrap();
        assert!(matches!(&valve.kind, rig::NodeKind::Opening(o) if (o.cda_m2 - area_m2 / 10f64.sqrt()).abs() < 1e-9));
    }

    /// A check valve stands in the middle of its pipe, a minor loss is spread along it, a demand at a valve moves on,
    /// an emitter is an opening.
    #[test]
    fn check_valves_minor_losses_emitters_and_demands_at_valves_are_taken() {
        let text = NETWORK
            .replacen("p3 T B 60 150 0.1 0 Open", "p3 T B 60 150 100 4 CV", 1)
            .replacen("D-W", "H-W", 1)
            .replacen(" D 0 0\n", " D 0 9\n", 1)
            .replacen("[PIPES]", "[EMITTERS]\n B 36\n[PIPES]", 1)
            .replace(" 0.1 0 Open", " 100 0 Open");
        let made = draft(&read(&text).unwrap(), &told(None)).unwrap();
        let rig = Rig::from_toml(&made.text, "net.toml").unwrap_or_else(|e| panic!("{e}\n{}", made.text));
        let node = |name: &str| rig.graph.nodes.iter().position(|n| n.name == name).unwrap();
        let line = |name: &str| rig.pipes.iter().position(|p| p.name == name).unwrap();
        let (first, second) = (&rig.graph.lines[line("p3")], &rig.graph.lines[line("p3 behind")]);
        assert_eq!([first.from, first.to, second.from, second.to], ["T", "middle p3", "middle p3", "B"].map(node));
        assert_eq!(rig.graph.nodes[first.to].kind, rig::NodeKind::CheckValve);
        assert_eq!((rig.pipes[line("p3")].length_m, rig.pipes[line("p3 behind")].length_m), (30.0, 30.0));
        let plain = darcy_factor(Friction::HazenWilliams, 100.0, 0.15);
        // f L/D of the whole pipe has grown by K.
        let grown = (rig.pipes[line("p3")].friction_factor.unwrap() - plain) * 60.0 / 0.15;
        assert!((grown - 4.0).abs() < 1e-6, "{grown}");
        assert!((rig.graph.nodes[node("E")].kind.demand_m3_s() * 3600.0 - 16.2).abs() < 1e-9);
        // 36 m³/h at 1 m, of which √(2g h) is 4.4294 m/s; it opens at the elevation of 5 m.
        let emitter = rig.graph.nodes[node("B")].kind.opening().unwrap();
        assert!((emitter.cda_m2 - 0.01 / 4.42945).abs() < 1e-7 && emitter.discharge_head_m == Some(5.0), "{emitter:?}");
        assert!(
            made.assumed[0].contains("the demand at 'D', where 'V' stands, is drawn off at 'E'"),
            "{:?}",
            made.assumed
        );
    }

    #[test]
    fn what_a_rig_cannot_have_is_refused_by_name() {
        let refused = |from: &str, to: &str, valve: Option<&str>| {
            let text = NETWORK.replacen(from, to, 1);
            draft(&read(&text).unwrap(), &told(valve)).err().unwrap_or_default()
        };
        for (from, to, valve, says) in [
            (" V C D 150 TCV 10\n", "", None, "no valve says where the flow is shut off"),
            (
                "",
                "",
                Some("B"),
                "'B' is no valve or dead end: give option `valve NAME`; the network has valves (V) and dead ends",
            ),
            ("TCV 10", "PRV 10", Some("E"), "'V' is a PRV"),
            ("HEAD h", "POWER 3", None, "the pump '9' needs a curve"),
            (" h 100 50", " h 0 50\n h 50 40\n h 70 30\n h 100 10", None, "the pump '9' needs a curve"),
            (" E 0 7.2\n", " E 0 7.2\n[EMITTERS]\n E 1\n", Some("E"), "'E', which has an emitter"),
            ("0.1 0 Open\n p2", "0.1 0 CV\n p2", None, "the check valve of the pipe 'p1' lets no water"),
        ] {
            let said = refused(from, to, valve);
            assert!(said.contains(says), "{to}: {said}");
        }
    }

    /// Head of a known slope: Hazen and Williams' C of 100 in 457.2 mm at 1 m/s loses 2.82 m over 1 km.
    #[test]
    fn friction_has_the_loss_of_its_formula() {
        let f = darcy_factor(Friction::HazenWilliams, 100.0, 0.4572);
        let slope = f / 0.4572 / (2.0 * GRAVITY_M_S2);
        let q: f64 = std::f64::consts::FRAC_PI_4 * 0.4572 * 0.4572;
        // The customary form in ft and ft³/s: 4.727 C^-1.852 d^-4.871 q^1.852.
        let customary = 4.727 * 100f64.powf(-1.852) * 1.5f64.powf(-4.871) * (q / 0.028_316_846_592).powf(1.852);
        assert!((slope / customary - 1.0).abs() < 2e-3, "{slope} {customary}");
    }
}
